"""Where the ship was, and how it lay, when a transponder was seen.

The ship's position at an instant lies on the geodesic between its fix before and its fix after, in
proportion to the time; its heading turns evenly, the shorter way. Both must be at most `GAP` apart:
nothing is extrapolated. Roll and pitch are not applied: the systems read here give levelled
positions. Nor are lever arms: the transducer is taken to be at the antenna.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from surefix.geo.angle import wrap
from surefix.geo.local_frame import LocalFrame
from surefix.io.nmea_record import Position

__all__ = ["GAP", "HEADINGS", "Placed", "Ship", "placed"]

GAP = 10.0
"""s between two fixes, or two headings, of the ship that are still interpolated between."""

HEADINGS = {
    "PSIMSNS": 0, "HDT": 1, "THS": 1, "PTSAH": 2, "PASHR": 2, "PSXN": 2, "HDG": 3, "HDM": 3,
}  # fmt: skip
"""Sentences with a true heading and their rank; those of the best rank in a log turn positions."""

_KEPT = 4096
_Entry = TypeVar("_Entry", bound=tuple[float, ...])


class Placed(NamedTuple):
    """A sighting in the axes of the output: x, y m or latitude, longitude deg."""

    x: float
    y: float


@dataclass(slots=True)
class Ship:
    """Fixes and headings of the ship, as far back as they may still be asked for.

    Parameters
    ----------
    fixes
        (time s, latitude deg, longitude deg).
    headings
        (time s, degrees).
    decimals
        Those of the latest fix.
    """

    fixes: deque[tuple[float, float, float]] = field(default_factory=lambda: deque(maxlen=_KEPT))
    headings: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=_KEPT))
    decimals: int = -9

    def copy(self) -> Ship:
        """One that goes on by itself from here."""
        return Ship(self.fixes.copy(), self.headings.copy(), self.decimals)

    def at(self, record: Position, time: float) -> None:
        """Take a fix; of several at one time the one with most decimals counts."""
        if not record.valid or math.isnan(time):
            return
        if self.fixes and self.fixes[-1][0] == time:
            if record.decimals <= self.decimals:
                return
            self.fixes.pop()
        self.decimals = record.decimals
        self.fixes.append((time, record.latitude, record.longitude))

    def turned(self, heading: float, time: float) -> None:
        """Take a true heading, degrees."""
        if not math.isnan(heading + time):
            self.headings.append((time, heading))

    def shift(self, seconds: float) -> None:
        """Move everything in time."""
        self.fixes = deque(((t + seconds, a, b) for t, a, b in self.fixes), maxlen=_KEPT)
        self.headings = deque(((t + seconds, a) for t, a in self.headings), maxlen=_KEPT)

    def position(self, time: float) -> LocalFrame | None:
        """Axes east and north through the ship at an instant; None if it is not known where."""
        found = _around(self.fixes, time)
        if found is None:
            return None
        (before, latitude, longitude), (after, *end) = found
        start = LocalFrame(latitude, longitude)
        if after == before:
            return start
        share = (time - before) / (after - before)
        x, y, _ = start.to_local(end[0], end[1])
        there, along, _ = start.to_geographic(share * x, share * y)
        return LocalFrame(float(there[0]), float(along[0]))

    def heading(self, time: float) -> float:
        """True heading at an instant, degrees; NaN if it is not known."""
        found = _around(self.headings, time)
        if found is None:
            return math.nan
        (before, first), (after, second) = found
        share = (time - before) / (after - before) if after > before else 0.0
        return (first + share * float(wrap(second - first))) % 360.0


def _around(known: deque[_Entry], time: float) -> tuple[_Entry, _Entry] | None:
    """The last entry before an instant and the first after it, if they are near enough."""
    before = after = None
    for entry in reversed(known):
        if entry[0] >= time and (after is None or entry[0] <= after[0]):
            after = entry
        if entry[0] <= time:
            before = entry
            break
    if before is None or after is None or after[0] - before[0] > GAP:
        return None
    return before, after


def placed(x: float, y: float, axes: str, time: float, ship: Ship, place: str) -> Placed | None:
    """Bring a sighting to the axes of the output; None if they cannot be reached from its own.

    Parameters
    ----------
    x, y, axes
        What was seen, as in `surefix.io.acoustic_record.Sighting`; ``axes`` is its ``place``.
    time
        s, when.
    ship
        The ship around that time.
    place
        What the output is in, one of `surefix.io.acoustic_record.Place`.
    """
    if math.isnan(x):
        return Placed(math.nan, math.nan)
    if axes == place:
        return Placed(x, y)
    if axes not in ("ship", "north") or place not in ("north", "globe"):
        return None
    if axes == "ship":
        angle = math.radians(ship.heading(time))
        sine, cosine = math.sin(angle), math.cos(angle)
        x, y = x * cosine + y * sine, y * cosine - x * sine
        if math.isnan(x):
            return None
    if place == "globe":
        frame = ship.position(time)
        if frame is None:
            return None
        latitude, longitude, _ = frame.to_geographic(x, y)
        x, y = float(latitude[0]), float(longitude[0])
    return Placed(x, y)
