"""Information gain: the paper's figures, sampled entropy, what no gain gives, honest covariance."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from reference import track_fusion as textbook
from surefix.fusion.information_gain import (
    entropy,
    fuse_by_gain,
    gain_weights,
    information_gain,
)
from surefix.fusion.track import weighted_mean

RNG = np.random.default_rng(0)


def covariances(*shape, n=3):
    A = RNG.normal(size=(*shape, n, n + 2))
    return A @ A.swapaxes(-1, -2)


def test_weights_of_the_papers_table():
    weights = gain_weights(np.array([0.1385, 0.1764, 0.1421]))
    assert weights == pytest.approx([0.3031, 0.3860, 0.3109], abs=5e-5)


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_entropy_is_that_of_scipy(n):
    P = covariances(4, n=n)
    expected = [multivariate_normal(cov=one).entropy() for one in P]
    assert entropy(P) == pytest.approx(expected, rel=1e-12)
    assert entropy(P) == pytest.approx(
        0.5 * np.log(2 * np.pi * np.e * np.linalg.eigvalsh(P)).sum(axis=-1)
    )


def test_gain_is_the_difference_of_the_entropies_and_any_size_of_unit():
    prior, posterior = covariances(5), covariances(5)
    gain = information_gain(prior, posterior)
    assert gain == pytest.approx(entropy(prior) - entropy(posterior))
    assert information_gain(1e-9 * prior, 1e-9 * posterior) == pytest.approx(gain)


@pytest.mark.parametrize(
    ("gains", "expected"),
    [
        ([1.0, 3.0], [0.25, 0.75]),
        ([0.0, 0.0], [0.5, 0.5]),
        ([-1.0, -2.0, -3.0], [1 / 3, 1 / 3, 1 / 3]),
        ([-1.0, 2.0], [0.0, 1.0]),
        ([np.nan, 2.0, 2.0], [0.0, 0.5, 0.5]),
        ([np.nan, 0.0], [0.0, 1.0]),
        ([np.nan, np.nan], [np.nan, np.nan]),
    ],
)
def test_weights_where_nothing_was_gained_or_known(gains, expected):
    assert gain_weights(np.array(gains)) == pytest.approx(expected, nan_ok=True)
    assert gain_weights(np.array([gains, gains])).shape == (2, len(gains))


def test_singular_covariance_gives_no_weight_of_infinity():
    gain = information_gain(np.eye(2), np.diag([1.0, 0.0]))
    assert gain == np.inf
    assert gain_weights(np.array([gain, 1.0])).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("seed", range(5))
def test_fused_covariance_with_cross_covariances_is_exact(seed):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(9, 12))
    joint = (A @ A.T).reshape(3, 3, 3, 3).swapaxes(1, 2)
    P, means = np.array([joint[i, i] for i in range(3)]), rng.normal(size=(3, 3))
    gain = rng.uniform(0.1, 1.0, 3)
    fused, weight = fuse_by_gain(means, P, gain, joint)
    mean, covariance = textbook.combination(means, joint, gain / gain.sum())
    assert weight == pytest.approx(gain / gain.sum())
    assert fused.mean == pytest.approx(mean, rel=1e-12)
    assert fused.covariance == pytest.approx(covariance, rel=1e-12)
    bound, _ = fuse_by_gain(means, P, gain)
    assert np.linalg.eigvalsh(bound.covariance - covariance).min() > -1e-12


def test_bound_is_reached_by_equal_errors():
    P = covariances()
    joint = np.broadcast_to(P, (4, 4, 3, 3))
    alike = np.broadcast_to(P, (4, 3, 3))
    args = np.zeros((4, 3)), alike, np.array([1.0, 2.0, 3.0, 4.0])
    assert weighted_mean(*args).covariance == pytest.approx(weighted_mean(*args, joint).covariance)


def test_missing_source_is_left_out():
    means, P = RNG.normal(size=(3, 2)), covariances(3, n=2)
    joint = np.zeros((3, 3, 2, 2))
    for i in range(3):
        joint[i, i] = P[i]
    gone = means.copy()
    gone[1] = np.nan
    for cross in (None, joint):
        fused = weighted_mean(gone, P, np.ones(3), cross)
        rest = [0, 2]
        part = None if cross is None else joint[np.ix_(rest, rest)]
        expected = weighted_mean(means[rest], P[rest], np.ones(2), part)
        assert fused.mean == pytest.approx(expected.mean)
        assert fused.covariance == pytest.approx(expected.covariance)
        none = weighted_mean(np.full((3, 2), np.nan), P, np.ones(3), cross)
        assert np.isnan(none.mean).all()
        assert np.isnan(none.covariance).all()
