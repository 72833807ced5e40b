"""Order and clock of a log repaired, chunk by chunk.

Rows go in as they arrived; they come out in the order of a continuous time tau that no step of the
recorder's clock disturbs. What a strange time means, `surefix.cleaning.clock_incidents` decides;
here rows are sorted, held back as long as an earlier one may still arrive, and let go.

The result does not depend on how the log is cut into chunks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.cleaning.clock_flow import LOOK_AHEAD, Clock, ordinary
from surefix.cleaning.clock_incidents import judge
from surefix.types import BoolArray, Event, FloatArray, IntArray

__all__ = ["REORDER_WINDOW", "ClockState", "Repaired", "repair"]

REORDER_WINDOW = 10.0  # s
_BLOCK_MIN, _BLOCK_MAX = 64, 65536  # rows looked at together on the clean path


class Repaired(NamedTuple):
    """The rows that are let go, in their order.

    Parameters
    ----------
    order
        (k,) which of the rows: an index into the rows held before followed by the new ones.
    tau
        (k,) continuous time of the filter, s, never falling over rows that are neither late nor
        without a time; equal to the recorded time until the clock first steps. NaN where the row
        has no time.
    time
        (k,) time for the output, s.
    late
        (k,) True for rows that arrived after later rows had to be let go.
    held
        (h,) indices, rising, of the rows held back: the caller keeps these in front of the next
        chunk.
    """

    order: IntArray
    tau: FloatArray
    time: FloatArray
    late: BoolArray
    held: IntArray


class _Rows(NamedTuple):
    """Columns of the rows at hand; those after ``time``, ``place`` and ``row`` once decided."""

    time: FloatArray
    place: FloatArray
    row: IntArray
    tau: FloatArray
    out: FloatArray
    late: BoolArray
    key: FloatArray


class ClockState(NamedTuple):
    """What is carried from chunk to chunk; ``ClockState()`` begins a log."""

    clock: Clock = Clock()
    held: _Rows | None = None
    decided: int = 0
    highest: float = -math.inf


def repair(
    time: FloatArray,
    place: FloatArray,
    row: IntArray,
    state: ClockState,
    *,
    final: bool,
    window: float = REORDER_WINDOW,
    reached: float = -math.inf,
) -> tuple[Repaired, ClockState, tuple[Event, ...]]:
    """Repair the order and the clock of the next rows of a log.

    - Rows up to `window` out of order are sorted, stably.
    - A few rows that lie further back, before the clock resumes, are ``late``; if they lie more
      than an hour back, or the rows lead by more than three typical steps and then return, they
      are misdated: their times are interpolated (event ``misdated``).
    - A lasting step back is a clock step: tau advances by the median of the last 64 steps and the
      output continues the earlier clock (event ``clock-step``). A clock that was wrong for less
      than the first 64 rows of a log, or by more than half a year before it leapt forward, is not
      continued: from there on the output shows the times as recorded.
    - A lasting step forward is a gap (event ``gap`` if it is longer than 30 s and ten typical
      steps), unless it exceeds half a year, or undoes an earlier step, or is at least ten minutes
      long while a vessel under way is still where it was: then it is a clock step.
    - A row without a time keeps its place.

    A step back by less than `window` cannot be told from rows out of order.

    Parameters
    ----------
    time
        (n,) recorded time in the order of arrival, s; not finite where missing.
    place
        (n, 2) local position, m; NaN where unknown.
    row
        (n,) record numbers, for the texts of events.
    state
        From the call before.
    final
        True with the last chunk, which may be empty: nothing is held back any more.
    window
        Reorder window, s.
    reached
        tau up to which rows are let go although an earlier one of this log may still arrive.
    """
    rows = _join(state.held, time, place, row)
    timed = np.flatnonzero(np.isfinite(rows.time[state.decided :])) + state.decided
    clock, done, events = _decide(rows, timed, state.clock, window, final)
    decided = int(timed[done]) if done < timed.size else rows.time.size
    highest = _place_keys(rows, slice(state.decided, decided), state.highest)
    release = np.zeros(rows.time.size, dtype=np.bool_)
    until = max((clock.top - window) + clock.offset, reached)
    release[:decided] = final | (rows.key[:decided] <= until)
    order, held = np.flatnonzero(release), np.flatnonzero(~release)
    key = rows.key[order]
    if np.any(key[1:] < key[:-1]):
        order = order[np.argsort(key, kind="stable")]
    repaired = Repaired(order, rows.tau[order], rows.out[order], rows.late[order], held)
    waiting = _Rows._make(column[held] for column in rows)
    undecided = rows.time.size - decided
    return repaired, ClockState(clock, waiting, held.size - undecided, highest), events


def _join(held: _Rows | None, time: FloatArray, place: FloatArray, row: IntArray) -> _Rows:
    """Put the held rows in front of the new ones, which are still undecided."""
    unknown = np.full(time.size, np.nan)
    no = np.zeros(time.size, dtype=np.bool_)
    new = _Rows(time, place[:, :2], row, unknown, unknown.copy(), no, unknown.copy())
    if held is None or held.time.size == 0:
        return new
    return _Rows._make(np.concatenate(pair) for pair in zip(held, new, strict=True))


def _decide(
    rows: _Rows, timed: IntArray, clock: Clock, window: float, final: bool
) -> tuple[Clock, int, tuple[Event, ...]]:
    """Decide as many rows as can be; fills their columns and gives the number of timed rows."""
    events: list[Event] = []
    done, block = 0, _BLOCK_MIN
    while done < timed.size:
        here = timed[done : done + block]
        decided = ordinary(rows.time[here], rows.place[here], clock, window)
        if decided.tau.size == 0:
            here, block = timed[done : done + LOOK_AHEAD + 1], _BLOCK_MIN
            seen = rows.time[here], rows.place[here], rows.row[here]
            verdict = judge(*seen, clock, window, final)
            if verdict is None:
                break
            decided = verdict
        else:
            block = min(2 * block, _BLOCK_MAX)
        here = here[: decided.tau.size]
        rows.tau[here], rows.out[here], rows.late[here] = decided.tau, decided.time, decided.late
        clock, done = decided.clock, done + here.size
        events.extend(decided.events)
    return clock, done, tuple(events)


def _place_keys(rows: _Rows, part: slice, highest: float) -> float:
    """Give each decided row its key for sorting: its tau, or its place if it has none."""
    own = np.where(rows.late[part] | np.isnan(rows.tau[part]), -np.inf, rows.tau[part])
    reached = np.maximum.accumulate(np.concatenate(([highest], own)))
    rows.key[part] = np.where(np.isneginf(own), reached[1:], own)
    return float(reached[-1])
