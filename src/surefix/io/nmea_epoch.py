"""One row per position epoch: GGA, RMC, GLL and GNS of one epoch put together.

A sentence belongs to a row of its source if it has the row's time of day and its type has not yet
been seen there. So an epoch that is logged twice gives two rows, and GGA, RMC and GLL of one epoch
give one, in whatever order they come. The satellite systems of a receiver (talkers GP, GN, GL …)
are one source; GN, which uses them all, is preferred.
"""

from __future__ import annotations

import copy
from array import array
from collections import deque
from math import cos, isnan, nan, radians, sin

import numpy as np

from surefix.io.nmea_record import Motion, Position, Sigma
from surefix.types import BoolArray, Edit, Fixes, FloatArray, IntArray

__all__ = ["Epochs", "source"]

_COLUMNS, _MARKS = 9, 3  # of a row that is complete
_OPEN_ROWS = 8  # rows that may still be joined by a sentence that comes late
_MOTION_AGE = 0.5  # s; a sentence without a time belongs to an epoch received at most so long ago
_SYSTEMS = frozenset({"GP", "GN", "GL", "GA", "GB", "BD", "GQ", "QZ", "GI"})
_PREFERENCE = {"GGA": 3, "GNS": 2, "RMC": 1, "GLL": 0}


def source(talker: str) -> str:
    """Name of the position source a talker belongs to.

    >>> source("GL"), source("II")
    ('GNSS', 'II')
    """
    return "GNSS" if talker in _SYSTEMS else talker


class _Row:
    """A row that may still grow."""

    __slots__ = (
        "course", "east", "height", "height_rank", "invalid", "latitude", "longitude", "north",
        "number", "rank", "received", "second", "seen", "source", "speed", "talker", "time", "up",
    )  # fmt: skip

    def __init__(self, name: str, number: int, second: float, time: float) -> None:
        self.source, self.number, self.second, self.time = name, number, second, time
        self.seen: list[str] = []
        self.invalid: list[str] = []
        self.rank: tuple[bool, bool, bool, int, int] = (False, False, False, -9, -1)
        self.height_rank = (False, False)
        self.talker = ""
        self.received = nan
        self.latitude = self.longitude = self.height = self.speed = self.course = nan
        self.east = self.north = self.up = nan

    def copy(self) -> _Row:
        """One that grows by itself."""
        other = copy.copy(self)
        other.seen, other.invalid = [*self.seen], [*self.invalid]
        return other

    def add(self, record: Position) -> None:
        """Take from the sentence what is better than what is there."""
        talker, kind, _, latitude, longitude, valid, decimals, height, speed, course, _ = record
        self.seen.append(talker + kind)
        if not valid:
            self.invalid.append(talker)
        whole = talker == "GN"
        rank = (valid, not isnan(latitude), whole, decimals, _PREFERENCE[kind])
        if rank > self.rank:
            self.rank, self.talker = rank, talker
            self.latitude, self.longitude = latitude, longitude
        if not isnan(height) and (isnan(self.height) or (valid, whole) > self.height_rank):
            self.height, self.height_rank = height, (valid, whole)
        if not isnan(speed) and not isnan(course):
            self.speed, self.course = speed, course

    @property
    def valid(self) -> bool:
        """Whether the source of the position calls it valid, in every sentence of the epoch."""
        return self.talker not in self.invalid


