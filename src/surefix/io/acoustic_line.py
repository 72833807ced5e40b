"""Instruments that do not speak NMEA: one record from one line, or why not.

- EvoLogics modems with USBL, ``+++AT:length:USBLLONG,…``: time now, time of the measurement,
  address, X, Y, Z, E, N, U, roll, pitch, yaw, propagation time, RSSI, integrity, accuracy.
  EvoLogics, *DMAC* (its own open software) and the ROS message ``AcousticModemUSBLLONG``. E, N, U
  are by the modem's compass; the length before them is the only guard against damage.
- Water Linked DVL A50/A125, *TCP JSON API*, ``json_v3`` to ``json_v3.3``: one object a line. X, Y,
  Z point forward, to starboard and down; ``fom`` is taken for the standard deviation.
- Motion sensors, ``:00FFCA -0003F-0325  0319`` (TSS1), see `surefix.io.attitude_sentence`.
"""

from __future__ import annotations

import json
import math
import re
from typing import Any

from surefix.io.acoustic_record import Attitude, BodyVelocity, Sighting
from surefix.io.attitude_sentence import motion_line
from surefix.io.nmea_record import Refused

__all__ = ["read_line"]

_NOTICE = re.compile(rb"\+\+\+AT:(\d{1,4}):(([A-Z]{2,16})\b.*)", re.DOTALL)
_NUMBER = r"([-+]?\d{1,10}\.?\d{0,12})"
_LONG = re.compile(
    rf"USBLLONG,{_NUMBER},{_NUMBER},(\d{{1,3}})" + f",{_NUMBER}" * 9 + ",[^,]*" * 3
    + r",(\d{0,7}\.?\d{0,12})",
    re.ASCII,
)  # fmt: skip
_OBJECT = re.compile(rb'\{\s*"')
_LONGEST_S = 60.0  # between a measurement and the line that tells it
_KNOWN = frozenset({"velocity", "velocity_water", "position_local", "response"})


def read_line(line: bytes) -> tuple[bytes, Sighting | BodyVelocity | Attitude | Refused] | None:
    """What stands before the message of a line, a time of reception perhaps, and what it says.

    None if the line holds no message of a kind that is known here; never an exception.

    >>> text = b"+++AT:76:USBLLONG,12.9,12.5,3,1,2,3,4.5,-6.5,-20.25,0,0,0,825,-36,77,1.5"
    >>> read_line(text)[1].kind  # the length says that something is lost or added
    'truncated'
    """
    notice = _NOTICE.search(line)
    if notice is not None:
        return line[: notice.start()], _notice(int(notice[1]), notice[2], notice[3])
    start = _OBJECT.search(line)
    if start is not None:
        told = _report(line[start.start() :])
        return None if told is None else (line[: start.start()], told)
    return motion_line(line)


def _notice(length: int, body: bytes, name: bytes) -> Sighting | Refused:
    if name != b"USBLLONG":
        return Refused("unknown-type", name.decode("ascii"))
    body = body.rstrip()
    if len(body) != length:
        return Refused("truncated", "")
    match = _LONG.fullmatch(body.decode("ascii", "replace"))
    if match is None:
        return Refused("field", "")
    told, measured, *values = (float(text) if text else math.nan for text in match.groups())
    east, north, up, sigma = values[4], values[5], values[6], values[-1] or math.nan
    if not 0.0 <= told - measured <= _LONGEST_S:
        return Refused("range", match[2])
    return Sighting(
        "", "USBLLONG", match[3], math.nan, "north", east, north, -up, sigma, sigma, sigma, True,
        None, measured, told,
    )  # fmt: skip


def _report(text: bytes) -> BodyVelocity | Refused | None:
    """What a JSON object says; None if it is not from this maker, as far as can be seen."""
    if b'"type"' not in text and b'"velocity_valid"' not in text:
        return None
    try:
        found = json.loads(text.rstrip().decode("ascii"), parse_constant=_no_number)
    except (ValueError, RecursionError):
        return Refused("field" if text.rstrip().endswith(b"}") else "truncated", "")
    if not isinstance(found, dict) or not str(found.get("format", "")).startswith("json_v3"):
        return None
    kind = found.get("type")
    if kind not in _KNOWN:
        return None
    if kind != "velocity":
        return Refused("unknown-type", kind)
    try:
        return _velocity(found)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        return Refused("field", str(error)[:40])


def _velocity(found: dict[str, Any]) -> BodyVelocity:
    valid = found["velocity_valid"]
    if not isinstance(valid, bool):
        raise ValueError("velocity_valid")
    measured = _finite(found, "time_of_validity") / 1e6
    told = _finite(found, "time_of_transmission") / 1e6
    if not 0.0 <= told - measured <= _LONGEST_S:
        raise ValueError("time_of_validity")
    nan = math.nan
    if not valid:
        return BodyVelocity("", "DVL", nan, nan, nan, nan, measured, told)
    forward, starboard, down = (_finite(found, name) for name in ("vx", "vy", "vz"))
    sigma = _finite(found, "fom")
    if sigma < 0.0:
        raise ValueError("fom")
    return BodyVelocity("", "DVL", forward, starboard, down, sigma or nan, measured, told)


def _finite(found: dict[str, Any], name: str) -> float:
    value = found[name]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(name)
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(name)
    return number


def _no_number(text: str) -> float:
    raise ValueError(text)
