"""Targets seen by single sights, with errors that are known."""

from typing import NamedTuple

import numpy as np

from surefix.filters.sight_records import SightModel, SightPrior, Sights
from surefix.models.sights import RANGE, expected

FAR = np.array(
    [[0.0, 0, 0], [100, 0, 0], [100, 100, -5], [0, 100, -20], [50, -60, -10], [-60, 50, -3]]
)
SMALL = np.array([[-0.48, 0, 0], [0, 0.46, 0], [0.48, -0.04, 0], [0, 0, -0.3]])
FLAT = np.array([[0.0, 0], [50, 0], [0, 50]])


class World(NamedTuple):
    """True states, what was seen of them, and which sights are wrong."""

    truth: np.ndarray
    model: SightModel
    prior: SightPrior
    sights: Sights
    wrong: np.ndarray
    gross: np.ndarray


def moving(rng, axes, time, q, start):
    """States of white acceleration."""
    x = np.zeros((len(time), 2 * axes))
    x[0, :axes], x[0, axes:] = start[:axes], rng.normal(0, 0.3, axes)
    for k, dt in enumerate(np.diff(time), 1):
        noise = np.linalg.cholesky([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]) * q
        moved, faster = noise @ rng.normal(size=(2, axes))
        x[k, :axes] = x[k - 1, :axes] + dt * x[k - 1, axes:] + moved
        x[k, axes:] = x[k - 1, axes:] + faster
    return x


def model_of(axes, kind, q):
    free = np.tile([-np.inf, np.inf], (axes, 1))
    return SightModel(axes, np.full(axes, q * q), np.asarray(kind), free)


def prior_of(channels, **changes):
    usual = np.full(channels, 0.05), np.full(channels, 0.5), np.full(channels, 1.5)
    return SightPrior(*usual, 0.02, 1e-4, 30.0, 1.0)._replace(**changes)


def sights_of(time, z, sigma, anchors):
    n, c = z.shape
    anchors = np.broadcast_to(anchors, (n, c, np.shape(anchors)[-1])).copy()
    return Sights(
        time, z, np.full((n, c), 1.0) * np.square(sigma), anchors, np.full((n, c), np.nan)
    )


def spoiled(rng, z, share, again, size):
    """Add gross errors; a channel that was wrong is again with probability ``again``."""
    wrong = rng.random(z.shape) < share
    for k in range(1, len(z)):
        stays = rng.random(z.shape[1]) < (share if again is None else again)
        wrong[k] = np.where(wrong[k - 1], stays, wrong[k])
    error = np.where(wrong, size * rng.normal(size=z.shape), 0.0)
    return z + error, wrong, error


def ranges(seed, anchors, *, n=200, sigma=0.05, q=0.02, share=0.1, again=None, size=5.0):
    """A target that wanders among receivers, irregularly seen."""
    rng = np.random.default_rng(seed)
    c, axes = anchors.shape
    time = np.cumsum(rng.uniform(0.5, 1.5, n))
    truth = moving(rng, axes, time, q, (10.0, 20.0, -8.0))
    kind = np.full(c, RANGE)
    z = expected(kind, anchors, truth) + sigma * rng.normal(size=(n, c))
    z, wrong, error = spoiled(rng, z, share, again, size)
    sights = sights_of(time, z, sigma, anchors)
    gross = np.abs(error) > 8.0 * sigma
    return World(truth, model_of(axes, kind, q), prior_of(c), sights, wrong, gross)


def nees(truth, mean, covariance):
    """Squared error of the position in its own standard deviations, per axis."""
    d = truth.shape[1] // 2
    e = (mean - truth)[:, :d]
    return np.einsum("ki,kij,kj->k", e, np.linalg.inv(covariance[:, :d, :d]), e) / d
