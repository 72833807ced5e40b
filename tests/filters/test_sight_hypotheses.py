"""Several hypotheses on single sights, in real time."""

import numpy as np
import pytest

from filters.sight_worlds import FAR, FLAT, SMALL, model_of, nees, prior_of, ranges, sights_of
from reference.sights import enumerate_decisions
from surefix.filters.sight_hypotheses import filter_sights
from surefix.filters.sight_modes import realtime_sights
from surefix.filters.sight_starts import begin_around, begin_at
from surefix.models.sights import COMPONENT, RANGE, expected


@pytest.mark.parametrize("seed", range(3))
def test_linear_sights_against_every_decision_there_can_be(seed):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 2.0, 5))
    z = 0.5 * time[:, None] + rng.normal(size=(5, 2))
    z[2:4, seed % 2] += 9.0  # twice, by the same amount
    prior = prior_of(2, wrong=np.array([0.1, 0.2]), again=np.array([0.7, 0.4]), restart=0.0)
    prior = prior._replace(spread=np.array([5.0, 8.0]), poor=1e-12)
    model = model_of(1, [COMPONENT, COMPONENT], 0.3)
    sights = sights_of(time, z, 0.8, [0.0])
    bank = begin_at(model, np.zeros(1), np.full(1, 3.0), 1.0, most=1024)
    _, found, _ = filter_sights(model, prior, sights, bank)
    start = np.zeros(2), np.diag([9.0, 1.0])
    mean, covariance, total = enumerate_decisions(time, z, 0.8, prior, 0.09, start)
    np.testing.assert_allclose(found.mean[-1], mean, rtol=5e-3, atol=5e-3)
    np.testing.assert_allclose(found.covariance[-1], covariance, rtol=2e-2, atol=1e-3)
    assert found.evidence.sum() == pytest.approx(total, abs=2e-2)


@pytest.mark.parametrize("anchors", [FAR, FAR[:4], FLAT], ids=["six", "four", "flat"])
@pytest.mark.parametrize("again", [None, 0.8], ids=["single", "in-rows"])
def test_gross_errors_are_rejected_and_sigma_is_honest(anchors, again):
    squares, caught, refused = [], [], []
    for seed in range(4):
        world = ranges(seed, anchors, share=0.1 if again is None else 0.03, again=again)
        bank = begin_around(world.model, world.sights, 1.0)
        _, found = realtime_sights(world.model, world.prior, world.sights, bank)
        squares.append(nees(world.truth, found.mean, found.covariance))
        caught.append(found.weight[world.gross] < 0.5)
        refused.append(found.weight[~world.wrong] < 0.5)
    assert 0.8 < np.mean(squares) < 1.25
    assert np.concatenate(caught).mean() >= 0.985
    assert np.concatenate(refused).mean() <= 0.005


@pytest.mark.parametrize("seed", range(4))
def test_three_of_six_ranges_wrong_at_once(seed):
    world = ranges(seed, FAR, n=120, share=0.0)
    rng = np.random.default_rng(seed)
    z, wrong = world.sights.z.copy(), np.zeros_like(world.wrong)
    for k in range(2, 120, 4):
        which = rng.choice(6, 3, replace=False)
        z[k, which] += rng.uniform(2.0, 20.0, 3) * rng.choice([-1, 1], 3)
        wrong[k, which] = True
    bank = begin_around(world.model, world.sights, 1.0)
    sights = world.sights._replace(z=z)
    prior = world.prior._replace(wrong=np.full(6, 0.15))
    _, found = realtime_sights(world.model, prior, sights, bank)
    assert (found.weight[wrong] < 0.5).mean() >= 0.985
    assert (found.weight[~wrong] < 0.5).mean() <= 0.01
    assert np.abs(found.mean - world.truth)[20:, :3].max() < 1.0


