"""Series that share their covariances: found from the data, with the figures of each by itself."""

import numpy as np
import pytest

from surefix.filters.kalman import Gaussian, gaussian
from surefix.filters.linear import filter_linear
from surefix.robust.loss import loss_named

SIZES = [(1, 1), (4, 2), (6, 6), (20, 3)]


def problem(seed, n, m, count=25, series=70):
    """Matrices that change with every step, correlated noise, the same gaps in all series."""
    rng = np.random.default_rng([seed, n, m])
    F = np.eye(n) + 0.3 * rng.standard_normal((count, n, n)) / np.sqrt(n)
    F /= np.maximum(1.0, np.abs(np.linalg.eigvals(F)).max(axis=1))[:, None, None]
    A, B = rng.standard_normal((count, n, n)), rng.standard_normal((count, m, m + 1))
    R = 0.3 * B @ np.swapaxes(B, 1, 2) + 0.2 * np.eye(m)
    z = 5.0 * rng.standard_normal((series, count, m))
    z[:, rng.random((count, m)) < 0.2] = np.nan
    z[:, 7] = np.inf
    x = gaussian(rng.standard_normal(n), np.eye(n))
    return x, z, F, 0.1 * A @ np.swapaxes(A, 1, 2), rng.standard_normal((count, m, n)), R


def shared(found):
    return found.covariance.strides[0] == 0 and found.weight.strides[0] == 0


def assert_each_by_itself(found, x, z, *model):
    for t, one in enumerate(z):
        start = x if x.mean.ndim == 1 else Gaussian(x.mean[t], x.factor[t])
        for field, among in zip(filter_linear(start, one, *model), found, strict=True):
            np.testing.assert_allclose(among[t], field, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(("n", "m"), SIZES)
def test_equal_gaps_share_covariances(n, m):
    x, z, *model = problem(1, n, m)
    found = filter_linear(x, z, *model)
    assert shared(found)
    assert not found.covariance.flags.writeable
    assert_each_by_itself(found, x, z, *model)


@pytest.mark.parametrize("ratio", [1e5, 1e10])
def test_vague_priors_share_covariances_too(ratio):
    x, z, F, Q, H, R = problem(2, 4, 2)
    found = filter_linear(gaussian(x.mean, ratio * np.eye(4)), z, F[0], Q[0], H[0], 0.1 * R[0])
    assert shared(found)
    start = gaussian(x.mean, ratio * np.eye(4))
    assert_each_by_itself(found, start, z, F[0], Q[0], H[0], 0.1 * R[0])


def test_means_may_begin_anywhere():
    x, z, *model = problem(3, 4, 2, series=9)
    means = np.random.default_rng(3).standard_normal((9, 4))
    whole = Gaussian(means, np.broadcast_to(x.factor, (9, 4, 4)))
    found = filter_linear(whole, z, *model)
    assert shared(found)
    assert_each_by_itself(found, whole, z, *model)


@pytest.mark.parametrize("other", ["gap", "covariance", "mean", "loss"])
def test_what_is_not_alike_is_not_shared(other):
    x, z, *model = problem(4, 4, 2, series=9)
    means, factors = np.tile(x.mean, (9, 1)), np.tile(x.factor, (9, 1, 1))
    loss = None
    if other == "gap":
        seen = np.argwhere(np.isfinite(z[5]))[-1]
        z[5, *seen] = np.nan
    elif other == "covariance":
        factors[5] *= 1.0 + 1e-15
    elif other == "mean":
        means[5, 0] = np.nan
    else:
        loss = loss_named("igg3")
    found = filter_linear(Gaussian(means, factors), z, *model, loss)
    assert found.covariance.strides[0] != 0
    assert found.covariance.flags.writeable
    assert_each_by_itself(found, Gaussian(means, factors), z, *model, loss)
