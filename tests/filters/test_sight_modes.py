"""Several hypotheses on single sights, offline: decisions, smoothing, what is learnt."""

import numpy as np
import pytest

from filters.sight_worlds import FAR, FLAT, SMALL, model_of, nees, prior_of, ranges, sights_of
from surefix.filters.sight_learning import SightFigures, learn_sights, with_figures
from surefix.filters.sight_modes import decide_sights, offline_sights
from surefix.filters.sight_review import add_bowl, review_sights
from surefix.filters.sight_smoothing import smooth_pass, smooth_sights
from surefix.filters.sight_starts import begin_around, begin_at
from surefix.models.sights import BEARING, COMPONENT, RANGE, expected


@pytest.mark.parametrize("sigma", [0.05, 0.3])
@pytest.mark.parametrize("anchors", [FAR[:4], FLAT], ids=["four", "flat"])
def test_all_is_learnt_and_gross_errors_are_left_out(anchors, sigma):
    squares, known, caught, refused = [], [], [], []
    for seed in range(2):
        world = ranges(seed, anchors, n=150, sigma=sigma, size=40.0 * sigma)
        group = np.zeros(len(anchors), np.int64)
        open_ = SightFigures(np.array([np.nan]), np.nan)
        bank = begin_around(world.model, world.sights, 1.0)
        figures, prior = learn_sights(world.model, world.sights, group, open_, bank, 1.0)
        assert figures.sigma[0] == pytest.approx(sigma, rel=0.15)
        assert figures.process == pytest.approx(0.02, rel=0.5)
        assert prior.wrong[0] == pytest.approx(0.1, abs=0.04)
        model, sights = with_figures(world.model, world.sights, group, figures)
        found = offline_sights(model, prior, sights, bank)
        squares.append(nees(world.truth, found.mean, found.covariance))
        told = offline_sights(world.model, world.prior, world.sights, bank)
        known.append(nees(world.truth, told.mean, told.covariance))
        caught.append(found.weight[world.gross] == 0.0)
        refused.append(found.weight[~world.wrong] == 0.0)
    assert 0.75 < np.mean(squares) / np.mean(known) < 1.3  # one track scatters by half
    assert np.concatenate(caught).mean() >= 0.99
    assert np.concatenate(refused).mean() <= 0.005


def test_three_ranges_in_ten_may_be_wrong():
    world = ranges(1, FAR, n=120, share=0.3)
    group, open_ = np.zeros(6, np.int64), SightFigures(np.array([np.nan]), np.nan)
    bank = begin_around(world.model, world.sights, 1.0)
    figures, prior = learn_sights(world.model, world.sights, group, open_, bank, 1.0)
    assert figures.sigma[0] == pytest.approx(0.05, rel=0.2)
    model, sights = with_figures(world.model, world.sights, group, figures)
    found = offline_sights(model, prior, sights, bank)
    assert (found.weight[world.gross] == 0.0).mean() >= 0.99
    assert (found.weight[~world.wrong] == 0.0).mean() <= 0.005


def test_a_small_array_tells_a_position_and_how_well():
    squares = []
    for seed in range(4):
        world = ranges(seed, SMALL, n=150, share=0.03, again=0.7)
        bank = begin_around(world.model, world.sights, 1.0)
        found = offline_sights(world.model, world.prior, world.sights, bank)
        squares.append(nees(world.truth, found.mean, found.covariance).mean())
        assert (found.weight[world.gross] == 0.0).mean() >= 0.99
        assert (found.weight[~world.wrong] == 0.0).mean() <= 0.01
    assert 0.3 < np.median(squares) < 1.8


