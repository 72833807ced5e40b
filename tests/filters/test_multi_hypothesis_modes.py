"""Real time, lag and offline against a filter that was told every fault, in worlds at random."""

import functools

import numpy as np
import pytest

from surefix.comparison.oracle import lag_of, oracle
from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.hypothesis_trail import decide, undecided
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.multi_hypothesis_modes import (
    lagged_hypotheses,
    offline_hypotheses,
    realtime_hypotheses,
)
from surefix.filters.offline import backward
from surefix.filters.records import Epochs, Estimate, Motion, Recovery
from surefix.filters.rts import smooth
from surefix.filters.track import by_axis, filter_track, start
from surefix.robust.loss import loss_named
from surefix.simulate.contamination import alone, draw, draw_world

MODES = ("offline", "lagged", "realtime")
KINDS = ("aided", "alone")
BEGUN = 20


def motion_of(trial):
    d = trial.world.axes
    return Motion(2, d, np.full(d, trial.world.process**2), by_axis(d), 2 * d, 0.0)


def prior_of(trial, **changes):
    """What is supposed of any log with these noises; runs of less than 40 fixes are survived."""
    world = trial.world
    speed, longest = 20.0 * world.sigma_m / world.interval_s, 39.5 * world.interval_s
    made = supposed(world.axes, world.sigma_m, world.sigma_mps, speed, longest)
    return made._replace(**changes)


def epochs_of(trial):
    n, d = trial.fixes.shape
    variance = np.empty((n, 2 * d))
    variance[:, :d], variance[:, d:] = trial.world.sigma_m**2, trial.world.sigma_mps**2
    fixed, none = np.full((n, 2 * d), np.nan), np.zeros(n, np.int64)
    z = np.hstack([trial.fixes, trial.velocities])
    return Epochs(trial.time, z, variance, fixed, none, none.copy())


def estimate(trial, mode, epochs=None, lag=None, **changes):
    given = epochs_of(trial) if epochs is None else epochs
    motion, prior = motion_of(trial), prior_of(trial, **changes)
    if mode == "offline":
        return offline_hypotheses(motion, prior, given)
    if mode == "lagged":
        every = np.ones(len(given.time), np.bool_)
        return lagged_hypotheses(motion, prior, given, lag_of(trial) if lag is None else lag, every)
    return realtime_hypotheses(motion, prior, given, no_hypotheses(motion))[1]


@functools.cache
def drawn(name, kind, seed, axes=0):
    world = draw_world([71, seed], epochs=600, axes=axes or 1 + seed % 3)
    trial = draw(name, world, [71, seed])
    return alone(trial) if kind == "alone" else trial


def rmse(trial, position):
    return np.sqrt(((position - trial.position)[BEGUN:] ** 2).mean())


def ratio(trial, found, mode):
    """RMSE of the position over that of the oracle of the same mode."""
    return rmse(trial, found.mean[:, : trial.world.axes]) / rmse(
        trial, oracle(trial, mode).position
    )


def ratios(name, kind, mode, seeds=5, axes=0, **changes):
    out = []
    for seed in range(seeds):
        trial = drawn(name, kind, seed, axes)
        out.append(ratio(trial, estimate(trial, mode, **changes), mode))
    return np.array(out)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("name", "share"),
    [("clean", 0.02), ("isolated-20", 0.2), ("isolated-40", 0.4), ("irregular", 0.05)],
)
def test_isolated_errors_cost_next_to_nothing(name, share, mode, kind):
    limit = {"offline": 1.02, "lagged": 1.02, "realtime": 1.03 if kind == "aided" else 1.08}[mode]
    seeds = 20 if (mode, kind) == ("realtime", "alone") else 5
    assert ratios(name, kind, mode, seeds, isolated=share).mean() < limit


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", MODES)
def test_errors_of_one_axis_leave_the_others(mode, kind):
    limit = {"offline": 1.02, "lagged": 1.02, "realtime": 1.03 if kind == "aided" else 1.08}[mode]
    assert ratios("one-axis", kind, mode, partial=0.2).mean() < limit
    trial = drawn("one-axis", kind, 2)
    found = estimate(trial, mode, partial=0.2)
    good = ~trial.bad_fix & trial.bad_fix.any(axis=1)[:, None]
    assert (found.weight[:, :3][trial.bad_fix] < 0.1).all()
    assert (found.weight[:, :3][good] > 0.2).mean() > 0.98


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", ["offline", "lagged"])
def test_a_run_with_a_common_offset_costs_nothing(mode, kind):
    assert ratios("burst-common", kind, mode).mean() < 1.02
    for seed in range(3):
        trial = drawn("burst-common", kind, seed)
        found = estimate(trial, mode)
        assert (found.weight[:, : trial.world.axes][trial.bad_fix] < 0.5).mean() > 0.97
        assert not found.jump.any()
        longest = found.run.max()
        assert longest in range(28, 32)
        assert (found.run == longest).sum() == longest
        assert (trial.bad_fix[found.run > 0].any(axis=1)).mean() > 0.9


