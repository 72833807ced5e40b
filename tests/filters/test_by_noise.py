"""Cipra and Romera's weights in the track filter: Huber's, of residuals over the noise alone."""

import numpy as np
import pytest

from surefix.filters.kalman import gaussian
from surefix.filters.m_estimation import m_update
from surefix.filters.offline import offline
from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.track import by_axis, filter_track, start
from surefix.models.motion import noise_factor, transition
from surefix.robust.loss import loss_named

LOSS = loss_named("huber")._replace(by_noise=1)
RECOVERY = Recovery(1e9, 1.0)


def world(seed, axes=2, n=80):
    """Fixes and velocities with gross errors, gaps and irregular steps."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.3, 2.0, n))
    sigma = np.repeat([0.5, 0.1], axes)
    truth = np.column_stack([0.4 * time] * axes + [np.full(n, 0.4)] * axes)
    z = truth + sigma * rng.standard_normal((n, 2 * axes))
    z[rng.uniform(size=z.shape) < 0.15] += 9.0
    z[rng.uniform(size=z.shape) < 0.2] = np.nan
    z[:3] = truth[:3]  # a beginning that is known
    motion = Motion(2, axes, np.full(axes, 0.02), by_axis(axes), 2 * axes, 0.0)
    variance = np.tile(sigma**2, (n, 1))
    blank = np.full((n, 2 * axes), np.nan)
    return motion, Epochs(time, z, variance, blank, np.zeros(n, np.int64))


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_the_step_is_the_update_as_printed(axes):
    motion, epochs = world(axes, axes)
    _, found, _ = filter_track(motion, LOSS, RECOVERY, epochs, start(motion, RECOVERY))
    H = np.eye(2 * axes)
    for k in range(3, 80):
        dt = epochs.time[k] - epochs.time[k - 1]
        F, G = transition("cv", axes, dt), noise_factor("cv", axes, dt, motion.density[0])
        S = found.factor[k - 1]
        P = F @ S @ S.T @ F.T + G @ G.T
        x = gaussian(F @ found.mean[k - 1], P)
        after, seen = m_update(x, epochs.z[k], H, np.diag(epochs.variance[k]), loss_named("huber"))
        np.testing.assert_allclose(found.mean[k], after.mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(found.weight[k], seen.weight, rtol=1e-9)
        np.testing.assert_allclose(
            found.factor[k] @ found.factor[k].T, after.covariance, rtol=0, atol=1e-9
        )


def test_an_unknown_prediction_says_nothing():
    motion, epochs = world(4)
    epochs.z[0, :2] = 7e4  # far from where the filter was begun
    _, found, _ = filter_track(motion, LOSS, RECOVERY, epochs, start(motion, RECOVERY))
    assert (found.weight[0, :2] == 1.0).all()


@pytest.mark.parametrize("seed", range(3))
def test_offline_the_weights_are_those_of_the_residuals_they_lead_to(seed):
    motion, epochs = world(seed, n=200)
    found = offline(motion, LOSS, RECOVERY, epochs)
    v = np.abs(epochs.z - found.mean[:, :4]) / np.sqrt(epochs.variance)
    seen = np.isfinite(v)
    expected = np.minimum(1.0, 1.5 / np.maximum(v[seen], 1e-9))
    np.testing.assert_allclose(found.weight[seen], expected, rtol=0, atol=0.03)
    assert (found.weight[seen] < 0.2).any()
