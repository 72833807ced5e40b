"""Rows of all sources in one order: clocks repaired per source, then merged by time.

A row is an observation of anything the track filter takes: a fix, a depth, a velocity. Sources are
read chunk by chunk; a row is let go when no source can still bring an earlier one, so that logs
larger than memory pass through, and the result does not depend on how they were cut.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from surefix.cleaning.clock import ClockState, repair
from surefix.geo.angle import wrap
from surefix.types import BoolArray, Channel, Event, Fixes, FloatArray, IntArray, Log, Problem

__all__ = [
    "METRES_PER_DEGREE",
    "Chunk",
    "Rows",
    "Source",
    "join_fixes",
    "join_rows",
    "merged",
    "pushed",
    "take_fixes",
    "take_rows",
]

METRES_PER_DEGREE = 111_195.0
"""Of latitude, on a sphere: good enough for digits and for telling motion from rest."""
_WITH_CHANNELS = ("fixes", "heading")  # roles whose scalar series are cleaned beside the track


class Rows(NamedTuple):
    """Observations in the order of ``tau``.

    Parameters
    ----------
    fixes
        What was observed; an auxiliary row has only the components its sensor measures.
    tau, time
        (n,) continuous time for the filter and time for the output, s.
    late
        (n,) arrived too late to be put in its place.
    auxiliary
        (n,) True for rows of another sensor, which have no row of their own in the output.
    """

    fixes: Fixes
    tau: FloatArray
    time: FloatArray
    late: BoolArray
    auxiliary: BoolArray


class Chunk(NamedTuple):
    """What is ready at one time: rows, and what came beside them."""

    rows: Rows | None
    channels: tuple[Channel, ...]
    events: tuple[Event, ...]
    problems: tuple[Problem, ...]
    has_depth: bool


@dataclass
class Source:
    """One input and where its reading stands.

    Parameters
    ----------
    logs
        Chunks of the input, in its order.
    name
        What to call it.
    role
        ``fixes``; ``depth`` or ``velocity``, whose observations support the fixes; or ``heading``,
        a series that is only cleaned.
    """

    logs: Iterator[Log]
    role: str = "fixes"
    name: str = ""
    clock: ClockState = field(default_factory=ClockState)
    held: Fixes | None = None
    ready: list[Rows] = field(default_factory=list)
    last_tau: float = -np.inf
    longitude: float = np.nan
    ended: bool = False


def take_rows(rows: Rows, index: IntArray | BoolArray | slice) -> Rows:
    """Pick rows by index, mask or slice."""
    return Rows(
        take_fixes(rows.fixes, index),
        rows.tau[index],
        rows.time[index],
        rows.late[index],
        rows.auxiliary[index],
    )


def take_fixes(fixes: Fixes, index: IntArray | BoolArray | slice) -> Fixes:
    """Pick fixes by index, mask or slice."""
    return Fixes._make([*(column[index] for column in fixes[:-1]), fixes.geographic])


def join_rows(parts: list[Rows]) -> Rows:
    """Put rows one after the other."""
    fixes = join_fixes([part.fixes for part in parts])
    columns = zip(*(part[1:] for part in parts), strict=True)
    return Rows._make([fixes, *(np.concatenate(column) for column in columns)])


def join_fixes(parts: list[Fixes]) -> Fixes:
    """Put fixes one after the other."""
    columns = zip(*(part[:-1] for part in parts), strict=True)
    geographic = any(part.geographic for part in parts)
    return Fixes._make([*(np.concatenate(column) for column in columns), geographic])


def merged(
    sources: Iterable[Source], sensors: list[str], reorder_s: float, delay_s: Mapping[str, float]
) -> Iterator[Chunk]:
    """Read the sources together and give their rows in one order of time.

    Parameters
    ----------
    sources
        Read from the one that is furthest behind.
    sensors
        Names of all sensors; grows as new ones are met, ``Fixes.sensor`` indexes it.
    reorder_s
        How far out of order a row may be, s.
    delay_s
        How much too late the times of a sensor are, by name.
    """
    open_sources = list(sources)
    while True:
        reading = [s for s in open_sources if not s.ended]
        if reading:
            chunk = _advance(min(reading, key=lambda s: s.last_tau), sensors, reorder_s, delay_s)
        else:
            chunk = Chunk(None, (), (), (), False)
        rows = _release(open_sources)
        yield chunk._replace(rows=rows)
        if not reading:
            return


def pushed(
    source: Source,
    log: Log | None,
    sensors: list[str],
    reorder_s: float,
    delay_s: Mapping[str, float],
) -> Chunk:
    """Take the next part of a single source, None at its end, and give the rows that are ready.

    The other arguments are those of `merged`.
    """
    source.logs = iter(() if log is None else (log,))
    chunk = _advance(source, sensors, reorder_s, delay_s)
    return chunk._replace(rows=_release([source]))


def _advance(
    source: Source, sensors: list[str], reorder_s: float, delay_s: Mapping[str, float]
) -> Chunk:
    """Read one chunk of a source into its ready rows."""
    log = next(source.logs, None)
    source.ended = log is None
    fixes = _supporting(log, source.role) if log is not None else None
    if fixes is not None and log is not None:
        numbers = np.array([_number(sensors, name) for name in log.sensors] or [0])
        delays = np.array([delay_s.get(name, 0.0) for name in log.sensors] or [0.0])
        time = fixes.time - delays[fixes.sensor]
        fixes = fixes._replace(sensor=numbers[fixes.sensor], time=time)
    events = _order(source, fixes, reorder_s)
    if log is None:
        return Chunk(None, (), events, (), False)
    channels = log.channels if source.role in _WITH_CHANNELS else ()
    return Chunk(None, channels, (*log.events, *events), log.problems, log.depth_positive_down)


def _number(sensors: list[str], name: str) -> int:
    if name not in sensors:
        sensors.append(name)
    return sensors.index(name)


def _supporting(log: Log, role: str) -> Fixes | None:
    """The fixes of a log; a depth series becomes observations of the height alone."""
    if role != "depth":
        return log.fixes
    series = [c for c in log.channels if c.name == "depth_m"]
    if not series:
        return None
    time = np.concatenate([c.time for c in series])
    n = len(time)
    position = np.full((n, 3), np.nan)
    position[:, 2] = -np.concatenate([c.value for c in series])
    empty = np.full((n, 3), np.nan)
    zero = np.zeros(n, np.int64)
    return Fixes(
        time, position, empty, empty, empty, zero, zero, np.ones(n, bool), np.arange(n), False
    )


def _order(source: Source, new: Fixes | None, reorder_s: float) -> tuple[Event, ...]:
    """Repair the clock of new rows and move those that are let go to the ready ones."""
    parts = [part for part in (source.held, new) if part is not None]
    fresh = new.time if new is not None else np.empty(0)
    place, row = _place(source, new), new.row if new is not None else np.empty(0, np.int64)
    repaired, source.clock, events = repair(
        fresh, place, row, source.clock, final=source.ended, window=reorder_s
    )
    if parts:
        both = join_fixes(parts)
        source.held = take_fixes(both, repaired.held)
        if len(repaired.order):
            auxiliary = np.full(len(repaired.order), source.role != "fixes")
            ordered = take_fixes(both, repaired.order)
            source.ready.append(
                Rows(ordered, repaired.tau, repaired.time, repaired.late, auxiliary)
            )
            source.last_tau = max(source.last_tau, float(np.nanmax(repaired.tau, initial=-np.inf)))
    return events


def _place(source: Source, fixes: Fixes | None) -> FloatArray:
    """(n, 2) rough local metres, good enough to tell a vessel under way from one at rest."""
    if fixes is None:
        return np.empty((0, 2))
    if not fixes.geographic:
        return fixes.position[:, :2]
    latitude, longitude = fixes.position[:, 0], fixes.position[:, 1]
    if np.isnan(source.longitude) and np.isfinite(longitude).any():
        source.longitude = float(longitude[np.isfinite(longitude)][0])
    east = wrap(longitude - source.longitude) * np.cos(np.radians(latitude))
    return np.column_stack([east, latitude]) * METRES_PER_DEGREE


def _release(sources: list[Source]) -> Rows | None:
    """Merge the ready rows that no source can still precede."""
    waiting = [s for s in sources if s.ready]
    if not waiting:
        return None
    until = min((s.last_tau for s in sources if not s.ended), default=np.inf)
    out: list[Rows] = []
    keys: list[FloatArray] = []
    for source in waiting:
        rows = join_rows(source.ready)
        key = _carried(rows.tau)
        stay = (key >= until) & (len(sources) > 1) & (until < np.inf)
        source.ready = [take_rows(rows, stay)] if stay.any() else []
        out.append(take_rows(rows, ~stay))
        keys.append(key[~stay])
    together = join_rows(out)
    if len(together.tau) == 0:
        return None
    if len(out) > 1:
        together = take_rows(together, np.argsort(np.concatenate(keys), kind="stable"))
    return together


def _carried(tau: FloatArray) -> FloatArray:
    """``tau`` with rows that have no time taking that of the row before them."""
    known = np.isfinite(tau)
    last = np.maximum.accumulate(np.where(known, np.arange(len(tau)), -1))
    filled = np.where(last >= 0, tau[last], -np.inf)
    return np.maximum.accumulate(filled) if len(tau) else filled