@pytest.mark.parametrize("seed", range(3))
def test_ranges_and_bearings_of_landmarks(seed):
    """A robot on a floor, whose bearings are from the landmarks to it."""
    rng = np.random.default_rng(seed)
    world = ranges(seed, FLAT[:2] / 5.0, n=200, share=0.0)
    kind = np.array([RANGE, RANGE, BEARING, BEARING])
    anchors = np.vstack([FLAT[:2] / 5.0] * 2)
    sigma = np.array([0.1, 0.1, 0.03, 0.03])
    z = expected(kind, anchors, world.truth) + sigma * rng.normal(size=(200, 4))
    wrong = rng.random(z.shape) < 0.05
    z += wrong * np.array([3.0, 3.0, 1.0, 1.0]) * rng.choice([-1, 1], z.shape)
    z[:, 2:] = np.angle(np.exp(1j * z[:, 2:]))
    z[rng.random(z.shape) < 0.3] = np.nan  # asynchronous
    seen = np.isfinite(z)
    z[0, 0] = world.sights.z[0, 0]
    sights = sights_of(world.sights.time, z, sigma, anchors)
    model = model_of(2, kind, 0.02)
    prior = prior_of(4, spread=np.array([3.0, 3.0, 0.7, 0.7]), again=np.full(4, 0.1))
    found = offline_sights(model, prior, sights, begin_around(model, sights, 1.0))
    assert 0.7 < nees(world.truth, found.mean, found.covariance).mean() < 1.4
    assert (found.weight[wrong & seen] == 0.0).mean() >= 0.99
    assert (found.weight[~wrong & seen] == 0.0).mean() <= 0.005


def test_linear_sights_are_smoothed_as_by_least_squares():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5, 2.0, 12))
    z = rng.normal(size=(12, 1))
    model, q = model_of(1, [COMPONENT], 0.5), 0.25
    sights = sights_of(time, z, 0.7, [0.0])
    start = np.array([1.0, 0.5]), np.diag([4.0, 1.0])
    none = np.zeros(12, np.bool_)
    about = rng.normal(size=(12, 2))
    m, P, _ = smooth_pass(model, prior_of(1), sights, np.ones((12, 1)), none, about, start)
    m, P = smooth_sights(model, prior_of(1), time, none, m, P)
    A = np.zeros((24, 24))
    b = np.zeros(24)
    A[:2, :2] += np.linalg.inv(start[1])
    b[:2] += np.linalg.solve(start[1], start[0])
    for k in range(12):
        A[2 * k, 2 * k] += 1.0 / 0.49
        b[2 * k] += z[k, 0] / 0.49
        if k:
            dt = time[k] - time[k - 1]
            J = np.hstack([-np.array([[1, dt], [0, 1]]), np.eye(2)])
            Q = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
            A[2 * k - 2 : 2 * k + 2, 2 * k - 2 : 2 * k + 2] += J.T @ np.linalg.solve(Q, J)
    np.testing.assert_allclose(m.ravel(), np.linalg.solve(A, b), atol=1e-9)
    C = np.linalg.inv(A)
    wanted = [C[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(12)]
    np.testing.assert_allclose(P, wanted, atol=1e-9)


def test_what_was_decided_beforehand_stays():
    world = ranges(2, FAR[:4], n=60)
    fixed = np.full(world.sights.z.shape, np.nan)
    fixed[10, 1], fixed[11, 1] = 0.0, 1.0
    sights = world.sights._replace(fixed=fixed)
    bank = begin_at(world.model, world.truth[0, :3], np.full(3, 5.0), 1.0)
    said = decide_sights(world.model, world.prior, sights, bank)
    assert (said.weight[10, 1], said.weight[11, 1]) == (0.0, 1.0)


def test_a_doubtful_sight_between_wrong_ones_is_wrong():
    prior = prior_of(1, again=np.array([0.8]), spread=np.array([1.0]))
    sights = sights_of(np.arange(8.0), np.zeros((8, 1)), 0.1, [0.0])
    residual = np.array([0.0, 0.0, 2.0, 0.28, 2.0, 0.0, 0.0, 0.28])[:, None]
    weight = review_sights(prior, sights, residual, np.full((8, 1), 0.01))
    assert weight[:, 0].tolist() == [1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]


def test_the_bowl_is_the_spread_of_points_on_a_sphere():
    rng = np.random.default_rng(0)
    mean, P = np.array([[40.0, 0, 0, 0, 0, 0]]), np.zeros((1, 6, 6))
    P[0, 1, 1], P[0, 2, 2] = 9.0, 4.0
    across = rng.normal(size=(200_000, 2)) * [3.0, 2.0]
    bend = np.sqrt(1600.0 - (across**2).sum(axis=1)) - 40.0
    added = add_bowl(mean, P, np.zeros((1, 3)))[0] - P[0]
    assert added[0, 0] == pytest.approx(np.mean(bend**2), rel=0.05)
    assert np.abs(added[1:, 1:]).max() == 0.0
