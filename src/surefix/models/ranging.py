"""What a platform of known position measures of a target: range, squared range, relative position.

Every measurement is a function of points (…, ≥ 3) whose first three components are the target's
position in m, so that it can be handed to `surefix.filters.sigma_point`; platforms broadcast
against the points. Jacobians are with respect to the position, for filters that linearise.
Source: paper 001, section 1.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.geo.rotation import body_to_earth, earth_to_body
from surefix.types import FloatArray

__all__ = [
    "locate",
    "range_jacobian",
    "range_to",
    "range_variance",
    "relative_jacobian",
    "relative_position",
    "squared_range",
    "squared_range_jacobian",
]


def range_to(points: ArrayLike, platform: ArrayLike) -> FloatArray:
    """Distance to each point, (…) m.

    >>> range_to([3.0, 4.0, 12.0], [0.0, 0.0, 0.0]).item()
    13.0
    """
    return np.sqrt(squared_range(points, platform))


def range_jacobian(points: ArrayLike, platform: ArrayLike) -> FloatArray:
    """Unit vector from the platform to each point, (…, 3); NaN where they coincide."""
    off = _offset(points, platform)
    distance = np.sqrt((off * off).sum(axis=-1, keepdims=True))
    return np.asarray(off / np.where(distance > 0.0, distance, np.nan))


def squared_range(points: ArrayLike, platform: ArrayLike) -> FloatArray:
    """Square of the distance to each point, (…) m²: what a travel time gives most directly."""
    off = _offset(points, platform)
    return np.asarray((off * off).sum(axis=-1))


def squared_range_jacobian(points: ArrayLike, platform: ArrayLike) -> FloatArray:
    """Twice the offset from the platform to each point, (…, 3) m."""
    return 2.0 * _offset(points, platform)


def range_variance(squared_variance: ArrayLike, range_m: ArrayLike) -> FloatArray:
    """Variance in m² of a range whose *square* was measured with a given variance.

    ``σ_d² = σ²_{d²} / (4d²)``, and never more than ``√(σ²_{d²})``: at short range the root of a
    noisy square cannot err by more than the root of its noise.

    Parameters
    ----------
    squared_variance
        (…) m⁴.
    range_m
        (…) m.

    Examples
    --------
    >>> (range_variance(2.5e7, 102.0) ** 0.5).round(1).item()
    24.5
    """
    variance = np.asarray(squared_variance, dtype=np.float64)
    least = np.sqrt(variance) / 4.0
    return np.asarray(variance / (4.0 * np.maximum(np.square(range_m), least)))


def relative_position(points: ArrayLike, platform: ArrayLike, attitude: ArrayLike) -> FloatArray:
    """Offset of each point from the platform in the platform's own axes, (…, 3) m.

    Parameters
    ----------
    points
        (…, ≥ 3).
    platform, attitude
        (…, 3) m in earth axes, and roll, pitch, yaw in rad.
    """
    turn = earth_to_body(attitude)
    return np.asarray((turn @ _offset(points, platform)[..., None])[..., 0])


def relative_jacobian(attitude: ArrayLike) -> FloatArray:
    """Jacobian of `relative_position`, (…, 3, 3): earth to body, wherever the target is."""
    return earth_to_body(attitude)


def locate(relative: ArrayLike, platform: ArrayLike, attitude: ArrayLike) -> FloatArray:
    """Position in earth axes of what was seen at ``relative`` in body axes, (…, 3) m.

    >>> locate([10.0, 0.0, 0.0], [1.0, 2.0, 3.0], [0.0, 0.0, np.pi / 2]).round(9).tolist()
    [1.0, 12.0, 3.0]
    """
    off = (body_to_earth(attitude) @ np.asarray(relative, dtype=np.float64)[..., None])[..., 0]
    return np.asarray(np.asarray(platform, dtype=np.float64) + off)


def _offset(points: ArrayLike, platform: ArrayLike) -> FloatArray:
    target = np.asarray(points, dtype=np.float64)[..., :3]
    return np.asarray(target - np.asarray(platform, dtype=np.float64))