def test_mirror_images_stay_open_until_bounds_or_motion_tell():
    flat = SMALL.copy()
    flat[3, 2] = 0.0
    world = ranges(3, flat, n=15, share=0.0, sigma=0.01, q=0.002)
    assert world.truth[-1, 2] < -3.0
    mixed = begin_around(world.model, world.sights, 1.0)
    _, open_ = realtime_sights(world.model, world.prior, world.sights, mixed)
    assert abs(open_.mean[-1, 2] - world.truth[-1, 2]) > 1.0  # between both
    assert 2.0 * np.sqrt(open_.covariance[-1, 2, 2]) > abs(world.truth[-1, 2])
    below = world.model._replace(within=np.array([[-np.inf, np.inf]] * 2 + [[-np.inf, 0.0]]))
    bank = begin_around(below, world.sights, 1.0)
    _, told = realtime_sights(below, world.prior, world.sights, bank)
    sigma = np.sqrt(told.covariance[-1, 2, 2])
    assert abs(told.mean[-1, 2] - world.truth[-1, 2]) < 3.0 * sigma < 3.0


@pytest.mark.parametrize("seed", range(3))
def test_one_beacon_and_a_velocity(seed):
    """Only a turn tells on which side of its course the target is."""
    rng = np.random.default_rng(seed)
    n = 150
    heading = np.interp(np.arange(n), [0, 70, 90, n], np.radians([17.0, 17.0, 107.0, 107.0]))
    v = np.column_stack([np.sin(heading), np.cos(heading)])
    p = np.array([30.0, 10.0]) + np.vstack([np.zeros(2), np.cumsum(v[:-1], axis=0)])
    truth = np.hstack([p, v])
    kind = np.array([RANGE, COMPONENT + 2, COMPONENT + 3])
    sigma = np.array([0.1, 0.03, 0.03])
    z = expected(kind, [0.0, 0.0], truth) + sigma * rng.normal(size=(n, 3))
    bad = rng.random(n) < 0.1
    z[bad, 0] += rng.uniform(2.0, 15.0, bad.sum())
    sights = sights_of(np.arange(n) * 1.0, z, sigma, [0.0, 0.0])
    model = model_of(2, kind, 0.1)
    prior = prior_of(3, spread=np.array([5.0, 1.0, 1.0]))
    _, found = realtime_sights(model, prior, sights, begin_around(model, sights, 1.0))
    error = np.linalg.norm(found.mean - truth, axis=1)
    assert np.sqrt(found.covariance[60, :2, :2].trace()) > 10.0  # two images
    assert error[100:].max() < 3.0
    assert (found.weight[bad, 0][5:] < 0.5).mean() >= 0.9


def test_a_track_that_goes_on_somewhere_else_is_followed():
    world = ranges(1, FAR[:4], share=0.02)
    moved = np.array([15.0, -10.0, 2.0]) * (np.arange(200) >= 100)[:, None]
    elsewhere = world.truth + np.hstack([moved, 0.0 * moved])
    kind, there = world.model.kind, world.sights.anchor
    z = world.sights.z - expected(kind, there, world.truth) + expected(kind, there, elsewhere)
    bank = begin_around(world.model, world.sights, 1.0)
    _, found = realtime_sights(world.model, world.prior, world.sights._replace(z=z), bank)
    assert np.linalg.norm((found.mean - elsewhere)[101:, :3], axis=1).max() < 1.5


def test_a_series_in_parts_gives_the_same():
    world = ranges(5, FLAT, n=60)
    bank = begin_around(world.model, world.sights, 1.0)
    _, whole = realtime_sights(world.model, world.prior, world.sights, bank)
    for k in range(60):
        one = world.sights._make(column[k : k + 1] for column in world.sights)
        bank, part = realtime_sights(world.model, world.prior, one, bank)
        np.testing.assert_array_equal(part.mean[0], whole.mean[k])
        np.testing.assert_array_equal(part.weight[0], whole.weight[k])
