"""The JSON record of the live service: its state, and the rows that are new.

Numbers that are missing are null. Angles are degrees, all else SI; local axes are x east, y north,
z up. Figures are rounded below what any sensor knows; the journal has them to the last bit.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from pydantic import BaseModel, Field

from surefix.reasons import texts
from surefix.service.alarms import Alarm, active
from surefix.service.history import Rows, shown, verdicts_of
from surefix.service.sensors import SensorState
from surefix.types import FloatArray, IntArray, Verdict

if TYPE_CHECKING:
    from surefix.service.running import Live
    from surefix.service.station import Latest

__all__ = [
    "VERSION",
    "AlarmRecord",
    "ExitRecord",
    "LineRecord",
    "PositionRecord",
    "RowsRecord",
    "SensorRecord",
    "StateRecord",
    "TrackRecord",
    "rows_record",
    "state_record",
    "track_record",
]

VERSION: Final = 1
"""Of the records; it grows when a field changes its meaning or goes."""

Vector = list[float]


class PositionRecord(BaseModel):
    """Where the vehicle is by all that has arrived."""

    time: float = Field(description="s, Unix, of validity")
    latitude: float = Field(description="deg; null for a metric log")
    longitude: float = Field(description="deg")
    height: float = Field(description="m, up")
    local: Vector = Field(description="x east, y north, z up, m")
    velocity: Vector = Field(description="m/s east, north, up")
    sigma: Vector = Field(description="standard deviations of local, m")
    sigma_velocity: Vector = Field(description="standard deviations of velocity, m/s")
    speed: float = Field(description="m/s over ground")
    course: float = Field(description="deg from north over east")
    observed: float = Field(description="s, Unix, of the last fix that was used")
    dead_reckoned: bool = Field(description="no fix was used for so long that outputs say so")


class RowsRecord(BaseModel):
    """Fixes that were cleaned for good, column by column."""

    number: list[int] = Field(description="counts the rows since the service began")
    time: list[float] = Field(description="s, Unix")
    sensor: list[int] = Field(description="index into sensors")
    sensors: list[str] = Field(description="names")
    raw: list[Vector] = Field(description="as measured: x east, y north, z up, m")
    clean: list[Vector] = Field(description="the track: x, y, z, m")
    geodetic: list[Vector] = Field(description="the same: latitude, longitude, deg, height, m")
    velocity: list[Vector] = Field(description="m/s")
    sigma: list[Vector] = Field(description="standard deviations of clean, m")
    innovation: list[Vector] = Field(description="x, y, z over their standard deviations")
    verdict: list[str] = Field(
        description="used, downweighted, rejected, missing, duplicate, edited"
    )
    weight: list[float] = Field(description="0 … 1, the share that was used")
    reason: list[str] = Field(description="why, in words")
    omitted: int = Field(description="rows of the span that are left out to keep it small")


class SensorRecord(BaseModel):
    """One sensor, at present; see `surefix.service.sensors.SensorState`."""

    name: str
    input: str
    quantity: str
    validity: str = Field(description="valid, doubtful or invalid")
    reason: str
    since: float
    observed: float
    rate: float
    latency: float
    rejected: float
    innovation: float


class AlarmRecord(BaseModel):
    """One alarm; see `surefix.service.alarms.Alarm`."""

    number: int
    concerns: str
    priority: str = Field(description="alarm, warning or caution")
    text: str
    since: float
    seen: float
    by: str
    gone: float


class LineRecord(BaseModel):
    """One input; see `surefix.service.inputs.Line`."""

    name: str
    address: str
    connected: bool
    trouble: str
    size: int
    last: float
    refused: int = Field(description="datagrams and clients of senders that are not listed")
    refused_from: str
    ended: bool


class ExitRecord(BaseModel):
    """One output; see `surefix.service.outputs.Exit`."""

    address: str
    clients: int
    dropped: int
    refused: int
    size: int
    trouble: str


class StateRecord(BaseModel):
    """The live service at one instant."""

    version: int = VERSION
    time: float = Field(description="s, Unix, when it was made")
    present: float = Field(description="s, Unix: the same, or the time of a log that is replayed")
    position: PositionRecord | None = Field(description="null until the log is settled")
    sensors: list[SensorRecord]
    alarms: list[AlarmRecord] = Field(description="those to be shown, the most urgent first")
    inputs: list[LineRecord]
    outputs: list[ExitRecord]
    unwritten: int = Field(description="bytes that wait for the journal")
    rows: RowsRecord = Field(description="fixes cleaned for good since the record before")


class TrackRecord(BaseModel):
    """A span of the past."""

    version: int = VERSION
    first: float = Field(description="s, Unix, of the oldest row that is kept")
    last: float = Field(description="s, Unix, of the newest")
    rows: RowsRecord
    sensors: list[SensorRecord] = Field(description="as they were judged at the end of the span")
    alarms: list[AlarmRecord] = Field(description="those that were to be shown at the end of it")


def state_record(live: Live, now: float, rows: RowsRecord) -> StateRecord:
    """Make the record of the service as it is.

    Parameters
    ----------
    live
        The service.
    now
        s, Unix.
    rows
        What is new, from `rows_record`.
    """
    named = zip(live.options.inputs, live.lines, strict=True)
    replayed = live.now is not None and any(line.address.kind == "file" for line in live.lines)
    return StateRecord(
        time=now,
        present=live.now.time if live.now is not None and replayed else now,
        position=None if live.now is None else _position(live.now),
        sensors=_sensors(live.sensors),
        alarms=_alarms(active(live.alarms)),
        inputs=[
            LineRecord(name=each.name, **vars(line) | {"address": str(line.address)})
            for each, line in named
        ],
        outputs=[
            ExitRecord(**vars(output.state) | {"address": str(output.state.address)})
            for _, output in live.outputs
        ],
        unwritten=live.keeper.size,
        rows=rows,
    )


def _position(known: Latest) -> PositionRecord:
    east, north, _ = known.velocity
    geodetic = (math.nan,) * 3 if known.geodetic is None else known.geodetic
    return PositionRecord(
        time=round(known.time, 3),
        latitude=round(float(geodetic[0]), 9),
        longitude=round(float(geodetic[1]), 9),
        height=round(float(geodetic[2]), 3),
        local=_rounded(known.position, 3),
        velocity=_rounded(known.velocity, 4),
        sigma=_rounded(known.sigma_position, 4),
        sigma_velocity=_rounded(known.sigma_velocity, 4),
        speed=round(math.hypot(east, north), 3),
        course=round(math.degrees(math.atan2(east, north)) % 360.0, 2),
        observed=round(known.observed, 3),
        dead_reckoned=known.dead_reckoned,
    )


def rows_record(rows: Rows, numbers: IntArray, sensors: Sequence[str], most: int) -> RowsRecord:
    """Make the record of rows.

    Parameters
    ----------
    rows, numbers
        (n,) what they are and their numbers, in the order of time.
    sensors
        Names that the rows refer to.
    most
        About how many at most; see `surefix.service.history.shown`.
    """
    chosen = shown(rows, most)
    rows, omitted = rows[chosen], len(rows) - len(chosen)
    verdicts = verdicts_of(rows)
    return RowsRecord(
        number=numbers[chosen].tolist(),
        time=np.round(rows["time"], 3).tolist(),
        sensor=rows["sensor"].tolist(),
        sensors=list(sensors),
        raw=np.round(rows["raw"], 3).tolist(),
        clean=np.round(rows["clean"], 3).tolist(),
        geodetic=np.round(rows["geodetic"], 9).tolist(),
        velocity=np.round(rows["velocity"], 4).tolist(),
        sigma=np.round(rows["sigma"], 4).tolist(),
        innovation=np.round(rows["innovation"], 3).tolist(),
        verdict=[Verdict(code).name.lower() for code in verdicts.verdict.tolist()],
        weight=np.round(rows["weight"], 4).tolist(),
        reason=texts(verdicts),
        omitted=omitted,
    )


async def track_record(live: Live, since: float, until: float, most: int) -> TrackRecord:
    """Make the record of a span of the past, s, its ends included, beside the loop."""
    history = live.history
    first, last = history.span()
    sensors, alarms = live.past.at(until)
    numbers = history.between(since, until)
    given = history.take(numbers), numbers, history.sensors, most
    rows = await asyncio.to_thread(rows_record, *given)
    return TrackRecord(
        first=first, last=last, rows=rows, sensors=_sensors(sensors), alarms=_alarms(alarms)
    )


def _sensors(states: Sequence[SensorState]) -> list[SensorRecord]:
    return [SensorRecord(**each._asdict()) for each in states]


def _alarms(alarms: Sequence[Alarm]) -> list[AlarmRecord]:
    return [AlarmRecord(**each._asdict()) for each in alarms]


def _rounded(values: FloatArray, digits: int) -> Vector:
    return [float(value) for value in np.round(values, digits)]
