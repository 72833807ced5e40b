"""Real time, fixed lag and what joins them, against brute force."""

import numpy as np
import pytest

from filters.worlds import NAMES, NEVER, PLAIN, ROBUST, covariances, straight, world
from reference import kalman as textbook
from reference import rts as textbook_rts
from surefix.filters.modes import from_filtered, lagged, realtime
from surefix.filters.offline import offline
from surefix.filters.records import Estimate, Recovery
from surefix.filters.rts import smooth
from surefix.filters.track import filter_track, start
from surefix.models.motion import noise_factor, transition
from surefix.robust.loss import loss_named

RECOVERY = Recovery(30.0, 5.0)


def everywhere(epochs):
    return np.ones(len(epochs.time), bool)


def spikes(seed, n=200, *, axes=2, velocity=None, share=0.1):
    """A straight run with single gross errors, too few on end for any recovery."""
    truth, epochs, motion = straight(seed, n, axes=axes, velocity=velocity)
    rng = np.random.default_rng(seed)
    bad = rng.random(n) < share
    bad[:15] = False
    epochs.z[bad, :axes] += rng.choice([-1, 1], (bad.sum(), axes)) * rng.uniform(20, 200)
    return truth, epochs, motion, bad


def jumped(seed, size, n=300, at=150, *, axes=2, velocity=None, back=None):
    """A straight run that from epoch ``at`` on (until ``back``) lies ``size`` metres aside."""
    truth, epochs, motion = straight(seed, n, axes=axes, velocity=velocity)
    shift = np.zeros((n, axes))
    shift[at:back, 0] = size
    epochs.z[:, :axes] += shift
    return truth + shift, epochs, motion


def same(one, other, at, **close):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a[at], b[at], **close)


@pytest.mark.parametrize("method", ["kalman", *ROBUST])
def test_realtime_is_the_filter_itself(method):
    _, epochs, motion, _ = spikes(1, velocity=0.1)
    begin = start(motion, RECOVERY)
    loss = loss_named(method)
    after, found = realtime(motion, loss, RECOVERY, epochs, begin)
    state, out, _ = filter_track(motion, loss, RECOVERY, epochs, begin)
    np.testing.assert_array_equal(found.mean, out.mean)
    np.testing.assert_allclose(found.sigma**2, np.einsum("kii->ki", covariances(out)), rtol=1e-12)
    np.testing.assert_array_equal(found.weight, out.weight)
    np.testing.assert_array_equal(after.mean, state.mean)
    assert after.time == epochs.time[-1]


