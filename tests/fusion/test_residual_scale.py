"""Fusion by residual scale: the weights of the paper, what is missing, and an honest variance."""

import numpy as np
import pytest

from surefix.errors import OptionsError
from surefix.filters.median_recursion import filter_medians, median_recursion
from surefix.fusion.residual_scale import fuse_by_scale, noise_gain


def test_weights_and_least_variance_are_the_papers():
    rng = np.random.default_rng(1)
    x, sigma = rng.standard_normal((4, 30, 2)), rng.uniform(0.1, 9.0, (4, 30, 2))
    fused = fuse_by_scale(x, sigma)
    weight = sigma**-2.0 / np.sum(sigma**-2.0, axis=0)
    np.testing.assert_allclose(fused.weight, weight, rtol=1e-12)
    np.testing.assert_allclose(fused.estimate, np.sum(weight * x, axis=0), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(fused.variance, 1.0 / np.sum(sigma**-2.0, axis=0), rtol=1e-12)


def test_no_other_weights_have_a_smaller_variance():
    sigma = np.array([1.0, 2.0, 5.0])
    best = fuse_by_scale(np.zeros(3), sigma)
    assert np.sum(best.weight**2 * sigma**2) == pytest.approx(float(best.variance))
    rng = np.random.default_rng(2)
    for weight in rng.dirichlet(np.ones(3), 200):
        assert np.sum(weight**2 * sigma**2) >= best.variance


@pytest.mark.parametrize("nothing", [np.nan, np.inf, 0.0, -1.0])
def test_a_scale_that_says_nothing_has_no_say(nothing):
    fused = fuse_by_scale([[1.0], [5.0]], [[nothing], [2.0]])
    assert fused.estimate.tolist() == [5.0]
    assert fused.variance.tolist() == [4.0]
    assert fused.weight.tolist() == [[0.0], [1.0]]


def test_missing_sources_and_nothing_at_all():
    fused = fuse_by_scale([[np.nan, np.nan], [2.0, np.nan]], [[1.0, 1.0], [3.0, 1.0]])
    np.testing.assert_array_equal(fused.estimate, [2.0, np.nan])
    np.testing.assert_array_equal(fused.variance, [9.0, np.nan])
    np.testing.assert_array_equal(fused.weight, [[0.0, 0.0], [1.0, 0.0]])


@pytest.mark.parametrize("window", [19, 39, 79])
@pytest.mark.parametrize("gain", [0.1, 0.2, 0.4])
def test_noise_gain_is_that_of_the_recursion(window, gain):
    options = median_recursion(window=window, gain=gain)
    y = np.random.default_rng(window).standard_normal((20_000, 2))
    _, found = filter_medians(options, y)
    error, residual = noise_gain(options)
    assert np.mean(found.estimate[200:] ** 2) == pytest.approx(error, rel=0.08)
    assert np.mean(found.residual[200:] ** 2) == pytest.approx(residual, rel=0.03)


def test_with_the_smoothing_counted_the_fused_variance_is_honest():
    """Two sources of different noise on three speeds; σ²min itself is an order too large."""
    options = median_recursion()
    error, residual = noise_gain(options)
    printed, honest = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        truth = np.arange(3000.0)[:, None] * np.array([0.0, -7.0, 300.0])
        both = [
            filter_medians(options, truth + sigma * rng.standard_normal(truth.shape))[1]
            for sigma in (1.0, 3.0)
        ]
        fused = fuse_by_scale([each.estimate for each in both], [each.scale for each in both])
        square = ((fused.estimate - truth) ** 2 / fused.variance)[200:]
        printed.append(square.mean())
        honest.append(square.mean() * residual / error)
    assert np.mean(printed) < 0.12
    assert np.mean(honest) == pytest.approx(1.15, abs=0.15)


@pytest.mark.parametrize(
    "options", [median_recursion("printed"), median_recursion(model="ca")], ids=["printed", "ca"]
)
def test_noise_gain_of_other_forms_is_refused(options):
    with pytest.raises(OptionsError, match="feedback"):
        noise_gain(options)
