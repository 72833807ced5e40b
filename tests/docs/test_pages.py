"""Every example of the documentation does what its page says."""

import re

import pytest

from docs.pages import PAGES, ROOT, blocks, run_console, run_page, same
from surefix.pipelines.demo import demonstrate

RAW = ("usbl.csv", "depth.csv", "dvl.csv")


@pytest.fixture(scope="module")
def dive(tmp_path_factory):
    """Folder with the files of the demonstration."""
    folder = tmp_path_factory.mktemp("dive")
    demonstrate(folder, 7)
    return folder


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_examples_run(page, dive, tmp_path, monkeypatch):
    for name in RAW:
        (tmp_path / name).write_bytes((dive / name).read_bytes())
    monkeypatch.chdir(tmp_path)
    run_page(page)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        place = page if not name else (page.parent / name).resolve()
        assert place.exists(), f"{page.name}: {target}"
        if anchor and place.suffix == ".md":
            assert anchor in anchors(place), f"{page.name}: {target}"


def anchors(page):
    """Anchors that GitHub gives to the headings of a page."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_recorded_example_gives_the_figures_of_the_readme(data, tmp_path, monkeypatch):
    folder = data / "usbl_mbari"
    for name, source in (
        ("usbl.csv", "oi_survey_1913_MINIROV_USBL_LATLONG.csv"),
        ("depth.csv", "oi_survey_1913_COMPAS_DEPTH.csv"),
    ):
        (tmp_path / name).write_bytes((folder / source).read_bytes())
    monkeypatch.chdir(tmp_path)
    recorded = [b for b in blocks(ROOT / "README.md") if b.info == "recorded"]
    assert recorded
    for block in recorded:
        run_console(block.text, f"README.md:{block.line}")


@pytest.mark.parametrize(
    ("printed", "wanted", "alike"),
    [
        ("3 rejected of 633, 0.44 m", "3 rejected of 630, 0.45 m", True),
        ("3 rejected", "4 rejected", False),
        ("100 rejected", "150 rejected", False),
        ("one\ntwo\nthree", "one\n…", True),
        ("one\ntwo\nthree", "…\nthree", True),
        ("one\ntwo\nthree", "one\nthree", False),
        ("wrote a.csv at 08:00:01", "wrote a.csv at …", True),
    ],
)
def test_output_is_compared_as_promised(printed, wanted, alike):
    if alike:
        same(printed, wanted, "here")
    else:
        with pytest.raises(AssertionError):
            same(printed, wanted, "here")
