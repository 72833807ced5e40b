"""Velocities that are wrong on end, and manoeuvres that only a fix shows."""

import numpy as np
import pytest

from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.records import Epochs, Motion
from surefix.filters.track import by_axis

N = 200
RUN = slice(80, 120)


def motion_of(axes, process, order=2):
    return Motion(order, axes, np.full(axes, process**2), by_axis(axes), 2 * axes, 0.0)


def log_of(seed, axes, process, noise, *, sigma=1.0, step=1.0):
    """Truth (n, 2·axes), and epochs of fixes and velocities without errors."""
    rng = np.random.default_rng(seed)
    time = step * np.cumsum(rng.gamma(8.0, 1.0 / 8.0, N))
    steps = np.diff(time, prepend=time[0] - step)[:, None]
    velocity = np.cumsum(process * np.sqrt(steps) * rng.standard_normal((N, axes)), axis=0)
    position = np.cumsum(steps * velocity, axis=0)
    truth = np.hstack([position, velocity])
    scale = np.repeat([sigma, noise], axes)
    z = truth + scale * rng.standard_normal(truth.shape)
    none = np.zeros(N, np.int64)
    variance = np.tile(scale**2, (N, 1))
    epochs = Epochs(time, z, variance, np.full(z.shape, np.nan), none, none.copy())
    return truth, epochs


def ways(seed, axes):
    way = np.random.default_rng(seed + 900).standard_normal(axes)
    return way / np.linalg.norm(way)


def followed(motion, prior, epochs):
    return filter_hypotheses(motion, prior, epochs, no_hypotheses(motion), traced=False)[1]


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("sigma", [0.05, 5.0])
def test_the_account_of_a_long_run_of_wrong_velocities_outlives_the_doubt(axes, sigma):
    """40 velocities are off by 12 … 16 σ, and fixes tell so little that it takes many of them."""
    process, noise = 0.06 * sigma, 0.03 * sigma
    motion = motion_of(axes, process)
    prior = supposed(axes, sigma, noise, 20.0 * sigma, 39.5)
    late = slice(RUN.stop - 10, RUN.stop + 40)
    ours, least = [], []
    for seed in range(8):
        truth, epochs = log_of(seed, axes, process, noise, sigma=sigma)
        epochs.z[RUN, axes:] += (12.0 + 0.5 * seed) * noise * ways(seed, axes)
        told = epochs._replace(fixed=epochs.fixed.copy())
        told.fixed[RUN, axes:] = 0.0
        for each, errors in ((epochs, ours), (told, least)):
            errors.append(followed(motion, prior, each).mean[late, :axes] - truth[late, :axes])
    assert np.std(ours) < 1.06 * np.std(least)


@pytest.mark.parametrize("order", [2, 3])
def test_a_gross_error_beside_doubted_velocities_is_no_manoeuvre(order):
    """However probable manoeuvres are: the velocity shows nothing of it."""
    axes, noise = 2, 0.05
    motion = motion_of(axes, 0.3, order)
    prior = supposed(axes, 1.0, noise, 20.0, 39.5)._replace(manoeuvre=0.04, again=0.6)
    for seed in range(4):
        truth, epochs = log_of(seed, axes, 0.06, noise)
        way = ways(seed, axes)
        epochs.z[100:102, axes:] += 1.5 * way
        epochs.z[101, :axes] += 60.0 * way
        found = followed(motion, prior, epochs)
        off = np.linalg.norm(found.mean[99:110, :axes] - truth[99:110, :axes], axis=1)
        assert off.max() < 6.0
        assert found.weight[101, 0] < 0.2


def test_a_manoeuvre_is_believed_where_velocities_are_silent():
    """The same fixes, without velocities beside them, and others that go on from there."""
    axes = 2
    motion = motion_of(axes, 0.06)
    prior = supposed(axes, 1.0, 0.05, 20.0, 39.5)._replace(manoeuvre=0.04)
    truth, epochs = log_of(1, axes, 0.06, 0.05)
    epochs.z[100:, :axes] += 12.0 * (epochs.time[100:, None] - epochs.time[99])
    epochs.z[:, axes:] = np.nan
    found = followed(motion, prior, epochs)
    truth[100:, :axes] += 12.0 * (epochs.time[100:, None] - epochs.time[99])
    off = np.linalg.norm(found.mean[103:, :axes] - truth[103:, :axes], axis=1)
    assert off.max() < 4.0
