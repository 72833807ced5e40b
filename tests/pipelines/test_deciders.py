"""Methods with a cleaner before the filter, and Cipra-Romera, through the whole of `clean`."""

import numpy as np
import pandas as pd
import pytest

import surefix
from acceptance.product import clean, local, off_the_line, read, told_in_one_line
from acceptance.product import surefix as run
from pipelines.test_batches import HEAD, equal, realtime
from surefix import CleanOptions, Reason, Verdict
from surefix.errors import OptionsError
from surefix.filters.deciding import THRESHOLDS
from surefix.pipelines.joining import join
from surefix.reasons import texts
from surefix.robust.loss import LossCode

CLEANERS = tuple(THRESHOLDS)
CASES = [
    (method, mode)
    for method in (*CLEANERS, "cipra-romera")
    for mode in ("offline", "lagged", "realtime")
    if mode != "realtime" or method in ("median", "cipra-romera")
]


def survey(seed, n=500, sigma=0.4, step=2.0, jitter=0.15, speed=0.4, share=0.08):
    """Turning slowly at a few tenths of a metre a second, with isolated errors of 10 … 40 m."""
    rng = np.random.default_rng(seed)
    time = step * (np.arange(n) + rng.uniform(-jitter, jitter, n))
    turn = 300.0
    truth = speed * turn * np.column_stack([np.sin(time / turn), 1.0 - np.cos(time / turn)])
    bad = np.zeros(n, np.bool_)
    bad[rng.choice(np.arange(12, n - 4, 4), int(share * n), replace=False)] = True
    error = rng.choice([-1.0, 1.0], (n, 2)) * rng.uniform(10.0, 40.0, (n, 2))
    x = truth + sigma * rng.standard_normal((n, 2)) + np.where(bad[:, None], error, 0.0)
    return {"time": time, "x": x[:, 0], "y": x[:, 1]}, truth, bad


def cleaned(log, method, mode="offline", **options):
    return surefix.clean(log, options=CleanOptions(method=method, mode=mode, **options))


@pytest.mark.parametrize(("method", "mode"), CASES)
def test_gross_errors_go_good_fixes_stay_and_sigma_is_honest(method, mode):
    squares = []
    for seed in range(3):
        log, truth, bad = survey(seed)
        found = cleaned(log, method, mode)
        verdict, weight = found.verdicts.verdict, found.verdicts.weight
        if method in CLEANERS:
            assert (verdict[bad] == Verdict.REJECTED).all()
            assert (verdict[~bad] == Verdict.USED).mean() > 0.97
            assert (found.verdicts.innovation_sigma[bad] > THRESHOLDS[method]).all()
            assert set(weight) == {0.0, 1.0}
            assert "σ off" in texts(found.verdicts)[int(np.flatnonzero(bad)[0])]
        else:
            assert (weight[bad] < 0.3).all()
            assert np.median(weight[~bad]) == 1.0
        error = found.track.position[:, :2] - truth
        squares.append(((error / found.track.sigma_position[:, :2])[20:] ** 2).mean())
    assert 0.8 < np.mean(squares) < 1.3, squares


