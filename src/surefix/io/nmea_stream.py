"""A log of sentences that comes in pieces: what has been read and not yet given out."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path

from surefix.io.acoustic_clock import CALENDAR, DeviceClock
from surefix.io.acoustic_line import read_line
from surefix.io.acoustic_plan import SHIP, Plan, described
from surefix.io.acoustic_record import Attitude, BodyVelocity, Sighting
from surefix.io.acoustic_rows import Sightings
from surefix.io.nmea import parse
from surefix.io.nmea_clock import LogClock, receive_time
from surefix.io.nmea_epoch import Epochs, source
from surefix.io.nmea_frame import START, Frame, finish, foreign, frame
from surefix.io.nmea_lines import Plain
from surefix.io.nmea_record import (
    REMEDIES,
    AlongSpeed,
    Clock,
    Depth,
    Heading,
    Motion,
    Position,
    ProblemKind,
    Record,
    Refused,
    Sigma,
    WaterSpeed,
)
from surefix.io.nmea_series import Series
from surefix.types import PLACE, Event, Log, Problem

__all__ = ["NmeaStream"]

_UNDATED = 500  # rows of a stream that wait for the first date
_STATE = (
    "_framing", "_clock", "_epochs", "_devices", "_channels", "_counts",
    "_problems", "_reported", "_line", "_led",
)  # fmt: skip
_SAMPLES_PER_FIX = 10  # a chunk also ends after so many channel samples per fix it may hold


class NmeaStream:
    """A log that comes in pieces, cut anywhere: what has been read and not yet given out.

    Parameters
    ----------
    path
        Its name, which the names of sensors begin with.
    require_checksum
        As for `read_nmea`.
    plan
        Which acoustic target's sightings are its fixes, and how; of a stream, which is not looked
        through before, the target alone, or `FIRST`. None: the fixes are those of its receivers.
    apart
        Whether sightings, of this log or another, are placed later, by what is told of the ship
        here or elsewhere: its positions are given as series, and sightings left in its axes.
    """

    def __init__(
        self,
        path: Path,
        require_checksum: bool = True,
        plan: Plan | str | None = None,
        apart: bool = False,
    ) -> None:
        self._path, self._apart = path, apart
        self._framing = START
        self._arrival = math.nan
        self._require_checksum = require_checksum
        self._clock = LogClock()
        self._epochs = Epochs() if plan is None or plan == SHIP else Sightings(plan, apart)
        self._led = math.nan  # time that a device has given to the log
        self._devices = {name: DeviceClock() for name in ("DVL", "USBLLONG")}
        self._channels = Series()
        self._counts: dict[str, int] = {}
        self._problems: dict[ProblemKind, tuple[int, str]] = {}
        self._coming: Iterator[Frame | tuple[int, float, Record]] = iter(())
        self._reported: set[str] = set()
        self._line = 0
        self._bind()

    def _bind(self) -> None:
        """Say who takes a record."""
        self._take: dict[type, Callable[..., bool | None]] = {
            Position: self._position,
            Motion: self._motion,
            Heading: self._heading,
            WaterSpeed: self._water_speed,
            AlongSpeed: self._along_speed,
            Depth: self._depth,
            Clock: self._time,
            Sigma: self._epochs.declare,
            Sighting: self._sighting,
            Attitude: self._attitude,
            BodyVelocity: self._body_velocity,
        }

    @property
    def state(self) -> dict[str, object]:
        """What it remembers, plain data that can be stored; `resume` goes on from it."""
        return {name: getattr(self, name) for name in _STATE}

    def resume(self, state: Mapping[str, object]) -> None:
        """Go on from a state of a stream of the same name and plan."""
        for name in _STATE:
            setattr(self, name, state[name])
        self._bind()

    def copy(self) -> NmeaStream:
        """One that goes on by itself from here, between two pieces."""
        other = NmeaStream(self._path, self._require_checksum, apart=self._apart)
        other.resume(
            self.state
            | {
                "_clock": copy.copy(self._clock),
                "_epochs": self._epochs.copy(),
                "_devices": {name: copy.copy(clock) for name, clock in self._devices.items()},
                "_channels": self._channels.copy(),
                "_counts": {**self._counts},
                "_problems": {**self._problems},
                "_reported": {*self._reported},
            }
        )
        return other

    @property
    def _sightings(self) -> Sightings | None:
        return self._epochs if isinstance(self._epochs, Sightings) else None

    @property
    def newest(self) -> float:
        """s, of the latest sentence: its own time, or that of its reception; NaN before any."""
        return self._clock.now()

    @property
    def count(self) -> int:
        """Rows begun so far."""
        return self._epochs.count

    @property
    def size(self) -> float:
        """Rows that a chunk would hold, or their equivalent in samples."""
        return max(len(self._epochs), self._channels.count / _SAMPLES_PER_FIX)

    @property
    def begun(self) -> list[tuple[str, int, float, bool]]:
        """Fixes that are not given out yet: sensor, number, time, and whether it has a position."""
        if not isinstance(self._epochs, Epochs) or not self._clock.dated:
            return []
        return [(f"{self._path.stem} {name}", n, t, ok) for name, n, t, ok in self._epochs.begun()]

    @property
    def waiting(self) -> list[tuple[str, int, float, bool]]:
        """Sightings that wait until the ship's position at their time is known; as `begun`."""
        if self._sightings is None:
            return []
        told = self._sightings.waiting()
        return [(f"{self._path.stem} {name}", n, t, ok) for name, n, t, ok in told]

    def read(self, data: bytes, arrival: float = math.nan) -> Log:
        """Read the next piece and give the rows that are complete.

        As long as there is neither a date nor a time of reception, up to 500 rows wait for one.

        Parameters
        ----------
        data
            The piece.
        arrival
            s, Unix, when it arrived; it is the time of reception of lines that do not say one.
        """
        self._arrival = arrival
        self._framing, frames = frame(self._framing, data)
        self._read(frames)
        received = not math.isnan(self._clock.receive)
        if self._clock.dated or received or self.size >= _UNDATED:
            return self.chunk()
        return Log(source=str(self._path))

    def settle(self, before: float) -> Log:
        """Give the fixes that began before a time, although a sentence may still belong to them."""
        if isinstance(self._epochs, Epochs):
            self._epochs.settle(before)
        return self.chunk()

    def rest(self) -> Log:
        """Read the line without an end, if there is one, and give all rows."""
        self._read(finish(self._framing))
        self._framing = START
        return self.chunk(last=True)

    def _read(self, frames: list[Frame]) -> None:
        self.add(self.begin(frames))
        self._coming = iter(())

    def begin(self, found: Plain | list[Frame]) -> int:
        """Take the next piece of the log; gives how many records or frames are in it."""
        if not isinstance(found, Plain):
            self._coming = iter(found)
            return len(found)
        self._count(found.unknown)
        self._coming = found.records
        return found.total

    def add(self, most: int) -> None:
        """Read so many records or frames of the piece, or what is left of it."""
        for item in islice(self._coming, most):
            if isinstance(item, Frame):
                self._add(item)
            else:
                self._line, self._clock.receive, record = item
                self._heed(record)

    def _count(self, unknown: Mapping[str, int]) -> None:
        for kind, count in unknown.items():
            self._counts[kind] = self._counts.get(kind, 0) + count

    def _add(self, item: Frame) -> None:
        line, prefix, text, problem = item
        if prefix:
            self._received(line, prefix)
        elif line != self._line:
            self._clock.receive = self._arrival
        self._line = line
        if problem is None:
            record = parse(text, require_checksum=self._require_checksum)
        else:
            told = read_line(text) if problem == "not-nmea" else None
            if told is None:
                self._problem(problem, line, text)
                return
            before, record = told
            if before:
                self._received(line, before.strip())
        if not isinstance(record, Refused):
            if self._heed(record) is False:
                self._problem("other-target", line, text)
        elif record.kind == "unknown-type":
            self._count({record.text: 1})
        else:
            self._problem(record.kind, line, text)

    def _heed(self, record: Record) -> bool | None:
        """Take a record in; False: it is of no target."""
        kind = record.type
        self._counts[kind] = self._counts.get(kind, 0) + 1
        return self._take[record.__class__](record)

    def chunk(self, last: bool = False) -> Log:
        """Give out what is complete, with ``last`` all there is."""
        log = Log(
            source=str(self._path),
            fixes=self._epochs.take(last),
            sensors=tuple(f"{self._path.stem} {name}" for name in self._epochs.sources),
            channels=tuple(self._channels.told(self._path.stem)),
            problems=tuple(self._told()),
            events=tuple(self._events()),
            counts=self._counts,
            depth_positive_down=self._sightings is not None,
            axes=self._sightings.axes if self._sightings is not None else "",
        )
        self._channels, self._problems, self._counts = Series(), {}, {}
        self._clock.settle()
        return log

    def _told(self) -> Iterator[Problem]:
        for kind, (total, example) in self._problems.items():
            yield Problem(kind, total, example, REMEDIES[kind])
        if self._sightings is not None and (lost := self._sightings.lost):
            example = f"{self._sightings.sources[0]} at {lost[0]:.1f} s"
            yield Problem("unplaced", len(lost), example, REMEDIES["unplaced"])
            lost.clear()

    def _events(self) -> Iterator[Event]:
        plan = None if self._sightings is None else self._sightings.plan
        if plan is not None and "plan" not in self._reported:
            self._reported.add("plan")
            yield Event("note", math.nan, described(plan))
        count = self._clock.rollovers
        if count and "rollover" not in self._reported:
            self._reported.add("rollover")
            text = (
                f"the dates of this log are {count} × 1024 weeks behind the times of reception "
                "(GPS week rollover); corrected"
            )
            yield Event("week-rollover", math.nan, text)
        undated = not self._clock.dated and not math.isnan(self._clock.latest)
        if undated and "undated" not in self._reported:
            self._reported.add("undated")
            text = "the log has no date: times count from midnight of its first day"
            yield Event("note", math.nan, text)

    def _received(self, line: int, prefix: bytes) -> None:
        time = receive_time(prefix)
        if line != self._line or not math.isnan(time):
            self._clock.receive = time
        if math.isnan(time):
            self._problem(foreign(prefix), line, prefix)

    def _problem(self, kind: ProblemKind, line: int, text: bytes) -> None:
        total, example = self._problems.get(kind, (0, ""))
        if not total:
            shown = text[:82].decode("ascii", "backslashreplace")
            example = f"line {line}: {shown}"
        self._problems[kind] = total + 1, example

    def _instant(self, second: float, day: int | None) -> float:
        time = self._clock.at(second, day)
        if self._clock.shift:
            self._epochs.shift(self._clock.shift)
            self._channels.shift(self._clock.shift)
            self._clock.shift = 0.0
        return time

    def _position(self, record: Position) -> None:
        time = self._instant(record.second, record.day)
        self._epochs.add(record, time, self._clock.receive)
        if self._apart and record.valid:
            name = f"{source(record.talker)} {record.type}"
            self._channels.add(PLACE[0], name, time, record.latitude)
            self._channels.add(PLACE[1], name, time, record.longitude)
        if record.type == "RMC":
            sensor = record.talker + "RMC"
            self._channels.add("speed_mps", sensor, time, record.speed)
            self._channels.add("course_deg", sensor, time, record.course)

    def _motion(self, record: Motion) -> None:
        self._epochs.move(record, self._clock.receive)
        self._samples_of(record, speed_mps=record.speed, course_deg=record.course)

    def _sighting(self, record: Sighting) -> bool | None:
        """Take a sighting; False if it is of another target than that of the plan."""
        if math.isnan(record.measured):
            time = self._instant(record.second, record.day)
        else:
            time = self._device(record.type, record.measured, record.told)
        return None if self._sightings is None else self._sightings.see(record, time)

    def _attitude(self, record: Attitude) -> None:
        time, sensor = self._instant(record.second, None), record.talker + record.type
        for name in ("heading", "roll", "pitch"):
            value = getattr(record, name)
            if value is not None:
                self._channels.add(f"{name}_deg", sensor, time, value)
        if self._sightings is not None and record.heading is not None:
            self._sightings.turn(record.type, record.heading, time)

    def _body_velocity(self, record: BodyVelocity) -> None:
        time = self._device(record.type, record.measured, record.told)
        self._channels.add("forward_mps", record.type, time, record.forward)
        self._channels.add("starboard_mps", record.type, time, record.starboard)
        self._channels.add("down_mps", record.type, time, record.down)
        self._channels.add("velocity_sigma_mps", record.type, time, record.sigma)

    def _device(self, name: str, measured: float, told: float) -> float:
        """Instant of a measurement; a device's calendar dates a log that has no time yet."""
        now = self._clock.now()
        if not math.isnan(now) and now != self._led:
            return self._devices[name].at(measured, told, now)
        if measured < CALENDAR:
            return math.nan
        self._led = self._clock.latest = measured
        self._clock.dated = True
        return measured

    def _heading(self, record: Heading) -> None:
        if self._sightings is not None:
            self._sightings.turn(record.type, record.true, self._clock.now())
        if record.type in ("HDT", "THS") or not math.isnan(record.true):
            self._samples_of(record, heading_deg=record.true)
        else:
            self._samples_of(record, heading_magnetic_deg=record.magnetic)

    def _water_speed(self, record: WaterSpeed) -> None:
        self._samples_of(record, water_speed_mps=record.speed)
        if not math.isnan(record.true):
            self._samples_of(record, heading_deg=record.true)
        if not math.isnan(record.magnetic):
            self._samples_of(record, heading_magnetic_deg=record.magnetic)

    def _along_speed(self, record: AlongSpeed) -> None:
        water, ground = record.water, record.ground
        self._samples_of(record, water_speed_along_mps=water, ground_speed_along_mps=ground)

    def _depth(self, record: Depth) -> None:
        self._samples_of(record, depth_m=record.depth)

    def _time(self, record: Clock) -> None:
        self._instant(record.second, record.day)

    def _samples_of(self, record: Record, **values: float) -> None:
        time, sensor = self._clock.now(), record.talker + record.type
        for name, value in values.items():
            self._channels.add(name, sensor, time, value)
