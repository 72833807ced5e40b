"""Paper 001 end to end: what agrees with the paper, honest covariances, late messages, findings."""

import numpy as np
import pytest

from docs.pages import ROOT, blocks
from docs.recorded import assert_shows
from surefix.errors import OptionsError
from surefix.papers import cooperative_rows
from surefix.papers.cooperative import CooperativeOptions, run
from surefix.papers.cooperative_rows import BY_SEVERAL, SEVERAL, SMOOTHED
from surefix.papers.reproduce import contents, reproduce, text_lines

PAGE = ROOT / "docs" / "papers" / "cooperative.md"
NOISE = slice(3, 6)  # columns of the scenarios where the model is right


@pytest.fixture(scope="module")
def experiment():
    return run(CooperativeOptions(seed=1, runs=12))


@pytest.fixture(scope="module")
def mean(experiment):
    """Mean of a row of a table, an array over its columns."""
    tables = {table.key: table for table in experiment.tables}
    return lambda key, row: tables[key].mean[tables[key].rows.index(row)]


def test_fusion_beats_every_master_as_in_the_paper(mean):
    for case in (0, 1, 2):
        fused = mean("rmse_m", "gain weights")[case]
        assert fused < 0.9 * mean("rmse_m", "best single master")[case]
        assert fused < 0.3 * mean("rmse_m", "mean of observations")[case]


def test_gains_are_of_the_printed_size(mean):
    gains = [mean("table_2", f"AUV{i}")[4] for i in (1, 2, 3)]
    assert gains == pytest.approx([0.1385, 0.1764, 0.1421], rel=0.35)
    weights = [mean("table_2", f"AUV{i}")[5] for i in (1, 2, 3)]
    assert sum(weights) == pytest.approx(1.0)


def test_errors_at_five_iterations_and_the_fit_agree(mean):
    for case, masters in ((1, 3), (2, 4)):
        for row in (*(f"AUV{i + 1}" for i in range(masters)), "gain weights"):
            fit = mean(f"case_{case}_fit", row)
            errors = mean(f"case_{case}_m", row)
            assert np.square(errors).mean() < fit[0]
            assert fit[1] < 1.05 * np.sqrt(5.0 / 4.0 * fit[0])


def test_ratio_to_the_centralised_filter(mean):
    """One weight per master costs little where all masters are alike."""
    assert mean("ratio", "gain weights")[NOISE] == pytest.approx([1.07, 1.08, 1.16], abs=0.08)
    assert mean("ratio", "inverse covariance")[NOISE] == pytest.approx([1.07, 1.08, 1.16], abs=0.08)
    assert mean("ratio", "Bar-Shalom–Campo")[NOISE].max() < 1.2
    assert (mean("ratio", "centralised filter") == 1.0).all()
    best = mean("ratio", "Bar-Shalom–Campo")[NOISE]
    assert (best < mean("ratio", "gain weights")[NOISE] + 0.01).all()


def test_how_the_noise_is_scaled_decides_what_gain_weights_lose(mean):
    by_gain = mean("axes_scaled", "gain weights")
    assert by_gain[0] == pytest.approx(mean("axes", "gain weights")[-1])
    assert by_gain[0] > by_gain[1] > by_gain[2] > 1.3
    assert mean("axes_scaled", "Bar-Shalom–Campo") == pytest.approx(np.ones(3), abs=0.05)


def test_covariances_are_honest_where_the_model_is_right(mean):
    for row in ("gain weights", "mean of estimates", "Bar-Shalom–Campo", "centralised filter"):
        assert mean("nees", row)[NOISE] == pytest.approx(np.ones(3), abs=0.17)
    assert (mean("nees", "gain weights, bound")[NOISE] < 0.8).all()
    assert (mean("nees", "inverse covariance")[NOISE] > 1.5).all()
    assert (mean("nees", "gain weights")[:3] < 0.6).all()


def test_one_weight_per_master_fails_where_quality_differs_by_axis(mean):
    gain, best = mean("axes", "gain weights"), mean("axes", "Bar-Shalom–Campo")
    assert (np.diff(gain) > 0.0).all()
    assert gain[-1] > 1.6
    assert best[-1] < 1.1
    assert mean("axes", "covariance intersection")[-1] < 1.2


