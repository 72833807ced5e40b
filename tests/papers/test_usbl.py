"""Paper 000 run again: its tables hold on every seed, and the page shows what is found."""

import json
import re

import numpy as np
import pytest

from docs.pages import ROOT, blocks
from reference import kalman as textbook
from surefix.errors import OptionsError
from surefix.metrics import normalised_squares, rmse
from surefix.models.motion import transition
from surefix.papers.reproduce import contents, reproduce, text_lines, write_json
from surefix.papers.usbl import UsblOptions, run
from surefix.papers.usbl_methods import SENSORS, Reading, compare, estimate, printed_gain
from surefix.papers.usbl_tables import rejected
from surefix.simulate.usbl_track import simulate

PAGE = ROOT / "docs" / "papers" / "usbl.md"
SEEDS = range(8)
FIRST = ("KF", "Huber", "IGG1", "IGG3")


@pytest.fixture(scope="module")
def experiment():
    """Three runs as the command line makes them."""
    return reproduce("usbl", seed=1, runs=3)


@pytest.mark.parametrize("kind", ["common", "independent"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_and_the_sizes_of_table_1_hold_on_every_seed(seed, kind):
    track = simulate([77, seed], run=kind)
    found = compare(track, Reading())
    error = {row: rmse(each.position - track.position) for row, each in found.items()}
    assert ((error["KF"] > 4.0) & (error["KF"] < 9.0)).all()
    assert (error["Huber"] < error["KF"]).all()
    for row in ("IGG1", "IGG3", "IGG3 (Yang)"):
        assert (error[row] <= 0.30).all()
        assert (error[row] < 0.2 * error["Huber"]).all()
    assert (error["KF"] < error["raw fixes"]).all()
    assert error["surefix, offline"].mean() < 0.5 * error["IGG3"].mean()
    assert error["multi-hypothesis, offline"].mean() < 1.02 * error["oracle, offline"].mean()
    assert (rejected(track, found["multi-hypothesis, offline"].position) >= 99.0).all()
    assert error["surefix, real time"].mean() < 1.1 * error["oracle, sensor noise"].mean()


@pytest.mark.parametrize("seed", SEEDS)
def test_rejection_is_that_of_table_2_but_for_huber(seed):
    track = simulate([77, seed])
    share = {row: rejected(track, estimate(track, row, Reading()).position) for row in FIRST}
    assert (share["KF"] < 4.0).all()
    assert share["Huber"].mean() < 15.0
    for row in ("IGG1", "IGG3"):
        assert share[row].mean() > 75.0
    less = rejected(track, estimate(track, "Huber", Reading(q=0.01)).position)
    assert 25.0 < less.mean() < 45.0


@pytest.mark.parametrize("noise", [(0.007, 3e-4, 0.03), (0.014, 6e-4, 0.06), (0.003, 1e-4, 0.02)])
def test_covariance_is_honest_with_the_noise_of_the_sensors(noise):
    squares = []
    for seed in SEEDS:
        track = simulate(
            [78, seed], sigma_phase=noise[0], sigma_time=noise[1], sigma_velocity=noise[2]
        )
        found = estimate(track, "IGG3", SENSORS)
        squares.append(normalised_squares(found.position - track.position, found.covariance).mean())
    assert np.mean(squares) == pytest.approx(3.0, abs=0.6)


def test_filter_is_the_textbook_s():
    """KF with Q = 0.1 I, R = I over the whole track, gross errors and all."""
    track = simulate(4)
    z = np.hstack([track.fixes, track.measured_velocity])
    F, eye = transition("cv", 3, 1.0), np.eye(6)
    m, P, found = z[0], eye, estimate(track, "KF", Reading())
    for k in range(1, len(z)):
        m, P = textbook.update(*textbook.predict(m, P, F, 0.1 * eye), z[k], eye, eye)[:2]
        np.testing.assert_allclose(found.position[k], m[:3], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance[k], P[:3, :3], rtol=1e-9, atol=1e-9)


def test_equation_13_word_for_word_is_a_gain_of_one_eleventh():
    track = simulate(4)
    z, F = np.hstack([track.fixes, track.measured_velocity]), transition("cv", 3, 1.0)
    state, found = z[0], printed_gain(track, "KF", Reading())
    for k in range(1, len(z)):
        state = (10.0 * (F @ state) + z[k]) / 11.0
        np.testing.assert_allclose(found.position[k], state[:3], rtol=1e-9, atol=1e-9)


def test_a_missing_fix_is_bridged():
    track = simulate(6)
    track.fixes[300:305] = track.phase[300:305] = np.nan
    for row in ("IGG3", "KF"):
        for reading in (Reading(), SENSORS):
            assert np.isfinite(estimate(track, row, reading).position).all()


def test_json_keeps_its_contract(experiment, tmp_path):
    write_json(experiment, tmp_path / "usbl.json")
    given = json.loads((tmp_path / "usbl.json").read_text(encoding="utf-8"))
    assert given == contents(experiment)
    for key in ("rmse_m", "rejected_pct"):
        assert list(given["tables"][key])[:4] == list(FIRST)
        assert set(given["printed"][key]) == set(FIRST)
        assert all(len(given["tables"][key][row]) == 3 for row in FIRST)
    assert given["columns"]["rmse_m"] == ["X", "Y", "Z"]
    assert given["printed"]["rmse_m"]["Huber"] == [4.439, 4.379, 2.267]
    assert {"rmse_independent_m", "rejected_independent_pct", "nees"} <= set(given["tables"])
    assert given["seed"] == 1
    assert given["runs"] == 3


def test_runs_are_repeatable_and_the_first_does_not_know_the_others(experiment):
    alone = run(UsblOptions(seed=1, runs=1))
    other = run(UsblOptions(seed=2, runs=1))
    for one, several, changed in zip(alone.tables, experiment.tables, other.tables, strict=True):
        np.testing.assert_array_equal(one.values[0], several.values[0])
        assert (one.values[0] != changed.values[0]).any()


def test_a_short_form_has_every_part():
    told = []
    small = run(UsblOptions(seed=5, runs=2, epochs=160), told.append)
    assert told == [1, 2]
    for table in small.tables:
        assert np.isfinite(table.values).all(), table.key
    assert {figure.key for figure in small.figures} >= {"errors", "axis-x", "axis-y", "axis-z"}


def test_findings_say_what_the_tables_say(experiment):
    said = " ".join(experiment.findings)
    table = {each.key: each for each in experiment.tables}
    share = table["rejected_pct"].mean[1].mean()
    assert f"Huber rejects {share:.0f} %" in said
    assert f"IGG3 {table['rmse_independent_m'].mean[3].mean():.2f} m" in said
    assert said in " ".join(text_lines(experiment))


def test_figures_show_each_axis_with_truth_fixes_and_all_filters(experiment):
    axis = next(figure for figure in experiment.figures if figure.key == "axis-z")
    assert [trace.name for trace in axis.panels[0].traces] == ["raw fix", *FIRST, "truth"]
    errors = {trace.name: trace.y for trace in axis.panels[1].traces}
    assert np.abs(errors["IGG3"]).max() < 1.5 < np.abs(errors["KF"]).max()


@pytest.mark.parametrize("wrong", [{"seed": -1}, {"runs": 0}, {"epochs": 100}])
def test_options_are_checked(wrong):
    with pytest.raises(OptionsError, match=next(iter(wrong))):
        UsblOptions(**wrong)


def test_the_page_shows_what_is_found(experiment):
    """Means of three runs lie within the spread that the page shows for twenty."""
    shown = [block.text for block in blocks(PAGE) if block.info == "recorded"]
    assert shown
    rows = re.findall(r"^  (\S.*?)((?:  +\d[\d,]*\.\d+ ± [\d.]+)+)$", shown[0], flags=re.MULTILINE)
    means = [
        (row, mean, table.digits)
        for table in experiment.tables
        for row, mean in zip(table.rows, table.mean, strict=True)
    ]
    assert [row for row, _ in rows] == [row for row, _, _ in means]
    for (row, text), (_, mean, digits) in zip(rows, means, strict=True):
        pairs = np.array([each.split(" ± ") for each in re.split(r"  +", text.strip())], float)
        near = 3.0 * pairs[:, 1] + 0.02 * pairs[:, 0] + 2.0 * 10.0**-digits
        assert (np.abs(pairs[:, 0] - mean) <= near).all(), (row, pairs, mean)
