"""The experiment of paper 003: what it must show, on short voyages of several seeds."""

import json
import re

import numpy as np
import pytest

from docs.pages import ROOT, blocks
from surefix.errors import OptionsError
from surefix.papers.reproduce import contents, reproduce
from surefix.papers.ship import ShipPaperOptions, run
from surefix.papers.ship_methods import DELAYS, METHODS, OURS, PAPER, SEVERAL

PAGE = ROOT / "docs" / "papers" / "ship.md"
CELL = re.compile(r"(-?[\d.]+) ± ([\d.]+)|–")
EDITORS = [name for name in METHODS if name not in ("five-point cubic", "weighted least squares")]


@pytest.fixture(scope="module")
def experiment():
    return run(ShipPaperOptions(seed=3, runs=3, hours=2.0))


@pytest.fixture(scope="module")
def tables(experiment):
    return {table.key: table for table in experiment.tables}


def figure(tables, key, row, column):
    table = tables[key]
    at = column if isinstance(column, int) else table.columns.index(column)
    return table.values[:, table.rows.index(row), at]


def test_isolated_errors_agree_with_the_paper(tables):
    logged = figure(tables, "rmse_isolated", "as logged", 0)
    assert (figure(tables, "rmse_isolated", PAPER, 0) < 0.03 * logged).all()
    for smoother in ("five-point cubic", "weighted least squares"):
        assert (figure(tables, "rmse_isolated", smoother, 0) > 0.3 * logged).all()
    cubic, least = (
        figure(tables, "rmse_isolated", name, 0)
        for name in ("five-point cubic", "weighted least squares")
    )
    assert (cubic > least).all()  # the cubic follows the errors more


@pytest.mark.parametrize("name", ["53H", PAPER, "improved 53H (odd)", "improved 53H (line)"])
def test_53h_removes_up_to_two_and_nothing_longer(tables, name):
    assert (figure(tables, "removed_pct", name, 0) > 99.0).all()
    assert (figure(tables, "removed_pct", name, 1) > 99.0).all()
    for column in (2, 3, 4, 5):
        assert (figure(tables, "removed_pct", name, column) < 1.0).all()


def test_what_is_better_for_bursts(tables):
    for column in (2, 3, 4, 5):
        ours = figure(tables, "removed_pct", OURS, column).mean()
        assert ours > figure(tables, "removed_pct", PAPER, column).mean() + 15.0
    assert figure(tables, "removed_pct", "Hampel, 61 samples", 5).mean() > 35.0
    assert figure(tables, "removed_pct", "Hampel, 11 samples", 4).mean() < 5.0


def test_editors_leave_good_samples_alone_and_smoothers_do_not(tables):
    altered = tables["altered_pct"]
    for name in EDITORS:
        assert np.nanmax(altered.mean[altered.rows.index(name)]) < 3.0
    for name in ("five-point cubic", "weighted least squares"):
        assert np.nanmin(altered.mean[altered.rows.index(name)]) > 99.0


def test_thresholds_have_a_wide_plateau(tables):
    removed = {
        row: figure(tables, "threshold_pct", row, 0).mean() for row in ("0.5 T", "1 T", "2 T")
    }
    assert min(removed.values()) > 99.0
    assert figure(tables, "threshold_pct", "8 T", 0).mean() < 80.0
    roll = [figure(tables, "threshold_pct", row, "roll").mean() for row in ("0.1 T", "1 T")]
    assert roll[0] > 5.0 * roll[1]


def test_ends(tables):
    np.testing.assert_allclose(tables["end_bias"].mean[1], [3.5, 1.0, 0.25, 0.0], atol=1e-9)
    np.testing.assert_allclose(tables["end_bias"].mean[2:], 0.0, atol=1e-9)
    left = tables["end_wild_pct"]
    np.testing.assert_allclose(left.mean[left.rows.index("odd reflection")], [100, 25, 0, 0])
    np.testing.assert_allclose(left.mean[left.rows.index("line (default)")], 0.0, atol=1e-9)
    noise = tables["end_noise"].mean
    assert noise[3][0] < noise[2][0]  # the line is quieter than odd reflection


