"""Rows of fixes from sightings: each waits until the ship's position around its time is known.

It takes the place of `surefix.io.nmea_epoch.Epochs` where a log is read for a transponder. A stream
cannot be looked through before it is read: the first sightings then wait until the plan is made.
"""

from __future__ import annotations

import copy
import math
from array import array
from collections import deque

import numpy as np

from surefix.io.acoustic_plan import FIRST, SHIP, Plan, Seen
from surefix.io.acoustic_record import Place, Sighting
from surefix.io.acoustic_ship import GAP, HEADINGS, Ship, placed
from surefix.io.nmea_epoch import source
from surefix.io.nmea_record import Motion, Position, Sigma
from surefix.types import Edit, Fixes

__all__ = ["Sightings"]

_MOST = 4096  # sightings that wait
_HEARD = 20  # sightings of a target that a stream's plan is made on …
_PATIENCE = 120  # … or, as long as it can only be told from the ship, at most


class Sightings:
    """Rows in the order in which the transponder was heard of.

    Parameters
    ----------
    plan
        From looking the log through; of a stream, a transponder, or `FIRST`.
    apart
        Whether another log tells where the ship was; sightings are then left in its axes.
    """

    def __init__(self, plan: Plan | str, apart: bool = False) -> None:
        self.sources: list[str] = []
        self.lost: list[float] = []  # times of sightings that could not be placed
        self.plan = None if isinstance(plan, str) else plan
        self._target = plan if isinstance(plan, str) else plan.target
        self._apart = apart
        self._seen = Seen()
        self._ships: dict[str, Ship] = {}  # by source of the positions, those without plan
        self._turns: dict[int, Ship] = {}  # by rank of the headings, those without plan
        self._ship = Ship()
        self._waiting: deque[tuple[Sighting, float]] = deque()
        self._count = 0
        self._columns = tuple(array("d") for _ in range(7))
        self._valid = array("b")

    def __len__(self) -> int:
        """Rows that are ready."""
        return len(self._valid)

    @property
    def axes(self) -> str:
        """What the rows are in, as ``Log.axes``."""
        if self.plan is None:
            return "wait" if self._waiting else "?"
        left = self._apart and self.plan.place in ("ship", "north")
        return self.plan.place if left else ""

    @property
    def count(self) -> int:
        """Sightings of the target so far, those that wait included."""
        return self._count + len(self) + len(self._waiting)

    def waiting(self) -> list[tuple[str, int, float, bool]]:
        """Give those that are not ready: target, number, time, whether there is a position."""
        first = self._count + len(self)
        return [
            (each.target, first + k, time, each.valid)
            for k, (each, time) in enumerate(self._waiting)
        ]

    def copy(self) -> Sightings:
        """One that goes on by itself from here."""
        other = copy.copy(self)
        vars(other).update(
            sources=[*self.sources],
            lost=[*self.lost],
            _columns=tuple(column[:] for column in self._columns),
            _valid=self._valid[:],
            _waiting=self._waiting.copy(),
            _seen=copy.deepcopy(self._seen),
            _ship=self._ship.copy(),
            _ships={name: ship.copy() for name, ship in self._ships.items()},
            _turns={rank: ship.copy() for rank, ship in self._turns.items()},
        )
        return other

    def add(self, record: Position, time: float, _received: float) -> None:
        """Take a position of the ship."""
        name = source(record.talker)
        if self.plan is None:
            self._seen.fixed(record)
            self._ships.setdefault(name, Ship()).at(record, time)
        elif name == self.plan.source:
            self._ship.at(record, time)
            self._release(time)

    def turn(self, kind: str, heading: float, time: float) -> None:
        """Take a true heading of the ship, degrees, from a sentence of a type."""
        if self.plan is None:
            self._seen.turned(kind, heading)
            self._turns.setdefault(HEADINGS[kind], Ship()).turned(heading, time)
        elif HEADINGS[kind] == self.plan.heading:
            self._ship.turned(heading, time)
            self._release(time)

    def see(self, record: Sighting, time: float) -> bool:
        """Take a sighting; False if it is of another target."""
        if self.plan is None:
            self._seen.sighted(record)
            if self._target == FIRST and not record.target.lower().startswith(SHIP):
                self._target = record.target
        if record.target != self._target:
            return False
        self._waiting.append((record, time))
        if self.plan is None and self._enough():
            self._settle()
        self._release(time)
        return True

    def _enough(self) -> bool:
        """Whether a plan can be made by now, for the best that this target can be told in."""
        heard = len(self._waiting)
        if heard < _HEARD or heard >= _PATIENCE:
            return heard >= _PATIENCE
        plan = self._seen.plan(self._target)
        return self._apart or (plan is not None and plan.place in ("globe", "grid"))

    def _settle(self) -> None:
        """Make the plan, and keep of the ship what it needs."""
        plan = self._seen.plan(self._target, apart=self._apart)
        if plan is not None:
            self.plan = plan
            self._ship = self._ships.get(plan.source, Ship())
            self._ship.headings = self._turns.get(plan.heading, Ship()).headings
            self._ships, self._turns, self._seen = {}, {}, Seen()

    def move(self, record: Motion, _received: float) -> None:
        """Pass over the ship's velocity."""

    def declare(self, record: Sigma) -> None:
        """Pass over the standard deviations of the ship's position."""

    def shift(self, seconds: float) -> None:
        """Move all rows not yet taken in time, and the ship."""
        times = np.frombuffer(self._columns[0], dtype=np.float64)
        times += seconds
        self._waiting = deque((record, time + seconds) for record, time in self._waiting)
        for ship in (self._ship, *self._ships.values(), *self._turns.values()):
            ship.shift(seconds)

    def take(self, last: bool = False) -> Fixes | None:
        """Rows that are ready, with ``last`` all of them; None if there are none."""
        if last and self.plan is None:
            self._settle()
        while last and self.plan is not None and self._waiting:
            self._place(*self._waiting.popleft())
        n = len(self)
        if not n or self.plan is None:
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
            geographic=self.plan.place == "globe",
        )

    def _release(self, now: float) -> None:
        """Place what need not wait any longer, in the order of arrival."""
        while self.plan is not None and self._waiting:
            record, time = self._waiting[0]
            ready = (
                self._ready(record, time, self.plan.place) or now > time + GAP or math.isnan(time)
            )
            if not ready and len(self._waiting) <= _MOST:
                return
            self._place(*self._waiting.popleft())

    def _ready(self, record: Sighting, time: float, place: Place) -> bool:
        """Whether the ship has been heard of at the time of a sighting or after it."""
        if record.place == place or record.place in ("grid", "globe"):
            return True
        fixes, headings = self._ship.fixes, self._ship.headings
        there = place != "globe" or bool(fixes and fixes[-1][0] >= time)
        return there and (record.place == "north" or bool(headings and headings[-1][0] >= time))

    def _place(self, record: Sighting, time: float) -> None:
        assert self.plan is not None
        found = placed(record.x, record.y, record.place, time, self._ship, self.plan.place)
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
