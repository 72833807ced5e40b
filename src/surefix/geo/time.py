"""Time: calendar text and Unix numbers to seconds, and dates for bare times of day.

Everything is in seconds since 1970-01-01 00:00 UTC without leap seconds (POSIX), as float64,
which resolves 0.24 µs today. What cannot be read is NaN, never an exception.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, date, datetime
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.types import FloatArray

__all__ = [
    "DAY",
    "GPS_ROLLOVER",
    "TIME_UNITS",
    "day_number",
    "nearest_day",
    "parse_time",
    "parse_times",
    "second_of_day",
    "unix_seconds",
    "unix_unit",
    "week_rollovers",
]

DAY = 86_400.0
"""Seconds in a day."""

GPS_ROLLOVER = 1024 * 7 * DAY
"""Seconds after which the ten-bit GPS week number starts again (IS-GPS-200, 20.3.3.3.1.1)."""

TIME_UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "µs": 1e6, "ns": 1e9}
"""Ticks per second of the units a Unix time may be given in."""

_EPOCH = date(1970, 1, 1).toordinal()
_CALENDAR = re.compile(
    r"\s*(?:(\d{4})([-/.]?)(\d\d)\2(\d\d)|(\d\d)\.(\d\d)\.(\d{4}))"  # y-m-d, y/m/d, ymd or d.m.y
    r"(?:(?:T|\s+|[_,]\s*)(\d\d):?(\d\d)(?::?(\d\d)(?:[.,](\d{1,12}))?)?)?"
    r"\s*(?:Z|UTC|GMT|([+-])(\d\d):?(\d\d)?)?\s*",
    re.IGNORECASE | re.ASCII,
)
_PLAIN = re.compile(r"(?:\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?\n)+", re.ASCII)


def second_of_day(hour: int, minute: int, second: float) -> float:
    """Seconds since midnight UTC; NaN if it is no time of day.

    A leap second, 23:59:60 with any fraction, becomes 86400.0: the midnight that follows it. The
    clock then stands still for that second and never runs backwards.

    >>> second_of_day(12, 30, 1.5), second_of_day(23, 59, 60.7), second_of_day(12, 60, 0.0)
    (45001.5, 86400.0, nan)
    """
    if 0 <= hour < 24 and 0 <= minute < 60 and 0.0 <= second < 60.0:
        return hour * 3600.0 + minute * 60.0 + second
    if hour == 23 and minute == 59 and 60.0 <= second < 61.0:
        return DAY
    return math.nan


def day_number(year: int, month: int, day: int) -> int | None:
    """Days since 1970-01-01, or None if there is no such day.

    >>> day_number(2014, 8, 1), day_number(2014, 2, 30)
    (16283, None)
    """
    try:
        return date(year, month, day).toordinal() - _EPOCH
    except ValueError:
        return None


def parse_time(text: str) -> float:
    """Unix time of a calendar text; NaN if it cannot be read.

    Understood are ISO 8601 (extended and basic), the same with a blank, comma or underscore for
    ``T``, ``YYYY/mm/dd``, ``YYYYMMDD hh:mm:ss.sss`` and ``dd.mm.YYYY``, each with or without
    seconds, fraction, and ``Z`` or an offset. No offset means UTC.

    >>> parse_time("2014-08-01T02:00:00.25+02:00"), parse_time("20140801 00:00:00.250")
    (1406851200.25, 1406851200.25)
    >>> parse_time("2016-12-31 23:59:60.5") == parse_time("2017-01-01")
    True
    >>> parse_time("yesterday")
    nan
    """
    if text[4:5] == "-":
        try:
            stamp = datetime.fromisoformat(text)
        except ValueError:
            pass
        else:
            return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    match = _CALENDAR.fullmatch(text)
    return _calendar_time(match) if match else math.nan


def _calendar_time(match: re.Match[str]) -> float:
    year, _, month, day, day2, month2, year2, hour, minute, second, fraction, *offset = (
        match.groups("")
    )
    days = day_number(int(year or year2), int(month or month2), int(day or day2))
    if days is None:
        return math.nan
    seconds = float(f"{second or 0}.{fraction or 0}")
    time = days * DAY + second_of_day(int(hour or 0), int(minute or 0), seconds)
    sign, hours, minutes = offset
    if not sign:
        return time
    shift = int(hours) * 3600.0 + int(minutes or 0) * 60.0
    return time - shift if sign == "+" else time + shift


def parse_times(texts: Sequence[str]) -> FloatArray:
    """`parse_time` of many texts, (n,) s; quick where all are written ``YYYY-mm-ddTHH:MM:SS.f``.

    >>> parse_times(["2014-08-01 00:00:01.5", "2014-08-01T00:00:02Z", ""])
    array([1.4068512e+09, 1.4068512e+09,           nan])
    """
    joined = "\n".join(texts).replace("Z\n", "\n").removesuffix("Z") + "\n"
    if joined.count("\n") == len(texts) and _PLAIN.fullmatch(joined):
        try:
            ticks = np.array(joined.split("\n")[:-1], dtype="datetime64[ns]").astype(np.int64)
        except ValueError:  # a leap second or an impossible date among them: one by one
            pass
        else:
            return ticks // 10**9 + (ticks % 10**9) / 1e9
    return np.array([parse_time(text) for text in texts], dtype=np.float64)


def unix_unit(values: ArrayLike) -> str:
    """Unit of Unix times, told by their size: ``s``, ``ms``, ``us`` or ``ns``.

    The bounds leave room from 1973 (ms) and 1970-01-02 (µs, ns) to the year 5138. Times that count
    from the start of a log are small and therefore taken as seconds.

    >>> [unix_unit(1406851200 * k) for k in (1, 10**3, 10**6, 10**9)]
    ['s', 'ms', 'us', 'ns']
    """
    numbers = np.abs(np.asarray(values, dtype=np.float64))
    numbers = numbers[np.isfinite(numbers)]
    size = float(np.median(numbers)) if numbers.size else 0.0
    return "s" if size < 1e11 else "ms" if size < 1e14 else "us" if size < 1e17 else "ns"


def unix_seconds(values: ArrayLike, unit: str | None = None) -> FloatArray:
    """Unix times in ``unit`` (one of `TIME_UNITS`; None: told by size) as seconds.

    Raises
    ------
    OptionsError
        If the unit is not known.

    >>> unix_seconds([1406851200250, 1406851201250])
    array([1.4068512e+09, 1.4068512e+09])
    """
    unit = unit or unix_unit(values)
    if unit not in TIME_UNITS:
        raise OptionsError(f"time unit {unit!r}", "one of " + ", ".join(TIME_UNITS))
    return np.asarray(np.asarray(values, dtype=np.float64) / TIME_UNITS[unit])


@overload
def nearest_day(second: float, reference: float) -> float: ...
@overload
def nearest_day(second: FloatArray, reference: FloatArray | float) -> FloatArray: ...
def nearest_day(second: float | FloatArray, reference: float | FloatArray) -> float | FloatArray:
    """Instant at this time of day that lies within 12 h of a reference.

    Parameters
    ----------
    second
        Seconds since midnight, scalar or (n,).
    reference
        Instant in s, of the same shape.

    >>> nearest_day(86399.0, 1406851201.0) - 1406851201.0  # just before midnight, seen after it
    -2.0
    """
    return second + DAY * (((reference - second) / DAY + 0.5) // 1.0)


def week_rollovers(time: float, reference: float, tolerance: float = DAY) -> int:
    """Number of 1024-week periods to add to ``time`` to bring it to ``reference``.

    0 unless the difference is such a multiple to within ``tolerance`` s: any other difference is
    not a week rollover.

    >>> week_rollovers(parse_time("1994-12-16"), parse_time("2014-08-01"))
    1
    >>> week_rollovers(parse_time("2008-08-01"), parse_time("2014-08-01"))
    0
    """
    if not (math.isfinite(time) and math.isfinite(reference)):
        return 0
    count = round((reference - time) / GPS_ROLLOVER)
    return count if abs(reference - time - count * GPS_ROLLOVER) <= tolerance else 0
