"""An experiment as text: one line a row, or parts that fit a terminal."""

import numpy as np
import pytest

from surefix.errors import OptionsError
from surefix.experiment import Experiment, gather
from surefix.papers.reproduce import reproduce, text_lines


def made(runs=2, columns=6):
    names = [f"column {i}" for i in range(columns)]
    rows = [{"KF": np.arange(columns) + run, "a long name": [1.0] * columns} for run in range(runs)]
    printed = {"KF": tuple(np.arange(columns) + 0.5)}
    table = gather("k_m", "Heading", names, rows, unit="m", printed=printed, digits=1, note="note")
    return Experiment(
        paper="usbl", title="Title", source="Source", seed=3, runs=runs, tables=(table,),
        figures=(), findings=("Found.",),
    )  # fmt: skip


def test_a_table_stands_beside_what_was_printed():
    lines = text_lines(made(columns=2))
    assert lines[:3] == ["Title", "Source", "seed 3, 2 runs: mean ± spread of the runs"]
    assert lines[4:] == [
        "Heading, m",
        "                column 0   column 1",
        "  KF           0.5 ± 0.7  1.5 ± 0.7",
        "    paper            0.5        1.5",
        "  a long name  1.0 ± 0.0  1.0 ± 0.0",
        "  note",
        "",
        "Found.",
    ]


def test_one_run_has_no_spread():
    lines = text_lines(made(runs=1))
    assert lines[2] == "seed 3, 1 run"
    assert not any("±" in line for line in lines)


@pytest.mark.parametrize("width", [1, 30, 40, 60, 80, 200])
def test_wide_tables_come_in_parts_that_fit(width):
    whole, parts = text_lines(made()), text_lines(made(), width)
    table = [line for line in parts[5:] if line.startswith("  ") and "note" not in line]
    if width >= 30:
        assert max(map(len, table)) <= width
    shown = [cell for line in table if line.startswith("  KF") for cell in line.split()[1::3]]
    assert shown == ["0.5", "1.5", "2.5", "3.5", "4.5", "5.5"]
    assert sum(line.count("column") for line in table) == 6
    assert (parts == whole) == (width >= max(map(len, whole)))


@pytest.mark.parametrize(
    "wrong", [{"paper": "none"}, {"seed": -1}, {"runs": 0}, {"logs": ["a.nmea"]}]
)
def test_what_cannot_be_run_is_refused(wrong):
    with pytest.raises(OptionsError, match="expected"):
        reproduce(**{"paper": "usbl", **wrong})
