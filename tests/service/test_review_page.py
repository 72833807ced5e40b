"""The review page in a real browser: by mouse, by touch sizes, and by keys alone."""

import threading
import time

import pytest

from acceptance.product import surefix
from service.reviewed import WILD, begun, log
from surefix.io.edits import read_edits, standing
from surefix.service.review_server import open_server

webdriver = pytest.importorskip("selenium.webdriver")

SIZES = {"desk": (1400, 900), "tablet": (820, 1180)}
PLACE = """
const [plot, along, up] = arguments, p = document.getElementById(plot), l = p._fullLayout;
const r = p.getBoundingClientRect(), x = l.xaxis, y = l.yaxis;
return [r.left + x._offset + x.d2p(along), r.top + y._offset + y.d2p(up)];
"""
LOOK = """
return {
  scroll: document.documentElement.scrollWidth,
  inner: innerWidth,
  fetched: performance.getEntriesByType('resource').map(r => r.name)
    .filter(name => !name.startsWith(location.origin + '/') && !/^(data|blob):/.test(name)),
  small: [...document.querySelectorAll('button, select')]
    .filter(b => b.getBoundingClientRect().height < 27).map(b => b.id || b.textContent),
  unnamed: [...document.querySelectorAll('button, select')]
    .filter(b => !(b.textContent.trim() || b.getAttribute('aria-label'))).length,
};
"""


@pytest.fixture
def page(browser, tmp_path):
    review = begun(tmp_path / "edits.jsonl", log(tmp_path / "dive.csv"))
    server = open_server(review, "track", "surefix clean dive.csv --edits edits.jsonl")
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    yield Page(browser, server.url, tmp_path / "edits.jsonl")
    browser.get("about:blank")
    server.stop()
    thread.join(30.0)


class Page:
    """What a person does with the page, and sees of it."""

    def __init__(self, browser, url, edits):
        self.browser, self.url, self.edits = browser, url, edits

    def open(self, size="desk"):
        width, height = SIZES[size]
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.browser.get_log("browser")
        self.browser.get(self.url)
        self.until("document.documentElement.dataset.ready === 'true'")

    def js(self, text, *given):
        return self.browser.execute_script(text, *given)

    def until(self, condition):
        deadline = time.monotonic() + 60.0
        while not self.js(f"return {condition}"):
            assert time.monotonic() < deadline, (condition, self.browser.get_log("browser"))
            time.sleep(0.05)

    def text(self, name):
        return self.js("return document.getElementById(arguments[0]).textContent", name)

    def keys(self, *keys):
        chain = webdriver.ActionChains(self.browser)
        for key in keys[:-1]:
            chain.key_down(key)
        chain.send_keys(keys[-1])
        for key in keys[:-1]:
            chain.key_up(key)
        chain.perform()

    def at(self, plot, x, y):
        return [int(value) for value in self.js(PLACE, plot, x, y)]

    def drag(self, *points):
        chain = webdriver.ActionChains(self.browser, duration=20)
        mouse = chain.w3c_actions.pointer_action
        mouse.move_to_location(*points[0])
        mouse.pointer_down()
        for point in points[1:]:
            mouse.move_to_location(*point)
        mouse.pointer_up()
        chain.perform()

    def click(self, point):
        chain = webdriver.ActionChains(self.browser)
        chain.w3c_actions.pointer_action.move_to_location(*point).pointer_down().pointer_up()
        chain.perform()

    def standing(self):
        return [
            (entry.action, sorted(row for part in entry.fixes for row in part.row.tolist()))
            for entry in standing(read_edits(self.edits, new=True).entries)[0]
        ]


WAITS = "/decided since/.test(document.getElementById('status').textContent)"
SETTLED = "/has all edits/.test(document.getElementById('status').textContent)"
CHOSEN = "document.getElementById('count').textContent !== ''"