def test_thresholds_keep_gross_errors_out(mean):
    assert mean("gross_m", "gain weights")[-1] > 1.8 * mean("gross_m", "gain weights")[0]
    kept = mean("gross_m", "gain weights, thresholds")
    assert kept[-1] < 1.25 * mean("gross_m", "gain weights")[0]
    assert kept[0] < 1.1 * mean("gross_m", "gain weights")[0]


def test_tracklets_are_the_centralised_filter(mean):
    """Weights leave a gap where Q is in the truth; what each observation added leaves none."""
    assert mean("ratio", "tracklets").max() < 1.05
    assert mean("ratio", "tracklets")[NOISE].max() < 1.02
    assert (mean("ratio", "tracklets")[NOISE] < mean("ratio", "Bar-Shalom–Campo")[NOISE]).all()
    assert mean("nees", "tracklets")[NOISE] == pytest.approx(np.ones(3), abs=0.17)
    assert mean("axes", "tracklets").max() < 1.03


def near_the_told(ratio, bound):
    for name in (BY_SEVERAL, SEVERAL):
        assert (ratio(name) < bound).all(), name
    assert (ratio(SMOOTHED) < 0.9).all()


def test_several_hypotheses_come_near_a_filter_told_all_gross_errors(mean):
    near_the_told(lambda name: mean("gross_ratio", name), 1.04)
    thresholds = mean("gross_ratio", "centralised filter, thresholds")
    assert mean("gross_ratio", BY_SEVERAL)[-1] < thresholds[-1]


@pytest.mark.parametrize("seed", [2, 3])
def test_so_they_do_on_other_seeds(seed):
    rows = cooperative_rows._gross(
        CooperativeOptions(seed=seed), [[seed, i] for i in range(4)], (0.0, 0.1)
    )["gross_ratio"]
    near_the_told(lambda name: rows[name].mean(axis=0), 1.06)


def test_late_messages(mean):
    replay = mean("late_ratio", "replay of observations")
    assert replay[0] == pytest.approx(1.0, abs=0.01)
    timely, printed = (mean("late_ratio", f"timely, {x}") for x in ("gain weights", "as printed"))
    waiting = mean("late_ratio", "in order, as printed")
    assert (replay < timely + 0.02).all()
    assert (timely < printed).all()
    assert (printed < waiting).all()
    for row in ("gain weights", "Bar-Shalom–Campo"):
        assert mean("late_nees", f"timely, {row}") == pytest.approx(np.ones(4), abs=0.35)
    assert mean("replay", "replay of observations").tolist() == [100.0]


def test_every_reading_of_R_works(mean):
    for reading in ("position", "components", "range"):
        _, _, _, masters, fused, central = mean("readings", reading)
        assert fused < masters
        assert np.isfinite(central)


def test_result_is_complete_and_can_be_written(experiment):
    assert {figure.key for figure in experiment.figures} >= {
        *(f"fig-{k}" for k in (7, 8, 9, 11, 13, 14)),
        "cumulative",
    }
    for figure in experiment.figures:
        for panel in figure.panels:
            assert all(trace.x.shape == trace.y.shape for trace in panel.traces)
    assert contents(experiment)["tables"]["ratio"]["centralised filter"][0] == 1.0
    assert all("nan" not in line for line in (*text_lines(experiment), *experiment.findings))


def test_first_run_does_not_depend_on_how_many_there_are(experiment):
    alone = reproduce("cooperative", seed=1, runs=1)
    for one, other in zip(alone.tables, experiment.tables, strict=True):
        assert one.values[0] == pytest.approx(other.values[0], rel=1e-9, abs=1e-9, nan_ok=True)
    assert all("nan" not in line for line in alone.findings)


def test_the_page_shows_what_is_found(experiment):
    (shown,) = (block.text for block in blocks(PAGE) if block.info == "recorded")
    assert_shows(shown, experiment)


@pytest.mark.parametrize(
    "wrong",
    [
        {"runs": 0},
        {"seed": -1},
        {"process": 0.0},
        {"variance": np.nan},
        {"thresholds": (3.0, 2.0)},
        {"loss": 1.0},
        {"period_s": (1.0, 0.0, 1.0)},
    ],
)
def test_wrong_options_are_refused(wrong):
    with pytest.raises(OptionsError):
        CooperativeOptions(**wrong)
