"""Rotations between the axes of a vehicle and those of the earth.

An attitude is (roll φ, pitch θ, yaw ψ) in radians, and ``S = R_z(ψ) R_y(θ) R_x(φ)`` turns body
components into earth components (paper 001, section 1.1). All axes are right-handed; yaw is counted
from the earth's first axis towards its second. With z down (x north, y east) that makes ψ the
heading and a positive θ bow up; with z up (x east, y north) ψ is counted counter-clockwise from
east and a positive θ is bow down.

Source: Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2011, section 2.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.types import FloatArray

__all__ = ["attitude_along", "body_to_earth", "earth_to_body", "euler_rates"]

_GIMBAL_LOCK = 1e-9  # cos θ below which roll and yaw cannot be told apart


def body_to_earth(attitude: ArrayLike) -> FloatArray:
    """Give S, (…, 3, 3), that turns body components into earth components.

    Parameters
    ----------
    attitude
        (…, 3) roll, pitch, yaw, rad.

    Examples
    --------
    >>> S = body_to_earth([0.0, 0.0, np.pi / 2])
    >>> (S @ [1.0, 0.0, 0.0]).round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    roll, pitch, yaw = np.moveaxis(np.asarray(attitude, dtype=np.float64), -1, 0)
    cf, sf, ct, st, cp, sp = (
        np.cos(roll),
        np.sin(roll),
        np.cos(pitch),
        np.sin(pitch),
        np.cos(yaw),
        np.sin(yaw),
    )
    rows = (
        (cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf),
        (sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf),
        (-st, ct * sf, ct * cf),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def earth_to_body(attitude: ArrayLike) -> FloatArray:
    """Give the inverse of `body_to_earth`, which is its transpose, (…, 3, 3)."""
    return body_to_earth(attitude).mT


def euler_rates(attitude: ArrayLike, body_rates: ArrayLike) -> FloatArray:
    """Turn angular rates about the body axes into rates of roll, pitch and yaw.

    ``φ̇ = p + (q sin φ + r cos φ) tan θ``, ``θ̇ = q cos φ − r sin φ``,
    ``ψ̇ = (q sin φ + r cos φ) / cos θ``.

    Parameters
    ----------
    attitude
        (…, 3) roll, pitch, yaw, rad.
    body_rates
        (…, 3) p, q, r about the body's x, y, z, rad/s.

    Returns
    -------
    rates
        (…, 3) rad/s. At θ = ±90° roll and yaw turn about one line and have no rates of their own:
        they are NaN there.

    Examples
    --------
    >>> euler_rates([0.0, 0.0, 1.0], [0.1, 0.2, 0.3]).tolist()
    [0.1, 0.2, 0.3]
    """
    roll, pitch = np.moveaxis(np.asarray(attitude, dtype=np.float64), -1, 0)[:2]
    p, q, r = np.moveaxis(np.asarray(body_rates, dtype=np.float64), -1, 0)
    upright = np.cos(pitch)
    secant = 1.0 / np.where(np.abs(upright) > _GIMBAL_LOCK, upright, np.nan)
    yawing = (q * np.sin(roll) + r * np.cos(roll)) * secant
    rolling = p + yawing * np.sin(pitch)
    return np.stack([rolling, q * np.cos(roll) - r * np.sin(roll), yawing], axis=-1)


def attitude_along(direction: ArrayLike) -> FloatArray:
    """Give the attitude without roll whose body x axis points along a direction.

    Parameters
    ----------
    direction
        (…, 3) in earth axes, any length; zero gives level at yaw 0.

    Examples
    --------
    >>> np.degrees(attitude_along([1.0, 1.0, 0.0])).round(9).tolist()
    [0.0, 0.0, 45.0]
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    pitch = np.arctan2(-z, np.hypot(x, y)) + 0.0
    return np.stack([np.zeros_like(x), pitch, np.arctan2(y, x)], axis=-1)
