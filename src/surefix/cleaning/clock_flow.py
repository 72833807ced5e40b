"""What is remembered of a log's clock, and the rows whose times follow from those before.

The rows come in the order of arrival. As long as their times advance by ordinary amounts, or fall
back by no more than the reorder window, there is nothing to decide, and a whole block is passed at
once. Anything else is an incident, see `surefix.cleaning.clock_incidents`.

Three times occur: the *clock* time as read, the filter's continuous time *tau* = clock + offset,
and the *output* time = clock + shift.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from surefix.types import BoolArray, Event, FloatArray, IntArray

__all__ = ["LOOK_AHEAD", "SLACK", "Clock", "Decided", "first", "latest", "lengthen", "ordinary"]

LOOK_AHEAD = 64
"""Rows read beyond an incident at most; also how many advances and places are remembered."""

SLACK = 3.0
"""An advance is ordinary up to so many typical ones."""


class Clock(NamedTuple):
    """What is remembered of the rows decided so far.

    Parameters
    ----------
    top
        Latest time read on the present clock, s; −inf before the first row.
    offset, shift
        tau and output time less the clock, s.
    floor
        tau that was safe to release when the clock last stepped, s.
    rows
        Number of rows decided.
    adrift
        Number of misdated rows since the last row that had a right time.
    steps
        (≤64,) the latest positive advances of `top`, s.
    trail
        (≤64, 3) tau, x and y of the latest rows that have a place.
    """

    top: float = -math.inf
    offset: float = 0.0
    shift: float = 0.0
    floor: float = -math.inf
    rows: int = 0
    adrift: int = 0
    steps: FloatArray = np.zeros(0)
    trail: FloatArray = np.zeros((0, 3))

    @property
    def typical(self) -> float:
        """Running (lower) median of the advances, s; NaN before there are any."""
        ordered = np.sort(self.steps)
        return float(ordered[(ordered.size - 1) // 2]) if ordered.size else math.nan


class Decided(NamedTuple):
    """The first k rows, decided.

    Parameters
    ----------
    tau, time
        (k,) filter time and output time, s.
    late
        (k,) True where the row came too late to be sorted in.
    clock
        What is remembered after them.
    events
        What the user should know.
    """

    tau: FloatArray
    time: FloatArray
    late: BoolArray
    clock: Clock
    events: tuple[Event, ...] = ()


def ordinary(time: FloatArray, place: FloatArray, clock: Clock, window: float) -> Decided:
    """Decide the leading rows, possibly none, up to the first incident.

    Parameters
    ----------
    time
        (n,) clock time of rows in the order of arrival, s; no NaN.
    place
        (n, 2) local position, m; NaN where unknown.
    clock
        What is remembered of the rows before.
    window
        Reorder window, s.
    """
    top = time[0] if math.isinf(clock.top) else clock.top
    tops = np.maximum.accumulate(np.concatenate(([top], time)))
    advance = time - tops[:-1]
    count = first(time < tops[:-1] - window)
    ahead = np.flatnonzero(advance[:count] > window)
    if ahead.size:
        typical = _typical_before(clock.steps, advance[:count], ahead)
        strange = ahead[advance[ahead] > np.fmax(window, SLACK * typical)]
        count = int(strange[0]) if strange.size else count
    kept, grown = time[:count], advance[:count]
    tau = np.maximum(kept + clock.offset, clock.floor)
    after = clock._replace(
        top=float(tops[count]) if count else clock.top,
        rows=clock.rows + count,
        adrift=0 if count else clock.adrift,
        steps=latest(clock.steps, grown[grown > 0.0]),
        trail=lengthen(clock.trail, tau, place[:count]),
    )
    return Decided(tau, kept + clock.shift, np.zeros(count, dtype=np.bool_), after)


def _typical_before(steps: FloatArray, advance: FloatArray, at: IntArray) -> FloatArray:
    """Running median of the positive advances before each of the rows ``at``; NaN where none."""
    positive = advance > 0.0
    unknown = np.full(LOOK_AHEAD - steps.size, np.nan)
    history = np.concatenate((unknown, steps, advance[positive]))
    rank = np.concatenate(([0], np.cumsum(positive)))[at]
    ordered = np.sort(sliding_window_view(history, LOOK_AHEAD)[rank], axis=1)
    known = LOOK_AHEAD - np.isnan(ordered).sum(axis=1)
    return np.asarray(ordered[np.arange(at.size), np.maximum(known - 1, 0) // 2])


def first(where: BoolArray) -> int:
    """Index of the first True, or the length."""
    return int(np.argmax(where)) if where.any() else where.size


def latest(before: FloatArray, new: FloatArray) -> FloatArray:
    """Append rows and keep the last `LOOK_AHEAD`."""
    return np.concatenate((before, new[-LOOK_AHEAD:]))[-LOOK_AHEAD:]


def lengthen(trail: FloatArray, tau: FloatArray, place: FloatArray) -> FloatArray:
    """Append the rows with a known place to the trail."""
    known = np.flatnonzero(np.isfinite(place).all(axis=1))[-LOOK_AHEAD:]
    return latest(trail, np.column_stack((tau[known], place[known])))
