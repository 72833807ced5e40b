"""Units as they are written in column names and in ``--column role=name:unit``."""

from __future__ import annotations

import math
import re
from typing import Literal, NamedTuple

__all__ = ["Dimension", "Heading", "factor", "known", "split_unit"]

Dimension = Literal["time", "length", "angle", "speed", "text"]

_SPELLINGS: dict[str, dict[str, str]] = {
    "time": {
        "s": "s sec secs second seconds unix epoch",
        "ms": "ms msec millis millisecond milliseconds",
        "us": "us µs μs usec micros microsecond microseconds",
        "ns": "ns nsec nanos nanosecond nanoseconds",
        "iso": "iso iso8601",
        "": "utc gmt z",
    },
    "length": {
        "m": "m meter meters metre metres",
        "km": "km",
        "cm": "cm",
        "mm": "mm",
        "ft": "ft feet foot",
    },
    "angle": {
        "deg": "deg degs degree degrees ° dd n e wgs84 wgs-84",
        "rad": "rad rads radian radians",
    },
    "speed": {
        "m/s": "m/s mps m_s ms ms-1 m.s-1",
        "kn": "kn kt kts knot knots",
        "km/h": "km/h kmh kph km_h",
    },
    "text": {},
}
_UNITS: dict[str, dict[str, str]] = {
    dimension: {text: unit for unit, texts in units.items() for text in texts.split()}
    for dimension, units in _SPELLINGS.items()
}
_FACTORS = {
    "m": 1.0,
    "km": 1e3,
    "cm": 1e-2,
    "mm": 1e-3,
    "ft": 0.3048,
    "deg": 1.0,
    "rad": 180.0 / math.pi,
    "m/s": 1.0,
    "kn": 1852.0 / 3600.0,
    "km/h": 1.0 / 3.6,
    "": 1.0,
}
_BRACKETS = re.compile(r"^(.*?)\s*[\[({]\s*([^\])}]*?)\s*[\])}]\s*$")
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_SEPARATORS = re.compile(r"[^\w.]+|_+")
_SUFFIX = re.compile(r"^(.+?)_((?:m_s|km_h)|[^_]+)$")


class Heading(NamedTuple):
    """One column name, taken apart.

    Parameters
    ----------
    column
        Position of the column, from 0.
    text
        The name as it stands in the file.
    readings
        ``(base, unit)`` pairs it can be read as, the most literal first: ``depth_m`` is
        ``("depth_m", "")`` or ``("depth", "m")``. Bases are lower case with underscores.
    """

    column: int
    text: str
    readings: tuple[tuple[str, str], ...]


def _snake(text: str) -> str:
    return _SEPARATORS.sub("_", _CAMEL.sub("_", text.strip())).strip("_").lower()


def split_unit(column: int, text: str) -> Heading:
    """Take a column name apart.

    >>> split_unit(0, "V North [m/s]").readings
    (('v_north', 'm/s'),)
    >>> split_unit(0, "speed_kn").readings
    (('speed_kn', ''), ('speed', 'kn'))
    """
    if bracketed := _BRACKETS.match(text):
        return Heading(column, text, ((_snake(bracketed[1]), bracketed[2].lower()),))
    base = _snake(text)
    readings = [(base, "")]
    if suffixed := _SUFFIX.match(base):
        readings.append((suffixed[1], suffixed[2]))
    return Heading(column, text, tuple(readings))


def known(dimension: Dimension, unit: str) -> str | None:
    """Name of a unit in our spelling, or None where it is no unit of that dimension.

    >>> known("speed", "kts"), known("length", "kts")
    ('kn', None)
    """
    return unit if not unit else _UNITS[dimension].get(unit.strip().lower())


def factor(unit: str) -> float:
    """Return what one unit is in m, deg or m/s."""
    return _FACTORS[unit]