@pytest.mark.parametrize("size", SIZES)
def test_a_lasso_an_edit_undone_redone_and_run(page, size):
    page.open(size)
    mark = "document.getElementById('plan').data.find(t => t.name === 'rejected')"
    x, y = page.at("plan", *page.js(f"return [{mark}.x[0], {mark}.y[0]]"))
    around = ((10, 10), (-10, 10), (-10, -10), (10, -10), (10, 9))
    page.drag(*([x + dx, y + dy] for dx, dy in around))
    page.until(CHOSEN)
    assert "rejected" in page.text("said")
    page.until("document.getElementById('plan').data.some(t => t.name === 'chosen' && t.x.length)")
    page.keys("x")
    page.until(WAITS)
    ((action, rows),) = page.standing()
    assert action == "reject"
    assert WILD[0] in rows
    page.keys(webdriver.Keys.CONTROL, "z")
    page.until(SETTLED)
    assert page.standing() == []
    page.keys(webdriver.Keys.CONTROL, webdriver.Keys.SHIFT, "z")
    page.until(WAITS)
    assert page.standing() == [("reject", rows)]
    page.keys("r")
    page.until("document.documentElement.dataset.drawn === '2'")
    page.until(SETTLED)
    names = page.js("return document.getElementById('strips').data.map(t => t.name)")
    assert {"before", "difference", "decided by the user"} <= set(names)
    assert "before" in page.text("told")
    assert "undo" in page.text("edits")
    seen = page.js(LOOK)
    assert seen["scroll"] <= seen["inner"] == SIZES[size][0]
    assert (seen["fetched"], seen["small"], seen["unnamed"]) == ([], [], 0)
    assert page.browser.get_log("browser") == []


def test_a_click_a_box_and_what_is_hidden(page):
    page.open()
    mark = "document.getElementById('strips').data.find(t => t.name === 'rejected')"
    x, y = page.js(f"return [{mark}.x[1], {mark}.y[1]]")
    page.click(page.at("strips", x, y))
    page.until(CHOSEN)
    assert f"row {WILD[1]}" in page.text("said")
    page.keys(webdriver.Keys.ESCAPE)
    page.until("document.getElementById('count').textContent === ''")
    page.js("document.querySelector('[data-name=used]').click()")
    page.keys("b")
    left, top, right, bottom = page.js(
        "const p = document.getElementById('strips'), l = p._fullLayout,"
        " r = p.getBoundingClientRect(), x = r.left + l.xaxis._offset, y = r.top + l.yaxis._offset;"
        "return [x + 3, y + 3, x + l.xaxis._length - 3, y + l.yaxis._length - 3]"
    )
    page.drag([int(left), int(top)], [int(right) - 200, int(top) + 40], [int(right), int(bottom)])
    page.until(CHOSEN)
    assert page.text("said") == f"{len(WILD)} rejected"
    page.js("document.getElementById('accept').click()")
    page.until(WAITS)
    assert page.standing() == [("accept", list(WILD))]
    assert page.browser.get_log("browser") == []


def test_all_by_keys(page):
    page.open()
    for wild in WILD:
        page.keys(".")
        page.until(f"document.getElementById('said').textContent.includes('row {wild},')")
    page.keys(",")
    page.until(f"document.getElementById('said').textContent.includes('row {WILD[1]},')")
    page.keys("a")
    page.until(WAITS)
    assert page.standing() == [("accept", [WILD[1]])]
    reached = set()
    for _ in range(40):
        page.keys(webdriver.Keys.TAB)
        reached.add(
            page.js("return document.activeElement.id || document.activeElement.dataset.drag")
        )
    assert {"lasso", "adding", "whole", "undo", "run", "compare", "export", "plan"} <= reached
    assert {"strips", "previous", "next"} <= reached


def test_edits_of_others_appear(page):
    page.open()
    place = page.edits.with_name("dive.csv")
    done = surefix("edit", place, "--reject", "--rows", "5-9", "--edits", page.edits)
    assert done.code == 0, done.err
    page.until(WAITS)
    assert page.text("status").startswith("5 fixes")


def test_without_the_address_it_says_what_to_open(page):
    page.browser.get("about:blank")
    page.browser.get(page.url.partition("#")[0])
    page.js("sessionStorage.clear()")
    page.browser.refresh()
    page.until("document.getElementById('status').className === 'bad'")
    assert "surefix review printed" in page.text("status")
