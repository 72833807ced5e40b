"""What it means when the time of a row does not follow from the rows before it.

A late row, rows with a wrong date, a step of the clock, or a gap. A verdict on row i reads at most
the next `LOOK_AHEAD` rows, and the same ones however the log is cut into chunks.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.cleaning.clock_flow import (
    LOOK_AHEAD,
    SLACK,
    Clock,
    Decided,
    first,
    latest,
    lengthen,
)
from surefix.types import Event, FloatArray, IntArray

__all__ = ["judge"]

_SHORT_LOOK = 4  # rows, for forward steps of less than an hour
_ENOUGH = 4  # rows back on the old clock that confirm an excursion
_LONELY = 2  # fewer following rows than this at the end of a log confirm no new clock
_HOUR = 3600.0
_STEP_MIN = 600.0  # s; a shorter forward step is always taken as a gap
_HALF_YEAR = 180.0 * 86400.0
_GAP_MIN = 30.0  # s
_GAP_STEPS = 10.0  # typical steps
_SPEED_MIN = 0.3  # m/s
_TRAIL_MIN = 16  # places


def judge(
    time: FloatArray,
    place: FloatArray,
    row: IntArray,
    clock: Clock,
    window: float,
    final: bool,
) -> Decided | None:
    """Decide the incident at the first row, or None when more rows must be seen first.

    Parameters
    ----------
    time, place
        As for `ordinary`; only the first ``1 + LOOK_AHEAD`` rows are read.
    row
        (n,) record numbers, for the texts.
    clock, window
        As for `ordinary`.
    final
        True if the log ends with these rows.
    """
    time, place = time[: LOOK_AHEAD + 1], place[: LOOK_AHEAD + 1]
    step = float(time[0]) - clock.top
    if step < 0.0:
        return _behind(time, place, int(row[0]), clock, window, final)
    reach = LOOK_AHEAD if step > _HOUR else _SHORT_LOOK
    seen = time[1 : reach + 1]
    old = (seen >= clock.top - window) & (seen < min(clock.top + step / 2, time[0] - window))
    strayed = first(old) + 1
    confirming = old[strayed - 1 : strayed - 1 + min(strayed + 1, _ENOUGH)]
    back = strayed <= seen.size and bool(confirming.all())
    if back and confirming.size == min(strayed + 1, _ENOUGH):
        return _misdated(time[:strayed], clock, int(row[0]), float(time[strayed]))
    if seen.size < reach and not final and (back or strayed > seen.size):
        return None
    if _is_clock_step(step, place, clock, window):
        return _clock_step(time, place, int(row[0]), clock, window)
    return _gap(time, place, clock)


def _behind(
    time: FloatArray, place: FloatArray, row: int, clock: Clock, window: float, final: bool
) -> Decided | None:
    """Decide a row that lies more than the window behind."""
    behind = clock.top - float(time[0])
    if behind <= np.fmax(window, SLACK * clock.typical):
        return _strays(time[:1], clock, row, window)
    seen = time[1:]
    jump = seen - np.maximum.accumulate(time)[:-1]
    returned = first((seen >= clock.top - window) & (jump > behind / 2))
    caught_up = first((seen > clock.top) & (jump <= behind / 2))
    if returned < min(caught_up, seen.size):
        return _strays(time[: returned + 1], clock, row, window, float(time[returned + 1]))
    if caught_up == seen.size and seen.size < LOOK_AHEAD:
        if not final:
            return None
        if seen.size < _LONELY:
            return _strays(time, clock, row, window)
    return _clock_step(time, place, row, clock, window)


def _strays(
    time: FloatArray, clock: Clock, row: int, window: float, resumes: float = math.nan
) -> Decided:
    """Rows behind the clock before it resumes: misdated ones get a tau, late ones are flagged."""
    behind = clock.top - time
    far = behind > np.fmax(_HOUR, SLACK * clock.typical)
    late = ~far & (behind > window)
    between = _misdated(time, clock, row, resumes)
    own = np.maximum(time + clock.offset, np.where(late, -np.inf, clock.floor))
    return Decided(
        np.where(far, between.tau, own),
        np.where(far, between.time, time + clock.shift),
        late,
        between.clock._replace(adrift=clock.adrift + int(far.sum())),
        between.events if far.any() else (),
    )


def _misdated(time: FloatArray, clock: Clock, row: int, resumes: float) -> Decided:
    """Rows whose time is wrong, spread evenly between their neighbours."""
    count = time.size
    step = clock.typical if math.isfinite(clock.typical) else 0.0
    span = max(resumes - clock.top, 0.0) if math.isfinite(resumes) else step * (count + 1)
    between = clock.top + span * np.arange(1, count + 1) / (count + 1)
    rows = f"row {row}" if count == 1 else f"{count} rows from row {row}"
    text = (
        f"{rows} dated {_span(float(time[0]) - clock.top)} "
        f"{'ahead' if time[0] > clock.top else 'back'}, then the clock returned: "
        "their times were interpolated"
    )
    event = Event("misdated", float(between[0] + clock.shift), text)
    tau = np.maximum(between + clock.offset, clock.floor)
    after = clock._replace(rows=clock.rows + count, adrift=clock.adrift + count)
    return Decided(tau, between + clock.shift, np.zeros(count, dtype=np.bool_), after, (event,))


def _clock_step(
    time: FloatArray, place: FloatArray, row: int, clock: Clock, window: float
) -> Decided:
    """Begin a new clock at the first row: tau advances by a typical step."""
    now, step = float(time[0]), float(time[0]) - clock.top
    typical = clock.typical if math.isfinite(clock.typical) else 0.0
    undone = _advance_if_undone(now, clock, window)
    returns = math.isfinite(undone)
    advance = undone if returns else typical
    follow = returns or step > _HALF_YEAR or clock.rows < LOOK_AHEAD
    shift = 0.0 if follow else clock.top + clock.shift + advance - now
    offset = clock.top + clock.offset + advance - now
    floor = max(clock.floor, (clock.top - window) + clock.offset)
    tau = np.maximum(time[:1] + offset, floor)
    after = clock._replace(
        top=now,
        offset=offset,
        shift=shift,
        floor=floor,
        rows=clock.rows + 1,
        adrift=0,
        trail=lengthen(clock.trail, tau, place[:1]),
    )
    text = (
        f"the clock stepped {'forward' if step > 0 else 'back'} by {_span(step)} at row {row}: "
        f"times after it {'are as recorded' if shift == 0.0 else 'continue the earlier clock'}"
    )
    event = Event("clock-step", now + shift, text)
    return Decided(tau, time[:1] + shift, np.zeros(1, dtype=np.bool_), after, (event,))


def _gap(time: FloatArray, place: FloatArray, clock: Clock) -> Decided:
    """Nothing arrived for a while: time advances as it says."""
    now, step = float(time[0]), float(time[0]) - clock.top
    tau = np.maximum(time[:1] + clock.offset, clock.floor)
    after = clock._replace(
        top=now,
        rows=clock.rows + 1,
        adrift=0,
        steps=latest(clock.steps, np.asarray([step])),
        trail=lengthen(clock.trail, tau, place[:1]),
    )
    events: tuple[Event, ...] = ()
    if step / (clock.adrift + 1) > np.fmax(_GAP_MIN, _GAP_STEPS * clock.typical):
        events = (Event("gap", clock.top + clock.shift, f"no fix for {_span(step)}"),)
    return Decided(tau, time[:1] + clock.shift, np.zeros(1, dtype=np.bool_), after, events)


def _is_clock_step(step: float, place: FloatArray, clock: Clock, window: float) -> bool:
    """Tell a lasting forward step of the clock from a gap."""
    if step > _HALF_YEAR or math.isfinite(_advance_if_undone(clock.top + step, clock, window)):
        return True
    return step >= _STEP_MIN and _stayed(place[:3], step, clock)


def _advance_if_undone(now: float, clock: Clock, window: float) -> float:
    """Advance since the last row if this row is on the log's first clock again, else NaN."""
    for away in (clock.shift, clock.offset):
        advance = now - (clock.top + away)
        if away != 0.0 and -np.fmax(0.0, clock.typical) <= advance <= np.fmax(
            window, SLACK * clock.typical
        ):
            return max(advance, 0.0)
    return math.nan


