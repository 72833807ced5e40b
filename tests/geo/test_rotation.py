"""Rotations against SciPy, their derivatives against differences, and the poles of the attitude."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surefix.geo.rotation import attitude_along, body_to_earth, earth_to_body, euler_rates

ATTITUDES = np.random.default_rng(0).uniform([-3, -1.5, -3], [3, 1.5, 3], (40, 3))


def test_scipy_finds_the_same():
    expected = Rotation.from_euler("ZYX", ATTITUDES[:, ::-1]).as_matrix()
    assert body_to_earth(ATTITUDES) == pytest.approx(expected, abs=1e-14)


def test_inverse_undoes():
    both = body_to_earth(ATTITUDES) @ earth_to_body(ATTITUDES)
    assert both == pytest.approx(np.broadcast_to(np.eye(3), both.shape), abs=1e-14)
    assert np.linalg.det(body_to_earth(ATTITUDES)) == pytest.approx(np.ones(40))


def test_euler_rates_turn_the_matrix_as_body_rates_do():
    """``Ṡ = S [ω]×`` for the body rates ω."""
    omega = np.random.default_rng(1).normal(size=(40, 3))
    rates = euler_rates(ATTITUDES, omega)
    step = 1e-6
    numeric = (
        body_to_earth(ATTITUDES + step * rates) - body_to_earth(ATTITUDES - step * rates)
    ) / (2 * step)
    p, q, r = omega.T
    zero = np.zeros_like(p)
    cross = np.array([[zero, -r, q], [r, zero, -p], [-q, p, zero]]).transpose(2, 0, 1)
    assert numeric == pytest.approx(body_to_earth(ATTITUDES) @ cross, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_upright_has_no_rates_of_roll_and_yaw(pitch):
    rates = euler_rates([0.3, pitch, 0.1], [0.1, 0.2, 0.3])
    assert np.isnan(rates).tolist() == [True, False, True]
    assert rates[1] == pytest.approx(0.2 * np.cos(0.3) - 0.3 * np.sin(0.3))


def test_missing_attitude_gives_missing_matrix():
    assert np.isnan(body_to_earth([0.0, np.nan, 0.0])).any()


def test_bow_points_along_the_direction():
    direction = np.random.default_rng(2).normal(size=(30, 3))
    bow = body_to_earth(attitude_along(direction))[..., 0]
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    assert bow == pytest.approx(direction / length, abs=1e-14)
    assert attitude_along(direction)[:, 0].tolist() == [0.0] * 30
    assert attitude_along(np.zeros(3)).tolist() == [0.0, 0.0, 0.0]
