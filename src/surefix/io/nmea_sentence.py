"""The layout of each NMEA 0183 sentence type: one pattern of fields, one builder of the record.

Layouts after the published NMEA 0183 descriptions (gpsd, "NMEA Revealed"). A pattern begins at the
comma after the address. Whatever it does not match is refused as a whole: no field is guessed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import NamedTuple

from surefix.geo.time import day_number, second_of_day
from surefix.io.nmea_record import (
    AlongSpeed,
    Clock,
    Depth,
    Heading,
    Motion,
    Position,
    Record,
    Sigma,
    WaterSpeed,
)

__all__ = ["LAYOUTS", "Layout", "OutOfRangeError"]

KNOT = 1852.0 / 3600.0
KMH = 1.0 / 3.6
FOOT = 0.3048

_TIME = r"(?:(\d\d)(\d\d)(\d\d\.?\d{0,9}))?"
_LATITUDE = r"(?:(\d\d)(\d\d\.?\d{0,12}),([NS])|,[NS]?)"
_LONGITUDE = r"(?:(\d\d\d)(\d\d\.?\d{0,12}),([EW])|,[EW]?)"
_NUMBER = r"([-+]?\d{0,7}\.?\d{0,12})"
_SIZE = r"(\d{0,7}\.?\d{0,12})"
_ANY = r"[^,]*"
_REST = r"(?:,.*)?"


class OutOfRangeError(ValueError):
    """A field is a number, but not a possible one."""


class Layout(NamedTuple):
    """Fields of a sentence type.

    ``commas`` is the least number a whole sentence has. Without a checksum fewer mean that it was
    cut short; with a right one the device writes it so, and the pattern decides.
    """

    pattern: re.Pattern[str]
    commas: int
    build: Callable[[str, str, tuple[str, ...]], Record]


def _number(text: str) -> float:
    return float(text) if text else math.nan


def _bounded(text: str, limit: float) -> float:
    """Value from 0 to the limit, both included."""
    if not text:
        return math.nan
    value = float(text)
    if value > limit:
        raise OutOfRangeError(text)
    return value


def _second(hour: str, minute: str, second: str) -> float:
    if not hour:
        return math.nan
    time = second_of_day(int(hour), int(minute), float(second))
    if math.isnan(time):
        raise OutOfRangeError(f"{hour}:{minute}:{second}")
    return time


def _degrees(whole: str, minutes: str, hemisphere: str, limit: float) -> float:
    if not whole:
        return math.nan
    part = float(minutes)
    value = int(whole) + part / 60.0
    if part >= 60.0 or value > limit:
        raise OutOfRangeError(whole + minutes)
    return -value if hemisphere in "SW" else value


def _day(year: int, month: int, day: int) -> int | None:
    """Day number; None where the device writes noughts because it does not know the date."""
    if month == 0 or day == 0:
        return None
    number = day_number(year, month, day)
    if number is None:
        raise OutOfRangeError(f"{year}-{month}-{day}")
    return number


def _position(
    talker: str,
    kind: str,
    second: float,
    place: tuple[str, ...],
    valid: bool,
    height: float = math.nan,
    speed: float = math.nan,
    course: float = math.nan,
    day: int | None = None,
) -> Position:
    """Position from the six texts of latitude and longitude.

    A fix that calls itself valid must have both; one that does not and says 0, 0 has none.
    """
    latitude = _degrees(place[0], place[1], place[2], 90.0)
    longitude = _degrees(place[3], place[4], place[5], 180.0)
    if math.isnan(latitude) or math.isnan(longitude):
        if valid:
            raise ValueError("valid, but without position")
        latitude = longitude = math.nan
    elif not valid and latitude == 0.0 and longitude == 0.0:
        latitude = longitude = math.nan
    decimals = len(place[1]) - 3
    return Position(
        talker, kind, second, latitude, longitude, valid, decimals, height, speed, course, day
    )


def _gga(talker: str, kind: str, f: tuple[str, ...]) -> Position:
    second = _second(f[0], f[1], f[2])
    return _position(talker, kind, second, f[3:9], f[9] not in "0", height=_number(f[10]))


def _gns(talker: str, kind: str, f: tuple[str, ...]) -> Position:
    second = _second(f[0], f[1], f[2])
    return _position(talker, kind, second, f[3:9], bool(f[9].strip("N")), height=_number(f[10]))


def _rmc(talker: str, kind: str, f: tuple[str, ...]) -> Position:
    second = _second(f[0], f[1], f[2])
    valid = f[3] == "A" and f[13] != "N"
    date = f[12]
    day = None
    if date:
        year = int(date[4:])
        day = _day(year + (1900 if year >= 80 else 2000), int(date[2:4]), int(date[:2]))
    if not valid:
        return _position(talker, kind, second, f[4:10], False, day=day)
    speed, course = _number(f[10]) * KNOT, _bounded(f[11], 360.0)
    return _position(talker, kind, second, f[4:10], True, math.nan, speed, course, day)


def _gll(talker: str, kind: str, f: tuple[str, ...]) -> Position:
    valid = f[9] != "V" and f[10] != "N"
    return _position(talker, kind, _second(f[6], f[7], f[8]), f[:6], valid)


def _vtg(talker: str, kind: str, f: tuple[str, ...]) -> Motion:
    course, knots, kmh, mode, old_course, old_knots, old_kmh = f
    if mode == "N":
        return Motion(talker, kind, math.nan, math.nan)
    knots, kmh = knots or old_knots, kmh or old_kmh
    speed = _number(knots) * KNOT if knots else _number(kmh) * KMH
    return Motion(talker, kind, speed, _bounded(course or old_course, 360.0))


def _hdt(talker: str, kind: str, f: tuple[str, ...]) -> Heading:
    return Heading(talker, kind, _bounded(f[0], 360.0), math.nan)


def _hdm(talker: str, kind: str, f: tuple[str, ...]) -> Heading:
    return Heading(talker, kind, math.nan, _bounded(f[0], 360.0))


def _ths(talker: str, kind: str, f: tuple[str, ...]) -> Heading:
    return Heading(talker, kind, _bounded(f[0], 360.0) if f[1] != "V" else math.nan, math.nan)


def _signed(text: str, side: str) -> float:
    """Deviation or variation, east positive; NaN if it is not given with its side."""
    if not (text and side):
        return math.nan
    return -_bounded(text, 180.0) if side == "W" else _bounded(text, 180.0)


def _hdg(talker: str, kind: str, f: tuple[str, ...]) -> Heading:
    heading = _bounded(f[0], 360.0)
    deviation, variation = _signed(f[1], f[2]), _signed(f[3], f[4])
    if not math.isnan(deviation):
        heading = (heading + deviation) % 360.0
    if math.isnan(variation):
        return Heading(talker, kind, math.nan, heading)
    return Heading(talker, kind, (heading + variation) % 360.0, math.nan)


def _vhw(talker: str, kind: str, f: tuple[str, ...]) -> WaterSpeed:
    true, magnetic = _bounded(f[0], 360.0), _bounded(f[1], 360.0)
    speed = _number(f[2]) * KNOT if f[2] else _number(f[3]) * KMH
    return WaterSpeed(talker, kind, speed, true, magnetic)


def _vbw(talker: str, kind: str, f: tuple[str, ...]) -> AlongSpeed:
    water = _number(f[0]) * KNOT if f[1] == "A" else math.nan
    ground = _number(f[2]) * KNOT if f[3] == "A" else math.nan
    return AlongSpeed(talker, kind, water, ground)


def _dpt(talker: str, kind: str, f: tuple[str, ...]) -> Depth:
    offset = _number(f[1])
    return Depth(talker, kind, _number(f[0]) + (offset if offset > 0.0 else 0.0))


def _dbt(talker: str, kind: str, f: tuple[str, ...]) -> Depth:
    feet, metres, fathoms = f
    if metres:
        return Depth(talker, kind, float(metres))
    return Depth(talker, kind, FOOT * (float(feet) if feet else 6.0 * _number(fathoms)))


def _zda(talker: str, kind: str, f: tuple[str, ...]) -> Clock:
    day = _day(int(f[5]), int(f[4]), int(f[3])) if f[3] and f[4] and f[5] else None
    return Clock(talker, kind, _second(f[0], f[1], f[2]), day)


def _gst(talker: str, kind: str, f: tuple[str, ...]) -> Sigma:
    north, east, up = (_number(text) or math.nan for text in f[3:])
    return Sigma(talker, kind, _second(f[0], f[1], f[2]), east, north, up)


def _layout(
    commas: int, build: Callable[[str, str, tuple[str, ...]], Record], *fields: str
) -> Layout:
    return Layout(re.compile("," + ",".join(fields) + _REST, re.ASCII), commas, build)


LAYOUTS: dict[str, Layout] = {
    # time, latitude, longitude, quality, satellites, HDOP, altitude, M, geoid, M, age, station
    "GGA": _layout(
        14, _gga, _TIME, _LATITUDE, _LONGITUDE, r"(\d?)", r"\d{0,2}", r"\d{0,5}\.?\d{0,9}",
        _NUMBER + "(?:,M?)?",
    ),
    # time, latitude, longitude, mode per system, satellites, HDOP, altitude, geoid, age, station
    "GNS": _layout(
        12, _gns, _TIME, _LATITUDE, _LONGITUDE, r"([A-Z]{0,8})", r"\d{0,3}",
        r"\d{0,5}\.?\d{0,9}", _NUMBER,
    ),
    # time, status, latitude, longitude, speed, course, date, variation, side, mode, status
    "RMC": _layout(
        9, _rmc, _TIME, "([AV])", _LATITUDE, _LONGITUDE, _SIZE, _SIZE,
        r"(\d{6}|)(?:,[^,]*(?:,[EW]?(?:,([A-Z]?))?)?)?",
    ),
    # latitude, longitude, time, status, mode
    "GLL": _layout(
        4, _gll, _LATITUDE, rf"{_LONGITUDE}(?:,{_TIME}(?:,([AV]?)(?:,([A-Z]?))?)?)?"
    ),
    # course, T, course, M, knots, N, km/h, K, mode; before version 2.3 without the letters
    "VTG": _layout(
        4, _vtg,
        rf"(?:{_SIZE},T,{_ANY},M?,{_SIZE},N?,{_SIZE},K?(?:,([A-Z]?))?|{_SIZE},{_SIZE[1:-1]},"
        rf"{_SIZE},{_SIZE})",
    ),
    "HDT": _layout(2, _hdt, _SIZE, "T?"),
    "HDM": _layout(2, _hdm, _SIZE, "M?"),
    "THS": _layout(2, _ths, _SIZE, "([AEMSV]?)"),
    # heading, deviation, side, variation, side
    "HDG": _layout(5, _hdg, _SIZE, _SIZE, "([EW]?)", _SIZE, "([EW]?)"),
    # heading, T, heading, M, knots, N, km/h, K
    "VHW": _layout(8, _vhw, _SIZE, "T?", _SIZE, "M?", _SIZE, "N?", _SIZE, "K?"),
    # along and across through the water, status, along and across over ground, status
    "VBW": _layout(6, _vbw, _NUMBER, _ANY, "([AV]?)", _NUMBER, _ANY, "([AV]?)"),
    "DPT": _layout(2, _dpt, _SIZE, _NUMBER),
    # feet, f, metres, M, fathoms, F
    "DBT": _layout(6, _dbt, _SIZE, "f?", _SIZE, "M?", _SIZE, "F?"),
    # time, day, month, year, local zone
    "ZDA": _layout(4, _zda, _TIME, r"(\d\d|)", r"(\d\d|)", r"(\d{4}|)"),
    # time, RMS of the ranges, ellipse (3), latitude, longitude, altitude
    "GST": _layout(8, _gst, _TIME, _ANY, _ANY, _ANY, _ANY, _SIZE, _SIZE, _SIZE),
}  # fmt: skip
"""Sentence types that are understood."""
