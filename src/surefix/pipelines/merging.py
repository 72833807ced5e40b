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
from surefix.pipelines.azimuth import settled
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.placing import Told, escorted, follow, known_until
from surefix.pipelines.rows import (
    METRES_PER_DEGREE,
    Rows,
    join_fixes,
    join_rows,
    take_fixes,
    take_rows,
)
from surefix.pipelines.supporting import BODY, NOT_CLEANED, no_heading, steered, support
from surefix.pipelines.turning import ANGLES, Arm, Turning, arms_at, reached, turned
from surefix.types import PLACE, Channel, Event, Fixes, FloatArray, Log, Problem

__all__ = ["Chunk", "Merging", "begin_merging", "merge"]

_HEADINGS = ("heading", "turning")  # roles whose headings are those of the vehicle
_ATTITUDE = (*_HEADINGS, "attitude")  # roles of inputs that tell how it lies, nothing else
_WITH_CHANNELS = ("fixes", "heading", "attitude", "ship")  # whose series are cleaned as well
_WAITS = 300.0  # s that sightings of a live stream may wait for what they are in
_NO_VELOCITY = "a table with velocities, or a log of a DVL; a receiver is an input of fixes"
_NO_SERIES = (NOT_CLEANED, *PLACE)  # what only goes with another series is not one


class Chunk(NamedTuple):
    """What is ready at one time: rows, and what came beside them."""

    rows: Rows | None
    channels: tuple[Channel, ...]
    events: tuple[Event, ...]
    problems: tuple[Problem, ...]
    has_depth: bool


class _Inflow(NamedTuple):
    """Where one input stands: its sensors and clock, rows held back by it, and rows in order.

    In its rows a sensor has its number in ``sensors`` here. ``axes`` says in which axes they are
    until they are let go: as ``Log.axes``, or the vehicle's own; ``waits`` that there are some of
    which that is not known yet; ``ship`` is what it tells of the ship.
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
    waits: bool = False
    axes: str = ""
    ship: tuple[Told, ...] = ()

    @property
    def reach(self) -> float:
        """Time up to which it brings nothing new, s, but for rows that are late."""
        return min(self.last_tau, known_until(self.ship) if self.ship else np.inf)


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
    headings
        Those that turn velocities along the vehicle's own axes.
    """

    inflows: tuple[_Inflow, ...]
    sensors: tuple[str, ...] = ()
    homes: tuple[int, ...] = ()
    patience: float = np.inf
    released: float = -np.inf
    arms: tuple[Arm, ...] = ()
    turnings: tuple[Turning, Turning] = (Turning(), Turning())
    headings: Turning = Turning()

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

    A role is ``fixes``; ``depth`` or ``velocity``, whose observations support the fixes;
    ``heading`` or ``attitude``, series that are only cleaned, and carry lever arms and turn
    velocities; ``turning``, the same as ``heading`` where it is cleaned by another role already; or
    ``ship``, positions and headings of the ship from which the fixes are seen. The heading is that
    of an input of the first, else of the second, else, for lever arms, that beside the fixes; roll
    and pitch are those of the second, else of the first, else those beside the fixes. An input that
    is more than ``patience`` seconds behind is waited for no longer; what it brings from before the
    rows that were let go is late.
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
    if log is not None and inflow.role == "fixes":
        inflow = inflow._replace(waits=log.axes == "wait")
    brought = support(log, inflow.role) if log is not None else None
    fixes = None if brought is None else brought.fixes
    if fixes is not None and brought is not None:
        delay, names = options.sensor_delay_s, brought.sensors
        inflow = inflow._replace(sensors=tuple(dict.fromkeys((*inflow.sensors, *names))))
        inflow = inflow._replace(axes=brought.axes or inflow.axes)
        numbers = np.array([inflow.sensors.index(name) for name in names] or [0])
        delays = np.array([delay.get(name, 0.0) for name in names] or [0.0])
        time = fixes.time - delays[fixes.sensor]
        fixes = fixes._replace(sensor=numbers[fixes.sensor], time=time)
    if inflow.axes == BODY and not {each.role for each in merging.inflows} & {*_ATTITUDE}:
        raise no_heading(inflow.name)
    inflow, events = _order(inflow, fixes, options.reorder_s)
    if log is not None:
        inflow, merging = _heeded(inflow, merging, log, options)
    inflows = [*merging.inflows]
    inflows[source] = inflow
    least = max((each.last_tau for each in inflows if not each.ended), default=np.inf)
    least -= merging.patience
    for i, each in enumerate(inflows):
        if each.held is not None and not each.ended and each.last_tau < least < np.inf:
            inflows[i], more = _order(each, None, options.reorder_s, least)
            events = (*events, *more)
    inflows, rows, released, problems = _release(inflows, merging, least, options)
    after = merging._replace(inflows=tuple(inflows), released=released)
    if rows is not None:
        after, rows = _numbered(after, rows, options)
        if options.lever_arm:
            rows = _with_arms(rows, after, options)
    if log is None:
        if inflow.role == "velocity" and not inflow.sensors:
            problems = (*problems, Problem("no-velocity", 1, inflow.name, _NO_VELOCITY))
        return after, Chunk(rows, (), events, problems, False)
    channels = tuple(each for each in log.channels if each.name not in _NO_SERIES)
    channels = channels if inflow.role in _WITH_CHANNELS else ()
    events, problems = (*log.events, *events), (*log.problems, *problems)
    return after, Chunk(rows, channels, events, problems, log.depth_positive_down)


