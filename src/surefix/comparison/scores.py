"""How well fixes that a method did not get were foretold, gross errors among them."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from scipy.special import gammaln

from surefix.comparison.leave_out import Held
from surefix.filters.noise import difference_scale
from surefix.geo.local_frame import LocalFrame, origin_of
from surefix.types import Cleaned, FloatArray, IntArray

__all__ = ["GROSS_SHARE", "Yardstick", "foretold", "log_density", "off_and_sigma", "yardstick"]

GROSS_SHARE: Final = 0.05
"""Share of gross errors in the mixture that every method is scored under."""
_GROSS_SCALE: Final = 10.0  # scale of their Cauchy density over that of the noise
_LEAST_M: Final = 1e-3


class Yardstick(NamedTuple):
    """What the fixes of a log are measured by; it does not depend on the method.

    Parameters
    ----------
    frame
        Where distances are taken; None for metric input.
    axes
        East and north where they were observed, else the height.
    place
        (k, a) the fixes that can be left out, m.
    scale
        Of the Cauchy density of gross errors, m.
    extent
        Distance of the farthest fix from the middle, m: what a fix counts that nothing foretells.
    """

    frame: LocalFrame | None
    axes: list[int]
    place: FloatArray
    scale: float
    extent: float


def yardstick(cleaned: Cleaned, held: Held) -> Yardstick:
    """Take the measure of a log.

    Parameters
    ----------
    cleaned
        The whole log, cleaned by any method.
    held
        From `surefix.comparison.leave_out.fixes_of`.
    """
    rows = held.row
    flat = [i for i in (0, 1) if np.isfinite(cleaned.raw_position[rows, i]).any()]
    axes, frame = flat or [2], None
    if flat and cleaned.track.geodetic is not None:
        latitude, longitude = cleaned.raw_coordinates[rows, :2].T
        frame = origin_of(latitude, longitude)
        east, north, _ = frame.to_local(latitude, longitude)
        place = np.column_stack([east, north])
    else:
        place = cleaned.raw_position[rows][:, axes]
    time, scales = cleaned.track.time[rows], []
    for column in place.T:
        seen = np.isfinite(column) & np.isfinite(time)
        scales.append(difference_scale(time[seen], column[seen]))
    finite = [each for each in scales if np.isfinite(each)]
    off = np.linalg.norm(place - np.nanmedian(place, axis=0), axis=1) if len(rows) else np.zeros(1)
    scale = _GROSS_SCALE * max([*finite, _LEAST_M])
    return Yardstick(frame, axes, place, scale, float(max(np.nanmax(off, initial=0.0), scale)))


def off_and_sigma(
    measure: Yardstick, whole: Cleaned, held: Held, fixes: IntArray, found: Cleaned
) -> tuple[FloatArray, FloatArray]:
    """Difference of fixes from what was foretold, and its standard deviation with their noise.

    Parameters
    ----------
    measure
        Of the log.
    whole, held
        The whole log, cleaned, and the fixes of it that can be left out.
    fixes
        (j,) numbers of those that were.
    found
        The log without them, cleaned.

    Returns
    -------
    off, sigma
        (j, a) m each; NaN where nothing was foretold.
    """
    rows = held.row[fixes]
    at = _same_rows(whole, rows, found)
    track = found.track
    if measure.frame is not None:
        assert track.geodetic is not None
        east, north, _ = measure.frame.to_local(track.geodetic[at, 0], track.geodetic[at, 1])
        place = np.column_stack([east, north])
    else:
        place = track.position[at][:, measure.axes]
    noise = _noise(found, "height" if measure.axes == [2] else "position")[whole.sensor[rows]]
    sigma = np.hypot(track.sigma_position[at][:, measure.axes], noise[:, None])
    return measure.place[fixes] - place, sigma


def foretold(off: FloatArray, measure: Yardstick) -> FloatArray:
    """(j,) distance of each fix from what was foretold, m; the extent of the log if nothing was."""
    return np.asarray(np.nan_to_num(np.linalg.norm(off, axis=1), nan=measure.extent))


def log_density(off: FloatArray, sigma: FloatArray, measure: Yardstick) -> FloatArray:
    """(j,) logarithm of the density that was foretold at each fix, nats.

    The density is a mixture: with probability 1 − ε normal with the standard deviations of the
    method, with ε = 0.05 a Cauchy density about the same point, whose scale is ten times the noise
    of the log, the same for all methods. So a gross error costs about the same whatever its size
    and whichever method had to foretell it, unless it was followed.

    Parameters
    ----------
    off, sigma
        (j, a) from `off_and_sigma`; NaN where nothing was foretold.
    measure
        Of the log.
    """
    known = np.asarray(np.isfinite(off + sigma).all(axis=1))
    square = np.where(known, (off**2).sum(axis=1), measure.extent**2)
    half, s2 = 0.5 * (off.shape[1] + 1), measure.scale**2
    cauchy = gammaln(half) - half * np.log(np.pi) + 0.5 * np.log(s2) - half * np.log(s2 + square)
    spread = np.where(known[:, None], sigma, 1.0)
    standard = np.where(known[:, None], off, 0.0) / spread
    normal = -0.5 * (standard**2 + np.log(2.0 * np.pi * spread**2)).sum(axis=1)
    normal = np.where(known, np.log1p(-GROSS_SHARE) + normal, -np.inf)
    return np.asarray(np.logaddexp(normal, np.log(GROSS_SHARE) + cauchy))


def _same_rows(whole: Cleaned, rows: IntArray, found: Cleaned) -> IntArray:
    """Find the rows of another result that came from the same records."""
    most = int(max(whole.row.max(initial=0), found.row.max(initial=0))) + 1
    key = found.sensor * most + found.row
    order = np.argsort(key)
    place = np.searchsorted(key[order], whole.sensor[rows] * most + whole.row[rows])
    return np.asarray(order[np.minimum(place, len(order) - 1)])


def _noise(found: Cleaned, quantity: str) -> FloatArray:
    """(sensors,) standard deviation of the fixes of each; where there is none, of the others."""
    figures = {each.sensor: each.value for each in found.noise if each.quantity == quantity}
    usual = float(np.median(list(figures.values()))) if figures else 0.0
    return np.array([figures.get(name, usual) for name in found.sensors])
