"""Polar and Cartesian coordinates of a radar, their derivatives, and the unbiased conversion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surefix.models.radar import (
    polar_difference,
    polar_jacobian,
    site,
    to_cartesian,
    to_polar,
    unbiased,
)

TILTED = site([1e4, -2e4, 300.0], Rotation.from_euler("zyx", [0.7, 0.2, -0.1]).as_matrix())


def drawn(n=200, seed=1):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.uniform(1e2, 1e5, n), rng.uniform(0, 2 * np.pi, n), rng.uniform(-1.4, 1.4, n)]
    )


@pytest.mark.parametrize(
    ("polar", "xyz"),
    [
        ([100.0, 0.0, 0.0], [0.0, 100.0, 0.0]),
        ([100.0, np.pi / 2, 0.0], [100.0, 0.0, 0.0]),
        ([100.0, np.pi, 0.0], [0.0, -100.0, 0.0]),
        ([100.0, 3 * np.pi / 2, 0.0], [-100.0, 0.0, 0.0]),
        ([100.0, 1.0, np.pi / 2], [0.0, 0.0, 100.0]),
    ],
)
def test_azimuth_is_clockwise_from_north_and_elevation_up(polar, xyz):
    np.testing.assert_allclose(to_cartesian(polar, site([0.0, 0.0, 0.0])), xyz, atol=1e-12)


@pytest.mark.parametrize("at", [site([0.0, 0.0, 0.0]), TILTED])
def test_there_and_back(at):
    polar = drawn()
    np.testing.assert_allclose(to_polar(to_cartesian(polar, at), at), polar, rtol=1e-9)


def test_the_site_itself_has_no_direction():
    assert to_polar(TILTED.position, TILTED).tolist() == [0.0, 0.0, 0.0]


def test_missing_stays_missing():
    assert np.isnan(to_cartesian([np.nan, 1.0, 0.1], TILTED)).all()
    assert np.isnan(to_polar([np.nan, 1.0, 0.1], TILTED)).all()
    position, covariance = unbiased([[np.nan, 1.0, 0.1]], [1.0, 0.01, 0.01], TILTED)
    assert np.isnan(position).all()
    assert np.isnan(covariance).all()


def test_azimuths_differ_across_north():
    one, two = [10.0, 0.01, 0.0], [10.0, 2 * np.pi - 0.01, 0.0]
    np.testing.assert_allclose(polar_difference(one, two), [0.0, 0.02, 0.0], atol=1e-12)
    np.testing.assert_allclose(polar_difference(two, one), [0.0, -0.02, 0.0], atol=1e-12)


@pytest.mark.parametrize("at", [site([0.0, 0.0, 0.0]), TILTED])
def test_jacobian_is_the_derivative(at):
    polar = drawn(20)
    steps = np.array([1.0, 1e-6, 1e-6])
    for i in range(3):
        step = np.zeros(3)
        step[i] = steps[i]
        ahead, behind = to_cartesian(polar + step, at), to_cartesian(polar - step, at)
        numeric = (ahead - behind) / (2 * steps[i])
        np.testing.assert_allclose(polar_jacobian(polar, at)[..., i], numeric, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("angle", [0.002, 0.02, 0.06])
def test_conversion_is_unbiased_and_its_covariance_honest(angle):
    truth = np.array([5e4, 5.8, 0.3])
    sigma = np.array([30.0, angle, 0.7 * angle])
    n = 100_000
    draws = sigma * np.random.default_rng(3).standard_normal((n, 3))
    position, covariance = unbiased(truth + draws, sigma, TILTED)
    error = position - to_cartesian(truth, TILTED)
    assert (np.abs(error.mean(axis=0)) < 4.0 * error.std(axis=0) / np.sqrt(n)).all()
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
    assert nees.mean() == pytest.approx(3.0, abs=0.04)
    plain = to_cartesian(truth + draws, TILTED) - to_cartesian(truth, TILTED)
    if angle > 0.05:
        assert (np.abs(plain.mean(axis=0)) > 4.0 * plain.std(axis=0) / np.sqrt(n)).any()


def test_for_small_noise_it_is_the_linear_covariance():
    polar, sigma = drawn(50), np.array([1.0, 1e-5, 1e-5])
    position, covariance = unbiased(polar, sigma, TILTED)
    J = polar_jacobian(polar, TILTED)
    linear = J @ np.diag(sigma**2) @ J.swapaxes(-1, -2)
    size = np.sqrt(np.einsum("nii,njj->nij", linear, linear))
    assert (np.abs(covariance - linear) / size).max() < 1e-4
    np.testing.assert_allclose(position, to_cartesian(polar, TILTED), atol=1e-4)
