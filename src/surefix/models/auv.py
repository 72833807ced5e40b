"""Kinematics of an underwater vehicle: how its pose follows from velocities in its own axes.

Paper 001, section 1.1: ``ṗ = S(φ, θ, ψ) [u v w]ᵀ`` and the Euler rates of `surefix.geo.rotation`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.geo.rotation import body_to_earth, euler_rates
from surefix.types import FloatArray

__all__ = ["Pose", "advance", "position_rate"]


class Pose(NamedTuple):
    """Position in earth axes, (…, 3) m, and attitude: roll, pitch, yaw, (…, 3) rad."""

    position: FloatArray
    attitude: FloatArray


def position_rate(attitude: ArrayLike, body_velocity: ArrayLike) -> FloatArray:
    """Velocity in earth axes, (…, 3) m/s, of a vehicle that moves with (u, v, w) in its own.

    Parameters
    ----------
    attitude
        (…, 3) roll, pitch, yaw, rad.
    body_velocity
        (…, 3) surge, sway, heave, m/s.
    """
    surge = np.asarray(body_velocity, dtype=np.float64)
    return np.asarray((body_to_earth(attitude) @ surge[..., None])[..., 0])


def advance(pose: Pose, body_velocity: ArrayLike, body_rates: ArrayLike, dt: float) -> Pose:
    """Move a vehicle on by ``dt`` seconds at constant body velocity and rates (midpoint rule).

    Parameters
    ----------
    pose
        Where it starts.
    body_velocity, body_rates
        (…, 3) m/s and rad/s about the body axes.
    dt
        s; the error of a step is of order dt³.

    Examples
    --------
    >>> start = Pose(np.zeros(3), np.zeros(3))
    >>> for _ in range(100):  # a quarter of a circle of radius 10 m
    ...     start = advance(start, [1.0, 0.0, 0.0], [0.0, 0.0, 0.1], np.pi / 20)
    >>> start.position.round(2).tolist()
    [10.0, 10.0, 0.0]
    """
    halfway = pose.attitude + 0.5 * dt * euler_rates(pose.attitude, body_rates)
    return Pose(
        pose.position + dt * position_rate(halfway, body_velocity),
        pose.attitude + dt * euler_rates(halfway, body_rates),
    )
