"""The dashboard in a real browser: it shows what the service knows, and obeys the keyboard."""

import math
import time
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from service.test_station import recorded
from service.web_made import OPERATOR, TOKENS, VIEWER, served, voyage
from surefix.service.alarms import active, raised
from surefix.service.sensors import SensorState

webdriver = pytest.importorskip("selenium.webdriver")
keys = pytest.importorskip("selenium.webdriver.common.keys").Keys

SIZES = {"desk": (1400, 900), "tablet": (820, 1180), "small tablet": (768, 1024)}
STATE = """
const marks = [...document.querySelectorAll('#plan .trace')].length;
const targets = [...document.querySelectorAll('button, select, input')]
  .filter((e) => e.checkVisibility()).map((e) => e.getBoundingClientRect());
return {
  marks,
  strips: document.querySelectorAll('#strips .yaxislayer-above').length,
  wide: document.documentElement.scrollWidth,
  least: Math.min(...targets.map((t) => t.height)),
  fetched: performance.getEntriesByType('resource').map((r) => new URL(r.name).host),
  right: Math.max(...[...document.querySelectorAll('section, footer')]
    .map((e) => e.getBoundingClientRect().right)),
};
"""


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    with served(tmp_path_factory.mktemp("dashboard"), "requests_per_s = 1000", rows=0) as made:
        made.sail(voyage(310))
        yield made


@contextmanager
def judged(service):
    """Three sensors, one of each kind, and two alarms, for a while."""
    before = {"sensors": service.live.sensors, "alarms": service.live.alarms}
    now = service.now
    evil = "<b>gyro</b><script>alert(1)</script>"
    sensors = (
        SensorState("boat GP", "boat", since=now, observed=now, rate=1.0, rejected=0.08),
        SensorState("boat GP", "boat", "velocity", "doubtful", "noisy: 2.1 times as declared", now),
        SensorState(
            evil, "boat", "heading", "invalid", "stale: nothing for 12 s", now - 12.0, now - 12.0
        ),
    )
    alarms = raised((), "gyro", "warning", "stale: nothing for 12 s", now - 12.0)
    alarms = raised(alarms, "position", "alarm", "dead-reckoned: no fix is used", now - 4.0)
    service.call(service.set(sensors=sensors, alarms=alarms))
    yield
    service.call(service.set(**before))


class Page:
    """The page, opened and drawn."""

    def __init__(self, browser, service, size="desk"):
        self.browser = browser
        width, height = SIZES[size]
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        browser.delete_all_cookies()
        browser.get_log("browser")
        browser.get(f"http://{service.host}/")

    def __call__(self, script):
        return self.browser.execute_script(f"return {script}")

    def until(self, condition, seconds=20.0):
        end = time.monotonic() + seconds
        while not self(condition):
            assert time.monotonic() < end, (condition, self.browser.get_log("browser"))
            time.sleep(0.05)
        return self

    def drawn(self):
        return self.until("Number(document.documentElement.dataset.drawn) > 0")

    def text(self, place):
        return self(f"document.querySelector({place!r}).innerText")

    def press(self, *pressed):
        webdriver.ActionChains(self.browser).send_keys(*pressed).perform()

    def focus_by_tab(self, condition):
        for _ in range(40):
            self.press(keys.TAB)
            if self(f"(document.activeElement.matches({condition!r}))"):
                return
        raise AssertionError(f"no Tab leads to {condition}")

    def complaints(self):
        log = self.browser.get_log("browser")
        return [each["message"] for each in log if each["level"] in ("SEVERE", "WARNING")]


@pytest.mark.parametrize("size", SIZES)
def test_everything_is_there_and_fits(browser, service, size):
    with judged(service):
        page = Page(browser, service, size).drawn()
        page.until("document.querySelectorAll('#plan .trace').length > 3")
        seen = SimpleNamespace(**browser.execute_script(STATE))
        assert seen.wide <= SIZES[size][0]
        assert seen.right <= SIZES[size][0]
        assert seen.least >= 44.0  # for a finger
        assert seen.strips >= 3
        assert set(seen.fetched) == {service.host}
        assert page.complaints() == []


