"""Rows of fixes from sightings: each waits until the ship's position around its time is known.

It takes the place of `surefix.io.nmea_epoch.Epochs` where a log is read for a transponder.
"""

from __future__ import annotations

import math
from array import array
from collections import deque

import numpy as np

from surefix.io.acoustic_plan import Plan
from surefix.io.acoustic_record import Sighting
from surefix.io.acoustic_ship import GAP, HEADINGS, Ship, placed
from surefix.io.nmea_epoch import source
from surefix.io.nmea_record import Motion, Position, Sigma
from surefix.types import Edit, Fixes

__all__ = ["Sightings"]

_MOST = 4096  # sightings that wait


class Sightings:
    """Rows in the order in which the transponder was heard of."""

    def __init__(self, plan: Plan) -> None:
        self.sources: list[str] = []
        self.lost: list[float] = []  # times of sightings that could not be placed
        self._plan = plan
        self._ship = Ship()
        self._waiting: deque[tuple[Sighting, float]] = deque()
        self._count = 0
        self._columns = tuple(array("d") for _ in range(7))
        self._valid = array("b")

    def __len__(self) -> int:
        """Rows that are ready."""
        return len(self._valid)

    def add(self, record: Position, time: float, _received: float) -> None:
        """Take a position of the ship."""
        if source(record.talker) == self._plan.source:
            self._ship.at(record, time)
            self._release(time)

    def turn(self, kind: str, heading: float, time: float) -> None:
        """Take a true heading of the ship, degrees, from a sentence of a type."""
        if HEADINGS[kind] == self._plan.heading:
            self._ship.turned(heading, time)
            self._release(time)

    def see(self, record: Sighting, time: float) -> bool:
        """Take a sighting; False if it is of another target."""
        if record.target != self._plan.target:
            return False
        self._waiting.append((record, time))
        self._release(time)
        return True

    def move(self, record: Motion, _received: float) -> None:
        """Pass over the ship's velocity."""

    def declare(self, record: Sigma) -> None:
        """Pass over the standard deviations of the ship's position."""

    def shift(self, seconds: float) -> None:
        """Move all rows not yet taken in time, and the ship."""
        times = np.frombuffer(self._columns[0], dtype=np.float64)
        times += seconds
        self._waiting = deque((record, time + seconds) for record, time in self._waiting)
        self._ship.shift(seconds)

    def take(self, last: bool = False) -> Fixes | None:
        """Rows that are ready, with ``last`` all of them; None if there are none."""
        while last and self._waiting:
            self._place(*self._waiting.popleft())
        n = len(self)
        if not n:
            return None
        time, *values = (np.array(column, dtype=np.float64) for column in self._columns)
        valid = np.array(self._valid, dtype=np.bool_)
        self._columns = tuple(array("d") for _ in range(7))
        self._valid = array("b")
        first, self._count = self._count, self._count + n
        unknown = np.full((n, 3), np.nan)
        return Fixes(
            time=time,
            position=np.column_stack(values[:3]),
            velocity=unknown,
            sigma_position=np.column_stack(values[3:]),
            sigma_velocity=unknown.copy(),
            sensor=np.zeros(n, np.int64),
            edit=np.full(n, int(Edit.NONE), dtype=np.int64),
            valid=valid,
            row=np.arange(first, first + n),
            geographic=self._plan.place == "globe",
        )

    def _release(self, now: float) -> None:
        """Place what need not wait any longer, in the order of arrival."""
        while self._waiting:
            record, time = self._waiting[0]
            ready = self._ready(record, time) or now > time + GAP or math.isnan(time)
            if not ready and len(self._waiting) <= _MOST:
                return
            self._place(*self._waiting.popleft())

    def _ready(self, record: Sighting, time: float) -> bool:
        """Whether the ship has been heard of at the time of a sighting or after it."""
        if record.place == self._plan.place or record.place in ("grid", "globe"):
            return True
        fixes, headings = self._ship.fixes, self._ship.headings
        there = self._plan.place != "globe" or bool(fixes and fixes[-1][0] >= time)
        return there and (record.place == "north" or bool(headings and headings[-1][0] >= time))

    def _place(self, record: Sighting, time: float) -> None:
        found = placed(record, time, self._ship, self._plan.place)
        if found is None:
            self.lost.append(time)
            where = (math.nan, math.nan, math.nan)
        else:
            where = (found.x, found.y, -record.depth)
        sigma = record.sigma_x, record.sigma_y, record.sigma_depth
        for column, value in zip(self._columns, (time, *where, *sigma), strict=True):
            column.append(value)
        self._valid.append(record.valid)
        if not self.sources:
            self.sources.append(record.target)
