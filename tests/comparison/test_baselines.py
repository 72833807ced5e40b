"""The baselines against textbook twins and filterpy, and what they survive."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from scipy.special import chdtri

from filters import worlds
from reference import kalman
from surefix.comparison.filters import imm, sage_husa, wolf
from surefix.comparison.gnc import gnc, truncated_weights
from surefix.comparison.methods import BASELINES, COMPARED, cleaner_of, works_in
from surefix.comparison.options import CompareOptions
from surefix.comparison.run import outcomes
from surefix.errors import OptionsError
from surefix.filters.records import Recovery
from surefix.models.motion import noise_factor, transition
from surefix.pipelines.options import METHODS
from surefix.robust.loss import block_scale
from surefix.simulate.contamination import World, alone, draw, draw_world

RECOVERY = Recovery(np.inf, 10.0)
ONLINE = {"wolf": wolf, "imm": imm, "sage-husa": sage_husa}


def series(seed, axes=2, order=2, n=80, share=0.15):
    """Epochs with gross errors, holes and irregular steps, and the matrices of their model."""
    rng = np.random.default_rng([9, seed])
    motion = worlds.motion_of(order, axes, 0.3)
    time = worlds.times(rng, n)
    z = np.cumsum(rng.normal(0.0, 1.0, (n, 2 * axes)), axis=0)
    bad = rng.random(n) < share
    z[bad, :axes] += rng.normal(0.0, 40.0, (int(bad.sum()), axes))
    z[:, axes:] = np.nan if seed % 2 else 0.1 * z[:, axes:]
    z[rng.random(n) < 0.1] = np.nan
    z[0, :axes] = 0.0
    sigma = np.repeat([0.5, 0.1], axes)
    name = worlds.NAMES[order]
    steps = np.diff(time, prepend=time[0])
    F = np.stack([transition(name, axes, dt) for dt in steps])
    G = np.stack([noise_factor(name, axes, dt, 0.3) for dt in steps])
    H = np.eye(2 * axes, order * axes)
    return motion, worlds.epochs_of(time, z, sigma, motion), F, G @ G.transpose(0, 2, 1), H


def first_belief(axes, order):
    sigma = np.full(order * axes, 10.0)
    sigma[:axes] = 1e6
    return np.zeros(order * axes), np.diag(sigma**2)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_wolf_is_the_kalman_filter_with_the_weighted_noise_of_the_paper(seed, axes, order):
    motion, epochs, F, Q, H = series(seed, axes, order)
    m, P = first_belief(axes, order)
    _, found = wolf(motion, RECOVERY, epochs, None)
    for k, z in enumerate(epochs.z):
        m, P = kalman.predict(m, P, F[k], Q[k])
        R = np.diag(epochs.variance[k])
        for g in range(motion.groups):
            mine = (motion.group == g) & np.isfinite(z)
            if mine.any() and not (np.diag(H @ P @ H.T) > 100.0 * np.diag(R))[mine].any():
                d2 = ((z - H @ m)[mine] ** 2 / np.diag(R)[mine]).sum()
                c2 = (2.385 * block_scale(int(mine.sum()), 0.0027)) ** 2
                squared_weight = (1.0 + d2 / c2) ** -1.0
                R[mine, mine] /= squared_weight
                assert found.weight[k, g] == pytest.approx(squared_weight, rel=1e-6)
        m, P, *_ = kalman.update(m, P, z, H, R)
        np.testing.assert_allclose(found.mean[k], m, atol=1e-6)
        np.testing.assert_allclose(found.sigma[k] ** 2, np.diag(P), rtol=1e-6)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_imm_finds_what_filterpy_finds(seed, axes):
    motion, epochs, *_, H = series(seed, axes)
    seen = np.isfinite(epochs.z[0])
    whole = np.isfinite(epochs.z[:, seen]).all(axis=1)
    kept = [column[whole] for column in epochs[:-1]]
    epochs, n = epochs._replace(**dict(zip(epochs._fields, kept, strict=False))), whole.sum()
    epochs.z[:, ~seen] = np.nan
    steps = np.diff(epochs.time, prepend=epochs.time[0])
    head = epochs._replace(**{f: getattr(epochs, f)[:6] for f in epochs._fields[:-1]})
    (_, begun), _ = imm(motion, RECOVERY, head, None)  # filterpy takes vague ones for singular
    modes = []
    for factor, belief in zip((1.0, 30.0**2), begun.beliefs, strict=True):
        one = KalmanFilter(2 * axes, int(seen.sum()))
        one.x, one.P, one.H = belief.mean.copy(), belief.covariance.copy(), H[seen]
        one.R = factor * np.diag(epochs.variance[0, seen])
        modes.append(one)
    both = IMMEstimator(modes, begun.probability, np.array([[0.95, 0.05], [0.5, 0.5]]))
    _, found = imm(motion, RECOVERY, epochs, None)
    for k in range(6, n):
        G = noise_factor("cv", axes, steps[k], 0.3)
        for one in modes:
            one.F, one.Q = transition("cv", axes, steps[k]), G @ G.T
        both.predict()
        both.update(epochs.z[k, seen])
        weight = both.mu[0] + both.mu[1] / 900.0
        np.testing.assert_allclose(found.weight[k, 0], weight, rtol=1e-4)
        np.testing.assert_allclose(found.mean[k], both.x.ravel(), atol=2e-4)
        np.testing.assert_allclose(found.sigma[k] ** 2, np.diag(both.P), rtol=1e-3)
    assert found.weight[:, 0].min() < 0.01
    assert np.median(found.weight[:, 0]) > 0.9


@pytest.mark.parametrize("seed", range(4))
def test_sage_husa_is_what_is_worked_out_by_hand_on_one_axis(seed):
    motion, epochs, *_ = series(seed, axes=1, share=0.1)
    _, found = sage_husa(motion, RECOVERY, epochs, None)
    p, v, pp, pv, vv = 0.0, 0.0, 1e12, 0.0, 100.0
    adapted, last = [0.25, 0.01], epochs.time[0]
    for k, (time, z) in enumerate(zip(epochs.time, epochs.z, strict=True)):
        dt, last = time - last, time
        p, pp, pv = p + dt * v, pp + 2 * dt * pv + dt**2 * vv + 0.1 * dt**3, pv + dt * vv
        pv, vv = pv + 0.15 * dt**2, vv + 0.3 * dt
        told = [0.25, 0.01]
        for c, state in ((0, p), (1, v)):
            own = (pp, vv)[c]
            if np.isfinite(z[c]) and own <= 100.0 * told[c]:
                news = max((z[c] - state) ** 2 - own, 0.01 * told[c])
                adapted[c] = 0.97 * adapted[c] + 0.03 * news
        if np.isfinite(z[0]):
            one, two, off = pp / (pp + adapted[0]), pv / (pp + adapted[0]), z[0] - p
            p, v = p + one * off, v + two * off
            pp, pv, vv = adapted[0] * one, adapted[0] * two, vv - two * pv
        if np.isfinite(z[1]):
            one, two, off = pv / (vv + adapted[1]), vv / (vv + adapted[1]), z[1] - v
            p, v = p + one * off, v + two * off
            pp, pv, vv = pp - one * pv, adapted[1] * one, adapted[1] * two
        np.testing.assert_allclose(found.mean[k], [p, v], rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(found.sigma[k] ** 2, [pp, vv], rtol=1e-5)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_gnc_is_reweighted_least_squares_of_all_states_at_once(seed, axes):
    motion, epochs, F, Q, H = series(seed, axes, n=40, share=0.2)
    Q = Q + 1e-12 * np.eye(2 * axes)  # invertible where two epochs have one time
    m, P = first_belief(axes, 2)
    P[:axes] /= 1e4  # vague enough, and the information can be inverted
    weight, mu = np.ones((40, motion.groups)), None
    for _ in range(200):
        R = np.stack([np.diag(v) for v in epochs.variance])
        z = epochs.z.copy()
        for k, g in zip(*np.nonzero(weight < 1.0), strict=True):
            mine = np.flatnonzero(motion.group == g)
            R[k, mine, mine] /= max(weight[k, g], 1e-300)
            z[k, mine] = np.nan if weight[k, g] == 0.0 else z[k, mine]
        mean, covariance = kalman.batch(m, P, z, H, R, F, Q)
        r2 = np.full((40, motion.groups), np.nan)
        limit = np.ones((40, motion.groups))
        for g in range(motion.groups):
            seen = np.isfinite(epochs.z) & (motion.group == g)
            off = np.where(seen, (epochs.z - mean @ H.T) ** 2 / epochs.variance, 0.0)
            r2[:, g] = np.where(seen.any(axis=1), off.sum(axis=1), np.nan)
            limit[:, g] = chdtri(np.maximum(seen.sum(axis=1), 1), 0.0027)
        mu = 1.4 * mu if mu else 1.0 / (2.0 * np.nanmax(r2 / limit) - 1.0)
        after = np.ones_like(weight)
        for k, g in zip(*np.nonzero(np.isfinite(r2)), strict=True):
            c, r = np.sqrt(limit[k, g]), np.sqrt(r2[k, g])
            if r**2 >= (mu + 1.0) / mu * c**2:
                after[k, g] = 0.0
            elif r**2 >= mu / (mu + 1.0) * c**2:
                after[k, g] = c / r * np.sqrt(mu * (mu + 1.0)) - mu
        if (after == weight).all() and np.isin(after, (0.0, 1.0)).all():
            break
        weight = after
    _, found = gnc(motion, RECOVERY, epochs, None)
    used = np.isfinite(r2)
    np.testing.assert_array_equal(found.weight[used], weight[used])
    assert 0 < (weight[used] == 0.0).sum() < 0.5 * used.sum()
    np.testing.assert_allclose(found.mean, mean, atol=2e-3)
    sigma = np.sqrt(np.einsum("kii->ki", covariance))
    np.testing.assert_allclose(found.sigma, sigma, rtol=1e-2)


def test_weights_go_from_convex_to_truncated():
    ratio = np.array([0.0, 0.5, 0.99, 1.01, 3.0, np.nan])
    np.testing.assert_array_equal(truncated_weights(ratio, 1e12), [1, 1, 1, 0, 0, 1])
    nearly = truncated_weights(ratio, 1e-6)
    assert nearly[1] == pytest.approx(np.sqrt(1e-6 / 0.5), rel=1e-2)
    assert (np.diff(nearly[:5]) <= 0.0).all()


@pytest.mark.parametrize("name", ONLINE)
def test_a_series_in_parts_gives_the_same_bits(name):
    motion, epochs, *_ = series(2)
    _, whole = ONLINE[name](motion, RECOVERY, epochs, None)
    state, parts = None, []
    for rows in (slice(0, 1), slice(1, 30), slice(30, 80)):
        cut = epochs._replace(**{f: getattr(epochs, f)[rows] for f in epochs._fields[:-1]})
        state, found = ONLINE[name](motion, RECOVERY, cut, state)
        parts.append(found)
    for one, pieces in zip(whole, zip(*parts, strict=True), strict=True):
        np.testing.assert_array_equal(one, np.concatenate(pieces))


@pytest.mark.parametrize(("name", "most"), [("gnc", 1.15), ("imm", 1.15), ("wolf", 1.4)])
def test_isolated_errors_are_survived(name, most):
    mode, ratios = BASELINES[name].mode, []
    for seed in range(3):
        trial = alone(draw("isolated-20", draw_world([5, seed], epochs=400), [5, seed]))
        ratios.append(outcomes(trial, [name], [mode])[mode, name].merit.rmse_ratio)
    assert 0.95 < np.mean(ratios) < most


@pytest.mark.parametrize("name", BASELINES)
@pytest.mark.parametrize("seed", range(2))
def test_where_nothing_is_wrong_they_are_near_the_oracle_and_honest(name, seed):
    trial = draw("clean", draw_world([6, seed], epochs=500, axes=2 + seed), [6, seed])
    mode = BASELINES[name].mode
    for each in (trial, alone(trial)):
        merit = outcomes(each, [name], [mode])[mode, name].merit
        assert 0.98 < merit.rmse_ratio < 1.2
        assert 0.6 < merit.nees < 1.6


def test_every_name_has_its_modes_and_an_unknown_one_is_refused():
    assert (*METHODS, *BASELINES) == COMPARED
    assert works_in("gnc", "offline")
    assert not works_in("gnc", "realtime")
    assert not works_in("53h", "realtime")
    assert cleaner_of("huber") == ("huber", None)
    assert cleaner_of("gnc") == ("igg3", gnc)
    with pytest.raises(OptionsError, match="sage-husa"):
        works_in("magic", "offline")
    with pytest.raises(OptionsError, match="mode realtime"):
        CompareOptions(methods=("igg3", "wolf"), modes=("offline",))


def test_what_does_not_work_in_a_mode_has_no_figure():
    trial = replace(draw("clean", World(epochs=200), 1))
    found = outcomes(trial, ["gnc", "wolf", "igg3"], ["offline", "realtime"])
    assert [key for key in found if key[1] != "oracle"] == [
        ("offline", "gnc"),
        ("offline", "igg3"),
        ("realtime", "wolf"),
        ("realtime", "igg3"),
    ]
