"""The covariance is honest: NEES and NIS over seeds lie within their χ² bounds."""

import numpy as np
import pytest

from filters.worlds import NEVER, PLAIN, covariances, world
from surefix.filters.modes import lagged
from surefix.filters.rts import smooth
from surefix.filters.track import filter_track, start
from surefix.metrics import mean_bounds, normalised_squares
from surefix.robust.loss import loss_named

RUNS = 60
CASES = [
    (2, 1, None, 0.02),
    (2, 2, None, 0.5),
    (2, 3, None, 0.02),
    (2, 2, 0.1, 0.1),
    (2, 3, 0.1, 0.5),
    (3, 1, None, 0.02),
    (3, 2, 0.1, 0.1),
]


def runs(order, axes, speed, q, n=60):
    """NEES of filter and smoother (runs, n), NIS sums (runs,) and how many innovations."""
    forward, backward, squares, counts = [], [], [], []
    for seed in range(RUNS):
        made = world(100 + seed, n, order=order, axes=axes, velocity=speed, missing=0.1, q=q)
        out = filter_track(made.motion, PLAIN, NEVER, made.epochs, made.state)[1]
        found = smooth(made.motion, NEVER, made.epochs.time, out)
        forward.append(normalised_squares(out.mean - made.truth, covariances(out)))
        backward.append(normalised_squares(found.mean - made.truth, found.covariance))
        squares.append(np.nansum(out.nis))
        counts.append(np.isfinite(made.epochs.z).sum())
    return np.array(forward), np.array(backward), np.array(squares), np.array(counts)


@pytest.mark.parametrize(("order", "axes", "speed", "q"), CASES)
def test_nees_and_nis_lie_within_their_bounds(order, axes, speed, q):
    """At each epoch the runs are independent: 95 % of the epochs lie within the 95 % bounds."""
    forward, backward, _, _ = runs(order, axes, speed, q)
    states = order * axes
    low, high = mean_bounds(states, RUNS)
    for nees in (forward, backward):
        mean = nees.mean(axis=0)
        assert np.mean((low < mean) & (mean < high)) >= 0.8
        wide = mean_bounds(states, RUNS, 1.0 - 1e-6)
        assert wide[0] < mean.min()
        assert mean.max() < wide[1]
        # three epochs far apart are nearly independent runs
        apart = nees[:, [5, 30, 55]]
        bounds = mean_bounds(states, apart.size, 0.99)
        assert bounds[0] < apart.mean() < bounds[1]


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("order", [2, 3])
def test_innovations_are_white_and_of_their_size(order, axes):
    """With one group of components per block the NIS of a run are independent χ²."""
    total, count, products, pairs = 0.0, 0, 0.0, 0
    for seed in range(RUNS):
        made = world(500 + seed, 80, order=order, axes=axes, q=0.1)
        out = filter_track(made.motion, PLAIN, NEVER, made.epochs, made.state)[1]
        seen = np.isfinite(out.nis)
        total += out.nis[seen].sum()
        count += np.isfinite(made.epochs.z).sum()
        nu = out.standardised[:, :axes]
        products += (nu[1:] * nu[:-1]).sum()
        pairs += nu[1:].size
    low, high = mean_bounds(1, count)
    assert low < total / count < high
    assert abs(products / pairs) < 2.5 / np.sqrt(pairs)


@pytest.mark.parametrize("lag", [3.0, 20.0])
def test_nees_of_the_fixed_lag_lies_within_its_bounds(lag):
    """`lagged` gives standard deviations only, so each state is judged on its own."""
    squares = []
    for seed in range(RUNS):
        made = world(900 + seed, 60, axes=2, q=0.1)
        begin = start(made.motion, NEVER)
        found = lagged(made.motion, PLAIN, NEVER, made.epochs, lag, np.ones(60, bool))
        assert (begin.mean == 0.0).all()
        error = (found.mean - made.truth) / found.sigma
        squares.append(error[[15, 35, 55]] ** 2)
    low, high = mean_bounds(1, 3 * RUNS, 0.999)
    for state in range(4):
        assert low < np.mean([each[:, state] for each in squares]) < high


@pytest.mark.parametrize(("factor", "side"), [(0.5, 1), (2.0, -1)])
def test_a_wrong_noise_figure_is_seen(factor, side):
    """The bounds can fail: half or twice the standard deviation falls out of them."""
    nees = []
    for seed in range(RUNS):
        made = world(seed, 40, axes=2)
        epochs = made.epochs._replace(variance=made.epochs.variance * factor**2)
        out = filter_track(made.motion, PLAIN, NEVER, epochs, made.state)[1]
        nees.append(normalised_squares(out.mean[-1] - made.truth[-1], covariances(out)[-1]))
    low, high = mean_bounds(4, RUNS)
    assert np.mean(nees) > high if side > 0 else np.mean(nees) < low


@pytest.mark.parametrize("method", ["gate", "igg1", "igg3", "igg3-yang", "huber", "student-t"])
def test_a_robust_filter_on_clean_data_is_nearly_honest(method):
    """Down-weighting good fixes costs a little: the claim stays within a quarter of the truth."""
    nees = []
    for seed in range(RUNS):
        made = world(seed, 60, axes=2, q=0.1)
        out = filter_track(made.motion, loss_named(method), NEVER, made.epochs, made.state)[1]
        nees.append(normalised_squares(out.mean - made.truth, covariances(out))[20:].mean())
    assert 3.0 < np.mean(nees) < 5.0
