"""Fixes that say nothing new: the same record again, an old fix polled again, an idle axis.

A sensor that is polled faster than it measures hands out its last fix again and again; to a filter
each copy looks like an independent confirmation. But a position may also repeat because its digits
are coarse and the vessel hardly moves, and then every repetition is a measurement. The two are told
apart by the *grain* of a sensor, the smallest step its digits ever make: where successive positions
differ by many grains, equality is no coincidence; nor is it where the axes of a sensor repeat
together far more often than each by itself would have it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from surefix.types import BoolArray, FloatArray, IntArray

__all__ = [
    "RepeatState",
    "Repeats",
    "constant_axes",
    "find_repeats",
    "idle_axes",
    "start_repeats",
    "stuck",
]

_GRAINS = 4.0  # a hold is believed where positions usually change by at least so many grains
_COPIES = 10  # copies on end that are believed to be held; a vessel may have come to rest
_CHANGES = 5  # the latest changes, whose median counts
_IDLE_MIN = 10  # fixes that show an axis to be idle
_STRETCH = 50  # successive fixes whose steps are compared with their repetitions
_MOVING = 10  # changes that a stretch needs to say anything
_TOGETHER = 5.0  # standard deviations by which axes repeat together too often for chance


class _Sensor(NamedTuple):
    """One sensor's past: its grain, latest changes in grains, last position, rows of last time."""

    grain: FloatArray
    polled: bool
    changes: FloatArray
    position: FloatArray
    since: float
    copies: int
    epoch: FloatArray


class RepeatState(NamedTuple):
    """What is carried from chunk to chunk, by sensor; made by `start_repeats`."""

    sensors: tuple[_Sensor, ...]


class Repeats(NamedTuple):
    """Which rows say nothing new.

    Parameters
    ----------
    repeated
        (n,) the same record again: same sensor, time and fields.
    held
        (n,) the same position again at a later time, where coarse digits do not explain it.
    first
        (n,) time of the first such record, s; NaN elsewhere.
    """

    repeated: BoolArray
    held: BoolArray
    first: FloatArray


def start_repeats(position: FloatArray, sensor: IntArray, sensors: int) -> RepeatState:
    """Learn the grain of each sensor from a head of the log.

    Parameters
    ----------
    position
        (n, d) positions as recorded, in the units of their digits; NaN where missing.
    sensor
        (n,) sensor indices.
    sensors
        Number of sensors. One that does not occur in the head is never taken to hold its fixes.
    """
    return RepeatState(tuple(_learn(position[sensor == index]) for index in range(sensors)))


def find_repeats(
    time: FloatArray, fields: FloatArray, sensor: IntArray, state: RepeatState
) -> tuple[Repeats, RepeatState]:
    """Find the rows that say nothing new; the result does not depend on the chunks.

    Parameters
    ----------
    time
        (n,) s, in order; rows whose time is NaN are left out.
    fields
        (n, m) all that a record says beside its time and sensor, NaN where missing; the first d
        columns are the position as `start_repeats` got it.
    sensor
        (n,) sensor indices.
    state
        From `start_repeats` or the call before.
    """
    count = time.size
    no = np.zeros(count, dtype=np.bool_)
    repeats = Repeats(no, no.copy(), np.full(count, np.nan))
    after = []
    for index, past in enumerate(state.sensors):
        rows = np.flatnonzero((sensor == index) & np.isfinite(time))
        if not rows.size:
            after.append(past)
            continue
        repeated, epoch = _same_record(time[rows], fields[rows], past.epoch)
        repeats.repeated[rows] = repeated
        repeats.first[rows[repeated]] = time[rows[repeated]]
        new = rows[~repeated]
        held, since, known = _same_position(time[new], fields[new], past)
        repeats.held[new] = held
        repeats.first[new[held]] = since[held]
        after.append(known._replace(epoch=epoch))
    return repeats, RepeatState(tuple(after))


def constant_axes(position: FloatArray, sensor: IntArray, sensors: int) -> BoolArray:
    """Find axes that say nothing of the noise: constant over a head of the log while others vary.

    Parameters
    ----------
    position
        (n, d) positions of the head; NaN where missing.
    sensor
        (n,) sensor indices.
    sensors
        Number of sensors.

    Returns
    -------
    constant
        (sensors, d) True where an axis with at least ten values never changes although another
        axis of the same sensor does.
    """
    constant = np.zeros((sensors, position.shape[1]), dtype=np.bool_)
    for index in range(sensors):
        own = position[sensor == index]
        known = np.isfinite(own).sum(axis=0)
        low = np.min(own, axis=0, initial=np.inf, where=np.isfinite(own))
        high = np.max(own, axis=0, initial=-np.inf, where=np.isfinite(own))
        constant[index] = (known >= _IDLE_MIN) & (low == high) & (low < high).any()
    return constant


def idle_axes(
    position: FloatArray, sensor: IntArray, sensors: int, *, geographic: bool
) -> BoolArray:
    """Find constant axes that nobody measured: the vertical one, or a column of zeros.

    A vehicle may well keep to one meridian of coarse digits, and half a latitude and longitude is
    no place: only both together can be zeros that stand for nothing.

    Parameters
    ----------
    position, sensor, sensors
        As for `constant_axes`; d = 3, and the last axis is the vertical one.
    geographic
        Whether the first two are latitude and longitude.

    Returns
    -------
    idle
        (sensors, 3) True where an axis is to be left out.
    """
    idle = constant_axes(position, sensor, sensors)
    for index in range(sensors):
        own = position[sensor == index, :2]
        idle[index, :2] &= ((own == 0.0) | np.isnan(own)).all(axis=0)
    if geographic:
        idle[:, :2] &= idle[:, :2].all(axis=1, keepdims=True)
    return idle


