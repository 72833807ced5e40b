"""Layouts of the acoustic sentences that look like NMEA 0183: one pattern, one builder each.

Where the layouts come from:

- ``PSIMSSB``, ``PSIMSNS`` (Kongsberg HiPAP and many others): EIVA, *The Kongsberg NMEA format
  $PSIMSSB*, knowledge base 43000526599; Navis, *NavDP 4000 operation manual* 000.JDP-10000-OME,
  "Simrad SSBL" (which axis comes first); Tritech, *MicronNav manual* 0656-SOM-00001, 7.2.10;
  Sonardyne, *How do I interface Ranger 2 into a 3rd party survey system*. The coordinate system
  ``D`` (degrees and minutes) is written by HiPAP systems at sea: OpenRVDAS, device type HiPAP.
  What the two fields of ``P`` (polar) hold is in none of them: it is refused.
- ``PTSAG``, ``PTSAH`` (iXblue GAPS, Posidonia): iXblue, *GAPS user guide* MU-GAPS-AN-005-H, I.4.1;
  QGIS PosiView, *Protocol description* (heading).
- ``PSONLLD``, ``PSONALL`` (Sonardyne Ranger 2): QGIS PosiView, *Protocol description*; the error
  ellipse after WHOI, ``ds_sensors/sonardyne_usbl``.
"""

from __future__ import annotations

import math
import re

from surefix.io.acoustic_record import NOT_MEASURED, Attitude, Place, Sighting
from surefix.io.nmea_sentence import (
    _ANY,
    _LATITUDE,
    _LONGITUDE,
    _REST,
    _SIZE,
    _TIME,
    Layout,
    OutOfRangeError,
    _bounded,
    _day,
    _degrees,
    _number,
    _second,
)

__all__ = ["PROPRIETARY", "UnknownCoordinatesError"]

_NUMBER = r"([-+]?\d{0,9}\.?\d{0,12})"  # of a map grid as well
_NAME = r"([^,*]{0,31}[^,*\s])"
_FILTER = {"M": "", "F": NOT_MEASURED[0], "P": NOT_MEASURED[1]}
_CHANNELS = 3  # hydrophones of four that a position needs


class UnknownCoordinatesError(ValueError):
    """A position whose coordinates are of a kind that is not read."""


def _sigma(text: str) -> float:
    """Declared standard deviation; nought says that there is none."""
    return _number(text) or math.nan


def _simssb(talker: str, kind: str, f: tuple[str, ...]) -> Sighting:
    second = _second(f[0], f[1], f[2])
    target = f[3].strip() + _FILTER[f[8] + f[17]]
    sigma = _sigma(f[21])
    if f[6]:
        place: Place = "globe"
        x, y = _degrees(f[9], f[10], f[11], 90.0), _degrees(f[12], f[13], f[14], 180.0)
    else:
        place, x, y = _simrad_place(f[15], f[16], _number(f[18]), _number(f[19]))
    valid = f[4] == "A" and not f[5].strip()
    x, y = _there(valid, place, x, y)
    return Sighting(
        talker, kind, target, second, place, x, y, _number(f[20]), sigma, sigma, sigma, valid
    )


def _there(valid: bool, place: Place, x: float, y: float) -> tuple[float, float]:
    """A position that calls itself valid must be there; one that does not and is 0, 0 is none."""
    if math.isnan(x) or math.isnan(y):
        if valid:
            raise ValueError("valid, but without position")
        return math.nan, math.nan
    nowhere = not valid and place == "globe" and x == 0.0 and y == 0.0
    return (math.nan, math.nan) if nowhere else (x, y)


def _simrad_place(
    system: str, axes: str, first: float, second: float
) -> tuple[Place, float, float]:
    """What x and y are, and the two: east (or starboard, latitude) first."""
    if system == "C" and axes in "HE":
        return "ship" if axes == "H" else "north", first, second
    if system == "C" and axes == "N":
        return "north", second, first
    if system == "U" and axes in "EN":
        return ("grid", first, second) if axes == "E" else ("grid", second, first)
    if system == "R" and axes in "NGH":
        return ("globe", *_on_earth(math.degrees(first), math.degrees(second)))
    raise UnknownCoordinatesError(f"{system},{axes}")


def _on_earth(latitude: float, longitude: float) -> tuple[float, float]:
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        raise OutOfRangeError(f"{latitude:.6f}, {longitude:.6f}")
    return latitude, longitude


def _simsns(talker: str, kind: str, f: tuple[str, ...]) -> Attitude:
    return Attitude(talker, kind, _second(f[0], f[1], f[2]), _bounded(f[3], 360.0))


