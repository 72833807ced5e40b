"""The fusion rules against their textbook forms."""

import numpy as np
import pytest

from reference import fusion as twin
from surefix.fusion.covariance_intersection import covariance_intersection
from surefix.fusion.information_gain import entropy, fuse_by_gain, information_gain
from surefix.fusion.residual_scale import fuse_by_scale


def spd(rng, n, scale=1.0):
    A = rng.normal(size=(n, n))
    return scale * (A @ A.T + 0.1 * np.eye(n))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_gain_weights_and_mean(seed, n):
    rng = np.random.default_rng([seed, n])
    sources = 2 + seed
    posterior = np.array([spd(rng, n) for _ in range(sources)])
    prior = np.array([P + spd(rng, n, 3.0) for P in posterior])
    means = rng.normal(size=(sources, n))
    for P in posterior:
        assert float(entropy(P)) == pytest.approx(twin.entropy(P), abs=1e-9)
    fused, weights = fuse_by_gain(means, posterior, information_gain(prior, posterior))
    expected, mean = twin.fused_by_gain(means, prior, posterior)
    np.testing.assert_allclose(weights, expected, atol=1e-9)
    np.testing.assert_allclose(fused.mean, mean, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_covariance_intersection_of_two(seed):
    rng = np.random.default_rng(seed)
    n = 1 + seed % 3
    P = np.array([spd(rng, n), spd(rng, n)])
    means = rng.normal(size=(2, n))
    fused, omega = covariance_intersection(means, P)
    mean, covariance, best = twin.intersected(means, P)
    assert np.trace(fused.covariance) <= np.trace(covariance) + 1e-9
    assert np.trace(fused.covariance) == pytest.approx(np.trace(covariance), rel=1e-5)
    assert omega[0] == pytest.approx(best, abs=2e-3)
    np.testing.assert_allclose(fused.mean, mean, atol=2e-2)


@pytest.mark.parametrize("seed", range(5))
def test_residual_scale(seed):
    rng = np.random.default_rng(seed)
    values, scales = rng.normal(size=2 + seed), rng.uniform(0.1, 10.0, 2 + seed)
    fused = fuse_by_scale(values, scales)
    mean, variance = twin.fused_by_scale(values, scales)
    assert float(fused.estimate) == pytest.approx(mean, abs=1e-9)
    assert float(fused.variance) == pytest.approx(variance, rel=1e-9)