class Epochs:
    """Rows in the order in which they began, and the columns of those that are complete."""

    def __init__(self) -> None:
        self.sources: list[str] = []
        self.count = 0
        self._open: deque[_Row] = deque()
        self._sigma: Sigma | None = None
        self._clear()

    def __len__(self) -> int:
        """Complete rows."""
        return len(self._marks) // _MARKS

    def begun(self) -> list[tuple[str, int, float, bool]]:
        """Give the rows that may still grow: source, number, time, whether there is a position."""
        return [
            (row.source, row.number, row.time, row.valid and not isnan(row.latitude))
            for row in self._open
        ]

    def settle(self, before: float) -> None:
        """Complete the rows that began before a time."""
        while self._open and self._open[0].time < before:
            self._close(self._open.popleft())

    def copy(self) -> Epochs:
        """One that goes on by itself from here."""
        other = copy.copy(self)
        vars(other).update(
            sources=[*self.sources],
            _open=deque(row.copy() for row in self._open),
            _values=self._values[:],
            _marks=self._marks[:],
        )
        return other

    def add(self, record: Position, time: float, received: float) -> None:
        """Put a position sentence into its row, or begin one.

        ``time`` and ``received`` are s; ``received`` is NaN if the log does not say.
        """
        name = source(record.talker)
        row = self._find(name, record.talker + record.type, record.second, received)
        if row is None:
            row = self._begin(name, record.second, time)
        elif record.day is not None:
            row.time = time
        row.received = received
        row.add(record)

    def move(self, record: Motion, received: float) -> None:
        """Give speed and course to the latest row of the talker, unless they are old or known."""
        row = self._find(source(record.talker), record.talker + "VTG", nan, received)
        if row is None:
            return
        row.seen.append(record.talker + "VTG")
        if isnan(row.speed) and not isnan(record.speed) and not isnan(record.course):
            row.speed, row.course = record.speed, record.course

    def declare(self, record: Sigma) -> None:
        """Give standard deviations to the row of the same epoch, or keep them for it."""
        name = source(record.talker)
        row = self._find(name, record.talker + "GST", record.second, nan)
        if row is None or isnan(record.second):
            self._sigma = record
            return
        row.seen.append(record.talker + "GST")
        row.east, row.north, row.up = record[3:]

    def shift(self, seconds: float) -> None:
        """Move all rows not yet taken in time."""
        for row in self._open:
            row.time += seconds
        times = np.frombuffer(self._values, dtype=np.float64)[::_COLUMNS]
        times += seconds

    def take(self, last: bool = False) -> Fixes | None:
        """Complete rows, with ``last`` all of them; None if there are none."""
        while last and self._open:
            self._close(self._open.popleft())
        if not len(self):
            return None
        rows = np.array(self._values, dtype=np.float64).reshape(-1, _COLUMNS)
        time, *values = (np.ascontiguousarray(column) for column in rows.T)
        marks = np.array(self._marks, dtype=np.int64).reshape(-1, _MARKS)
        sensor, number, valid = (np.ascontiguousarray(column) for column in marks.T)
        self._clear()
        return _fixes(time, values, sensor, number, valid != 0)

    def _clear(self) -> None:
        self._values, self._marks = array("d"), array("q")  # row after row

    def _find(self, name: str, kind: str, second: float, received: float) -> _Row | None:
        timed = not isnan(second)
        for row in reversed(self._open):
            if row.source != name:
                continue
            if timed and row.second == second:
                if kind not in row.seen:
                    return row
            elif not timed or isnan(row.second):
                old = abs(received - row.received) > _MOTION_AGE
                return row if not timed and not old and kind not in row.seen else None
        return None

    def _begin(self, name: str, second: float, time: float) -> _Row:
        row = _Row(name, self.count, second, time)
        self.count += 1
        self._open.append(row)
        if len(self._open) > _OPEN_ROWS:
            self._close(self._open.popleft())
        kept = self._sigma
        if kept is not None and kept.second == second and source(kept.talker) == name:
            row.seen.append(kept.talker + "GST")
            row.east, row.north, row.up = kept[3:]
        self._sigma = None
        return row

    def _close(self, row: _Row) -> None:
        if row.source not in self.sources:
            self.sources.append(row.source)
        valid = row.valid
        height = row.height if row.height_rank[0] or not valid else nan
        course = radians(row.course)
        moved = (row.speed * sin(course), row.speed * cos(course))
        place = (row.time, row.latitude, row.longitude, height)
        self._values.extend((*place, *moved, row.east, row.north, row.up))
        self._marks.extend((self.sources.index(row.source), row.number, valid))


def _fixes(
    time: FloatArray, values: list[FloatArray], sensor: IntArray, number: IntArray, valid: BoolArray
) -> Fixes:
    latitude, longitude, height, east, north, sigma_east, sigma_north, sigma_up = values
    missing = np.full(len(time), np.nan)
    return Fixes(
        time=time,
        position=np.column_stack([latitude, longitude, height]),
        velocity=np.column_stack([east, north, missing]),
        sigma_position=np.column_stack([sigma_east, sigma_north, sigma_up]),
        sigma_velocity=np.full((len(time), 3), np.nan),
        sensor=sensor,
        edit=np.full(len(time), int(Edit.NONE), dtype=np.int64),
        valid=valid,
        row=number,
        geographic=True,
    )
