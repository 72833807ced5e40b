"""Offline: both directions, jumps where they happened, and no decision the log contradicts."""

import numpy as np
import pytest

from filters.worlds import NEVER, PLAIN, ROBUST, epochs_of, motion_of, straight, world
from surefix.filters.offline import backward, offline
from surefix.filters.records import Recovery
from surefix.filters.rts import leave_one_out, smooth
from surefix.filters.track import filter_track, start
from surefix.robust.loss import loss_named, weights

RECOVERY = Recovery(30.0, 5.0)
AT = 150
REDESCENDING = sorted(set(ROBUST) - {"huber"})


def run(method, epochs, motion, recovery=RECOVERY):
    return offline(motion, loss_named(method), recovery, epochs)


def errors(found, truth):
    return np.abs(found.mean[:, : truth.shape[1]] - truth).max(axis=1)


def spiked(seed, n=300, *, share=0.15, axes=2, velocity=None):
    truth, epochs, motion = straight(seed, n, axes=axes, velocity=velocity)
    rng = np.random.default_rng(seed)
    bad = rng.random(n) < share
    off = rng.choice([-1, 1], (bad.sum(), axes)) * rng.uniform(10, 300, (bad.sum(), axes))
    epochs.z[bad, :axes] += off
    return truth, epochs, motion, bad


def plain(epochs, motion, fixed):
    """Smoothed track and deleted residuals with the given weights."""
    decided = epochs._replace(fixed=fixed)
    out = filter_track(motion, PLAIN, RECOVERY, decided, start(motion, RECOVERY))[1]
    found = smooth(motion, RECOVERY, epochs.time, out)
    return found, *leave_one_out(motion, epochs.z, epochs.variance, out.weight, found)


def test_without_robustness_it_is_the_smoother():
    made = world(1, 80, velocity=0.2, missing=0.2)
    found = offline(made.motion, PLAIN, NEVER, made.epochs)
    out = filter_track(made.motion, PLAIN, NEVER, made.epochs, start(made.motion, NEVER))[1]
    whole = smooth(made.motion, NEVER, made.epochs.time, out)
    np.testing.assert_array_equal(found.mean, whole.mean)
    nis, standardised = leave_one_out(
        made.motion, made.epochs.z, made.epochs.variance, out.weight, whole
    )
    np.testing.assert_array_equal(found.standardised, standardised)
    scale = np.where(np.isfinite(made.epochs.z[:, :2]).all(axis=1), PLAIN.scale2, 1.0)
    both = scale > 1.0
    np.testing.assert_allclose(found.distance[both, 0], np.sqrt(nis[both, 0]) / PLAIN.scale2)


@pytest.mark.parametrize("method", ROBUST)
def test_it_ends_where_weights_and_deleted_residuals_agree(method):
    """The fixed point of M-estimation: refit with its weights, and the loss gives them again."""
    for seed in range(3):
        _, epochs, motion, _ = spiked(seed)
        found = run(method, epochs, motion)
        refit, nis, _ = plain(epochs, motion, found.weight)
        np.testing.assert_allclose(found.mean, refit.mean, rtol=1e-9, atol=1e-9)
        again = weights(nis[:, 0], 2, loss_named(method))
        known = np.isfinite(again)
        assert np.abs(again[known] - found.weight[known, 0]).max() < 0.06


@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("method", ROBUST)
def test_it_comes_near_a_track_that_was_told_the_gross_errors(method, velocity):
    total, oracle = 0.0, 0.0
    for seed in range(5):
        truth, epochs, motion, bad = spiked(seed, velocity=velocity)
        found = run(method, epochs, motion)
        assert (found.weight[bad, 0] < 0.25).all()
        told = np.ones((300, motion.groups))
        told[bad, 0] = 0.0
        total += np.sum((found.mean[:, :2] - truth) ** 2)
        oracle += np.sum((plain(epochs, motion, told)[0].mean[:, :2] - truth) ** 2)
    assert total < (1.7 if method == "huber" else 1.1) * oracle


@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("size", [100.0, 500.0, 1e5])
@pytest.mark.parametrize("method", ["gate", "igg1", "igg3", "igg3-yang"])
def test_a_jump_is_dated_back_to_its_epoch(method, size, velocity):
    for seed, axes in enumerate((1, 2, 3)):
        truth, epochs, motion = straight(seed, 300, axes=axes, velocity=velocity)
        truth[AT:, 0] += size
        epochs.z[AT:, 0] += size
        found = run(method, epochs, motion)
        assert np.flatnonzero(found.jump & 1).tolist() == [AT]
        assert found.since[AT, 0] == epochs.time[AT]
        assert errors(found, truth).max() < 2.5
        assert (found.weight[:, 0] > 0.5).mean() > 0.9


@pytest.mark.parametrize("size", [10.0, 20.0, 60.0])
@pytest.mark.parametrize("method", ROBUST)
@pytest.mark.xfail(
    reason="what dead reckoning reaches before the recovery is bent, not flagged as a jump"
)
def test_a_small_jump_without_velocities_is_dated_back_too(method, size):
    for seed in range(3):
        truth, epochs, motion = straight(seed, 300)
        truth[AT:, 0] += size
        epochs.z[AT:, 0] += size
        found = run(method, epochs, motion)
        assert np.flatnonzero(found.jump & 1).tolist() == [AT]
        assert errors(found, truth).max() < 2.5


