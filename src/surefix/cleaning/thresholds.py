"""Thresholds from what a vessel can do: how far a quantity may move from one sample to the next.

Paper 003, section 2: for positions T = V_max/R (radians, samples 1 s apart), for velocities
T = a_max·Δt, for attitude T = ω_max·Δt. The paper uses one T for latitude and longitude, which is
too tight for longitudes away from the equator: at 60° a second at V_max is twice as much longitude.
Here each has its own, with the radii of curvature of WGS-84, and Δt may vary.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.types import FloatArray

__all__ = ["position_thresholds", "rate_threshold", "spacing"]

_A = 6_378_137.0  # m, WGS-84
_E2 = 6.694379990141316e-3


def spacing(time: ArrayLike) -> FloatArray:
    """Time from each sample to its farther neighbour, (n,) s.

    The farther one, because a running mean over a gap moves by a share of the gap: a sample beside
    a gap must not fall to a threshold made for the usual step. Steps that are unknown or do not
    advance count as the median step; with fewer than two known times all are NaN.

    Parameters
    ----------
    time
        (n,) s.

    Examples
    --------
    >>> spacing([0.0, 1.0, 2.0, 10.0, 11.0]).tolist()
    [1.0, 1.0, 8.0, 8.0, 1.0]
    """
    steps = np.diff(np.asarray(time, dtype=np.float64))
    with np.errstate(invalid="ignore"):
        good = steps > 0.0
    if not good.any():
        return np.full(steps.size + 1, np.nan)
    steps = np.where(good, steps, np.median(steps[good]))
    return np.asarray(np.maximum(np.append(steps[0], steps), np.append(steps, steps[-1])))


def rate_threshold(time: ArrayLike, rate: float) -> FloatArray:
    """Threshold of a quantity whose rate of change is bounded: ``rate`` · Δt, (n,).

    For a velocity the rate is the greatest acceleration, for an attitude or a heading the greatest
    angular rate.

    Parameters
    ----------
    time
        (n,) s.
    rate
        Greatest change per second, in the unit of the quantity.
    """
    return rate * spacing(time)


def position_thresholds(
    time: ArrayLike, latitude: ArrayLike, max_speed: float
) -> tuple[FloatArray, FloatArray]:
    """Thresholds of latitude and longitude, V_max·Δt/M and V_max·Δt/(N cos φ), (n,) rad each.

    M and N are the radii of curvature of the ellipsoid in the meridian and across it. The latitude
    used is the median of the series: its single values may be wild. The threshold of the longitude
    never exceeds π, so that near a pole it only ceases to find anything.

    Parameters
    ----------
    time
        (n,) s.
    latitude
        (n,) rad; NaN is left out.
    max_speed
        V_max, m/s.

    Examples
    --------
    >>> north, east = position_thresholds([0.0, 1.0], np.radians([60.0, 60.0]), 10.0)
    >>> round(float(east[0] / north[0]), 3)
    1.997
    """
    phi = np.asarray(latitude, dtype=np.float64)
    known = phi[np.isfinite(phi)]
    middle = float(np.median(known)) if known.size else float("nan")
    bend = 1.0 - _E2 * np.sin(middle) ** 2
    meridian = _A * (1.0 - _E2) / bend**1.5
    parallel = max(_A / np.sqrt(bend) * np.cos(middle), max_speed / np.pi)
    reach = rate_threshold(time, max_speed)
    return reach / meridian, np.minimum(reach / parallel, np.pi)