def _tsag(talker: str, kind: str, f: tuple[str, ...]) -> Sighting:
    second, day = _second(f[0], f[1], f[2]), _day(int(f[5]), int(f[4]), int(f[3]))
    latitude, longitude = _degrees(f[7], f[8], f[9], 90.0), _degrees(f[10], f[11], f[12], 180.0)
    valid = int(f[13], 16).bit_count() >= _CHANNELS
    latitude, longitude = _there(valid, "globe", latitude, longitude)
    depth = math.nan if f[15] == "0" else _number(f[14])
    number = int(f[6])
    nan = math.nan
    return Sighting(
        talker, kind, str(number) if number else "ship", second, "globe", latitude, longitude,
        depth, nan, nan, nan, valid, day,
    )  # fmt: skip


def _tsah(talker: str, kind: str, f: tuple[str, ...]) -> Attitude:
    return Attitude(talker, kind, math.nan, _bounded(f[0], 360.0))


def _sonlld(talker: str, kind: str, f: tuple[str, ...]) -> Sighting:
    second = _second(f[0], f[1], f[2])
    valid = f[4] == "A"
    latitude, longitude = _there(valid, "globe", *_on_earth(_number(f[5]), _number(f[6])))
    east, north = _ellipse(_sigma(f[8]), _sigma(f[9]), _number(f[10]))
    return Sighting(
        talker, kind, f[3].strip(), second, "globe", latitude, longitude,
        _number(f[7]), east, north, _sigma(f[11]), valid,
    )  # fmt: skip


def _ellipse(major: float, minor: float, azimuth_deg: float) -> tuple[float, float]:
    """Standard deviations east and north of an error ellipse; the azimuth is that of ``major``."""
    turned = math.radians(azimuth_deg)
    sine, cosine = math.sin(turned), math.cos(turned)
    return math.hypot(major * sine, minor * cosine), math.hypot(major * cosine, minor * sine)


def _sonall(talker: str, kind: str, f: tuple[str, ...]) -> Sighting:
    second = _second(f[1], f[2], f[3])
    easting, northing, sigma = _number(f[4]), _number(f[5]), _sigma(f[7])
    easting, northing = _there(True, "grid", easting, northing)
    return Sighting(
        talker, kind, f[0].strip(), second, "grid", easting, northing,
        _number(f[6]), sigma, sigma, _sigma(f[8]), True,
    )  # fmt: skip


def _fields(*fields: str) -> re.Pattern[str]:
    return re.compile("," + ",".join(fields) + _REST, re.ASCII)


PROPRIETARY: dict[str, Layout] = {
    # time, transponder, status, error, coordinates, axes, filter, x, y (D: angles and sides),
    # depth, accuracy, what the two values are that follow
    "PSIMSSB": Layout(
        _fields(
            _TIME, _NAME, "([AV])", "([^,*]{0,8})",
            rf"(?:(D),([A-Z]),([MFP]),(?:{_LATITUDE},{_LONGITUDE}|,)"
            rf"|([A-CE-Z]),([A-Z]),([MFP]),{_NUMBER},{_NUMBER})",
            _NUMBER, _SIZE,
        ),
        13, _simssb,
    ),
    # time, transponder, transceiver, transducer, roll, pitch, heave, heading, tag …
    "PSIMSNS": Layout(_fields(_TIME, _ANY, _ANY, _ANY, _ANY, _ANY, _ANY, _SIZE), 9, _simsns),
    # frame, time, day, month, year, transponder, latitude, longitude, channels, depth, its kind,
    # depth of the sensor
    "PTSAG": Layout(
        _fields(
            r"#?\d{1,12}", _TIME, r"(\d\d)", r"(\d\d)", r"(\d{4})", r"(-?\d{1,4})", _LATITUDE,
            _LONGITUDE,
            "([0-9A-F])", _NUMBER, "([012])", _ANY,
        ),
        14, _tsag,
    ),
    # 0, heading, speed
    "PTSAH": Layout(_fields("0", _SIZE, _ANY), 3, _tsah),
    # time, transponder, status, latitude, longitude, depth, major axis, minor axis, azimuth, depth
    "PSONLLD": Layout(
        _fields(
            _TIME, _NAME, "([AV])", _NUMBER, _NUMBER, _NUMBER, _SIZE, _SIZE, _NUMBER, _SIZE
        ),
        10, _sonlld,
    ),
    # name, point of it, time, easting, northing, depth, heading, course, kind of heading, pitch,
    # roll, speed, accuracy of the position, of the depth
    "PSONALL": Layout(
        _fields(
            _NAME, _ANY, _TIME, _NUMBER, _NUMBER, _NUMBER, _ANY, _ANY, _ANY, _ANY, _ANY, _ANY,
            _SIZE, _SIZE,
        ),
        14, _sonall,
    ),
}  # fmt: skip
"""Acoustic sentences that are understood, by address."""