@pytest.mark.parametrize("mode", MODES)
def test_a_run_of_unlike_errors_costs_nothing_where_velocities_help(mode):
    assert ratios("burst-independent", "aided", mode).mean() < 1.03


@pytest.mark.parametrize(
    ("mode", "limit"), [("offline", 1.02), ("lagged", 1.02), ("realtime", 1.3)]
)
def test_a_run_of_unlike_errors_is_seen_through(mode, limit):
    """Alone, in space: a lucky guess is not believed among wrong ones, if such runs are known."""
    found = ratios("burst-independent", "alone", mode, seeds=8, axes=3)
    assert found.mean() < limit
    assert ratios("burst-independent", "alone", mode, seeds=8, axes=3, row=0.05).mean() > 1.15


@pytest.mark.parametrize("kind", KINDS)
def test_a_jump_is_dated_exactly(kind):
    for mode, limit in (("offline", 1.02), ("lagged", 1.02)):
        found = []
        for seed in range(4):
            trial = drawn("jump", kind, seed)
            each = estimate(trial, mode)
            assert np.flatnonzero(each.jump).tolist() == [trial.jump]
            assert np.nanmax(each.since) == trial.time[trial.jump]
            assert np.isfinite(each.since).any(axis=1).sum() == 1
            found.append(ratio(trial, each, mode))
        assert np.mean(found) < limit


@pytest.mark.parametrize("kind", KINDS)
def test_a_jump_is_told_once_as_it_is_believed(kind):
    """In real time, and in a lag that is too short for dating it back."""
    for seed in range(4):
        trial = drawn("jump", kind, seed)
        now = estimate(trial, "realtime")
        (told,) = np.flatnonzero(now.jump)
        assert told - trial.jump in (39, 40)
        began = now.since[told, 0]
        assert began == trial.time[trial.jump]
        error = np.abs(now.mean[:, : trial.world.axes] - trial.position)
        assert (error[told + 1 :] < 6.0 * trial.world.sigma_m).all()
        short = estimate(trial, "lagged", lag=10.0 * trial.world.interval_s)
        assert len(np.flatnonzero(short.jump)) == 1
        assert np.flatnonzero(short.jump)[0] - trial.jump in range(28, 32)


@pytest.mark.parametrize("mode", MODES)
def test_wrong_velocities_cost_little(mode):
    """Runs of them, each with its own offset."""
    assert ratios("dvl-faults", "aided", mode, seeds=8).mean() < 1.03


@pytest.mark.parametrize("mode", MODES)
def test_wrong_velocities_are_left_out(mode):
    for seed in range(4):
        trial = drawn("dvl-faults", "aided", seed)
        d = trial.world.axes
        found = estimate(trial, mode)
        wrong = trial.bad_velocity.any(axis=1)
        weight = found.weight[:, d:].min(axis=1)
        assert (weight[wrong] < 0.5).mean() > 0.97
        assert (weight[~wrong] < 0.1).mean() < 0.04


def nees(trial, position, sigma):
    return (((position - trial.position) / sigma)[BEGUN:] ** 2).mean()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", MODES)
def test_uncertainty_is_honest(mode, kind):
    """As much as that of the oracle, whose errors last as long."""
    both = []
    for seed in range(8):
        trial = drawn("isolated-20", kind, seed)
        found, told, d = estimate(trial, mode), oracle(trial, mode), trial.world.axes
        pairs = ((found.mean[:, :d], found.sigma[:, :d]), told)
        both.append([nees(trial, *pair) for pair in pairs])
    found, told = np.mean(both, axis=0)
    assert found / told == pytest.approx(1.0, abs=0.08)
    assert found == pytest.approx(1.0, abs=0.2)


