"""Tracklets: what each observation added, read off the filters, makes the centralised filter."""

import numpy as np
import pytest

from surefix.fusion.track import Estimate
from surefix.fusion.tracklets import tracklet, use_tracklets


def textbook(m, P, z, H, R):
    """One update with all observations stacked, by the gain."""
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    return m + K @ (z - H @ m), (np.eye(len(m)) - K @ H) @ P


def spd(rng, n):
    root = rng.standard_normal((n, n))
    return root @ root.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("n", [1, 2, 3, 6])
@pytest.mark.parametrize("seed", range(4))
def test_the_centralised_filter_over_several_steps(n, seed):
    """Three masters with priors of their own, irregular steps, partial observations."""
    rng = np.random.default_rng([seed, n])
    N = 3
    m, P = rng.standard_normal(n), spd(rng, n)
    ours = Estimate(m.copy(), P.copy())
    local = [(rng.standard_normal(n), spd(rng, n)) for _ in range(N)]
    for _ in range(5):
        F, Q = np.eye(n) + 0.1 * rng.standard_normal((n, n)), spd(rng, n)
        H = [rng.standard_normal((1 + i % n, n)) for i in range(N)]
        R = [spd(rng, len(h)) for h in H]
        z = [rng.standard_normal(len(h)) for h in H]
        m, P = F @ m, F @ P @ F.T + Q
        ours = Estimate(F @ ours.mean, F @ ours.covariance @ F.T + Q)
        added = []
        for i, (x, S) in enumerate(local):
            before = Estimate(F @ x, F @ S @ F.T + Q)
            after = Estimate(*textbook(*before, z[i], H[i], R[i]))
            local[i] = after.mean, after.covariance
            added.append((before, after))
        stacked = [
            Estimate(*(np.stack(field) for field in zip(*side, strict=True)))
            for side in zip(*added, strict=True)
        ]
        ours = use_tracklets(ours, tracklet(*stacked))
        noise = np.zeros((sum(map(len, z)),) * 2)
        at = 0
        for r in R:
            noise[at : at + len(r), at : at + len(r)] = r
            at += len(r)
        m, P = textbook(m, P, np.concatenate(z), np.vstack(H), noise)
        np.testing.assert_allclose(ours.mean, m, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(ours.covariance, P, rtol=1e-6, atol=1e-8)


def test_a_master_without_an_observation_or_an_estimate_adds_nothing():
    same = Estimate(np.array([[1.0, 2.0], [np.nan, 0.0]]), np.stack([2.0 * np.eye(2)] * 2))
    added = tracklet(same, same)
    assert not added.information.any()
    assert not added.vector.any()
    prediction = Estimate(np.array([3.0, 4.0]), 5.0 * np.eye(2))
    kept = use_tracklets(prediction, added)
    np.testing.assert_allclose(kept.mean, prediction.mean)
    np.testing.assert_allclose(kept.covariance, prediction.covariance)
