"""The track filter against filterpy and the textbook twins, and the edges of what it is given."""

import itertools

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.worlds import (
    NEVER,
    PLAIN,
    ROBUST,
    covariances,
    epochs_of,
    matrices,
    motion_of,
    straight,
    twin,
    world,
)
from reference import kalman as textbook
from reference import robust_filter
from surefix.filters.records import Recovery
from surefix.filters.track import by_axis, by_block, filter_track, start
from surefix.robust.loss import loss_named, weights

CASES = [(order, axes, speed) for order in (2, 3) for axes in (1, 2, 3) for speed in (None, 0.1)]


def filtered(made, loss=PLAIN, recovery=NEVER):
    return filter_track(made.motion, loss, recovery, made.epochs, made.state)[1]


@pytest.mark.parametrize(("order", "axes", "speed"), CASES)
def test_filterpy_finds_the_same(order, axes, speed):
    for seed in range(3):
        made = world(seed, 80, order=order, axes=axes, velocity=speed, missing=0.25, q=0.3)
        out = filtered(made)
        F, Q = matrices(made.motion, made.epochs.time, made.state.time)
        other = KalmanFilter(dim_x=order * axes, dim_z=1)
        other.x, other.P = made.state.mean[:, None].copy(), made.state.factor @ made.state.factor.T
        H = np.eye(2 * axes, order * axes)
        for k, z in enumerate(made.epochs.z):
            other.predict(F=F[k], Q=Q[k])
            seen = ~np.isnan(z)
            if seen.any():
                other.dim_z = int(seen.sum())
                other.update(z[seen, None], R=np.diag(made.epochs.variance[k, seen]), H=H[seen])
            np.testing.assert_allclose(out.mean[k], other.x[:, 0], rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(covariances(out)[k], other.P, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("order", "axes"), [(2, 1), (2, 2), (3, 3)])
def test_from_nowhere_filterpy_agrees_once_the_start_is_forgotten(order, axes):
    """From the vague start, 1e6 m, double precision keeps about nine digits of the covariance."""
    made = world(5, 60, order=order, axes=axes, q=0.3)
    begin = start(made.motion, NEVER)
    out = filter_track(made.motion, PLAIN, NEVER, made.epochs, begin)[1]
    run = textbook.run(*initial(made, begin))
    np.testing.assert_allclose(out.mean[20:], run[0][20:], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(covariances(out)[20:], run[1][20:], rtol=1e-6, atol=1e-7)


def initial(made, begin):
    F, Q = matrices(made.motion, made.epochs.time, made.epochs.time[0])
    H = np.eye(2 * made.motion.axes, made.truth.shape[1])
    R = np.stack([np.diag(row) for row in made.epochs.variance])
    return begin.mean, begin.factor @ begin.factor.T, made.epochs.z, H, R, F, Q


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_innovation_figures_are_those_of_the_textbook(axes):
    made = world(3, 60, axes=axes, velocity=0.2, missing=0.2)
    out = filtered(made)
    run = twin(made)[0]
    nu, S = run[4], run[5]
    scale = [PLAIN.scale2, PLAIN.scale3]
    for k in range(60):
        for g in range(made.motion.groups):
            c = np.flatnonzero((made.motion.group == g) & ~np.isnan(nu[k]))
            if not len(c):
                assert np.isnan(out.nis[k, g])
                assert np.isnan(out.weight[k, g])
                continue
            block = S[k][np.ix_(c, c)]
            nis = nu[k, c] @ np.linalg.solve(block, nu[k, c])
            assert out.nis[k, g] == pytest.approx(nis, rel=1e-8)
            assert out.logdet[k, g] == pytest.approx(np.linalg.slogdet(block)[1], abs=1e-8)
            shorter = [1.0, *scale][len(c) - 1]
            assert out.sigma[k, g] == pytest.approx(np.sqrt(nis) / shorter, rel=1e-8)
        expected = nu[k] / np.sqrt(np.diag(S[k]))
        np.testing.assert_allclose(out.standardised[k], expected, rtol=1e-8, atol=1e-9)


def spiked(seed, axes, *, velocity=0.2, blocks=False, order=2, share=0.2):
    """A world in which a share of the components is off by 3 to 30 standard deviations."""
    made = world(
        seed, 120, order=order, axes=axes, velocity=velocity, missing=0.1, blocks=blocks, q=0.1
    )
    rng = np.random.default_rng(seed + 1000)
    off = np.sqrt(made.epochs.variance) * rng.choice([-30, -6, -3, 3, 6, 30], made.epochs.z.shape)
    z = made.epochs.z + np.where(rng.random(made.epochs.z.shape) < share, off, 0.0)
    return made._replace(epochs=made.epochs._replace(z=z))


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("order", [2, 3])
def test_igg3_by_axis_is_the_robust_filter_of_the_paper(order, axes):
    counted = np.zeros(3)
    for seed in range(4):
        made = spiked(seed, axes, order=order)
        loss = loss_named("igg3", k0=1.5, k1=4.5)
        out = filtered(made, loss)
        F, Q = matrices(made.motion, made.epochs.time, made.state.time)
        H = np.eye(2 * axes, order * axes)
        R = np.stack([np.diag(row) for row in made.epochs.variance])
        P = made.state.factor @ made.state.factor.T
        z = made.epochs.z
        mean, spread, w = robust_filter.igg3_run(made.state.mean, P, z, H, R, F, Q, 1.5, 4.5)
        np.testing.assert_allclose(out.weight, w, atol=1e-9)
        np.testing.assert_allclose(out.mean, mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(covariances(out), spread, rtol=1e-9, atol=1e-9)
        counted += [(w == 0.0).sum(), ((w > 0.0) & (w < 1.0)).sum(), (w == 1.0).sum()]
    assert (counted > 50).all()


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("degrees", [1.0, 4.0, 30.0])
def test_student_t_is_the_variational_filter(axes, degrees):
    loss = loss_named("student-t", k0=degrees)
    H = np.eye(axes, 2 * axes)
    for seed in range(4):
        made = spiked(seed, axes, velocity=None, blocks=True)
        z = made.epochs.z.copy()
        z[np.isnan(z[:, :axes]).any(axis=1)] = np.nan
        z[:, 2:axes] = np.nan  # a height is a block of its own
        made = made._replace(epochs=made.epochs._replace(z=z))
        out = filtered(made, loss)
        F, Q = matrices(made.motion, made.epochs.time, made.state.time)
        m, P = made.state.mean, made.state.factor @ made.state.factor.T
        flat = min(axes, 2)
        for k, row in enumerate(z):
            m, P = textbook.predict(m, P, F[k], Q[k])
            if not np.isnan(row[0]):
                R = np.diag(made.epochs.variance[k, :flat])
                m, P, w = robust_filter.student_t_update(m, P, row[:flat], H[:flat], R, degrees)
                assert out.weight[k, 0] == pytest.approx(w, rel=1e-9)
            np.testing.assert_allclose(out.mean[k], m, rtol=1e-8, atol=1e-9)
            np.testing.assert_allclose(covariances(out)[k], P, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("method", sorted(set(ROBUST) - {"student-t"}))
@pytest.mark.parametrize("axes", [1, 2, 3])
def test_the_weight_is_the_loss_of_the_distance(method, axes):
    made = spiked(7, axes, blocks=True)
    loss = loss_named(method)
    out = filtered(made, loss)
    for g in range(made.motion.groups):
        z = made.epochs.z[:, made.motion.group == g]
        size = np.isfinite(z).sum(axis=1)
        for m in range(1, z.shape[1] + 1):
            rows = size == m
            np.testing.assert_allclose(
                out.weight[rows, g], weights(out.nis[rows, g], m, loss), atol=1e-12
            )
        assert np.isnan(out.weight[size == 0, g]).all()


def test_weights_decided_beforehand_win():
    made = spiked(1, 2, blocks=True)
    rng = np.random.default_rng(0)
    fixed = rng.choice([0.0, 0.25, 1.0], (120, made.motion.groups))
    out = filtered(made._replace(epochs=made.epochs._replace(fixed=fixed)), loss_named("igg3"))
    seen = ~np.isnan(out.weight)
    assert (out.weight[seen] == fixed[seen]).all()
    per_component = np.repeat(fixed, [2, 2], axis=1)
    with np.errstate(divide="ignore"):
        variance = made.epochs.variance / per_component
    z = np.where(per_component > 0.0, made.epochs.z, np.nan)
    same = filtered(made._replace(epochs=made.epochs._replace(z=z, variance=variance)))
    np.testing.assert_allclose(out.mean, same.mean, rtol=1e-12, atol=1e-12)


# one call per epoch ------------------------------------------------------------------------------


def pieces(made, loss, recovery, cuts):
    """Filter a series in several calls; the outputs joined, and the last state."""
    state, parts = made.state, []
    edges = [0, *cuts, len(made.epochs.time)]
    for first, last in itertools.pairwise(edges):
        rows = type(made.epochs)(*(field[first:last] for field in made.epochs))
        state, out, done = filter_track(made.motion, loss, recovery, rows, state)
        assert done == last - first
        parts.append(out)
    return state, type(out)(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


def identical(one, other):
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other, strict=True))


def troubled(seed, axes=2, velocity=None, n=150):
    """Jumps, spikes and gaps: everything that changes the filter's memory."""
    rng = np.random.default_rng(seed)
    _, epochs, motion = straight(seed, n, axes=axes, velocity=velocity)
    z = epochs.z.copy()
    z[n // 3 :, :axes] += 200.0
    z[2 * n // 3 :, 0] -= 5000.0
    z[:3, :axes] += 1e4
    spikes = rng.random(n) < 0.15
    z[spikes, :axes] += 50.0 * rng.normal(size=(spikes.sum(), axes))
    z[rng.random(z.shape) < 0.1] = np.nan
    time = epochs.time.copy()
    time[50:] -= 0.5
    time[51] = time[50]
    epochs = epochs._replace(time=time, z=z)
    state = start(motion, Recovery(12.0, 5.0))
    return world(0, 2)._replace(epochs=epochs, motion=motion, state=state)


@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("method", ["kalman", *ROBUST])
def test_one_call_per_epoch_is_one_call_for_the_series(method, axes, velocity):
    made = troubled(axes, axes, velocity)
    loss, recovery = loss_named(method), Recovery(12.0, 5.0)
    whole, out, _ = filter_track(made.motion, loss, recovery, made.epochs, made.state)
    state, joined = pieces(made, loss, recovery, range(1, 150))
    assert identical(out, joined)
    assert identical(whole, state)
    if method not in ("kalman", "huber"):
        assert np.isfinite(out.since).any()


@given(
    seed=st.integers(0, 50),
    method=st.sampled_from(["kalman", *ROBUST]),
    velocity=st.sampled_from([None, 0.1]),
    cuts=st.lists(st.integers(0, 60), max_size=8).map(sorted),
)
@settings(max_examples=60, deadline=None)
def test_calls_may_be_split_anywhere(seed, method, velocity, cuts):
    made = troubled(seed, 1 + seed % 3, velocity, n=60)
    loss, recovery = loss_named(method), Recovery(6.0, 5.0)
    whole, out, _ = filter_track(made.motion, loss, recovery, made.epochs, made.state)
    state, joined = pieces(made, loss, recovery, cuts)
    assert identical(out, joined)
    assert identical(whole, state)


def test_a_state_and_a_series_are_not_modified():
    made = troubled(1)
    before = [np.array(field) for field in (*made.epochs, *made.state)]
    filter_track(made.motion, loss_named("igg3"), Recovery(12.0, 5.0), made.epochs, made.state)
    after = (*made.epochs, *made.state)
    assert identical(before, after)


def test_a_call_that_waits_for_a_recovery_goes_on_where_it_stopped():
    made = troubled(2)
    loss, recovery = loss_named("igg3"), Recovery(12.0, 5.0)
    out = filter_track(made.motion, loss, recovery, made.epochs, made.state)[1]
    state, at, stops = made.state, 0, []
    while at < 150:
        rows = type(made.epochs)(*(field[at:] for field in made.epochs))
        state, part, done = filter_track(
            made.motion, loss, recovery, rows, state, until_recovery=True
        )
        assert np.array_equal(part.mean[:done], out.mean[at : at + done])
        at += done
        stops.append(at - 1)
    found = np.flatnonzero(np.isfinite(out.since).any(axis=1)).tolist()
    assert len(found) >= 3
    assert stops[: len(found)] == found


# edges -------------------------------------------------------------------------------------------


def test_no_epochs_and_nothing_observed():
    motion = motion_of(axes=2)
    empty = epochs_of(np.empty(0), np.empty((0, 4)), np.ones(4), motion)
    begin = start(motion, NEVER)
    state, out, done = filter_track(motion, PLAIN, NEVER, empty, begin)
    assert done == 0
    assert identical(state, begin)
    blind = epochs_of(np.arange(5.0), np.full((5, 4), np.nan), np.ones(4), motion)
    state, out, done = filter_track(motion, PLAIN, NEVER, blind, begin)
    assert done == 5
    assert np.isnan(out.weight).all()
    assert (out.mean == 0.0).all()
    assert (np.diff(covariances(out)[:, 0, 0]) > 0.0).all()


def test_dead_reckoning_goes_straight_on_and_its_covariance_grows():
    """Fault 32."""
    made = world(2, 60, velocity=0.1, irregular=False)
    z = made.epochs.z.copy()
    z[30:] = np.nan
    out = filtered(made._replace(epochs=made.epochs._replace(z=z)))
    gone = made.epochs.time[30:] - made.epochs.time[29]
    expected = out.mean[29, :2] + gone[:, None] * out.mean[29, 2:]
    np.testing.assert_allclose(out.mean[30:, :2], expected, rtol=1e-12, atol=1e-9)
    assert (np.diff(np.einsum("kii->ki", covariances(out)[29:]), axis=0) > 0.0).all()


def test_several_fixes_at_one_time_are_one_better_fix():
    motion = motion_of(axes=2)
    z = np.array([[1.0, 2.0, np.nan, np.nan], [3.0, 2.0, np.nan, np.nan]])
    twice = epochs_of([0.0, 0.0], z, np.ones(4), motion)
    out = filter_track(motion, PLAIN, NEVER, twice, start(motion, NEVER))[1]
    np.testing.assert_allclose(out.mean[1, :2], [2.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(covariances(out)[1, :2, :2], 0.5 * np.eye(2), atol=1e-9)


def test_a_day_at_rest_then_under_way():
    """Fault 19: 24 h static at 1 Hz with hardly any process noise, then 2 m/s."""
    rng = np.random.default_rng(0)
    n, moving = 86_400, 600
    time = np.arange(n + moving, dtype=float)
    truth = np.maximum(time - n, 0.0) * 2.0
    for q in (1e-6, 1e-3):
        motion = motion_of(axes=1, q=q)
        z = np.column_stack([truth + rng.normal(size=n + moving), np.full(n + moving, np.nan)])
        for method in ("kalman", *ROBUST):
            recovery = Recovery(30.0, 1.0)
            epochs = epochs_of(time, z, np.ones(2), motion)
            begin = start(motion, recovery)
            out = filter_track(motion, loss_named(method), recovery, epochs, begin)[1]
            assert np.isfinite(out.mean).all()
            assert np.isfinite(out.factor).all()
            sigma = np.sqrt(covariances(out)[:, 0, 0])
            assert (np.abs(out.mean[1000:n, 0]) < 5.5 * sigma[1000:n]).all()
            assert np.linalg.eigvalsh(covariances(out)[::997])[:, 0].min() >= 0.0
            if q == 1e-3:
                assert np.abs(out.mean[-100:, 0] - truth[-100:]).max() < 3.0, method
            elif method != "kalman":
                assert np.abs(out.mean[-100:, 0] - truth[-100:]).max() < 20.0, method


@pytest.mark.parametrize("method", ["kalman", *ROBUST])
@pytest.mark.parametrize("step", [0.2, -0.2])
def test_a_heading_goes_through_north_without_noticing(method, step):
    """Fault 20: 359.9 to 0.1 is a step of 0.2 degrees."""
    motion = motion_of(axes=1, q=1e-4, period=360.0)
    heading = (359.9 + step * np.arange(-50, 2000)) % 360.0
    z = np.column_stack([heading, np.full(len(heading), np.nan)])
    epochs = epochs_of(np.arange(len(z)), z, [0.1, 1.0], motion)
    recovery = Recovery(30.0, 1.0)
    loss, begin = loss_named(method), start(motion, recovery)
    out = filter_track(motion, loss, recovery, epochs, begin)[1]
    predicted = out.mean[:-1, 0] + out.mean[:-1, 1]
    innovation = np.abs((heading[1:] - predicted + 180.0) % 360.0 - 180.0)
    assert innovation[5:].max() <= 0.2
    assert np.abs(np.diff(out.mean[:, 0]))[5:].max() < 0.3
    assert (out.weight[5:, 0] > 0.9).all()
    assert out.mean[-1, 0] - out.mean[5, 0] == pytest.approx(step * (len(z) - 6), abs=0.1)


def test_groups_by_block_and_by_axis():
    assert by_block((0, 1)).tolist() == [0, 0, 1, 1]
    assert by_block((0,)).tolist() == [0, 1]
    assert by_block((0, 2)).tolist() == [0, 1, 2, 3]
    assert by_axis(3).tolist() == [0, 1, 2, 3, 4, 5]