def test_with_all_the_future_the_lag_is_the_smoother_of_the_last_account():
    for seed, name in enumerate(("isolated-20", "burst-common", "jump", "dvl-faults")):
        trial = drawn(name, "aided", seed)
        motion, prior, epochs = motion_of(trial), prior_of(trial), epochs_of(trial)
        n = len(epochs.time)
        _, _, trail = filter_hypotheses(motion, prior, epochs, no_hypotheses(motion))
        said = undecided(motion, n)
        seen = np.isfinite(epochs.z[:, : motion.axes])
        decide(motion, seen, trail, n - 1, 0, said)
        told = epochs._replace(fixed=said.fixed, jump=said.jump)
        recovery = Recovery(np.inf, prior.sigma_velocity, keeps_rate=True)
        begin = start(motion, recovery)
        out = filter_track(motion, loss_named("kalman"), recovery, told, begin)[1]
        whole = smooth(motion, recovery, epochs.time, out)
        found = estimate(trial, "lagged", lag=1e9)
        np.testing.assert_allclose(found.mean, whole.mean, rtol=1e-6, atol=1e-6)
        np.testing.assert_array_equal(found.jump, said.jump)


@pytest.mark.parametrize("mode", MODES)
def test_every_epoch_has_its_row_and_nothing_is_modified(mode):
    trial = drawn("dropouts", "aided", 1)
    epochs = epochs_of(trial)
    before = [np.array(field) for field in epochs]
    found = estimate(trial, mode, epochs)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before, epochs, strict=True))
    assert isinstance(found, Estimate)
    assert {len(field) for field in found} == {len(epochs.time)}
    assert np.isfinite(found.mean).all()
    assert np.isfinite(found.sigma).all()
    lost = np.isnan(epochs.z)
    np.testing.assert_array_equal(np.isnan(found.weight), lost)
    again = estimate(trial, mode, epochs)
    for a, b in zip(found, again, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_very_short_logs(mode, n):
    trial = drawn("clean", "alone", 1)
    epochs = Epochs(*(field[:n] for field in epochs_of(trial)))
    found = estimate(trial, mode, epochs)
    assert found.mean.shape == (n, 4)
    assert {len(field) for field in found} == {n}
    for k in range(n):
        assert np.abs(found.mean[k, :2] - epochs.z[k, :2]).max() < 5.0 * trial.world.sigma_m


@pytest.mark.parametrize("mode", MODES)
def test_what_the_user_decided_stays(mode):
    trial = drawn("isolated-20", "aided", 4)
    epochs = epochs_of(trial)
    fixed = epochs.fixed.copy()
    good, bad = np.flatnonzero(~trial.bad_fix.any(axis=1))[50], 0
    bad = np.flatnonzero(trial.bad_fix.any(axis=1))[20]
    fixed[good, :2], fixed[bad, :2] = 0.0, 1.0
    found = estimate(trial, mode, epochs._replace(fixed=fixed))
    assert found.weight[good, :2].max() < 1e-9
    assert found.weight[bad, :2].min() > 0.999


def test_a_log_read_backwards_gives_the_same_track():
    for seed, name in enumerate(("isolated-20", "burst-common", "one-axis", "jump")):
        trial = drawn(name, "aided", seed)
        d = trial.world.axes
        one = estimate(trial, "offline")
        other = estimate(trial, "offline", backward(motion_of(trial), epochs_of(trial)))
        gap = np.abs(one.mean[:, :d] - other.mean[::-1, :d]) / one.sigma[:, :d]
        assert np.quantile(gap, 0.99) < 0.5
        rejected = one.weight[:, :d] == 0.0
        assert (rejected == (other.weight[::-1, :d] == 0.0)).mean() > 0.99


def test_no_row_is_worse_for_being_wanted():
    """Rows that nobody asks for keep the estimate of the filter."""
    trial = drawn("isolated-20", "alone", 2)
    motion, prior, epochs = motion_of(trial), prior_of(trial), epochs_of(trial)
    every = np.ones(len(epochs.time), np.bool_)
    some = every.copy()
    some[::3] = False
    lag = lag_of(trial)
    whole = lagged_hypotheses(motion, prior, epochs, lag, every)
    part = lagged_hypotheses(motion, prior, epochs, lag, some)
    np.testing.assert_allclose(part.mean[some], whole.mean[some], rtol=1e-9, atol=1e-9)
    assert (part.sigma[~some][BEGUN:-1] > whole.sigma[~some][BEGUN:-1]).all()
