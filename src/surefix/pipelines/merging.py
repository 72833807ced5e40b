"""Rows of all inputs in one order: clocks repaired per input, then merged by time.

A row is an observation of anything the track filter takes: a fix, a depth, a velocity. Inputs come
in parts; a row is let go when no input can still bring an earlier one, so that logs larger than
memory pass through, and the result does not depend on how they were cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from surefix.cleaning.clock import ClockState, repair
from surefix.geo.angle import wrap
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import (
    METRES_PER_DEGREE,
    Rows,
    join_fixes,
    join_rows,
    take_fixes,
    take_rows,
)
from surefix.pipelines.turning import ANGLES, Arm, Turning, arms_at, reached, turned
from surefix.types import Channel, Event, Fixes, FloatArray, Log, Problem

__all__ = ["Chunk", "Merging", "begin_merging", "merge"]

_ATTITUDE = ("heading", "attitude")  # roles of inputs that tell how the vehicle lies, nothing else
_WITH_CHANNELS = ("fixes", *_ATTITUDE)  # roles whose scalar series are cleaned beside the track
_NO_SERIES = "velocity_sigma_mps"  # what a sensor declares of its velocities is not one


class Chunk(NamedTuple):
    """What is ready at one time: rows, and what came beside them."""

    rows: Rows | None
    channels: tuple[Channel, ...]
    events: tuple[Event, ...]
    problems: tuple[Problem, ...]
    has_depth: bool


class _Inflow(NamedTuple):
    """Where one input stands: its sensors and clock, rows held back by it, and rows in order.

    In its rows a sensor has its number in ``sensors`` here.
    """

    name: str
    role: str
    sensors: tuple[str, ...] = ()
    clock: ClockState = ClockState()
    held: Fixes | None = None
    ready: tuple[Rows, ...] = ()
    last_tau: float = -np.inf
    longitude: float = np.nan
    ended: bool = False


class Merging(NamedTuple):
    """Where the merging of inputs stands; made by `begin_merging`.

    Parameters
    ----------
    inflows
        One per input.
    sensors, homes
        Names of all sensors in the order of the rows that were let go, which is the same however
        the inputs arrived; ``Fixes.sensor`` indexes them. And the number of the input of each.
    patience
        s that an input may be behind the others before they wait for it no longer.
    released
        Time up to which rows were let go, s.
    arms
        Where the antenna of each sensor is.
    turnings
        Heading, roll and pitch, where an antenna has a lever arm: of the inputs of these roles, and
        those beside the fixes.
    """

    inflows: tuple[_Inflow, ...]
    sensors: tuple[str, ...] = ()
    homes: tuple[int, ...] = ()
    patience: float = np.inf
    released: float = -np.inf
    arms: tuple[Arm, ...] = ()
    turnings: tuple[Turning, Turning] = (Turning(), Turning())

    @property
    def ended(self) -> bool:
        """Whether every input has come to its end."""
        return all(inflow.ended for inflow in self.inflows)

    @property
    def behind(self) -> int:
        """The input that is furthest behind: the next to be read."""
        there = [i for i, inflow in enumerate(self.inflows) if not inflow.ended]
        return min(there, key=lambda i: self.inflows[i].last_tau)


def begin_merging(inputs: Sequence[tuple[str, str]], patience: float = np.inf) -> Merging:
    """Begin to merge inputs of the given names and roles.

    A role is ``fixes``; ``depth`` or ``velocity``, whose observations support the fixes; or
    ``heading`` or ``attitude``, series that are only cleaned, and carry the lever arms. The heading
    is that of an input of the first, else of the second, else that beside the fixes; roll and pitch
    are those of the second, else of the first, else those beside the fixes. An input that is more
    than ``patience`` seconds behind is waited for no longer; what it brings from before the rows
    that were let go is late.
    """
    return Merging(tuple(_Inflow(name, role) for name, role in inputs), patience=patience)


def merge(
    merging: Merging, source: int, log: Log | None, options: CleanOptions
) -> tuple[Merging, Chunk]:
    """Take in the next part of an input and give what can be let go.

    Parameters
    ----------
    merging
        From the call before; not modified.
    source
        Number of the input.
    log
        The part; None: the input has come to its end.
    options
        How far out of order a row may be, and how much too late the times of a sensor are.
    """
    inflow = merging.inflows[source]._replace(ended=log is None)
    fixes = _supporting(log, inflow.role) if log is not None else None
    if fixes is not None and log is not None:
        delay = options.sensor_delay_s
        names = log.sensors if inflow.role != "depth" else _depth_sensors(log)
        inflow = inflow._replace(sensors=tuple(dict.fromkeys((*inflow.sensors, *names))))
        numbers = np.array([inflow.sensors.index(name) for name in names] or [0])
        delays = np.array([delay.get(name, 0.0) for name in names] or [0.0])
        time = fixes.time - delays[fixes.sensor]
        fixes = fixes._replace(sensor=numbers[fixes.sensor], time=time)
    inflow, events = _order(inflow, fixes, options.reorder_s)
    if log is not None and options.lever_arm:
        inflow, merging = _turn(inflow, merging, log)
    elif log is not None and inflow.role in _ATTITUDE:
        inflow = inflow._replace(last_tau=_reached(log, inflow.last_tau))
    inflows = [*merging.inflows]
    inflows[source] = inflow
    least = max((each.last_tau for each in inflows if not each.ended), default=np.inf)
    least -= merging.patience
    for i, each in enumerate(inflows):
        if each.held is not None and not each.ended and each.last_tau < least < np.inf:
            inflows[i], more = _order(each, None, options.reorder_s, least)
            events = (*events, *more)
    inflows, rows, released = _release(inflows, merging, least)
    after = merging._replace(inflows=tuple(inflows), released=released)
    if rows is not None:
        after, rows = _numbered(after, rows, options)
        if options.lever_arm:
            rows = _with_arms(rows, after, options)
    if log is None:
        return after, Chunk(rows, (), events, (), False)
    channels = tuple(each for each in log.channels if each.name != _NO_SERIES)
    channels = channels if inflow.role in _WITH_CHANNELS else ()
    events = (*log.events, *events)
    return after, Chunk(rows, channels, events, log.problems, log.depth_positive_down)


def _numbered(merging: Merging, rows: Rows, options: CleanOptions) -> tuple[Merging, Rows]:
    """Number the sensors of rows that are let go, new ones in the order in which they appear."""
    labels = [(i, name) for i, inflow in enumerate(merging.inflows) for name in inflow.sensors]
    found, first = np.unique(rows.fixes.sensor, return_index=True)
    sensors, homes, arms = [*merging.sensors], [*merging.homes], [*merging.arms]
    numbers = np.zeros(len(labels), np.int64)
    for place in found[np.argsort(first)]:
        home, name = labels[place]
        if name not in sensors:
            sensors.append(name)
            homes.append(home)
            arms.append(_arm(name, merging.inflows[home].name, options))
        numbers[place] = sensors.index(name)
    merging = merging._replace(sensors=tuple(sensors), homes=tuple(homes), arms=tuple(arms))
    return merging, rows._replace(fixes=rows.fixes._replace(sensor=numbers[rows.fixes.sensor]))


def _reached(log: Log, before: float) -> float:
    """How far an input without rows has come, s."""
    return max((float(np.nanmax(c.time, initial=before)) for c in log.channels), default=before)


def _supporting(log: Log, role: str) -> Fixes | None:
    """The fixes of a log; a depth series becomes observations of the height alone."""
    if role != "depth":
        return None if role in _ATTITUDE else log.fixes
    series = _depths(log)
    if not series:
        return None
    time = np.concatenate([c.time for c in series])
    number = {name: k for k, name in enumerate(_depth_sensors(log))}
    sensor = np.concatenate([np.full(len(c.time), number[c.sensor]) for c in series])
    n = len(time)
    position = np.full((n, 3), np.nan)
    position[:, 2] = -np.concatenate([c.value for c in series])
    empty = np.full((n, 3), np.nan)
    zero = np.zeros(n, np.int64)
    return Fixes(
        time, position, empty, empty, empty, sensor, zero, np.ones(n, bool), np.arange(n), False
    )


def _arm(name: str, home: str, options: CleanOptions) -> Arm:
    """Where the antenna of a sensor is: named by sensor, or by input."""
    given = options.lever_arm
    return tuple(given.get(name, given.get(home, ())))


def _turn(inflow: _Inflow, merging: Merging, log: Log) -> tuple[_Inflow, Merging]:
    """Take the angles of an input for its lever arms, but for those that another one is for."""
    roles = {each.role for each in merging.inflows}
    left = {"heading": roles & {"heading"}, "roll": roles & {"attitude"}}
    left["pitch"] = left["roll"]
    names = [name for name in ANGLES if left[name] <= {inflow.role}]
    own, beside = merging.turnings
    if inflow.role in _ATTITUDE:
        own = turned(own, log.channels, merging.released, names)
        inflow = inflow._replace(last_tau=max(inflow.last_tau, reached(own, names)))
    elif inflow.role == "fixes":
        beside = turned(beside, log.channels, merging.released, names)
    return inflow, merging._replace(turnings=(own, beside))


def _with_arms(rows: Rows, merging: Merging, options: CleanOptions) -> Rows:
    arms = np.zeros((max(len(merging.arms), 1), 3))
    for k, arm in enumerate(merging.arms):
        arms[k] = arm or 0.0
    sigmas = np.radians([options.sigma_heading_deg, options.sigma_attitude_deg])
    own, time = arms[rows.fixes.sensor], rows.fixes.time
    return rows._replace(lever=arms_at(merging.turnings, time, own, *sigmas.tolist()))


def _depths(log: Log) -> list[Channel]:
    return [channel for channel in log.channels if channel.name == "depth_m"]


def _depth_sensors(log: Log) -> tuple[str, ...]:
    return tuple(dict.fromkeys(channel.sensor for channel in _depths(log)))


def _order(
    inflow: _Inflow, new: Fixes | None, reorder_s: float, reached: float = -np.inf
) -> tuple[_Inflow, tuple[Event, ...]]:
    """Repair the clock of new rows and move those that are let go to the ready ones."""
    parts = [part for part in (inflow.held, new) if part is not None]
    fresh = new.time if new is not None else np.empty(0)
    inflow, place = _place(inflow, new)
    row = new.row if new is not None else np.empty(0, np.int64)
    repaired, clock, events = repair(
        fresh, place, row, inflow.clock, final=inflow.ended, window=reorder_s, reached=reached
    )
    inflow = inflow._replace(clock=clock)
    if parts:
        both = join_fixes(parts)
        inflow = inflow._replace(held=take_fixes(both, repaired.held))
        if len(repaired.order):
            auxiliary = np.full(len(repaired.order), inflow.role != "fixes")
            ordered = take_fixes(both, repaired.order)
            blank = np.empty((len(auxiliary), 0))
            rows = Rows(ordered, repaired.tau, repaired.time, repaired.late, auxiliary, blank)
            latest = float(np.nanmax(repaired.tau, initial=-np.inf))
            inflow = inflow._replace(
                ready=(*inflow.ready, rows), last_tau=max(inflow.last_tau, latest)
            )
    return inflow, events


def _place(inflow: _Inflow, fixes: Fixes | None) -> tuple[_Inflow, FloatArray]:
    """(n, 2) rough local metres, good enough to tell a vessel under way from one at rest."""
    if fixes is None:
        return inflow, np.empty((0, 2))
    if not fixes.geographic:
        return inflow, fixes.position[:, :2]
    latitude, longitude = fixes.position[:, 0], fixes.position[:, 1]
    if np.isnan(inflow.longitude) and np.isfinite(longitude).any():
        inflow = inflow._replace(longitude=float(longitude[np.isfinite(longitude)][0]))
    east = wrap(longitude - inflow.longitude) * np.cos(np.radians(latitude))
    return inflow, np.column_stack([east, latitude]) * METRES_PER_DEGREE


def _release(
    inflows: list[_Inflow], merging: Merging, least: float
) -> tuple[list[_Inflow], Rows | None, float]:
    """Merge the ready rows that no input can still precede; also tells up to when.

    An input that is behind ``least`` is not waited for. The sensors of all inputs are numbered
    through.
    """
    waits = (max(inflow.last_tau, least) for inflow in inflows if not inflow.ended)
    until = min(waits, default=np.inf)
    out: list[Rows] = []
    keys: list[FloatArray] = []
    after: list[_Inflow] = []
    before = 0
    for inflow in inflows:
        own, before = before, before + len(inflow.sensors)
        if not inflow.ready:
            after.append(inflow)
            continue
        rows = join_rows(list(inflow.ready))
        key = _carried(rows.tau)
        stay = (key >= until) & (len(inflows) > 1) & (until < np.inf)
        after.append(inflow._replace(ready=(take_rows(rows, stay),) if stay.any() else ()))
        free = take_rows(rows, ~stay)
        out.append(free._replace(fixes=free.fixes._replace(sensor=free.fixes.sensor + own)))
        keys.append(key[~stay])
    released = max([merging.released, *(float(key[-1]) for key in keys if len(key))])
    if not sum(len(rows.tau) for rows in out):
        return after, None, released
    together = join_rows(out)
    if len(out) > 1:
        together = take_rows(together, np.argsort(np.concatenate(keys), kind="stable"))
    if merging.patience < np.inf:
        late = together.late | (together.tau < merging.released)
        together = together._replace(late=late)
    return after, together, released


def _carried(tau: FloatArray) -> FloatArray:
    """``tau`` with rows that have no time taking that of the row before them."""
    known = np.isfinite(tau)
    last = np.maximum.accumulate(np.where(known, np.arange(len(tau)), -1))
    filled = np.where(last >= 0, tau[last], -np.inf)
    return np.maximum.accumulate(filled) if len(tau) else filled
