"""The heading that turns a velocity along the vehicle's own axes, between those beside it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from surefix.geo.angle import wrap
from surefix.pipelines.turning import Angles
from surefix.types import FloatArray, IntArray

__all__ = ["azimuth_at", "settled"]

_AWAY: Final = 2.0  # s after the last heading, for which the turn goes on
_BESIDE: Final = 10.0  # s between two headings that still turn a velocity between them
_MEDIAN: Final = 1.0  # s before and after, over which a heading is typical …
_INSTANTS: Final = 11  # … and instants at which it is looked at there
_SPAN: Final = 0.5  # s before, over which the rate of turn is taken


def azimuth_at(headings: Angles, time: FloatArray) -> FloatArray:
    """Headings at given times, rad: between two at most 10 s apart, or up to 2 s after the last.

    Each is the median of those within a second, so that less than a second of wrong ones does
    nothing; near a gap and at the ends of as many as there are on either side.

    Parameters
    ----------
    headings
        The headings there are.
    time
        (n,) s.

    Returns
    -------
    heading
        (n,) clockwise from north; NaN where it is not known.
    """
    known = headings.time
    if len(known) < 2:
        return np.full(len(time), np.nan)
    at = np.clip(np.searchsorted(known, time, side="right") - 1, 0, None)
    after = np.minimum(at + 1, len(known) - 1)
    gap, past = known[after] - known[at], time - known[at]
    heading, following = _typical(headings, at), _typical(headings, after)
    between = (gap > 0.0) & (gap <= _BESIDE)
    share = np.where(between, past / np.where(between, gap, 1.0), 0.0)
    begins, _ = _stretch(known, at)
    earlier = np.maximum(np.searchsorted(known, known[at] - _SPAN, side="right") - 1, begins)
    swept, lasted = _turn(heading - _typical(headings, earlier)), known[at] - known[earlier]
    rate = np.where(lasted > 0.0, swept / np.where(lasted > 0.0, lasted, 1.0), 0.0)
    moved = np.where(between, share * _turn(following - heading), rate * past)
    there = (past >= 0.0) & (between | (past <= _AWAY))
    return np.where(there, heading + moved, np.nan)


def settled(headings: Angles) -> float:
    """Time up to which another heading changes nothing that `azimuth_at` says, s."""
    known = headings.time
    sure = known[known <= known[-1] - _MEDIAN] if len(known) else known
    return float(sure[-1]) if len(sure) else -math.inf


def _stretch(known: FloatArray, index: IntArray) -> tuple[IntArray, IntArray]:
    """First and last heading of the stretch without a gap that some headings lie in."""
    cuts = np.flatnonzero(np.diff(known) > _BESIDE) + 1
    bounds = np.concatenate([[0], cuts, [len(known)]])
    stretch = np.searchsorted(bounds, index, side="right") - 1
    return bounds[stretch], bounds[stretch + 1] - 1


def _typical(headings: Angles, index: IntArray) -> FloatArray:
    """Median of the headings within a second of some of them, at as many instants on each side."""
    known, own = headings.time, headings.angle[index]
    first, last = _stretch(known, index)
    here = known[index]
    wide = np.minimum(_MEDIAN, np.minimum(here - known[first], known[last] - here))
    instants = here[:, None] + wide[:, None] * np.linspace(-1.0, 1.0, _INSTANTS)
    right = np.clip(np.searchsorted(known, instants), first[:, None], last[:, None])
    left = np.maximum(right - 1, first[:, None])
    nearest = np.where(instants - known[left] <= known[right] - instants, left, right)
    return own + np.median(_turn(headings.angle[nearest] - own[:, None]), axis=1)


def _turn(angle: FloatArray) -> FloatArray:
    """The angle in −π … π, rad."""
    return wrap(angle, 2.0 * np.pi)
