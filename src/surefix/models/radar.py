"""What a radar sees: range, azimuth and elevation about its site, and back to metres.

Azimuth is clockwise from the y axis of the site (north), elevation up from its horizontal plane:

    x = r cos ε sin θ,   y = r cos ε cos θ,   z = r sin ε.

A site has its place and its axes in a common frame, so that several radars measure one target. Over
distances at which the Earth is not flat the axes of each site are its own horizon; the common frame
may then be any Cartesian one.

Source: Bar-Shalom, Li and Kirubarajan 2001, *Estimation with Applications to Tracking and
Navigation*, section 10.4; Longbin, Xiaoquan, Yiyu, Kang and Bar-Shalom 1998, *Unbiased converted
measurements for tracking*, IEEE Trans. AES 34, 1023–1027.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.geo.angle import wrap
from surefix.types import FloatArray

__all__ = [
    "Site",
    "polar_difference",
    "polar_jacobian",
    "site",
    "to_cartesian",
    "to_polar",
    "unbiased",
]


class Site(NamedTuple):
    """Where a radar stands.

    Parameters
    ----------
    position
        (3,) m in the common frame.
    axes
        (3, 3) columns: the site's east, north and up in the common frame.
    """

    position: FloatArray
    axes: FloatArray


def site(position: ArrayLike, axes: ArrayLike | None = None) -> Site:
    """Place a radar; without ``axes`` its axes are those of the common frame."""
    turned = np.eye(3) if axes is None else np.array(axes, dtype=np.float64)
    return Site(np.array(position, dtype=np.float64), turned)


def to_cartesian(polar: ArrayLike, at: Site) -> FloatArray:
    """Positions in the common frame.

    Parameters
    ----------
    polar
        (…, 3) range m, azimuth rad, elevation rad; NaN is missing.
    at
        The radar.

    Examples
    --------
    >>> to_cartesian([1000.0, np.pi / 2, 0.0], site([0.0, 5.0, 0.0])).round(6).tolist()
    [1000.0, 5.0, 0.0]
    """
    r, azimuth, elevation = np.moveaxis(np.asarray(polar, dtype=np.float64), -1, 0)
    flat = r * np.cos(elevation)
    own = [flat * np.sin(azimuth), flat * np.cos(azimuth), r * np.sin(elevation)]
    return np.asarray(np.stack(own, axis=-1) @ at.axes.T + at.position)


def to_polar(position: ArrayLike, at: Site) -> FloatArray:
    """What the radar would measure without errors.

    Parameters
    ----------
    position
        (…, 3) m in the common frame; NaN is missing.
    at
        The radar.

    Returns
    -------
    polar
        (…, 3) range m, azimuth in 0 … 2π, elevation. At the site itself both angles are 0.
    """
    own = (np.asarray(position, dtype=np.float64) - at.position) @ at.axes
    x, y, z = np.moveaxis(own, -1, 0)
    flat = np.hypot(x, y)
    azimuth = np.mod(np.arctan2(x, y), 2.0 * math.pi)
    return np.stack([np.hypot(flat, z), azimuth, np.arctan2(z, flat)], axis=-1)


def polar_difference(one: ArrayLike, two: ArrayLike) -> FloatArray:
    """``one − two``, (…, 3) in m and rad, the azimuth reduced to ±π."""
    off = np.array(np.asarray(one, dtype=np.float64) - np.asarray(two, dtype=np.float64))
    off[..., 1] = wrap(off[..., 1], 2.0 * math.pi)
    return off


def polar_jacobian(polar: ArrayLike, at: Site) -> FloatArray:
    """Derivative of `to_cartesian`, (…, 3, 3): rows x, y, z, columns range, azimuth, elevation."""
    r, azimuth, elevation = np.moveaxis(np.asarray(polar, dtype=np.float64), -1, 0)
    sa, ca, se, ce = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    zero = np.zeros_like(r * sa)
    rows = [
        [ce * sa, r * ce * ca, -r * se * sa],
        [ce * ca, -r * ce * sa, -r * se * ca],
        [se, zero, r * ce],
    ]
    own = np.moveaxis(np.array(rows, dtype=np.float64), (0, 1), (-2, -1))
    return np.asarray(at.axes @ own)


def unbiased(polar: ArrayLike, sigma: ArrayLike, at: Site) -> tuple[FloatArray, FloatArray]:
    """Positions without the bias of the conversion, and their covariances.

    Angular noise shortens the converted position, on average by λ = exp(−σ²/2) an angle. It is
    divided by λ, and the covariance is that of the error given the measurement, to all orders in σ
    (modified unbiased conversion; noises are normal and independent).

    Parameters
    ----------
    polar
        (n, 3) measured range m, azimuth rad, elevation rad.
    sigma
        (3,) or (n, 3) standard deviations in m, rad, rad.
    at
        The radar.

    Returns
    -------
    position, covariance
        (n, 3) m and (n, 3, 3) m² in the common frame.
    """
    measured = np.asarray(polar, dtype=np.float64)
    sr, sa, se = np.moveaxis(np.broadcast_to(np.asarray(sigma, float), measured.shape), -1, 0)
    r, azimuth, elevation = np.moveaxis(measured, -1, 0)
    la, le = np.exp(-0.5 * sa**2), np.exp(-0.5 * se**2)
    shrink = np.stack([la * le, la * le, le], axis=-1)
    flat = site(np.zeros(3))
    raw = to_cartesian(measured, flat)
    own, expected = raw / shrink, raw * shrink
    # second moment of the true position given the measurement
    square = r**2 + sr**2
    c2a, s2a = la**4 * np.cos(2.0 * azimuth), la**4 * np.sin(2.0 * azimuth)
    c2e, s2e = le**4 * np.cos(2.0 * elevation), le**4 * np.sin(2.0 * elevation)
    xx, yy = 0.25 * square * (1.0 - c2a) * (1.0 + c2e), 0.25 * square * (1.0 + c2a) * (1.0 + c2e)
    xy, zz = 0.25 * square * s2a * (1.0 + c2e), 0.5 * square * (1.0 - c2e)
    xz, yz = 0.5 * square * la * np.sin(azimuth) * s2e, 0.5 * square * la * np.cos(azimuth) * s2e
    moment = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), (0, 1), (-2, -1))
    cross = own[..., :, None] * expected[..., None, :]
    both = own[..., :, None] * own[..., None, :]
    covariance = both - cross - cross.swapaxes(-1, -2) + moment
    position = own @ at.axes.T + at.position
    return np.asarray(position), np.asarray(at.axes @ covariance @ at.axes.T)