def _stayed(place: FloatArray, step: float, clock: Clock) -> bool:
    """Tell whether a moving vessel is still where it was: then no such time has passed.

    Its speed is that between the medians of the first and the last quarter of the trail; it has
    stayed if some place among the next three lies within five typical moves, and within 5 % of the
    way it would have made, of one of the last three.
    """
    trail, place = clock.trail, place[np.isfinite(place).all(axis=1)]
    if len(trail) < _TRAIL_MIN or not len(place):
        return False
    quarter = len(trail) // 4
    lapse, *way = np.median(trail[-quarter:], axis=0) - np.median(trail[:quarter], axis=0)
    speed = math.hypot(*way) / lapse if lapse > 0.0 else 0.0
    moves = np.hypot(*np.diff(trail[:, 1:], axis=0).T)
    typical = max(float(np.median(moves)), speed * clock.typical)
    moved = float(np.min(np.linalg.norm(place[:, None, :] - trail[None, -3:, 1:], axis=2)))
    return speed > _SPEED_MIN and moved < 5.0 * typical and moved < 0.05 * speed * step


def _span(seconds: float) -> str:
    """A duration in words."""
    size = abs(seconds)
    if size < 600.0:
        return f"{size:.1f} s"
    if size < 2 * 86400.0:
        return f"{size / 3600.0:.2f} h"
    return f"{size / 86400.0:,.1f} days"
