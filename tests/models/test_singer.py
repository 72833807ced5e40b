"""Singer's model: exact for any αT, the limits, and the variance that follows the mean."""

import numpy as np
import pytest
from scipy.integrate import quad

from reference import singer as textbook
from surefix.errors import OptionsError
from surefix.models.motion import noise_factor, transition
from surefix.models.singer import rayleigh_variance, singer


def close(one, two, rtol):
    """Entries agree relative to themselves, unless they are nothing beside the largest."""
    np.testing.assert_allclose(one, two, rtol=rtol, atol=1e-14 * np.abs(two).max())


@pytest.mark.parametrize("x", [0.0, 1e-8, 1e-4, 0.0025, 0.1, 0.5, 0.999, 1.0, 1.001, 2.0, 4.0])
@pytest.mark.parametrize("dt", [0.05, 1.0, 12.0])
def test_it_is_van_loans(x, dt):
    model = singer(x / dt, dt)
    for part, expected in zip(model[1:], textbook.singer(x / dt, dt), strict=True):
        close(part, expected, 1e-9)


@pytest.mark.parametrize("x", [1e-3, 0.7, 1.3, 10.0, 40.0])
def test_noise_is_the_integral_of_the_response(x):
    a = x
    g = (
        lambda s: (a * s - 1 + np.exp(-a * s)) / a**2,
        lambda s: (1 - np.exp(-a * s)) / a,
        lambda s: np.exp(-a * s),
    )
    expected = [[quad(lambda s, u=u, v=v: u(s) * v(s), 0, 1)[0] for v in g] for u in g]
    np.testing.assert_allclose(singer(a, 1.0).noise, expected, rtol=1e-6)


def test_without_forgetting_it_is_constant_acceleration():
    model = singer(0.0, 0.3)
    close(model.transition, transition("ca", 1, 0.3), 1e-14)
    G = noise_factor("ca", 1, 0.3, 1.0)
    close(model.noise, G @ G.T, 1e-12)
    assert (model.mean_input == 0.0).all()


@pytest.mark.parametrize("alpha", [1e-9, 0.01, 0.3, 5.0, 100.0])
def test_the_mean_is_carried_on_as_constant_acceleration(alpha):
    model = singer(alpha, 0.7)
    forward = model.transition + np.outer(model.mean_input, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(forward, transition("ca", 1, 0.7), rtol=1e-12)


@pytest.mark.parametrize("x", [1e-6, 0.01, 0.99, 1.01, 30.0])
def test_noise_is_a_covariance(x):
    noise = singer(x, 1.0).noise
    np.testing.assert_array_equal(noise, noise.T)
    assert np.linalg.eigvalsh(noise).min() > 0.0


def test_two_half_steps_are_one_step():
    alpha = 0.4
    whole, half = singer(alpha, 2.0), singer(alpha, 1.0)
    F = half.transition
    np.testing.assert_allclose(F @ F, whole.transition, rtol=1e-12)
    np.testing.assert_allclose(F @ half.noise @ F.T + half.noise, whole.noise, rtol=1e-12)
    np.testing.assert_allclose(F @ half.mean_input + half.mean_input, whole.mean_input, rtol=1e-12)


def test_variance_of_the_acceleration():
    assert rayleigh_variance(0.0, 10.0) == pytest.approx((4 - np.pi) / np.pi * 100.0)
    assert rayleigh_variance(4.0, 10.0) == rayleigh_variance(-4.0, 10.0)
    assert rayleigh_variance(12.0, 10.0) == 0.0


@pytest.mark.parametrize(("alpha", "dt"), [(-1.0, 1.0), (np.nan, 1.0), (1.0, 0.0), (np.inf, 1.0)])
def test_what_cannot_be_is_refused(alpha, dt):
    with pytest.raises(OptionsError, match="alpha ≥ 0"):
        singer(alpha, dt)
