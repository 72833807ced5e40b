import re
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from report.made import channel, cleaned, dive_result, straight
from surefix.errors import MissingExtraError, OutputError
from surefix.report.page import write_report
from surefix.types import Cleaned, Event, Noise, Problem, Verdict

pytest.importorskip("plotly")

SECTIONS = [
    "summary",
    "plan-view",
    "over-time",
    "channels",
    "consistency",
    "worst",
    "events",
    "problems",
    "noise",
    "settings",
]
HOSTILE = "<script>alert('1')</script>&\"</title>\u2028"


class _Page(HTMLParser):
    """Collect ids, links, text and scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.text = ""
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._inside = tag
        self.tags.append(tag)
        given = dict(attrs)
        self.ids += [given["id"]] if given.get("id") else []
        self.links += [value or "" for key, value in attrs if key in {"src", "href", "action"}]

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside not in {"script", "style"}:
            self.text += data + " "


def _page(result: Cleaned, tmp_path: Path, title: str | None = None) -> tuple[_Page, str]:
    place = tmp_path / "report.html"
    write_report(result, place, title=title)
    text = place.read_text(encoding="utf-8")
    page = _Page()
    page.feed(text)
    return page, text


def _figures(text: str) -> str:
    found = re.search(r'<script id="figures" type="application/json">(.*?)</script>', text)
    assert found is not None
    return found[1]


def test_every_section_is_there_and_its_figures_have_places(tmp_path: Path) -> None:
    page, text = _page(dive_result(), tmp_path, "Dive 7")
    assert set(SECTIONS) <= set(page.ids)
    drawn = re.findall(r'"id":"([a-z0-9-]+)"', _figures(text))
    assert drawn == [
        "plan",
        "position",
        "channel-0",
        "channel-1",
        "innovations-position",
        "histogram-position",
        "quantiles-position",
    ]
    assert set(drawn) <= set(page.ids)
    for told in ("Dive 7", "no fix for 32 s", "check the cable", "estimated", "igg3", "σ off"):
        assert told in page.text


def test_nothing_is_fetched(tmp_path: Path) -> None:
    page, text = _page(dive_result(), tmp_path)
    assert all(link.startswith(("#", "data:")) for link in page.links)
    assert "default-src 'none'" in text
    assert "url(" not in text.split("</style>")[0]


def test_the_policy_names_the_scripts_of_the_page_and_no_other(tmp_path: Path) -> None:
    _, text = _page(dive_result(), tmp_path)
    policy = re.search(r"script-src ([^;]*);", text)
    assert policy is not None
    assert len(re.findall(r"'sha256-[\w+/=]+'", policy[1])) == 2
    assert "unsafe" not in policy[1]


def test_texts_from_data_are_escaped(tmp_path: Path) -> None:
    time, raw, clean = straight(60)
    result = replace(
        cleaned(time, raw, clean),
        sources=(HOSTILE,),
        sensors=(HOSTILE,),
        channels=(channel(HOSTILE, time, raw[:, 2])._replace(sensor=HOSTILE),),
        events=(Event(HOSTILE, START_OF_LOG, HOSTILE),),
        problems=(Problem(HOSTILE, 1, HOSTILE, HOSTILE),),
        noise=(Noise(HOSTILE, HOSTILE, 1.0, HOSTILE, HOSTILE),),
        settings={HOSTILE: HOSTILE},
    )
    page, text = _page(result, tmp_path, HOSTILE)
    assert page.tags.count("script") == 3
    assert "<script>alert" not in text
    assert "<" not in _figures(text)
    assert page.tags.count("title") == 1
    assert HOSTILE in page.text


START_OF_LOG = 1_700_000_000.0


def _nothing() -> Cleaned:
    none = np.zeros((0, 3))
    return cleaned(np.zeros(0), none, none)


def test_an_empty_track(tmp_path: Path) -> None:
    page, text = _page(replace(_nothing(), events=(), problems=(), noise=()), tmp_path)
    assert set(SECTIONS) <= set(page.ids)
    assert "No position fixes in this log." in page.text
    assert '"figures":[]' in _figures(text)
    assert "nan" not in page.text.lower()


def test_channels_only(tmp_path: Path) -> None:
    time = np.arange(100.0)
    only = channel("heading_deg", time, np.mod(350.0 + time, 360.0), 360.0)
    page, _ = _page(replace(_nothing(), channels=(only,)), tmp_path)
    assert {"channel-0", "innovations-channel-0", "histogram-channel-0"} <= set(page.ids)
    assert "plan" not in page.ids
    assert "1 min 39 s" in page.text


def test_one_fix(tmp_path: Path) -> None:
    time, raw, clean = straight(1)
    page, _ = _page(cleaned(time, raw, clean), tmp_path)
    assert "plan" in page.ids
    assert "0.0 s" in page.text


def test_all_rejected(tmp_path: Path) -> None:
    time, raw, clean = straight(50)
    page, _ = _page(cleaned(time, raw + 100.0, clean), tmp_path)
    assert "50 rejected (100 %)" in page.text


@pytest.mark.parametrize("axes", [(0,), (2,), (0, 1), (1, 2)])
def test_axes_that_were_never_observed(tmp_path: Path, axes: tuple[int, ...]) -> None:
    time, raw, clean = straight(80)
    unseen = [i for i in range(3) if i not in axes]
    raw[:, unseen] = clean[:, unseen] = np.nan
    page, text = _page(cleaned(time, raw, clean), tmp_path)
    assert ("plan" in page.ids) == ({0, 1} <= set(axes))
    assert sum(f'"text":"{name}"' in text for name in AXIS_TITLES) >= len(axes)
    assert ("Height, m" in _figures(text)) == (2 in axes)


AXIS_TITLES = ("East, m", "North, m", "Height, m")


def test_holes_infinities_and_unknown_times(tmp_path: Path) -> None:
    time, raw, clean = straight(80)
    result = cleaned(time, raw, clean)
    raw[5], raw[6, 0], clean[7], clean[8, 2] = np.nan, np.inf, np.nan, np.inf
    result.track.time[-2:] = np.nan
    result.track.sigma_position[9] = 1e6
    page, text = _page(result, tmp_path)
    assert "plan" in page.ids
    assert "NaN" not in _figures(text)
    assert "Infinity" not in _figures(text)


def test_every_rejected_fix_is_drawn_and_the_file_stays_small(tmp_path: Path) -> None:
    time, raw, clean = straight(200_000)
    result = cleaned(time, raw, clean)
    rejected = int((result.verdicts.verdict == Verdict.REJECTED).sum())
    assert 9_000 < rejected < 12_000
    page, text = _page(result, tmp_path)
    assert len(text.encode()) < 12e6
    assert "every rejected one is drawn" in page.text
    assert re.search(r"Drawn are [\d,]+ of 1\d\d,\d\d\d used", page.text)


def test_too_many_rejected_fixes_are_counted(tmp_path: Path) -> None:
    time, raw, clean = straight(30_000)
    page, text = _page(cleaned(time, raw + 50.0, clean), tmp_path)
    assert re.search(r"Drawn are [\d,]+ of 30,000 rejected fixes", page.text), page.text[-3000:]
    assert len(text.encode()) < 12e6


def test_seconds_stay_seconds(tmp_path: Path) -> None:
    time, raw, clean = straight(60)
    page, text = _page(cleaned(time - START_OF_LOG, raw, clean), tmp_path)
    assert "Time, s" in text
    assert "UTC" not in _figures(text)
    assert "0.0 s to 59.0 s" in page.text


def test_the_same_result_gives_the_same_bytes(tmp_path: Path) -> None:
    first = _page(dive_result(), tmp_path)[1]
    assert _page(dive_result(), tmp_path)[1] == first


def test_a_name_with_special_characters(tmp_path: Path) -> None:
    place = tmp_path / "Tauchgang #3 „Süd“ 100 %.html"
    write_report(_nothing(), place)
    assert place.stat().st_size > 1e6
    assert [path.name for path in tmp_path.iterdir()] == [place.name]


def test_a_place_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(OutputError):
        write_report(_nothing(), tmp_path / "none" / "report.html")
    assert not list(tmp_path.iterdir())


def test_without_plotly_the_remedy_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'surefix\[report\]'"):
        write_report(_nothing(), tmp_path / "report.html")
    assert not list(tmp_path.iterdir())