@pytest.mark.parametrize("method", ["kalman", *ROBUST])
@pytest.mark.parametrize("axes", [1, 3])
def test_no_lag_is_real_time(method, axes):
    _, epochs, motion, _ = spikes(2, axes=axes, velocity=0.2)
    loss = loss_named(method)
    _, now = realtime(motion, loss, RECOVERY, epochs, start(motion, RECOVERY))
    found = lagged(motion, loss, RECOVERY, epochs, 0.0, everywhere(epochs))
    assert not found.jump.any()
    same(found, now, slice(None), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("method", ["kalman", *ROBUST])
def test_a_lag_longer_than_the_log_is_the_smoother(method):
    _, epochs, motion, _ = spikes(3)
    loss = loss_named(method)
    out = filter_track(motion, loss, RECOVERY, epochs, start(motion, RECOVERY))[1]
    whole = smooth(motion, RECOVERY, epochs.time, out)
    found = lagged(motion, loss, RECOVERY, epochs, 1e6, everywhere(epochs))
    np.testing.assert_allclose(found.mean, whole.mean, rtol=1e-9, atol=1e-9)
    spread = np.sqrt(np.einsum("kii->ki", whole.covariance))
    np.testing.assert_allclose(found.sigma, spread, rtol=1e-9)
    np.testing.assert_array_equal(found.weight, out.weight)


@pytest.mark.parametrize("lag", [0.7, 5.0, 17.3])
@pytest.mark.parametrize(("order", "axes"), [(2, 1), (2, 2), (3, 1)])
def test_each_epoch_sees_exactly_the_future_within_the_lag(lag, order, axes):
    """Irregular steps, several epochs at one time, gaps; the twins see one stretch per epoch."""
    made = world(4, 60, order=order, axes=axes, missing=0.2)
    time = made.epochs.time
    found = lagged(made.motion, PLAIN, NEVER, made.epochs, lag, everywhere(made.epochs))
    begin = start(made.motion, NEVER)
    H = np.eye(2 * axes, order * axes)
    steps = np.diff(time, prepend=time[0])
    F = np.stack([transition(NAMES[order], axes, dt) for dt in steps])
    G = np.stack([noise_factor(NAMES[order], axes, dt, made.motion.density) for dt in steps])
    Q = G @ G.transpose(0, 2, 1)
    R = np.stack([np.diag(row) for row in made.epochs.variance])
    P = begin.factor @ begin.factor.T
    mean, spread = textbook.run(begin.mean, P, made.epochs.z, H, R, F, Q)[:2]
    for k in range(15, 60):
        end = slice(0, int((time <= time[k] + lag).sum()))
        m, C = textbook_rts.smooth(mean[end], spread[end], F[end], Q[end])
        np.testing.assert_allclose(found.mean[k], m[k], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(found.sigma[k], np.sqrt(np.diag(C[k])), rtol=1e-6)


def test_epochs_that_are_not_wanted_keep_the_filters_estimate():
    _, epochs, motion, _ = spikes(5)
    loss = loss_named("igg3")
    wanted = np.random.default_rng(0).random(200) < 0.4
    some = lagged(motion, loss, RECOVERY, epochs, 10.0, wanted)
    every = lagged(motion, loss, RECOVERY, epochs, 10.0, everywhere(epochs))
    _, now = realtime(motion, loss, RECOVERY, epochs, start(motion, RECOVERY))
    np.testing.assert_array_equal(some.mean[wanted], every.mean[wanted])
    np.testing.assert_array_equal(some.mean[~wanted], now.mean[~wanted])
    assert (some.mean[~wanted] != every.mean[~wanted]).any()


def test_a_log_longer_than_a_block_has_no_seams():
    _, epochs, motion, _ = spikes(6, 12_000)
    loss = loss_named("igg3")
    out = filter_track(motion, loss, RECOVERY, epochs, start(motion, RECOVERY))[1]
    found = lagged(motion, loss, RECOVERY, epochs, 20.0, everywhere(epochs))
    np.testing.assert_array_equal(found.weight, out.weight)
    for k in (4990, 4999, 5000, 5001, 9995, 10_000):
        rows = type(out)(*(field[k - 200 : k + 21] for field in out))
        alone = smooth(motion, RECOVERY, epochs.time[k - 200 : k + 21], rows)
        np.testing.assert_allclose(found.mean[k], alone.mean[200], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("method", ROBUST)
def test_the_future_helps(method):
    """More future never makes the track worse, over seeds; nor do the modes differ in verdicts."""
    total = np.zeros(4)
    for seed in range(6):
        truth, epochs, motion, bad = spikes(seed, velocity=None)
        loss = loss_named(method)
        _, now = realtime(motion, loss, RECOVERY, epochs, start(motion, RECOVERY))
        late = [lagged(motion, loss, RECOVERY, epochs, s, everywhere(epochs)) for s in (2.0, 20.0)]
        every = [now, *late, offline(motion, loss, RECOVERY, epochs)]
        for i, found in enumerate(every):
            total[i] += np.sum((found.mean[20:, :2] - truth[20:]) ** 2)
            assert (found.weight[bad, 0] < 0.25).all()
    assert (np.diff(total) < 0.03 * total[:-1]).all()
    assert total[-1] < 0.7 * total[0]


@pytest.mark.parametrize("lag", [10.0, 45.0])
@pytest.mark.parametrize("method", sorted(set(ROBUST) - {"huber"}))
def test_a_jump_is_dated_back_as_far_as_the_lag_allows(method, lag):
    for seed in range(3):
        truth, epochs, motion = jumped(seed, 500.0)
        found = lagged(motion, loss_named(method), RECOVERY, epochs, lag, everywhere(epochs))
        error = np.abs(found.mean[:, :2] - truth).max(axis=1)
        first = 150 if lag > RECOVERY.after else 150 + int(RECOVERY.after - lag) + 1
        assert error[20:150].max() < 3.0
        assert error[first + 1 :].max() < 4.0
        flagged = np.flatnonzero(np.isfinite(found.since).any(axis=1))
        assert len(flagged) >= 1, "the jump must be flagged"
        assert flagged[0] in range(150, 182)
        assert np.nanmin(found.since) == epochs.time[150]


@pytest.mark.parametrize("gap", [0, 4, 25])
@pytest.mark.parametrize("method", ["gate", "igg1", "igg3", "igg3-yang"])
def test_jumps_of_two_groups_are_each_dated_back(method, gap):
    """The height jumps some time later, or is missing when the other recovers."""
    for seed in range(3):
        for later in (0, 9):
            truth, epochs, motion = jumped(seed, 500.0, axes=3)
            truth[150 + later :, 2] += 800.0
            epochs.z[150 + later :, 2] += 800.0
            epochs.z[178 : 178 + gap, 2] = np.nan
            found = lagged(motion, loss_named(method), RECOVERY, epochs, 60.0, everywhere(epochs))
            error = np.abs(found.mean[:, :3] - truth).max(axis=1)
            assert error[20:].max() < 3.0
            flags = np.argwhere(np.isfinite(found.since)).tolist()
            assert flags == [[150, 0], [150 + later, 1]]
            assert found.since[150, 0] == epochs.time[150]
            assert found.since[150 + later, 1] == epochs.time[150 + later]


def test_velocities_rejected_while_the_position_recovers_wait_their_full_time():
    _, epochs, motion = jumped(0, 500.0, velocity=0.1)
    epochs.z[175:200, 2:] += 50.0
    found = lagged(motion, loss_named("igg3"), RECOVERY, epochs, 60.0, everywhere(epochs))
    assert np.isnan(found.since[:, 1]).all()
    assert (found.weight[175:200, 1] == 0.0).all()


def test_lagged_gives_every_epoch_once():
    for seed in range(4):
        _, epochs, motion = jumped(seed, 100.0, back=220)
        epochs.z[40:80, 0] += 60.0
        found = lagged(motion, loss_named("igg3"), RECOVERY, epochs, 15.0, everywhere(epochs))
        assert isinstance(found, Estimate)
        assert {len(field) for field in found} == {300}
        assert np.isfinite(found.mean).all()
        assert np.isfinite(found.sigma).all()
    empty = type(epochs)(*(field[:0] for field in epochs))
    assert len(lagged(motion, PLAIN, RECOVERY, empty, 5.0, np.ones(0, bool)).mean) == 0


def test_from_filtered_keeps_the_verdicts():
    _, epochs, motion, _ = spikes(0)
    loss = loss_named("igg3")
    out = filter_track(motion, loss, RECOVERY, epochs, start(motion, RECOVERY))[1]
    found = from_filtered(out)
    np.testing.assert_array_equal(found.distance, out.sigma)
    np.testing.assert_array_equal(found.standardised, out.standardised)