@pytest.mark.parametrize("method", CLEANERS)
def test_the_track_is_that_of_a_log_without_the_wild_fixes(method):
    """Nothing of what a cleaner would put in their place reaches the track or its σ."""
    log, _, bad = survey(7)
    del log["y"]
    options = {"sigma_position": 0.4, "process": 0.01}
    whole = cleaned(log, method, **options)
    kept = whole.verdicts.verdict == Verdict.USED
    assert not kept[bad].any()
    rest = {name: column[kept] for name, column in log.items()}
    plain = cleaned(rest, "kalman", **options)
    for one, other in zip(whole.track[1:5], plain.track[1:5], strict=True):
        # but for the beginning, where the usual speed of the log counts
        np.testing.assert_allclose(one[kept][40:], other[40:], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("method", CLEANERS)
def test_one_wrong_axis_costs_that_axis_alone(method):
    log, truth, _ = survey(3, share=0.0)
    log["y"][250] += 30.0
    found = cleaned(log, method)
    assert found.verdicts.verdict[250] == Verdict.REJECTED
    assert found.verdicts.reason[250] == Reason.AXIS_OFF
    assert texts(found.verdicts)[250].endswith("σ off along y, the rest used")
    assert abs(found.track.position[250, 1] - truth[250, 1]) < 1.0


@pytest.mark.parametrize("method", CLEANERS)
def test_an_accepted_fix_is_used_and_velocities_are_cleaned_too(method):
    log, truth, _ = survey(4, share=0.0)
    log["x"][100] += 30.0
    log["edit"] = [""] * 500
    log["edit"][100] = "accept"
    time = np.arange(0.0, 1000.0, 0.5)
    velocity = {"time": time, "ve": 0.4 * np.cos(time / 300.0), "vn": 0.4 * np.sin(time / 300.0)}
    velocity["ve"] = velocity["ve"] + np.random.default_rng(1).normal(0.0, 0.02, len(time))
    velocity["vn"] = velocity["vn"] + np.random.default_rng(2).normal(0.0, 0.02, len(time))
    velocity["ve"][40::150] += 3.0
    found = surefix.clean(log, velocity=velocity, options=CleanOptions(method=method))
    assert found.verdicts.verdict[100] == Verdict.EDITED
    assert found.verdicts.weight[100] == 1.0
    off = np.abs(found.track.position[:, :2] - truth)
    assert np.delete(off, range(90, 111), axis=0).max() < 1.0


@pytest.mark.parametrize(
    "sizes", [[HEAD + 30, *[1] * 200], [HEAD + 30, *[7] * 120]], ids=["one by one", "sevens"]
)
@pytest.mark.parametrize("method", ["median", "cipra-romera"])
def test_chunks_do_not_change_the_fixes(sizes, method):
    equal(join(realtime([HEAD + 30], method=method)), join(realtime(sizes, method=method)))


@pytest.mark.parametrize(("method", "mode"), CASES)
def test_headings_are_cleaned_across_north(method, mode):
    rng = np.random.default_rng(5)
    log, _, _ = survey(5, share=0.0)
    log["heading"] = (340.0 + 0.1 * np.arange(500) + rng.normal(0.0, 1.0, 500)) % 360.0
    log["heading"][[150, 330]] += 120.0
    log["heading"] %= 360.0
    (series,) = cleaned(log, method, mode).channels
    off = (series.value - 340.0 - 0.1 * np.arange(500) + 180.0) % 360.0 - 180.0
    assert np.abs(off[10:]).max() < 5.0
    assert (series.verdicts.weight[[150, 330]] < 0.05).all()
    assert (series.verdicts.weight > 0.5).mean() > 0.9


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"method": "53h", "mode": "realtime"}, "method median decides from the past"),
        ({"method": "hampel", "mode": "realtime"}, "mode lagged or offline"),
        ({"method": "median", "k1": 4.0}, "k0 alone"),
        ({"method": "53h", "k1": 4.0}, "k0 alone"),
        ({"method": "cipra-romera", "k1": 4.0}, "k0 alone"),
        ({"method": "hampel", "k0": 0.0}, "above zero"),
        ({"method": "cipra-romera", "k0": -1.0}, "positive"),
    ],
)
def test_what_makes_no_sense_is_refused(options, said):
    with pytest.raises(OptionsError, match=said):
        CleanOptions(**options)


@pytest.mark.parametrize(("method", "least"), [("53h", "8"), ("hampel", "12")])
def test_the_lag_must_cover_what_a_cleaner_looks_ahead(method, least):
    log, _, _ = survey(6)
    with pytest.raises(OptionsError, match=f"at least {least}"):
        cleaned(log, method, "lagged", lag_s=5.0)
    cleaned(log, method, "lagged", lag_s=float(least) + 0.5)


def test_k0_is_the_threshold():
    log, _, bad = survey(8)
    strict, loose = (cleaned(log, "53h", k0=k0).verdicts.verdict for k0 in (1.5, 200.0))
    assert (strict[~bad] == Verdict.REJECTED).any()
    assert (loose == Verdict.USED).all()


def test_losses_behind_the_methods():
    assert CleanOptions(method="53h").loss.code == LossCode.NONE
    assert CleanOptions(method="cipra-romera", k0=2.0).loss[:2] == (LossCode.HUBER, 2.0)


def test_the_command_line_says_it_in_one_line(tmp_path):
    log, _, _ = survey(9, n=100)
    pd.DataFrame(log).to_csv(tmp_path / "log.csv", index=False)
    words = "clean", tmp_path / "log.csv", "--method", "53h"
    assert run(*words, "-o", tmp_path / "out.csv").code == 0
    told = told_in_one_line(run(*words, "--mode", "realtime"))
    assert "looks ahead" in told


@pytest.mark.parametrize(("method", "mode"), CASES)
def test_a_real_acoustic_log(data, tmp_path, method, mode):
    """Wild fixes far from the local line; 53H keeps what comes in a burst of three or more."""
    fixes, depth = (
        data / "usbl_mbari" / f"oi_survey_1913_{name}.csv"
        for name in ("MINIROV_USBL_LATLONG", "COMPAS_DEPTH")
    )
    out = tmp_path / "track.csv"
    column = "time=lcm_timestamp:us"
    clean(
        fixes, "--depth", depth, "--column", column, "-o", out, "--mode", mode, "--method", method
    )
    raw, track = pd.read_csv(fixes), read(out)
    place = local(raw.latitude.to_numpy(), raw.longitude.to_numpy())
    off = off_the_line(raw.lcm_timestamp.to_numpy() / 1e6, place)
    far, near = off > 8.0, off < 2.0
    assert far.sum() == 19
    assert (track.weight[far] >= 0.1).sum() <= (2 if method in ("53h", "cipra-romera") else 0)
    whole = (track.verdict == "rejected") & ~track.reason.str.endswith("the rest used")
    assert whole[near].mean() < 0.01
