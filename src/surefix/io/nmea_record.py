"""What one NMEA 0183 sentence says: a record by kind of content, or why it was refused.

Units: s since midnight, degrees, metres, m/s. NaN is missing; ``talker`` is the two letters of the
talker, ``type`` the three of the sentence.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from surefix.io.acoustic_record import Attitude, BodyVelocity, Sighting

__all__ = [
    "REMEDIES",
    "AlongSpeed",
    "Clock",
    "Depth",
    "Heading",
    "Motion",
    "Position",
    "ProblemKind",
    "Record",
    "Refused",
    "Sigma",
    "WaterSpeed",
]

ProblemKind = Literal[
    "no-checksum",
    "checksum",
    "truncated",
    "field",
    "range",
    "too-long",
    "binary",
    "not-nmea",
    "coordinates",
    "other-target",
    "unplaced",
    "unknown-type",
]

REMEDIES: dict[ProblemKind, str] = {
    "no-checksum": "if the source sends no checksums, accept sentences without: --no-checksum",
    "checksum": "check cable, baud rate and grounding; damaged sentences are left out",
    "truncated": "the logger lost part of the line; check its buffer and the baud rate",
    "field": "a field is not what the sentence type says; check the version of the device",
    "range": "a value is impossible, such as latitude 91; the sentence is left out",
    "too-long": "over 1024 bytes, or 4096 without end of line: is this a binary protocol?",
    "binary": "another protocol shares this log; only its NMEA sentences are read",
    "not-nmea": "other lines share this log; only its NMEA sentences are read",
    "coordinates": "set the output to Cartesian coordinates, UTM, radians or degrees",
    "other-target": "fixes of one target at a time: choose it with --target NAME",
    "unplaced": "the ship's position (GGA, RMC) or heading (HDT, PSIMSNS) is missing at that time",
    "unknown-type": "",
}
"""What the user can do about each kind of problem."""


class Position(NamedTuple):
    """GGA, GNS, RMC and GLL.

    ``day`` counts days since 1970-01-01 (RMC only), ``height`` is above mean sea level, ``speed``
    and ``course`` (true) are over ground, ``decimals`` those of the minutes of latitude.
    """

    talker: str
    type: str
    second: float
    latitude: float
    longitude: float
    valid: bool
    decimals: int
    height: float = math.nan
    speed: float = math.nan
    course: float = math.nan
    day: int | None = None


class Motion(NamedTuple):
    """VTG: speed and true course over ground."""

    talker: str
    type: str
    speed: float
    course: float


class Heading(NamedTuple):
    """HDT, THS, HDG and HDM: true heading, and magnetic heading where there is no true one."""

    talker: str
    type: str
    true: float
    magnetic: float


class WaterSpeed(NamedTuple):
    """VHW: speed through the water and the headings sent with it."""

    talker: str
    type: str
    speed: float
    true: float
    magnetic: float


class AlongSpeed(NamedTuple):
    """VBW: speeds along the ship's axis, through the water and over ground."""

    talker: str
    type: str
    water: float
    ground: float


class Depth(NamedTuple):
    """DPT and DBT: depth, positive down.

    A positive offset (transducer to waterline) is added; a negative one (transducer to keel) is
    not, so the depth is then below the transducer.
    """

    talker: str
    type: str
    depth: float


class Clock(NamedTuple):
    """ZDA: time of day and days since 1970-01-01."""

    talker: str
    type: str
    second: float
    day: int | None


class Sigma(NamedTuple):
    """GST: standard deviations of the position in metres."""

    talker: str
    type: str
    second: float
    east: float
    north: float
    up: float


class Refused(NamedTuple):
    """A sentence that gives no record; for ``unknown-type`` the text is the type."""

    kind: ProblemKind
    text: str


Record = (
    Position
    | Motion
    | Heading
    | WaterSpeed
    | AlongSpeed
    | Depth
    | Clock
    | Sigma
    | Attitude
    | BodyVelocity
    | Sighting
)
