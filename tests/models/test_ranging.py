"""Ranging: values by hand, Jacobians against differences, what coincidence and NaN give."""

import numpy as np
import pytest

from surefix.models import ranging as r

RNG = np.random.default_rng(3)
POINTS, PLATFORM = RNG.normal(0, 50, (20, 3)), np.array([5.0, -3.0, 20.0])
ATTITUDE = np.array([0.2, -0.4, 2.0])


def differences(function, points):
    step = 1e-4
    columns = [
        (function(points + step * axis) - function(points - step * axis)) / (2 * step)
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(
    ("function", "jacobian"),
    [
        (lambda p: r.range_to(p, PLATFORM), r.range_jacobian(POINTS, PLATFORM)),
        (lambda p: r.squared_range(p, PLATFORM), r.squared_range_jacobian(POINTS, PLATFORM)),
        (
            lambda p: r.relative_position(p, PLATFORM, ATTITUDE),
            np.broadcast_to(r.relative_jacobian(ATTITUDE), (20, 3, 3)),
        ),
    ],
)
def test_jacobians_are_the_derivatives(function, jacobian):
    assert differences(function, POINTS) == pytest.approx(jacobian, rel=1e-6, abs=1e-6)


def test_only_the_position_of_a_longer_state_counts():
    state = np.hstack((POINTS, RNG.normal(size=(20, 3))))
    assert (r.range_to(state, PLATFORM) == r.range_to(POINTS, PLATFORM)).all()


def test_locate_undoes_the_relative_position():
    seen = r.relative_position(POINTS, PLATFORM, ATTITUDE)
    assert r.locate(seen, PLATFORM, ATTITUDE) == pytest.approx(POINTS)
    assert np.linalg.norm(seen, axis=-1) == pytest.approx(r.range_to(POINTS, PLATFORM))


def test_a_target_on_the_platform_has_no_direction():
    assert r.range_to(PLATFORM, PLATFORM) == 0.0
    assert np.isnan(r.range_jacobian(PLATFORM, PLATFORM)).all()


def test_variance_of_the_root_of_a_noisy_square():
    """At long range it is that of the linearisation; at no range it exceeds the root of R."""
    noise = np.sqrt(2.5e7) * RNG.standard_normal(200_000)
    for distance in (250.0, 500.0):
        drawn = np.sqrt(np.maximum(distance**2 + noise, 0.0)).var()
        assert r.range_variance(2.5e7, distance) == pytest.approx(drawn, rel=0.03)
    near = r.range_variance(2.5e7, np.array([0.0, 1.0, 20.0]))
    assert near == pytest.approx(np.full(3, 5000.0))
    assert np.isnan(r.range_variance(2.5e7, np.nan))
