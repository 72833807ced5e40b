"""NMEA 0183 logs: files of sentences, bare or each behind its time of reception."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path

import numpy as np

from surefix.errors import InputError
from surefix.io.nmea import parse
from surefix.io.nmea_clock import LogClock, receive_time
from surefix.io.nmea_epoch import Epochs
from surefix.io.nmea_frame import START, Frame, finish, foreign, frame
from surefix.io.nmea_lines import Plain, pieces
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
from surefix.types import Channel, Event, Log, Problem

__all__ = ["read_nmea", "sniff"]

_BLOCK = 1 << 18
_STEP = 256  # frames between two looks at the size of a chunk
_SAMPLES_PER_FIX = 10  # a chunk also ends after so many channel samples per fix it may hold
_ANGLES = frozenset({"heading_deg", "heading_magnetic_deg", "course_deg"})
_SHARE = 0.3


def sniff(head: bytes) -> bool:
    """Whether a file that begins like this is an NMEA log.

    It is if at least three in ten of its lines of text hold a sentence, with a right checksum or of
    a known type without one. Lines that are binary or begin with ``#`` do not count.

    >>> sniff(b"2014-08-01T00:00:00Z $HEHDT,218.53,T*12"), sniff(b"time,lat,lon")
    (True, False)
    """
    end = max(head.rfind(b"\n"), head.rfind(b"\r"))
    state, frames = frame(START, head[: end + 1] if end > 0 else head)
    good = other = 0
    for _, _, text, problem in [*frames, *finish(state)]:
        if problem in ("binary", "too-long") or text.startswith(b"#"):
            continue
        known = problem is None and _plausible(text)
        good += known
        other += not known
    return good > 0 and good >= _SHARE * (good + other)


def _plausible(sentence: bytes) -> bool:
    record = parse(sentence, require_checksum=False)
    if not isinstance(record, Refused):
        return True
    return record.kind == "unknown-type" and b"*" in sentence


def read_nmea(
    path: Path,
    *,
    require_checksum: bool = True,
    chunk_fixes: int = 50_000,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Log]:
    """Read a log in chunks, in the order of arrival, with bounded memory; at least one chunk.

    Each sentence counts at its own UTC time of day, with the date nearest to its time of reception
    or, in a bare log, to the last date met. Sentences without a time get the time of reception, or
    that of the latest sentence with one. A log without any date counts from midnight of its first
    day. Clock steps and repeated epochs are left as they are: to judge them is not reading.

    Parameters
    ----------
    path
        The log.
    require_checksum
        False accepts sentences without a checksum. A wrong one is never accepted.
    chunk_fixes
        Rows of fixes per chunk, about.
    progress
        Told how many bytes have been read so far.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    reader = _Reader(path, require_checksum)
    state, done, given = START, 0, 0
    step = min(max(chunk_fixes, 1), _STEP)
    try:
        with path.open("rb") as file:
            while block := file.read(_BLOCK):
                for after, found in pieces(state, block):
                    state = after
                    for _ in range(0, reader.begin(found), step):
                        reader.add(step)
                        if reader.size >= chunk_fixes:
                            yield reader.chunk()
                            given += 1
                done += len(block)
                if progress is not None:
                    progress(done)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}", "a readable file") from error
    reader.add(reader.begin(finish(state)))
    rest = reader.chunk(last=True)
    if not given or rest.fixes or rest.channels or rest.problems or rest.counts:
        yield rest


class _Reader:
    """What has been read and not yet given out."""

    def __init__(self, path: Path, require_checksum: bool) -> None:
        self._path = path
        self._require_checksum = require_checksum
        self._clock = LogClock()
        self._epochs = Epochs()
        self._samples = 0
        self._channels: dict[tuple[str, str], tuple[array[float], array[float]]] = {}
        self._counts: dict[str, int] = {}
        self._problems: dict[ProblemKind, tuple[int, str]] = {}
        self._coming: Iterator[Frame | tuple[int, float, Record]] = iter(())
        self._reported: set[str] = set()
        self._line = 0
        self._take: dict[type, Callable[..., None]] = {
            Position: self._position,
            Motion: self._motion,
            Heading: self._heading,
            WaterSpeed: self._water_speed,
            AlongSpeed: self._along_speed,
            Depth: self._depth,
            Clock: self._time,
            Sigma: self._epochs.declare,
        }

    @property
    def size(self) -> float:
        """Rows that a chunk would hold, or their equivalent in samples."""
        return max(len(self._epochs), self._samples / _SAMPLES_PER_FIX)

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
            self._clock.receive = math.nan
        self._line = line
        if problem is not None:
            self._problem(problem, line, text)
            return
        record = parse(text, require_checksum=self._require_checksum)
        if not isinstance(record, Refused):
            self._heed(record)
        elif record.kind == "unknown-type":
            self._count({record.text: 1})
        else:
            self._problem(record.kind, line, text)

    def _heed(self, record: Record) -> None:
        kind = record.type
        self._counts[kind] = self._counts.get(kind, 0) + 1
        self._take[record.__class__](record)

    def chunk(self, last: bool = False) -> Log:
        """Give out what is complete, with ``last`` all there is."""
        log = Log(
            source=str(self._path),
            fixes=self._epochs.take(last),
            sensors=tuple(f"{self._path.stem} {name}" for name in self._epochs.sources),
            channels=tuple(self._series()),
            problems=tuple(
                Problem(kind, total, example, REMEDIES[kind])
                for kind, (total, example) in self._problems.items()
            ),
            events=tuple(self._events()),
            counts=self._counts,
        )
        self._channels, self._samples, self._problems, self._counts = {}, 0, {}, {}
        self._clock.settle()
        return log

    def _series(self) -> Iterator[Channel]:
        for (name, sensor), (time, value) in self._channels.items():
            yield Channel(
                name=name,
                sensor=f"{self._path.stem} {sensor}",
                time=np.array(time, dtype=np.float64),
                value=np.array(value, dtype=np.float64),
                period=360.0 if name in _ANGLES else 0.0,
            )

    def _events(self) -> Iterator[Event]:
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
            for times, _ in self._channels.values():
                shifted = np.frombuffer(times, dtype=np.float64)
                shifted += self._clock.shift
            self._clock.shift = 0.0
        return time

    def _sample(self, name: str, sensor: str, time: float, value: float) -> None:
        series = self._channels.get((name, sensor))
        if series is None:
            series = self._channels[name, sensor] = array("d"), array("d")
        series[0].append(time)
        series[1].append(value)
        self._samples += 1

    def _position(self, record: Position) -> None:
        time = self._instant(record.second, record.day)
        self._epochs.add(record, time, self._clock.receive)
        if record.type == "RMC":
            sensor = record.talker + "RMC"
            self._sample("speed_mps", sensor, time, record.speed)
            self._sample("course_deg", sensor, time, record.course)

    def _motion(self, record: Motion) -> None:
        self._epochs.move(record, self._clock.receive)
        self._samples_of(record, speed_mps=record.speed, course_deg=record.course)

    def _heading(self, record: Heading) -> None:
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
        self._samples_of(
            record, water_speed_along_mps=record.water, ground_speed_along_mps=record.ground
        )

    def _depth(self, record: Depth) -> None:
        self._samples_of(record, depth_m=record.depth)

    def _time(self, record: Clock) -> None:
        self._instant(record.second, record.day)

    def _samples_of(self, record: Record, **values: float) -> None:
        time, sensor = self._clock.now(), record.talker + record.type
        for name, value in values.items():
            self._sample(name, sensor, time, value)
