"""Angles that wrap: reduced to one turn, continued across the seam, and their robust centre.

Every function takes the `period` of the angle, 360 for degrees or 2π for radians, so that the same
code serves longitudes, headings and bearings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.types import FloatArray

__all__ = ["circular_median", "unwrap", "wrap"]

TURN_DEG = 360.0


def wrap(angle: ArrayLike, period: float = TURN_DEG) -> FloatArray:
    """Reduce angles to −period/2 … period/2 (the upper end excluded); NaN and infinity give NaN.

    Angles that already lie there are returned unchanged, bit for bit.

    Parameters
    ----------
    angle
        (…) in the unit of `period`.
    period
        One turn: 360 for degrees, 2π for radians.

    Examples
    --------
    >>> wrap([190.0, -190.0, 180.0, 45.0, 720.5]).tolist()
    [-170.0, 170.0, -180.0, 45.0, 0.5]
    """
    given = np.asarray(angle, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        return np.asarray(given - period * np.floor(given / period + 0.5))


def unwrap(angle: ArrayLike, reference: ArrayLike, period: float = TURN_DEG) -> FloatArray:
    """Add whole turns to each angle so that it lies within half a turn of its reference.

    Parameters
    ----------
    angle, reference
        (…) in the unit of `period`; broadcast together.
    period
        One turn: 360 for degrees, 2π for radians.

    Examples
    --------
    >>> unwrap([-179.5, 0.1], [179.9, 359.9]).tolist()
    [180.5, 360.1]
    """
    given = np.asarray(angle, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        turns = np.floor((given - np.asarray(reference, dtype=np.float64)) / period + 0.5)
        return np.asarray(given - period * turns)


def circular_median(angle: ArrayLike, period: float = TURN_DEG) -> float:
    """Median of angles, whichever side of the seam they lie; NaN where none is finite.

    The circle is cut in the middle of its largest empty arc, and the ordinary median of the angles
    so laid out is taken: a minority of wild angles does not move it.

    Parameters
    ----------
    angle
        (n,) in the unit of `period`; angles that are not finite are left out.
    period
        One turn: 360 for degrees, 2π for radians.

    Examples
    --------
    >>> circular_median([178.0, 179.0, -179.0, -178.0, 3.0])
    179.0
    """
    given = np.ravel(np.asarray(angle, dtype=np.float64))
    turned = np.sort(np.mod(given[np.isfinite(given)], period))
    if turned.size == 0:
        return float("nan")
    arcs = np.diff(turned, append=turned[0] + period)
    start = turned[(int(np.argmax(arcs)) + 1) % turned.size]
    laid_out = np.where(turned < start, turned + period, turned)
    return float(wrap(np.median(laid_out), period))