def _heeded(
    inflow: _Inflow, merging: Merging, log: Log, options: CleanOptions
) -> tuple[_Inflow, Merging]:
    """Take what a log tells of headings, and of the ship."""
    roles = {each.role for each in merging.inflows}
    before = inflow.last_tau
    if options.lever_arm:
        inflow, merging = _turn(inflow, merging, log)
    elif inflow.role in _ATTITUDE:
        inflow = inflow._replace(last_tau=_reached(log, inflow.last_tau))
    if inflow.role in ({*_HEADINGS} & roles or {"attitude"}) and "velocity" in roles:
        headings = turned(merging.headings, log.channels, merging.released, ("heading",))
        merging = merging._replace(headings=headings)
        sure = max(before, min(inflow.last_tau, settled(headings.heading)))
        inflow = inflow._replace(last_tau=sure)
    if inflow.role == "ship" or (log.axes and "ship" in roles):
        newest = max((each.last_tau for each in merging.inflows), default=-np.inf)
        needed = merging.released
        if merging.patience < np.inf:
            needed = max(needed, newest - _WAITS)
        inflow = inflow._replace(ship=follow(inflow.ship, log, needed))
    if inflow.role == "ship":
        inflow = inflow._replace(last_tau=known_until(inflow.ship))
    return inflow, merging


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


def _arm(name: str, home: str, options: CleanOptions) -> Arm:
    """Where the antenna of a sensor is: named by sensor, or by input."""
    given = options.lever_arm
    return tuple(given.get(name, given.get(home, ())))


def _turn(inflow: _Inflow, merging: Merging, log: Log) -> tuple[_Inflow, Merging]:
    """Take the angles of an input for its lever arms, but for those that another one is for."""
    roles = {each.role for each in merging.inflows}
    left = {"heading": roles & {*_HEADINGS}, "roll": roles & {"attitude"}}
    left["pitch"] = left["roll"]
    names = [name for name in ANGLES if not left[name] or inflow.role in left[name]]
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
    inflows: list[_Inflow], merging: Merging, least: float, options: CleanOptions
) -> tuple[list[_Inflow], Rows | None, float, tuple[Problem, ...]]:
    """Merge the ready rows that no input can still precede; also tells up to when.

    An input that is behind ``least`` is not waited for. The sensors of all inputs are numbered
    through. What is in axes of its own is turned, or put on the Earth, and counted where it cannot.
    """
    waits = (
        max(inflow.reach, least - _WAITS * inflow.waits) for inflow in inflows if not inflow.ended
    )
    until = min(waits, default=np.inf)
    out: list[Rows] = []
    keys: list[FloatArray] = []
    problems: list[Problem] = []
    told = [each.ship for role in ("ship", "fixes") for each in inflows if each.role == role]
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
        if inflow.axes == BODY and len(free.tau):
            sigma = np.radians(options.sigma_heading_deg)
            free, more = steered(free, merging.headings.heading, sigma, inflow.sensors[0])
            problems += more
        elif inflow.axes and len(free.tau):
            free, more = escorted(free, inflow.axes, told, inflow.sensors[0])
            problems += more
        out.append(free._replace(fixes=free.fixes._replace(sensor=free.fixes.sensor + own)))
        keys.append(key[~stay])
    released = max([merging.released, *(float(key[-1]) for key in keys if len(key))])
    if not sum(len(rows.tau) for rows in out):
        return after, None, released, tuple(problems)
    together = join_rows(out)
    if len(out) > 1:
        together = take_rows(together, np.argsort(np.concatenate(keys), kind="stable"))
    if merging.patience < np.inf:
        late = together.late | (together.tau < merging.released)
        together = together._replace(late=late)
    return after, together, released, tuple(problems)


def _carried(tau: FloatArray) -> FloatArray:
    """``tau`` with rows that have no time taking that of the row before them."""
    known = np.isfinite(tau)
    last = np.maximum.accumulate(np.where(known, np.arange(len(tau)), -1))
    filled = np.where(last >= 0, tau[last], -np.inf)
    return np.maximum.accumulate(filled) if len(tau) else filled