def stuck(state: RepeatState) -> tuple[FloatArray, BoolArray]:
    """Tell which sensors give the same position again and again.

    Returns
    -------
    since, lively
        (sensors,) since when each does, s, NaN where it does not; and whether coarse digits cannot
        explain it, because it usually changes by many of them.
    """
    since = np.array([past.since if past.copies else np.nan for past in state.sensors])
    lively = [past.polled or np.median(past.changes) >= _GRAINS for past in state.sensors]
    return since, np.array(lively, dtype=np.bool_)


def _learn(position: FloatArray) -> _Sensor:
    """Grain of each axis and the usual change, in grains, over the head of one sensor."""
    axes = position.shape[1]
    steps = np.abs(np.diff(position[np.isfinite(position).any(axis=1)], axis=0))
    grain = np.min(steps, axis=0, initial=np.inf, where=steps > 0.0)
    changes = _in_grains(steps, grain)
    changes = changes[changes > 0.0]
    usual = float(np.median(changes)) if changes.size else 0.0
    blank = np.full(axes, np.nan)
    polled = axes > 1 and _is_polled(steps)
    return _Sensor(grain, polled, np.full(_CHANGES, usual), blank, np.nan, 0, np.empty((0, 0)))


def _is_polled(steps: FloatArray) -> bool:
    """Tell whether the axes of a head of steps (n, d) repeat together more often than apart.

    Coarse digits repeat on each axis by themselves; a fix that is handed out again repeats on all
    axes at once. Within stretches where the sensor moves, the number of joint repetitions is
    compared with what independent axes would give, in standard deviations.
    """
    count = len(steps) // _STRETCH
    same = (steps[: count * _STRETCH, :2] == 0.0).reshape(count, _STRETCH, 2)
    both = same.all(axis=2).sum(axis=1)
    moving = _STRETCH - both >= _MOVING
    share = same[moving].mean(axis=1)
    more = both[moving].sum() - _STRETCH * share.prod(axis=1).sum()
    variance = _STRETCH * (share * (1.0 - share)).prod(axis=1).sum()
    return bool(more > _TOGETHER * variance**0.5)


def _in_grains(steps: FloatArray, grain: FloatArray) -> FloatArray:
    """Size of each step, in grains, along the axis where it is largest; unknown steps count 0."""
    return np.asarray(np.max(np.where(steps > 0.0, steps / grain, 0.0), axis=1, initial=0.0))


def _same_record(
    time: FloatArray, fields: FloatArray, epoch: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Flag records that repeat an earlier one of the same time; gives the rows of the last time."""
    if epoch.size and epoch[0, 0] == time[0]:
        repeated, last = _same_record(
            np.concatenate((epoch[:, 0], time)),
            np.concatenate((epoch[:, 1:], fields)),
            epoch[:0],
        )
        return repeated[len(epoch) :], last
    repeated = np.zeros(time.size, dtype=np.bool_)
    together = np.diff(time) == 0.0
    shared = np.flatnonzero(np.append(together, False) | np.insert(together, 0, False))
    if shared.size:
        table = np.column_stack((time[shared], fields[shared]))
        order = np.lexsort(table.T[::-1])
        repeated[shared[order[1:]]] = _equal(table[order[:-1]], table[order[1:]])
    latest = np.flatnonzero((time == time[-1]) & ~repeated)
    return repeated, np.column_stack((time[latest], fields[latest]))


def _equal(one: FloatArray, two: FloatArray) -> BoolArray:
    """Compare rows, a missing value being equal to a missing one."""
    return np.asarray(((one == two) | (np.isnan(one) & np.isnan(two))).all(axis=1))


def _same_position(
    time: FloatArray, fields: FloatArray, past: _Sensor
) -> tuple[BoolArray, FloatArray, _Sensor]:
    """Flag rows that hold the position of an earlier one; gives the time it was first seen."""
    held, since = np.zeros(time.size, dtype=np.bool_), np.full(time.size, np.nan)
    rows = np.flatnonzero(np.isfinite(fields[:, : past.grain.size]).any(axis=1))
    if not rows.size:
        return held, since, past
    position = np.vstack((past.position, fields[rows, : past.grain.size]))
    one, two = position[:-1], position[1:]
    same = _equal(one, two)
    begun = np.concatenate(([past.since], time[rows]))
    run = np.maximum.accumulate(np.where(same, 0, np.arange(1, rows.size + 1)))
    since[rows] = begun[run]

    compared = ~same & np.isfinite(one).any(axis=1)
    grains = _in_grains(np.abs(two - one), past.grain)[compared]
    changes = np.concatenate((past.changes, grains))
    usual = np.median(sliding_window_view(changes, _CHANGES), axis=1)
    copies = np.arange(1, rows.size + 1) - run + np.where(run == 0, past.copies, 0)
    still = (usual[np.cumsum(compared)] >= _GRAINS) & (copies <= _COPIES)
    held[rows] = same & (past.polled | still)
    return (
        held,
        since,
        past._replace(
            changes=changes[-_CHANGES:],
            position=position[-1],
            since=float(begun[run[-1]]),
            copies=int(copies[-1]),
        ),
    )