@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("method", ["gate", "igg1", "igg3", "igg3-yang"])
def test_a_jump_there_and_back(method, velocity):
    """A displacement that lasts longer than the recovery is believed, both ends in place."""
    for seed in range(3):
        truth, epochs, motion = straight(seed, 400, velocity=velocity)
        truth[AT : AT + 80, 1] -= 300.0
        epochs.z[AT : AT + 80, 1] -= 300.0
        found = run(method, epochs, motion)
        assert np.flatnonzero(found.jump & 1).tolist() == [AT, AT + 80]
        assert errors(found, truth).max() < 2.5


@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("method", REDESCENDING)
def test_a_short_excursion_leaves_no_trace(method, velocity):
    """Fault 23."""
    for seed, long in enumerate((1, 3, 8, 15)):
        truth, epochs, motion = straight(seed, 300, velocity=velocity)
        epochs.z[AT : AT + long, :2] += 500.0
        found = run(method, epochs, motion)
        assert not found.jump.any()
        assert (found.weight[AT : AT + long, 0] < 0.02).all()
        assert errors(found, truth).max() < 3.0


@pytest.mark.parametrize("method", REDESCENDING)
@pytest.mark.parametrize("wrong", [1, 3, 8])
def test_a_bad_beginning_or_end_is_rejected(method, wrong):
    for seed in range(3):
        truth, epochs, motion = straight(seed, 200)
        for rows in (slice(0, wrong), slice(200 - wrong, 200)):
            z = epochs.z.copy()
            z[rows, :2] += 3000.0 + 100.0 * np.arange(wrong)[:, None] ** 2
            found = run(method, epochs._replace(z=z), motion)
            good = np.ones(200, bool)
            good[rows] = False
            assert (found.weight[~good, 0] < 0.02).all()
            assert errors(found, truth)[good].max() < 2.5
            assert not found.jump.any()


@pytest.mark.parametrize("method", ["gate", "igg3", "student-t"])
def test_a_log_read_backwards_gives_the_same_track(method):
    for seed in range(3):
        _, epochs, motion, _ = spiked(seed, velocity=0.2)
        sign = np.repeat([1.0, -1.0], 2)
        mirrored = epochs._replace(
            time=-epochs.time[::-1],
            z=epochs.z[::-1] * sign,
            variance=epochs.variance[::-1],
            fixed=epochs.fixed[::-1],
        )
        one, other = run(method, epochs, motion), run(method, mirrored, motion)
        np.testing.assert_allclose(one.mean, other.mean[::-1] * sign, atol=0.05)
        np.testing.assert_allclose(one.weight, other.weight[::-1], atol=0.1)


def test_seen_backwards_positions_and_velocities_agree():
    """Without noise the filter of the reversed series finds hardly an innovation."""
    _, epochs, motion = straight(0, 50, position=1e-9, velocity=1e-9)
    epochs = epochs._replace(variance=np.ones_like(epochs.variance))
    back = backward(motion, epochs)
    assert (np.diff(back.time) > 0.0).all()
    out = filter_track(motion, PLAIN, NEVER, back, start(motion, NEVER))[1]
    assert np.abs(out.standardised[1:]).max() < 0.02  # the velocity prior lingers
    twice = backward(motion, back)
    np.testing.assert_array_equal(twice.z, epochs.z)
    np.testing.assert_array_equal(twice.time, epochs.time)


def test_what_the_user_decided_stays():
    _, epochs, motion, bad = spiked(0)
    fixed = epochs.fixed.copy()
    fixed[100, 0], fixed[np.flatnonzero(bad)[3], 0] = 0.0, 1.0
    jump = epochs.jump.copy()
    jump[200] = 1
    found = offline(motion, loss_named("igg3"), RECOVERY, epochs._replace(fixed=fixed, jump=jump))
    assert found.weight[100, 0] == 0.0
    assert found.weight[np.flatnonzero(bad)[3], 0] == 1.0
    assert found.jump[200] & 1


def test_arguments_are_not_modified():
    _, epochs, motion, _ = spiked(1)
    before = [np.array(field) for field in epochs]
    run("igg3", epochs, motion)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before, epochs, strict=True))


@pytest.mark.parametrize("method", ["kalman", *ROBUST])
@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_very_short_logs(method, n):
    motion = motion_of(axes=2)
    z = np.full((n, 4), np.nan)
    z[:, :2] = [5.0, 6.0]
    found = run(method, epochs_of(np.arange(n, dtype=float), z, np.ones(4), motion), motion)
    assert found.mean.shape == (n, 4)
    assert np.isfinite(found.sigma).all()
    np.testing.assert_allclose(found.mean[:, :2], z[:, :2], atol=0.1)


@pytest.mark.parametrize("method", ROBUST)
def test_the_covariance_of_what_it_keeps_is_honest(method):
    """Errors over claimed standard deviations after a tenth of gross errors, over seeds."""
    squares = []
    for seed in range(25):
        made = world(seed, 120, axes=2, q=0.05, irregular=False)
        rng = np.random.default_rng(seed)
        bad = rng.random(120) < 0.1
        z = made.epochs.z.copy()
        z[bad, :2] += rng.choice([-1, 1], (bad.sum(), 2)) * rng.uniform(10, 100, (bad.sum(), 2))
        found = run(method, made.epochs._replace(z=z), made.motion)
        squares.append(((found.mean - made.truth) / found.sigma)[:, :2] ** 2)
    # the influence of a gross error on huber is bounded, not nought
    assert 0.7 < np.mean(squares) < (1.7 if method == "huber" else 1.3)
