"""What the pages about the papers promise: figures, pictures, commands, modules, JSON keys."""

import importlib
import re

import numpy as np
import pytest

from docs.pages import ROOT
from surefix.experiment import Experiment, gather
from surefix.papers.reproduce import PAPERS, contents

PLACE = ROOT / "docs" / "papers"
INDEX = (PLACE / "README.md").read_text(encoding="utf-8")
PYTHON = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
FILES = (ROOT / "docs" / "reference" / "files.md").read_text(encoding="utf-8")


def page(paper):
    return (PLACE / f"{paper}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("paper", PAPERS)
def test_headline_figures_are_on_the_page(paper):
    (row,) = re.findall(rf"^\| {paper} \|(.+)\|$", INDEX, re.MULTILINE)
    figures = re.findall(r"\d*\.\d+", row) + re.findall(r"(\d+) %", row)
    assert figures
    shown = page(paper)
    for figure in figures:
        assert re.search(rf"(?<!\d){re.escape(figure)}(?!\d)", shown), figure


@pytest.mark.parametrize("paper", PAPERS)
def test_every_picture_is_shown_described_and_small(paper):
    drawn = {path.name for path in PLACE.glob(f"{paper}-*.svg")}
    shown = re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", page(paper))
    assert {name for _, name in shown} == drawn
    assert all(len(text) > 15 for text, _ in shown)
    assert all((PLACE / name).stat().st_size < 260_000 for name in drawn)


@pytest.mark.parametrize("paper", PAPERS)
def test_every_page_has_its_parts_and_is_linked(paper):
    shown = page(paper)
    for part in (
        "The problem", "The method", "What is printed, and what is reconstructed", "Our figures",
        "What agrees, and what does not", "What is better since", "Where it must not be used",
    ):  # fmt: skip
        assert f"\n## {part}\n" in shown
    assert f"({paper}.md)" in INDEX
    assert f"`surefix reproduce {paper}`" in INDEX
    assert f"(docs/papers/{paper}.md)" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_modules_of_the_reference_exist():
    below = PYTHON.split("## Beneath the front door")[1]
    names = [
        name
        for cell in re.findall(r"^\| (`surefix\..+?) \|", below, re.MULTILINE)
        for name in re.findall(r"`([^`]+)`", cell)
    ]
    assert len(names) > 25
    for name in names:
        assert importlib.import_module(name).__doc__


def test_json_keys_are_those_of_the_reference():
    rows = [{"KF": [1.0]}, {"KF": [np.nan]}]
    table = gather("rmse_m", "RMSE", ["X"], rows, note="n", printed={"KF": (1.0,)})
    made = Experiment(
        paper="usbl", title="t", source="s", seed=1, runs=2, tables=(table,), figures=()
    )
    part = FILES.split("## Output: experiments")[1].split("## ")[0]
    cells = re.findall(r"^\| (`[^|]+) \|", part, re.MULTILINE)
    assert re.findall(r"`(\w+)`", " ".join(cells)) == list(contents(made))
