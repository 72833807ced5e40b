"""Layouts of the sentences that tell roll and pitch; positive: starboard down, bow up.

Where the layouts and their signs come from:

- ``PASHR``: Trimble, *NMEA-0183 message: PASHR*; Applanix, *POS MV V5 installation and operation
  guide* PUBS-MAN-004291, table 20. Other sentences of that name (Ashtech) begin with a word.
- ``PSXN,23`` (Seapath): Kongsberg, *Seapath 320 installation manual* M300-62, which gives the signs
  and counts heave downwards; QPS, driver *Seapath MRU NMEA (PSXN)*.
- ``XDR``: NMEA 0183 4.11, *Update to XDR sentence*: angles in degrees, clockwise positive, by the
  names ``Pitch`` and ``Roll``; ``PTCH`` is what Airmar writes.
- ``PHTRO``: iXblue, *INS interface library* MU-INSIII-AN-001: ``M`` bow up, ``P`` bow down, ``T``
  port up, ``B`` port down.
- TSS1, a line and no sentence: NovAtel, *OEM7 commands and logs*, TSS1; Norwegian Subsea, *TSS1*
  (signs, and small letters for data that have not settled).

``PIXSE,ATITUD`` and the angles of ``PSIMSNS`` are not read: their signs are in none of these.
"""

from __future__ import annotations

import math
import re

from surefix.io.acoustic_record import Attitude
from surefix.io.nmea_sentence import (
    _ANY,
    _NUMBER,
    _REST,
    _SIZE,
    _TIME,
    Layout,
    OutOfRangeError,
    _bounded,
    _number,
    _second,
)

__all__ = ["ATTITUDE", "STEEPEST", "TRANSDUCERS", "UnreadError", "motion_line", "tilt"]

STEEPEST = 90.0
"""deg of roll and pitch; more is no attitude that a lever arm could be carried by."""

_VALUE = re.compile(_NUMBER, re.ASCII)
_NAMES = {"PITCH": "pitch", "PTCH": "pitch", "ROLL": "roll"}
_TSS1 = re.compile(rb":[0-9A-Fa-f]{6} [ -]\d{4}([A-Za-z?])([ -]\d{4}) ([ -]\d{4})\s*$")


class UnreadError(ValueError):
    """A sentence of a kind that is not read, although it has the address of one that is."""


def tilt(text: str) -> float:
    """Roll or pitch, deg; NaN where there is none.

    >>> tilt("-03.20"), tilt("")
    (-3.2, nan)
    """
    value = _number(text)
    if abs(value) > STEEPEST:
        raise OutOfRangeError(text)
    return value


def _ashr(talker: str, kind: str, f: tuple[str, ...]) -> Attitude:
    if f[6]:
        raise UnreadError(f[6])
    second = _second(f[0], f[1], f[2])
    return Attitude(talker, kind, second, _bounded(f[3], 360.0), tilt(f[4]), tilt(f[5]))


def _sxn(talker: str, kind: str, f: tuple[str, ...]) -> Attitude:
    if f[3]:
        raise UnreadError(f[3])
    return Attitude(talker, kind, math.nan, _bounded(f[2], 360.0), tilt(f[0]), tilt(f[1]))


def _htro(talker: str, kind: str, f: tuple[str, ...]) -> Attitude:
    pitch, roll = tilt(f[0]), tilt(f[2])
    pitch, roll = -pitch if f[1] == "P" else pitch, -roll if f[3] == "B" else roll
    return Attitude(talker, kind, math.nan, None, roll, pitch)


def _xdr(talker: str, kind: str, f: tuple[str, ...]) -> Attitude:
    fields = f[0].split(",")
    told: dict[str, str] = {}
    for kind_of, value, unit, name in zip(*(fields[k::4] for k in range(4)), strict=False):
        angle = _NAMES.get(name.upper())
        if angle is not None and kind_of == "A" and unit == "D":
            told.setdefault(angle, value)
    if not told:
        raise UnreadError(kind)
    for value in told.values():
        if _VALUE.fullmatch(value) is None:
            raise ValueError(value)
    roll, pitch = (tilt(told[name]) if name in told else None for name in ("roll", "pitch"))
    return Attitude(talker, kind, math.nan, None, roll, pitch)


def motion_line(line: bytes) -> tuple[bytes, Attitude] | None:
    """What stands before a TSS1 string and what it says; None if there is none.

    >>> motion_line(b":00FFCA -0003F-0325  0319")[1][4:]
    (-3.25, 3.19)
    """
    match = _TSS1.search(line)
    if match is None:
        return None
    settled = match[1].isupper()
    roll, pitch = (int(match[k]) / 100.0 if settled else math.nan for k in (2, 3))
    steep = max(abs(roll), abs(pitch)) > STEEPEST
    roll, pitch = (math.nan, math.nan) if steep else (roll, pitch)
    return line[: match.start()], Attitude("", "TSS1", math.nan, None, roll, pitch)


def _fields(*fields: str) -> re.Pattern[str]:
    return re.compile("," + ",".join(fields), re.ASCII)


ATTITUDE: dict[str, Layout] = {
    # time, heading, T, roll, pitch, heave, their accuracies (roll, pitch, heading), two states
    "PASHR": Layout(
        _fields(rf"(?:{_TIME},{_SIZE},T?,{_NUMBER},{_NUMBER},{_ANY}{_REST}|([A-Z].*))"), 2, _ashr
    ),
    # 23, roll, pitch, heading, heave
    "PSXN": Layout(
        _fields(rf"(?:23,{_NUMBER},{_NUMBER},{_SIZE},{_ANY}{_REST}|(?!23,)(\d.*))"), 2, _sxn
    ),
    # pitch, its side, roll, its side
    "PHTRO": Layout(_fields(_SIZE, "([MP])", _SIZE, "([TB])" + _REST), 4, _htro),
}
"""Sentences of makers, by address."""

TRANSDUCERS: dict[str, Layout] = {
    # type, value, unit, name; and so on
    "XDR": Layout(_fields("(.*)"), 4, _xdr)
}
"""Sentences with a talker, by type."""
