"""The page in a real browser, at the size of a desk and of a phone."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from report.made import channel, cleaned, dive_result, straight
from surefix.report.page import write_report
from surefix.types import Cleaned

webdriver = pytest.importorskip("selenium.webdriver")
pytest.importorskip("plotly")

SIZES = {"desk": (1400, 900, False), "phone": (390, 844, True)}
READY = "return document.documentElement.dataset.ready === 'true'"
LOOK = """
const drawn = [...document.querySelectorAll('figure')];
return {
  figures: drawn.length,
  plots: drawn.filter(f => f.querySelector('svg.main-svg')).length,
  widest: Math.max(0, ...drawn.map(f => f.getBoundingClientRect().right)),
  empty: drawn.filter(f => !f.querySelector('.trace')).length,
  scroll: document.documentElement.scrollWidth,
  inner: innerWidth,
  fetched: performance.getEntriesByType('resource').filter(r => !/^(data|blob):/.test(r.name))
    .map(r => r.name),
  buttons: [...document.querySelectorAll('.modebar-btn')].map(b => b.dataset.title || ''),
};
"""


def _open(browser: Any, place: Path, size: str) -> dict[str, Any]:
    width, height, phone = SIZES[size]
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": phone})
    browser.get_log("browser")
    browser.get(place.as_uri())
    deadline = time.monotonic() + 60.0
    while not browser.execute_script(READY):
        assert time.monotonic() < deadline, browser.get_log("browser")
        time.sleep(0.1)
    return dict(browser.execute_script(LOOK))


def _result(name: str) -> Cleaned:
    none = np.zeros((0, 3))
    moments = np.arange(50.0)
    match name:
        case "dive":
            return dive_result()
        case "one":
            return cleaned(*straight(1))
        case "rejected":
            when, raw, clean = straight(300)
            return replace(cleaned(when, raw + 80.0, clean), sensors=("<b>long name</b> " * 8,))
        case _:
            only = channel("depth_m", moments, np.sin(moments))
            return replace(cleaned(np.zeros(0), none, none), channels=(only,))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["dive", "one", "rejected", "channels only"])
def test_the_page_is_drawn_whole(browser: Any, tmp_path: Path, name: str, size: str) -> None:
    place = tmp_path / f"{name} #1 %.html"
    write_report(_result(name), place)
    seen = _open(browser, place, size)
    assert browser.get_log("browser") == []
    assert seen["scroll"] <= seen["inner"] == SIZES[size][0]
    assert seen["figures"] == seen["plots"] > 0
    assert seen["empty"] == 0
    assert seen["widest"] <= seen["inner"]
    assert seen["fetched"] == []
    assert not [text for text in seen["buttons"] if "cloud" in text.lower()]


def test_buttons_do_what_they_say(browser: Any, tmp_path: Path) -> None:
    when, raw, clean = straight(300)
    raw[100] += 5_000.0
    place = tmp_path / "far.html"
    write_report(cleaned(when, raw, clean), place)
    _open(browser, place, "desk")
    top = "return document.querySelector('#plan .plot')._fullLayout.xaxis.range[1]"
    first = browser.execute_script(top)
    click = "document.querySelector('#plan .note button').click()"
    browser.execute_script(click)
    _until(browser, f"{top} > 5000")
    browser.execute_script(click)
    _until(browser, f"Math.abs({top.removeprefix('return ')} - {first}) < 1")
    pressed = "document.querySelector('#plan .legend button')"
    browser.execute_script(f"{pressed}.click()")
    _until(browser, f"{pressed}.getAttribute('aria-pressed') === 'false'")
    _until(browser, "document.querySelector('#plan .plot').data[0].visible === false")
    assert browser.get_log("browser") == []


def test_plans_have_equal_axes_and_a_true_scale(browser: Any, tmp_path: Path) -> None:
    place = tmp_path / "plan.html"
    write_report(dive_result(), place)
    _open(browser, place, "desk")
    x, y, bar, text = browser.execute_script(
        "const p = document.querySelector('#plan'), l = p.querySelector('.plot')._fullLayout;"
        "const per = a => a._length / (a.range[1] - a.range[0]);"
        "return [per(l.xaxis), per(l.yaxis), p.querySelector('.scale b').offsetWidth,"
        " p.querySelector('.scale span span').textContent]"
    )
    assert x == pytest.approx(y, rel=1e-6)
    assert bar == pytest.approx(float(text.removesuffix(" m")) * x, abs=1.0)


def _until(browser: Any, condition: str) -> None:
    deadline = time.monotonic() + 10.0
    text = condition if condition.startswith("return ") else f"return {condition}"
    while not browser.execute_script(text):
        assert time.monotonic() < deadline, condition
        time.sleep(0.05)