def test_a_sensor_is_judged_in_words_signs_and_colour(browser, service):
    with judged(service):
        page = Page(browser, service).drawn()
        page.until("document.querySelectorAll('.card').length === 3")
        cards = page("[...document.querySelectorAll('.card')].map((c) => c.innerText)")
        assert "✓" in cards[0]
        assert "valid" in cards[0]
        assert "8.0 %" in cards[0]
        assert "?" in cards[1]
        assert "doubtful" in cards[1]
        assert "noisy: 2.1 times" in cards[1]
        assert "✕" in cards[2]
        assert "invalid" in cards[2]
        assert "<script>alert(1)</script>" in cards[2]  # as text
        edge = "getComputedStyle(card).borderLeftColor"
        colours = page(f"[...document.querySelectorAll('.card')].map((card) => {edge})")
        assert len(set(colours)) == 3
        assert page("document.querySelectorAll('main script, main .card b b').length") == 0


def test_an_alarm_is_acknowledged_by_the_keyboard(browser, service):
    """What is wrong at sea is told; one alarm lasts and one is over when they are seen."""
    service.silence(1)
    shown = active(service.live.alarms)
    (lasts,) = [each for each in shown if each.text.startswith("stale") and math.isnan(each.gone)]
    over = shown[0]
    assert (over.priority, over.concerns) == ("alarm", "position")
    assert not math.isnan(over.gone)
    page = Page(browser, service).drawn()
    page.until(f"document.querySelectorAll('.alarm').length === {len(shown)}")
    assert page("document.title").startswith(f"({len(shown)})")
    assert "position: lost: dead reckoning" in page.text(".alarm")  # the most urgent comes first
    place = f".alarm[data-key='{lasts.number}']"
    page.focus_by_tab(f"{place} button")
    assert page("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    time.sleep(2.2)  # records go on coming: the focus stays
    page.until(f"document.activeElement.matches({place + ' button'!r})", 0.1)
    page.press(keys.ENTER)
    service.silence(1)
    page.until(f"document.querySelector({place!r}).dataset.seen === 'true'")
    assert "acknowledged" in page.text(place)
    page.until("document.activeElement.matches('.alarm button')")  # the next to be seen
    page.focus_by_tab(f".alarm[data-key='{over.number}'] button")
    page.press(keys.SPACE)
    service.silence(1)
    page.until(f"!document.querySelector('.alarm[data-key=\\'{over.number}\\']')")
    assert page("document.title").startswith(f"({len(shown) - 2})")
    seen = {each.number: each.by for each in service.live.alarms}
    assert seen[lasts.number] == seen[over.number] == "operator at 127.0.0.1"


def test_looking_back_and_coming_back(browser, service):
    page = Page(browser, service).drawn()
    total = page("Number(document.documentElement.dataset.drawn)")
    assert total > 250
    page.focus_by_tab("#travel")
    assert page("document.querySelector('#travel').getAttribute('aria-valuetext')") == "live"
    for _ in range(5):
        page.press(keys.PAGE_DOWN)
    page.until("document.querySelector('#status').dataset.kind === 'past'")
    page.until(f"Number(document.documentElement.dataset.drawn) < {total - 100}")
    moment = float(page("document.querySelector('#travel').value"))
    rows = service.live.history.take(service.live.history.between(0.0, moment))
    assert page("Number(document.documentElement.dataset.drawn)") == len(rows)
    last = page("document.querySelector('#position dd').textContent")
    assert last == f"{time.strftime('%Y-%m-%d %H:%M:%S', time.gmtime(rows['time'][-1]))} UTC"
    assert "Looking back" in page.text("#status")
    service.sail(list(voyage(320))[310:])  # what comes meanwhile changes nothing here
    time.sleep(1.5)
    assert page("Number(document.documentElement.dataset.drawn)") == len(rows)
    page.focus_by_tab("#live")
    page.press(keys.SPACE)
    page.until("document.querySelector('#status').dataset.kind !== 'past'")
    page.until(f"Number(document.documentElement.dataset.drawn) >= {total}")
    assert page.complaints() == []


def test_what_was_wrong_then_is_shown_and_what_is_wrong_now_stays(tmp_path, browser):
    with served(tmp_path, rows=0) as service:
        service.sail(list(voyage(95)))
        quiet = service.now
        service.silence(40)
        lasting = len(active(service.live.alarms))
        assert lasting > 0
        page = Page(browser, service).drawn()
        page.until(f"document.querySelectorAll('#alarm-list .alarm').length === {lasting}")
        assert page("document.querySelector('#then').hidden")
        assert "invalid" in page.text("#sensors")
        page.focus_by_tab("#travel")
        page.press(*[keys.PAGE_DOWN] * 5)
        page.until("!document.querySelector('#then').hidden")
        moment = float(page("document.querySelector('#travel').value"))
        assert moment < quiet
        assert "None." in page.text("#then")
        cards = page("[...document.querySelectorAll('.card')].map((c) => c.dataset.validity)")
        assert cards == ["valid", "valid"]
        assert page.text("#sensors-when").startswith("at ")
        assert page("document.querySelectorAll('#alarm-list .alarm button').length") == lasting
        page.press(keys.END)  # the newest there is: the alarms of then are those of now
        page.until(f"document.querySelectorAll('#then-list .alarm').length === {lasting}")
        assert page("document.querySelectorAll('#then-list button').length") == 0
        page.focus_by_tab("#live")
        page.press(keys.SPACE)
        page.until("document.querySelector('#then').hidden")
        assert page.complaints() == []


def test_new_fixes_are_drawn_as_they_come(tmp_path, browser):
    with served(tmp_path, rows=100) as service:
        page = Page(browser, service).drawn()
        before = page("Number(document.documentElement.dataset.drawn)")
        where = page.text("#position")
        service.feed(recorded(160)[len(recorded(100)) :])
        rows = service.live.history.take(service.live.history.since(0))
        assert len(rows) > before + 40
        page.until(f"Number(document.documentElement.dataset.drawn) === {len(rows)}")
        assert page.text("#position") != where
        rejected = (
            "document.querySelector('#plan').data.find((t) => t.name === 'rejected').x.length"
        )
        assert page(rejected) == int((rows["verdict"] == 2).sum()) > 0


def test_without_the_service_it_says_so_and_comes_back(tmp_path, browser):
    with served(tmp_path, rows=60) as service:
        page = Page(browser, service).drawn()
        service.call(cut_all(service))
        page.until("document.querySelector('#status').dataset.kind === 'lost'", 6.0)
        assert "Not connected" in page.text("#status")
        page.until("document.querySelector('#status').dataset.kind === 'live'")


async def cut_all(service):
    for each in list(service.web._server.server_state.connections):
        each.transport.abort()


def test_viewers_see_and_operators_act(tmp_path, browser):
    with served(tmp_path, TOKENS, rows=60) as service, judged(service):
        page = Page(browser, service).until("document.querySelector('#dialog').open")
        assert page("document.querySelectorAll('.card').length") == 0
        page.press("wrong-token-0123456789", keys.ENTER)
        page.until("document.querySelector('#refused').textContent !== ''")
        browser.execute_script("document.querySelector('#token').value = ''")
        page.press(VIEWER, keys.ENTER)
        page.until("document.querySelector('#role')?.textContent === 'viewer'").drawn()
        page.until("document.querySelectorAll('.alarm button').length === 2")
        assert page("[...document.querySelectorAll('.alarm button')].every((b) => b.disabled)")
        page("document.querySelector('#sign').click()")
        page.until("document.querySelector('#dialog').open")
        page.press(OPERATOR, keys.ENTER)
        page.until("document.querySelector('#role')?.textContent === 'operator'").drawn()
        page.until("document.querySelectorAll('.alarm button:enabled').length === 2")
        assert page("document.cookie") == ""  # no script can read the session


def test_dark_where_the_system_is_dark(browser, service):
    features = [{"name": "prefers-color-scheme", "value": "dark"}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    try:
        page = Page(browser, service).drawn()
        ground = page("getComputedStyle(document.body).backgroundColor")
        paper = page("document.querySelector('#plan')._fullLayout.plot_bgcolor")
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert sum(int(part) for part in ground[4:-1].split(",")) < 120
    assert paper == "#141c24"
