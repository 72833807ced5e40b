"""Kinematics: against turning circles, and the order of the integration."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surefix.models.auv import Pose, advance, position_rate


def sail(steps, duration, velocity, rates):
    pose = Pose(np.zeros(3), np.array([0.1, -0.2, 0.3]))
    for _ in range(steps):
        pose = advance(pose, velocity, rates, duration / steps)
    return pose


def test_velocity_turns_with_the_vehicle():
    attitude = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    velocity = np.random.default_rng(1).normal(size=(20, 3))
    expected = Rotation.from_euler("ZYX", attitude[:, ::-1]).apply(velocity)
    assert position_rate(attitude, velocity) == pytest.approx(expected, abs=1e-14)


def test_constant_rates_end_where_the_exact_rotation_ends():
    rates, velocity, duration = np.array([0.02, -0.03, 0.05]), np.array([1.0, 0.1, 0.0]), 20.0
    begin = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1])
    time = (np.arange(20000) + 0.5) * duration / 20000
    turned = begin * Rotation.from_rotvec(time[:, None] * rates)
    position = turned.apply(velocity).sum(axis=0) * duration / 20000
    pose = sail(2000, duration, velocity, rates)
    end = (begin * Rotation.from_rotvec(duration * rates)).as_euler("ZYX")[::-1]
    assert pose.attitude == pytest.approx(end, abs=1e-6)
    assert pose.position == pytest.approx(position, abs=1e-5)


def test_half_the_step_is_a_quarter_of_the_error():
    truth = sail(4000, 20.0, [1.0, 0.0, 0.0], [0.0, 0.02, 0.1]).position
    errors = [
        np.linalg.norm(sail(n, 20.0, [1.0, 0.0, 0.0], [0.0, 0.02, 0.1]).position - truth)
        for n in (20, 40)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