def test_the_record_is_better_than_every_sensor(tables):
    record = tables["record_rmse"].mean
    rows = tables["record_rmse"].rows
    for column in range(4):
        others = [record[i, column] for i, row in enumerate(rows) if not row.startswith("record")]
        assert record[rows.index("record"), column] < np.nanmin(others)


def test_sigma_of_the_record_is_honest(tables):
    within = tables["within_pct"].mean
    assert (within > 85.0).all()


def test_gnss_goes_and_returns_without_a_jump(tables):
    naive, ours = tables["jump_m"].mean
    assert (ours < 0.2 * naive).all()


def test_checks_find_what_they_are_for(tables):
    found, refused = tables["check_pct"].mean.T
    assert found[0] == 100.0
    assert found[1] > 90.0
    assert found[3] >= found[2] > 60.0
    assert (refused < 1.0).all()


def test_delays(tables):
    table = tables["delay_samples"]
    assert table.rows == tuple(DELAYS)
    np.testing.assert_array_equal(table.mean[:, 0], list(DELAYS.values()))


def test_several_hypotheses_find_every_burst_and_leave_good_samples(tables):
    found = tables["found_pct"].values[:, tables["found_pct"].rows.index(SEVERAL)]
    assert (found[:, :5] == 100.0).all()
    assert found[:, 5].mean() > 95.0
    assert found[:, 6].mean() <= 1.0  # of 10,000 in the worst channel
    assert figure(tables, "removed_pct", SEVERAL, 4).mean() > 95.0


def test_runs_do_not_depend_on_their_number(experiment):
    one = run(ShipPaperOptions(seed=3, runs=1, hours=2.0))
    for few, many in zip(one.tables, experiment.tables, strict=True):
        np.testing.assert_array_equal(few.values[0], many.values[0])


def test_progress_findings_and_figures(experiment):
    told = []
    run(ShipPaperOptions(seed=1, runs=2, hours=0.5), told.append)
    assert told == [1, 2]
    assert [f.key for f in experiment.figures][:5] == [
        "ins-position", "ins-velocity", "ins-attitude", "east-velocity", "north-velocity",
    ]  # fmt: skip
    longest = max(len(t.x) for f in experiment.figures for p in f.panels for t in p.traces)
    assert longest <= 1200
    json.dumps(contents(experiment), allow_nan=False)
    assert len(experiment.findings) == 9


def test_the_page_shows_what_is_found():
    """Its means over 20 voyages against the first, within five standard errors."""
    (shown,) = (
        block.text for block in blocks(PAGE) if block.text.startswith("$ surefix reproduce ship\n")
    )
    found = run(ShipPaperOptions(runs=1))
    for table in found.tables:
        heading = f"{table.title}, {table.unit}" if table.unit else table.title
        part = shown.split(f"\n{heading}\n")[1].split("\n\n")[0].splitlines()[1:]
        for row, mean, line in zip(table.rows, table.mean, part, strict=False):
            assert line.strip().startswith(row), f"{heading}: {line}"
            cells = CELL.findall(line.strip().removeprefix(row))
            assert len(cells) == len(table.columns)
            for ours, (value, spread) in zip(mean, cells, strict=True):
                assert np.isfinite(ours) == bool(value)
                if value:
                    bound = 5.0 * float(spread) + 0.02 * abs(float(value))
                    off = abs(ours - float(value))
                    assert off <= bound + 2.0 * 10.0**-table.digits, f"{heading}: {line}"
    said = shown.strip().splitlines()[-len(found.findings) :]
    for ours, theirs in zip(found.findings, said, strict=True):
        assert re.sub(r"[\d.]+", "0", ours) == re.sub(r"[\d.]+", "0", theirs)


def test_wrong_options():
    for wrong in ({"seed": -1}, {"runs": 0}, {"hours": 0.1}):
        with pytest.raises(OptionsError):
            ShipPaperOptions(**wrong)
    with pytest.raises(OptionsError, match="ship"):
        reproduce("radar", logs=["a.txt"])
