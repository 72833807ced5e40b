"""The smoother and its deleted residuals against the twins and against brute force."""

import numpy as np
import pytest

from filters.worlds import NEVER, PLAIN, epochs_of, matrices, motion_of, straight, twin, world
from reference import kalman as textbook
from reference import rts as textbook_rts
from surefix.filters.records import Recovery
from surefix.filters.rts import leave_one_out, smooth, smooth_lag
from surefix.filters.track import filter_track, start
from surefix.robust.loss import loss_named

CASES = [(order, axes, speed) for order in (2, 3) for axes in (1, 2, 3) for speed in (None, 0.1)]


def smoothed(made, loss=PLAIN, recovery=NEVER):
    out = filter_track(made.motion, loss, recovery, made.epochs, made.state)[1]
    return out, smooth(made.motion, recovery, made.epochs.time, out)


@pytest.mark.parametrize(("order", "axes", "speed"), CASES)
def test_the_textbook_smoother_finds_the_same(order, axes, speed):
    for seed in range(3):
        made = world(seed, 80, order=order, axes=axes, velocity=speed, missing=0.2, q=0.3)
        run, F, Q = twin(made)
        mean, spread = textbook_rts.smooth(*run[:2], F, Q)
        found = smoothed(made)[1]
        np.testing.assert_allclose(found.mean, mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance, spread, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("order", [2, 3])
def test_a_long_series_smoothed_from_nowhere_stays_right(order):
    made = world(1, 3000, order=order, axes=1, q=0.01, irregular=False)
    begin = start(made.motion, NEVER)
    found = smoothed(made._replace(state=begin))[1]
    F, Q = matrices(made.motion, made.epochs.time, made.epochs.time[0])
    R = np.stack([np.diag(row) for row in made.epochs.variance])
    H = np.eye(2, order)
    run = textbook.run(begin.mean, begin.factor @ begin.factor.T, made.epochs.z, H, R, F, Q)
    mean, spread = textbook_rts.smooth(*run[:2], F, Q)
    np.testing.assert_allclose(found.mean, mean, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found.covariance[20:], spread[20:], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("axes", [1, 2, 3])
def test_each_lag_is_a_smoothing_of_its_own_stretch(order, axes):
    made = world(4, 60, order=order, axes=axes, missing=0.2)
    out = filter_track(made.motion, PLAIN, NEVER, made.epochs, made.state)[1]
    rng = np.random.default_rng(0)
    rows = np.sort(rng.choice(60, 25, replace=False))
    last = np.minimum(rows + rng.integers(0, 20, 25), 59)
    found = smooth_lag(made.motion, NEVER, made.epochs.time, out, rows, last)
    run, F, Q = twin(made)
    for i, (k, end) in enumerate(zip(rows, last, strict=True)):
        stretch = slice(0, end + 1)
        mean, spread = textbook_rts.smooth(*(part[stretch] for part in (*run[:2], F, Q)))
        np.testing.assert_allclose(found.mean[i], mean[k], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance[i], spread[k], rtol=1e-9, atol=1e-9)


def test_a_jump_cuts_the_series():
    """What comes before a jump is smoothed as if the log ended there; what follows starts anew."""
    _, epochs, motion = straight(3, 80)
    epochs.z[40:, :2] += 300.0
    epochs.jump[40] = 1
    begin = start(motion, NEVER)
    out = filter_track(motion, PLAIN, NEVER, epochs, begin)[1]
    whole = smooth(motion, NEVER, epochs.time, out)
    early = type(epochs)(*(field[:40] for field in epochs))
    first = filter_track(motion, PLAIN, NEVER, early, begin)[1]
    alone = smooth(motion, NEVER, early.time, first)
    np.testing.assert_allclose(whole.mean[:40], alone.mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(whole.covariance[:40], alone.covariance, rtol=1e-9, atol=1e-9)
    late = type(epochs)(*(field[40:] for field in epochs))
    late = late._replace(jump=np.zeros(40, np.int64))
    second = filter_track(motion, PLAIN, NEVER, late, begin)[1]
    alone = smooth(motion, NEVER, late.time, second)
    np.testing.assert_allclose(whole.mean[42:, :2], alone.mean[2:, :2], atol=1e-2)
    np.testing.assert_allclose(whole.covariance[42:], alone.covariance[2:], rtol=1e-4, atol=1e-6)


def test_a_jump_of_one_group_leaves_the_others_whole():
    made = world(5, 60, axes=3)
    made = made._replace(state=start(made.motion, NEVER))
    cut = made.epochs._replace(jump=made.epochs.jump.copy())
    cut.jump[30] = 1 << int(made.motion.group[2])
    plain, parted = smoothed(made)[1], smoothed(made._replace(epochs=cut))[1]
    flat, height = [0, 1, 3, 4], [2, 5]
    np.testing.assert_allclose(parted.mean[:, flat], plain.mean[:, flat], rtol=1e-12, atol=1e-12)
    variances = [np.einsum("kii->ki", found.covariance) for found in (parted, plain)]
    np.testing.assert_allclose(*(each[:, flat] for each in variances), rtol=1e-12)
    assert (variances[0][29:31][:, height] > 1.1 * variances[1][29:31][:, height]).all()


@pytest.mark.parametrize("decades", [0, 8, 16])
def test_smoothed_covariances_are_positive(decades):
    """Fault 18, smoothed: prior over measurement variance 10^decades, 200 seeds."""
    for seed in range(200 if decades == 16 else 40):
        rng = np.random.default_rng(seed)
        order, axes = int(rng.integers(2, 4)), int(rng.integers(1, 4))
        made = world(seed, 25, order=order, axes=axes, missing=0.3, q=10.0 ** rng.uniform(-6, 1))
        ratio = 10.0 ** (decades / 2)
        prior = np.diag(np.repeat([ratio, ratio, ratio][:order], axes))
        epochs = made.epochs._replace(variance=np.ones_like(made.epochs.variance))
        made = made._replace(epochs=epochs, state=made.state._replace(factor=prior))
        out, found = smoothed(made)
        for factor in out.factor:
            P = factor @ factor.T
            values = np.linalg.eigvalsh(P)
            assert np.isfinite(P).all()
            assert values[0] >= -1e-15 * values[-1]
        assert np.isfinite(found.mean).all()
        assert (found.covariance == found.covariance.transpose(0, 2, 1)).all()
        values = np.linalg.eigvalsh(found.covariance)
        assert (values[:, 0] >= -1e-15 * values[:, -1]).all()
        assert (np.einsum("kii->ki", found.covariance) >= 0.0).all()


@pytest.mark.parametrize("sigma_velocity", [1.0, 30.0])
def test_the_smoother_never_knows_less_than_the_filter(sigma_velocity):
    recovery = Recovery(np.inf, sigma_velocity)
    for seed in range(20):
        made = world(seed, 60, axes=2, velocity=0.3, missing=0.3)
        out, found = smoothed(made._replace(state=start(made.motion, recovery)), PLAIN, recovery)
        before = np.einsum("kij,kij->ki", out.factor, out.factor)
        after = np.einsum("kii->ki", found.covariance)
        assert (after <= before * (1.0 + 1e-9)).all()


def test_smoothing_nothing_or_one_epoch():
    motion = motion_of(axes=1)
    for n in (0, 1):
        epochs = epochs_of(np.zeros(n), np.zeros((n, 2)), np.ones(2), motion)
        out = filter_track(motion, PLAIN, NEVER, epochs, start(motion, NEVER))[1]
        found = smooth(motion, NEVER, epochs.time, out)
        assert found.mean == pytest.approx(out.mean)
        nothing = np.zeros(0, np.int64)
        assert len(smooth_lag(motion, NEVER, epochs.time, out, nothing, nothing).mean) == 0


# deleted residuals -------------------------------------------------------------------------------


def without(made, k, group):
    """Mean and covariance of epoch k, smoothed without the observation of a group there."""
    z = made.epochs.z.copy()
    z[k, made.motion.group == group] = np.nan
    run, F, Q = twin(made._replace(epochs=made.epochs._replace(z=z)))
    mean, spread = textbook_rts.smooth(*run[:2], F, Q)
    return mean[k], spread[k]


@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize(("order", "axes", "speed"), CASES)
def test_deleted_residuals_are_those_of_a_track_without_the_observation(order, axes, speed, blocks):
    made = world(6, 30, order=order, axes=axes, velocity=speed, missing=0.2, blocks=blocks, q=0.2)
    z, variance, group = made.epochs.z, made.epochs.variance, made.motion.group
    rng = np.random.default_rng(1)
    weight = rng.choice([0.0, 0.2, 1.0], (30, made.motion.groups), p=[0.2, 0.3, 0.5])
    fixed = made._replace(epochs=made.epochs._replace(fixed=weight))
    found = smoothed(fixed)[1]
    nis, standardised = leave_one_out(made.motion, z, variance, weight, found)
    spread = weight[:, group]
    with np.errstate(divide="ignore"):
        weighed = made.epochs._replace(
            z=np.where(spread > 0.0, z, np.nan),
            variance=np.where(spread > 0.0, variance / spread, variance),
        )
    weighed = made._replace(epochs=weighed)
    assert (np.isnan(standardised) == np.isnan(z)).all()
    for k in range(0, 30, 3):
        for g in range(made.motion.groups):
            c = np.flatnonzero((group == g) & ~np.isnan(z[k]))
            if not len(c):
                assert np.isnan(nis[k, g])
                continue
            mean, P = without(weighed, k, g)
            e = z[k, c] - mean[c]
            S = P[np.ix_(c, c)] + np.diag(variance[k, c])
            assert nis[k, g] == pytest.approx(e @ np.linalg.solve(S, e), rel=1e-6, abs=1e-9)
            expected = e / np.sqrt(np.diag(S))
            np.testing.assert_allclose(standardised[k, c], expected, rtol=1e-6, atol=1e-8)


def test_deleted_residual_of_an_angle_goes_round():
    motion = motion_of(axes=1, q=1e-4, period=360.0)
    heading = (359.0 + 0.1 * np.arange(40)) % 360.0
    heading[20] += 3.0
    z = np.column_stack([heading, np.full(40, np.nan)])
    epochs = epochs_of(np.arange(40.0), z, [0.1, 1.0], motion)
    out = filter_track(motion, loss_named("igg3"), NEVER, epochs, start(motion, NEVER))[1]
    found = smooth(motion, NEVER, epochs.time, out)
    _, standardised = leave_one_out(motion, z, epochs.variance, out.weight, found)
    assert standardised[20, 0] == pytest.approx(30.0, rel=0.1)
    assert np.abs(np.delete(standardised[:, 0], 20)).max() < 1.0


def test_an_observation_that_stands_alone_has_nothing_to_be_compared_with():
    motion = motion_of(axes=2)
    z = np.array([[3.0, 4.0, np.nan, np.nan]])
    epochs = epochs_of([0.0], z, np.ones(4), motion)
    out = filter_track(motion, PLAIN, NEVER, epochs, start(motion, NEVER))[1]
    found = smooth(motion, NEVER, epochs.time, out)
    nis, _ = leave_one_out(motion, z, epochs.variance, out.weight, found)
    assert np.isnan(nis[0, 0]) or nis[0, 0] < 1e-6
