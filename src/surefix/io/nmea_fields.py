"""Fields of a sentence as numbers, straight from its bytes; what is not plain is declined.

Every function reads the bytes ``data[a:b]``. A missing field is NaN; `DECLINED` says that the field
is not of the plain form, and that `surefix.io.nmea.parse` must look at the sentence. What is read
here is what `parse` reads, to the last bit: a number of at most 2⁵³ over a power of ten of at most
12 is rounded once, as in ``float(text)``.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from surefix.jit import helper
from surefix.types import ByteArray

__all__ = ["DECLINED", "day_of", "decimal", "degrees", "digits", "instant", "letter", "time_of_day"]

DECLINED: Final = np.inf
"""The field is not of the plain form."""

_EXACT = 1 << 53
_SCALE = 10.0 ** np.arange(19.0)
_LENGTHS = np.array([31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31])
_PLUS, _MINUS, _POINT, _ZERO, _DASH, _COLON = 43, 45, 46, 48, 45, 58
_T, _Z, _BLANK = 84, 90, 32
_MOST_TICKS = 1e11  # a Unix time from here on counts ms, from a thousand times that on µs, …


@helper
def digits(data: ByteArray, a: int, b: int) -> int:
    """Whole number of up to 18 digits, −1 if there is another byte or none at all."""
    if a >= b or b - a > 18:
        return -1
    value = 0
    for k in range(a, b):
        c = int(np.int64(data[k])) - _ZERO
        if c < 0 or c > 9:
            return -1
        value = 10 * value + c
    return value


@helper
def decimal(data: ByteArray, a: int, b: int, signed: bool) -> float:
    """Number with at most 7 digits before the point and 12 after it, where ``signed`` with sign."""
    if a == b:
        return np.nan
    negative = data[a] == _MINUS
    if signed and (negative or data[a] == _PLUS):
        a += 1
    point = a
    while point < b and data[point] != _POINT:
        point += 1
    places = max(b - point - 1, 0)
    if point - a > 7 or places > 12 or point - a + places == 0 or point - a + places > 18:
        return DECLINED
    value = 0
    for k in range(a, b):
        c = int(np.int64(data[k])) - _ZERO
        if k == point:
            continue
        if c < 0 or c > 9:
            return DECLINED
        value = 10 * value + c
    if value > _EXACT:
        return DECLINED
    number = float(value / _SCALE[places])
    return -number if signed and negative else number


@helper
def letter(data: ByteArray, a: int, b: int) -> int:
    """The only byte of a field; 0 where it is empty, 255 where there are more, or it is NUL."""
    if a == b:
        return 0
    return int(np.int64(data[a])) if b - a == 1 and data[a] != 0 else 255


@helper
def _pair(data: ByteArray, a: int, b: int) -> float:
    """Number with two digits before the point: seconds or minutes."""
    if b - a < 2 or b - a > 12 or data[a] == _POINT or data[a + 1] == _POINT:
        return DECLINED
    if b - a > 2 and data[a + 2] != _POINT:
        return DECLINED
    return decimal(data, a, b, False)


@helper
def time_of_day(data: ByteArray, a: int, b: int) -> float:
    """``hhmmss.sss``, s since midnight."""
    if a == b:
        return np.nan
    hour, minute = digits(data, a, min(a + 2, b)), digits(data, a + 2, min(a + 4, b))
    second = _pair(data, a + 4, b)
    if hour < 0 or minute < 0 or hour > 23 or minute > 59 or not second < 60.0:
        return DECLINED
    return hour * 3600.0 + minute * 60.0 + second


@helper
def degrees(data: ByteArray, a: int, b: int, side: int, latitude: bool) -> float:
    """``ddmm.mmm`` of a latitude or ``dddmm.mmm`` of a longitude, deg; ``side`` is its letter."""
    width, limit = (2, 90.0) if latitude else (3, 180.0)
    plus, minus = (78, 83) if latitude else (69, 87)
    if side not in (plus, minus):
        return np.nan if a == b and side == 0 else DECLINED
    if a == b:
        return np.nan
    whole, minutes = digits(data, a, min(a + width, b)), _pair(data, a + width, b)
    value = whole + minutes / 60.0
    if whole < 0 or not minutes < 60.0 or value > limit:
        return DECLINED
    return -value if side == minus else value


@helper
def day_of(year: int, month: int, day: int) -> float:
    """Days since 1970-01-01; NaN where a device writes noughts because it does not know them."""
    if month == 0 or day == 0:
        return np.nan
    if year < 1 or month < 0 or month > 12 or day < 0:
        return DECLINED
    leap = year % 4 == 0 and (year % 100 != 0 or year % 400 == 0)
    if day > _LENGTHS[month - 1] + (1 if leap and month == 2 else 0):
        return DECLINED
    before = year - 1
    days = 365 * before + before // 4 - before // 100 + before // 400 + day - 719163
    for k in range(month - 1):
        days += _LENGTHS[k]
    return float(days + (1 if leap and month > 2 else 0))


@helper
def instant(data: ByteArray, a: int, b: int) -> float:
    """Time of reception: ``2014-08-01T00:00:00.25Z``, or Unix seconds, ms, µs or ns; s."""
    if b - a > 4 and data[a + 4] == _DASH:
        return _calendar(data, a, b)
    point = a
    while point < b and data[point] != _POINT:
        point += 1
    places = max(b - point - 1, 0)
    whole, part = digits(data, a, point), digits(data, point + 1, b)
    if point - a < 9 or whole < 0 or (point < b and (part < 0 or places > 9)):
        return DECLINED
    number = float(whole)
    if point < b:
        if whole > _EXACT / _SCALE[places + 1]:
            return DECLINED
        number = (whole * np.int64(_SCALE[places]) + part) / _SCALE[places]
    tick, most = 1.0, _MOST_TICKS
    while number >= most:
        tick, most = 1e3 * tick, 1e3 * most
    return number / tick


@helper
def _calendar(data: ByteArray, a: int, b: int) -> float:
    b = b - 1 if data[b - 1] == _Z else b
    if b - a < 19 or b - a == 20 or b - a > 26:
        return DECLINED
    if data[a + 7] != _DASH or data[a + 13] != _COLON or data[a + 16] != _COLON:
        return DECLINED
    if data[a + 10] != _T and data[a + 10] != _BLANK:
        return DECLINED
    year, month, day = (
        digits(data, a, a + 4),
        digits(data, a + 5, a + 7),
        digits(data, a + 8, a + 10),
    )
    hour, minute = digits(data, a + 11, a + 13), digits(data, a + 14, a + 16)
    second, micro = digits(data, a + 17, a + 19), 0
    if b - a > 19:
        micro = digits(data, a + 20, b)
        if data[a + 19] != _POINT or micro < 0:
            return DECLINED
        for _ in range(26 - (b - a)):
            micro *= 10
    if year < 1970 or year > 2200 or month < 1 or day < 1:
        return DECLINED
    if hour < 0 or hour > 23 or minute < 0 or minute > 59 or second < 0 or second > 59:
        return DECLINED
    date = day_of(year, month, day)
    if not np.isfinite(date):
        return DECLINED
    whole = np.int64(date) * 86_400 + hour * 3600 + minute * 60 + second
    return (whole * 1_000_000 + micro) / 1e6
