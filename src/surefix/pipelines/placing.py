"""Put what was seen from a ship on the Earth, where other logs tell how the ship lay.

Positions and headings of the ship come from receivers and compasses of their own, each a series
here. A sighting is placed by the first series that has a value before it and one after it, at most
`GAP` apart, and by the very function that places sightings by what stands in their own log.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.io.acoustic_ship import GAP, HEADINGS, Ship, placed
from surefix.io.nmea_record import REMEDIES
from surefix.pipelines.rows import Rows
from surefix.types import PLACE, FloatArray, Log, Problem

__all__ = ["Told", "escorted", "follow", "known_until"]

_KEPT: Final = 300.0  # s of the ship that are kept behind what may still be asked for
_STEPPED: Final = 60.0  # s that a time falls back by: those before were wrong
_FIXES: Final = ("GGA", "GNS", "RMC", "GLL")  # sentences of one receiver, the best first
_LAST: Final = 9


class Told(NamedTuple):
    """One series of positions, or of headings, of the ship.

    Parameters
    ----------
    sensor
        Where it comes from.
    rank
        The series of the lowest rank comes first, of those of one input.
    time
        (n,) s, rising.
    value
        (n, 2) latitude and longitude, or (n, 1) true heading, degrees.
    """

    sensor: str
    rank: int
    time: FloatArray
    value: FloatArray

    @property
    def places(self) -> bool:
        """Whether it has positions."""
        return bool(self.value.shape[1] == 2)

    def nothing(self) -> Told:
        """The series before anything was told."""
        return self._replace(time=self.time[:0], value=self.value[:0])


def follow(known: tuple[Told, ...], log: Log, needed: float) -> tuple[Told, ...]:
    """Add what a log tells of the ship, and forget what is too old.

    Where the times fall back by more than a minute they were wrong before, and are forgotten.

    Parameters
    ----------
    known
        The series so far.
    log
        Positions in the series `surefix.types.PLACE` or, of a table, its fixes; and headings.
    needed
        s; what is 300 s older than that is forgotten.
    """
    series = {(each.sensor, each.places): each for each in known}
    for new in _news(log):
        key = new.sensor, new.places
        series[key] = _joined(series.get(key, new.nothing()), new, needed)
    return tuple(series.values())


def _joined(known: Told, new: Told, needed: float) -> Told:
    there = np.isfinite(new.time) & np.isfinite(new.value).all(axis=1)
    time = np.concatenate([known.time, new.time[there]])
    value = np.concatenate([known.value, new.value[there]])
    right = time <= np.minimum.accumulate(time[::-1])[::-1] + _STEPPED
    time, first = np.unique(time[right], return_index=True)
    keep = time >= min(needed, float(np.max(time, initial=-np.inf))) - _KEPT
    return known._replace(time=time[keep], value=value[right][first][keep])


def _news(log: Log) -> Iterator[Told]:
    """What a log tells, series by series."""
    channels = {(each.sensor, each.name): each for each in log.channels}
    east = [channels[sensor, PLACE[1]] for sensor, name in channels if name == PLACE[0]]
    for along in east:
        up = channels[along.sensor, PLACE[0]]
        kind = along.sensor.rpartition(" ")[2]
        rank = _FIXES.index(kind) if kind in _FIXES else _LAST
        yield Told(along.sensor, rank, along.time, np.column_stack([up.value, along.value]))
    if not east and log.fixes is not None and log.fixes.geographic and not log.axes:
        fixes = log.fixes
        for number, sensor in enumerate(log.sensors):
            mine = (fixes.sensor == number) & fixes.valid
            yield Told(sensor, _LAST, fixes.time[mine], fixes.position[mine, :2])
    for (sensor, name), each in channels.items():
        if name == "heading_deg":
            kind = sensor.rpartition(" ")[2]
            rank = HEADINGS.get(kind, HEADINGS.get(kind[-3:], _LAST))
            yield Told(sensor, rank, each.time, each.value[:, None])


def known_until(known: Sequence[Told]) -> float:
    """Time up to which what may still come places nothing otherwise, s; −∞ before anything.

    A series that is `GAP` behind the others of its input has no value near enough to come for
    what lies between; it is not waited for.
    """
    last = [float(each.time[-1]) for each in known if len(each.time)]
    newest = max(last, default=-np.inf)
    return min((at for at in last if newest - at <= GAP), default=-np.inf)


def escorted(
    rows: Rows, axes: str, told: Sequence[Sequence[Told]], sensor: str
) -> tuple[Rows, tuple[Problem, ...]]:
    """Put rows on the Earth; those that cannot be placed are left without position, and counted.

    Parameters
    ----------
    rows
        Their positions are in axes of the ship.
    axes
        Which, as ``Log.axes``.
    told
        What each input tells of the ship; the first one comes first.
    sensor
        What was seen.
    """
    series = [each for some in told for each in sorted(some, key=lambda one: one.rank)]
    fixes = [each for each in series if each.places]
    headings = [each for each in series if not each.places]
    position, lost = rows.fixes.position.copy(), []
    for k, time in enumerate(rows.fixes.time.tolist()):
        ship = Ship()
        ship.fixes.extend((at, there[0], there[1]) for at, there in _beside(fixes, time))
        ship.headings.extend((at, there[0]) for at, there in _beside(headings, time))
        x, y = position[k, :2].tolist()
        found = placed(x, y, axes, time, ship, "globe")
        if found is None:
            lost.append(time)
        position[k, :2] = (np.nan, np.nan) if found is None else found
    there = rows.fixes._replace(position=position, geographic=True)
    problems: tuple[Problem, ...] = ()
    if lost:
        example = f"{sensor} at {lost[0]:.1f} s"
        problems = (Problem("unplaced", len(lost), example, REMEDIES["unplaced"]),)
    return rows._replace(fixes=there), problems


def _beside(series: Sequence[Told], time: float) -> list[tuple[float, list[float]]]:
    """The values before and after an instant, of the first series that has both near enough."""
    for each in series:
        after = int(np.searchsorted(each.time, time))
        before = after if after < len(each.time) and each.time[after] == time else after - 1
        if before >= 0 and after < len(each.time) and each.time[after] - each.time[before] <= GAP:
            return [(float(each.time[k]), each.value[k].tolist()) for k in (before, after)]
    return []
