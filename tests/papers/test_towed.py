"""The experiment of paper 002: its shape, and what must hold in any run."""

import numpy as np
import pytest

from docs.pages import ROOT, blocks
from docs.recorded import assert_shows
from surefix.errors import OptionsError
from surefix.papers.towed import SEVERAL, TowedOptions, run
from surefix.papers.towed_methods import estimate, estimate_several, position_rmse, state_rmse
from surefix.simulate.towed import simulate

PAGE = ROOT / "docs" / "papers" / "towed.md"


@pytest.fixture(scope="module")
def small():
    return run(TowedOptions(seed=4, runs=3, minutes=9.0))


def figure(experiment, key, row, column=0):
    table = next(table for table in experiment.tables if table.key == key)
    return table.mean[table.rows.index(row), column]


def test_the_m_filter_is_between_the_kalman_filter_and_the_oracle(small):
    for column in (4, 5):
        oracle, ours, plain = (
            figure(small, "rmse", row, column) for row in ("oracle", "M eqs 19", "KF")
        )
        assert oracle < ours < 1.3 * oracle
        assert plain > 2.5 * oracle
    assert figure(small, "position_m", "KF") > 2.0 * figure(small, "position_m", "M eqs 19")


def test_without_gross_errors_little_is_lost(small):
    for row in ("M eqs 19", "M iterated, W₂", "M iterated, W₁ W₂", "Student-t iterated"):
        assert 0.9 < figure(small, "position_ratio", row) < 1.15
        assert 1.0 < figure(small, "heading_ratio", row) < 1.1
    assert figure(small, "position_ratio", "KF") == 1.0


def test_the_oracle_is_honest_and_the_kalman_filter_is_not(small):
    assert 5.0 < figure(small, "nees", "oracle") < 7.0
    assert 5.0 < figure(small, "nees", "oracle + RTS") < 7.0
    assert figure(small, "nees", "KF") > 40.0


def test_the_state_side_helps_against_kicks_and_hurts_with_bad_fixes(small):
    both, fixes = "M iterated, W₁ W₂", "M iterated, W₂"
    assert figure(small, "state_side_m", both, 2) < 0.6 * figure(small, "state_side_m", fixes, 2)
    assert figure(small, "state_side_m", both, 3) > 1.5 * figure(small, "state_side_m", fixes, 3)


def test_smoothing_mends_the_dives(small):
    smoothed, real = (figure(small, "position_m", r, 2) for r in ("M eqs 19 + RTS", "M eqs 19"))
    assert smoothed < 0.6 * real


@pytest.mark.parametrize("seed", [30, 60])
def test_several_hypotheses_come_near_the_smoothed_oracle(seed):
    ratio = []
    for i in range(seed, seed + 6):
        survey = simulate(i, minutes=12.0)
        best, ours = estimate(survey, "oracle", smooth=True), estimate_several(survey)
        place = [position_rmse(each, survey.surfaced) for each in (ours, best)]
        ratio.append([*(state_rmse(ours) / state_rmse(best))[4:], place[0] / place[1]])
    assert (np.mean(ratio, axis=0) < 1.05).all()


def test_several_hypotheses_lose_nothing_without_gross_errors(small):
    for key in ("position_ratio", "heading_ratio"):
        assert figure(small, key, SEVERAL) == pytest.approx(1.0, abs=0.01)


def test_the_page_shows_what_is_found():
    (shown,) = (block.text for block in blocks(PAGE) if block.info == "recorded")
    assert_shows(shown, run(TowedOptions(runs=2)))


def test_the_first_run_does_not_depend_on_the_number_of_runs(small):
    one = run(TowedOptions(seed=4, runs=1, minutes=9.0))
    for alone, among in zip(one.tables, small.tables, strict=True):
        np.testing.assert_array_equal(alone.values[0], among.values[0])


def test_figures_are_complete_and_finite(small):
    assert [figure.key for figure in small.figures] == [
        "states",
        "errors",
        "track",
        "contamination",
    ]
    assert [panel.y_label[:3] for panel in small.figures[0].panels] == ["(a)", "(b)", "(c)", "(d)"]
    for panel in (panel for figure in small.figures for panel in figure.panels):
        for trace in panel.traces:
            assert len(trace.x) == len(trace.y)
            assert np.isfinite(trace.y).any(), trace.name
    assert len(small.findings) == 7
    assert not any("nan" in finding for finding in small.findings)


def test_progress_is_told():
    told = []
    run(TowedOptions(seed=1, runs=2, minutes=9.0), told.append)
    assert told == [1, 2]


def test_a_survey_across_the_date_line_near_the_pole_is_as_good(small):
    polar = run(TowedOptions(seed=4, runs=1, minutes=9.0, latitude_deg=80.0, longitude_deg=180.0))
    for key, row in (("rmse", "M eqs 19"), ("position_m", "oracle")):
        first = next(table for table in small.tables if table.key == key)
        same = first.values[0, first.rows.index(row)]
        other = next(table for table in polar.tables if table.key == key)
        assert other.values[0, other.rows.index(row)] == pytest.approx(same, rel=1e-2)


@pytest.mark.parametrize(
    "wrong",
    [{"runs": 0}, {"latitude_deg": 90.0}, {"contamination": -0.1}, {"minutes": np.nan}],
)
def test_impossible_options_are_refused(wrong):
    with pytest.raises(OptionsError):
        TowedOptions(**wrong)
