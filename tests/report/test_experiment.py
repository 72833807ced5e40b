"""The report of an experiment: what is in it, and what may not break it."""

import json
import re

import numpy as np
import pytest

from surefix.errors import OutputError
from surefix.experiment import Experiment, Figure, Panel, Trace, gather
from surefix.report.experiment import COLOURS, colours_of, write_experiment


def made(**changes):
    x = np.arange(4.0)
    marked = [Trace(name, x, x, "points") for name in ("KF", "Huber", "IGG3")]
    panel = Panel(
        title="<i>", x_label="x, m", y_label="y", log_y=True, y_range=(0.1, 100.0),
        traces=(Trace("truth", x, x + 1.0, "truth"), *marked),
    )  # fmt: skip
    named = Panel(
        x_label="method", y_label="m", x_names=("a", "b"), equal=True,
        traces=(Trace("raw", x, x, "raw"), Trace("bad", x, x, "bad"), Trace("KF", x, x)),
    )  # fmt: skip
    table = gather(
        "rmse_m", "RMSE (Table 1)", ["X", "Y"], [{"KF": [1.0, np.nan]}, {"KF": [3.0, np.nan]}],
        unit="m", printed={"KF": (7.265, np.nan)}, note="a < b", of="Reading",
    )  # fmt: skip
    figure = Figure(key="fig", title="Tracks (beside Fig. 6)", panels=(panel, named), columns=2)
    given = {
        "paper": "usbl", "title": "R & D", "source": "<who>", "seed": 1, "runs": 2,
        "tables": (table,), "figures": (figure,), "findings": ("x < 1 m",),
    }  # fmt: skip
    return Experiment(**{**given, **changes})


@pytest.fixture
def page(tmp_path):
    write_experiment(made(), tmp_path / "page.html")
    return (tmp_path / "page.html").read_text()


def test_figures_stand_beside_the_printed_ones(page):
    body = re.sub(r"<[^>]+>", " ", re.search(r"<tbody>.*?</tbody>", page, re.DOTALL)[0])
    assert " ".join(body.split()) == "KF 2.000 ± 1.414 – printed in the paper 7.265 –"
    assert "<th>Reading</th>" in page


def test_every_text_is_escaped(page):
    assert "R &amp; D" in page
    assert "&lt;who&gt;" in page
    assert "x &lt; 1 m" in page
    assert "a &lt; b" in page
    assert "<who>" not in page
    assert "<i></" not in page


def test_links_name_each_section_without_its_aside(page):
    nav = re.search(r"<nav.*?</nav>", page, re.DOTALL)[0]
    assert re.findall(r">([^<>]+)</a>", nav) == ["Findings", "RMSE", "Tracks"]
    for target in re.findall(r'href="#([^"]+)"', nav):
        assert f'id="{target}"' in page


def test_marked_lines_that_lie_on_each_other_can_be_told_apart():
    dashes = {name: dash for name, (_, dash) in colours_of(made().figures[0]).items()}
    assert dashes == {"KF": "solid", "Huber": "dash", "IGG3": "solid"}


def test_one_name_has_one_colour_in_all_panels():
    lines = [Trace(f"{i}", np.zeros(1), np.zeros(1)) for i in range(len(COLOURS) + 1)]
    panel = Panel(x_label="", y_label="", traces=(*lines, lines[0]))
    found = colours_of(Figure(key="k", title="", panels=(panel, panel)))
    assert len(found) == len(set(found.values())) == len(COLOURS) + 1
    assert found["0"] == (COLOURS[0], "solid")
    assert found[f"{len(COLOURS)}"] == (COLOURS[0], "dash")


def test_an_experiment_without_findings_and_figures(tmp_path):
    write_experiment(made(findings=(), figures=()), tmp_path / "page.html")
    assert "Findings" not in (tmp_path / "page.html").read_text()


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(OutputError):
        write_experiment(made(), tmp_path / "none" / "page.html")
    assert not list(tmp_path.iterdir())


def test_the_figures_of_the_page_are_json(page):
    for text in re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', page, re.DOTALL):
        json.loads(text)
