"""Plain lines of an NMEA log, many at a time: found, checked and read by one kernel.

A line is plain if it holds one sentence, alone or behind a time of reception, with a right
checksum, of a type that is read here or that is not known at all, and if every field has its usual
form. Nearly all lines are. Whatever is not is *declined*: `surefix.io.nmea_frame` and
`surefix.io.nmea.parse` say what it is. They define how a log is read; a plain line gives the record
that they would give.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from surefix.io.nmea import MAX_LENGTH
from surefix.io.nmea_decode import TYPES, decode, heeded
from surefix.io.nmea_fields import instant
from surefix.jit import helper, kernel
from surefix.types import ByteArray, FloatArray, IntArray

__all__ = ["DECLINED", "UNKNOWN", "Lines", "scan"]

DECLINED: Final = -2
"""Code of a line that is not plain."""
UNKNOWN: Final = -1
"""Code of a sound sentence of an unknown type."""

_COLUMNS = 9
_COMMAS = 24  # places of so many are kept
_DOLLAR, _BANG, _STAR, _COMMA, _RETURN, _FEED, _P = 36, 33, 42, 44, 13, 10, 80
_AROUND = np.zeros(256, np.bool_)
_AROUND[list(b" \t\0,;|[]()<>\"'")] = True
_BLANK = np.zeros(256, np.bool_)
_BLANK[list(b" \t\0")] = True
_CODES = np.array([int.from_bytes(name.encode(), "big") for name in TYPES])


class Lines(NamedTuple):
    """The lines of a piece of a log.

    Parameters
    ----------
    begin
        (n + 1,) where each line begins; the last entry is the end of the piece.
    code
        (n,) place of the type in `surefix.io.nmea_decode.TYPES`, or `UNKNOWN`, or `DECLINED`.
    address
        (n, 2) where the address of its sentence begins and ends.
    received
        (n,) time of reception, s; NaN if the line has none.
    values
        (n, 9) what the sentence says, in the order of its record.
    """

    begin: IntArray
    code: IntArray
    address: IntArray
    received: FloatArray
    values: FloatArray


def scan(piece: bytes) -> Lines:
    r"""Read the lines of a piece that ends with a line feed.

    >>> lines = scan(b"$HEHDT,218.53,T*12\r\n$HEHDT,218.53,T*13\n")
    >>> lines.code, lines.values[0, 0]
    (array([ 5, -2]), np.float64(218.53))
    """
    n = piece.count(b"\n")
    lines = Lines(
        np.empty(n + 1, np.int64),
        np.empty(n, np.int64),
        np.empty((n, 2), np.int64),
        np.empty(n),
        np.empty((n, _COLUMNS)),
    )
    _scan(np.frombuffer(piece, np.uint8), lines)
    return lines


@kernel
def _scan(data: ByteArray, lines: Lines) -> None:
    comma = np.empty(_COMMAS + 1, np.int64)
    begin = 0
    for i in range(len(lines.code)):
        end = begin
        while data[end] != _FEED:
            end += 1
        lines.begin[i] = begin
        stop = end - 1 if end > begin and data[end - 1] == _RETURN else end
        lines.code[i] = _line(data, begin, stop, comma, lines, i)
        begin = end + 1
    lines.begin[len(lines.code)] = begin


@helper
def _line(data: ByteArray, begin: int, end: int, comma: IntArray, lines: Lines, i: int) -> int:
    """Read the line ``data[begin:end]`` and give its code."""
    start, commas = _sentence(data, begin, end, comma)
    if start < 0:
        return DECLINED
    lines.received[i] = _reception(data, begin, start)
    name = _address(data, start + 1, comma[0])
    if lines.received[i] == np.inf or name <= 0:
        return DECLINED
    lines.address[i, 0], lines.address[i, 1] = start + 1, comma[0]
    for code in range(len(_CODES)):
        if name == _CODES[code]:
            if not heeded(code, data, comma, commas):
                return UNKNOWN
            sound = decode(code, data, comma, commas, lines.values[i])
            return code if sound else DECLINED
    return DECLINED if data[start + 1] == _P else UNKNOWN


@helper
def _sentence(data: ByteArray, begin: int, end: int, comma: IntArray) -> tuple[int, int]:
    """Where the only sentence of a line begins, −1 if it is not plain, and how many commas it has.

    ``comma`` gets their places, and after them that of the asterisk.
    """
    star = end - 3
    if star <= begin or end - begin > MAX_LENGTH or data[star] != _STAR:
        return -1, 0
    start, commas, check = -1, 0, 0
    for k in range(begin, star):
        c = int(np.int64(data[k]))
        if c == _DOLLAR:
            if start >= 0:
                return -1, 0
            start = k
            continue
        if c in (_BANG, _STAR, _RETURN) or c > 127:
            return -1, 0
        if start >= 0:
            check ^= c
            if c == _COMMA and commas < _COMMAS:
                comma[commas] = k
                commas += 1
    if start < 0 or commas == 0 or 16 * _hex(data[star + 1]) + _hex(data[star + 2]) != check:
        return -1, 0
    comma[commas] = star
    return start, commas


@helper
def _hex(c: int) -> int:
    """Value of a hexadecimal digit; far too much for another byte."""
    c = int(np.int64(c))
    if 48 <= c <= 57:
        return c - 48
    c &= ~32
    return c - 55 if 65 <= c <= 70 else 999


@helper
def _address(data: ByteArray, a: int, b: int) -> int:
    """Type of an address, or the whole of a proprietary one, as a number; not above 0: neither."""
    if b - a < 4 or (data[a] != _P and b - a != 5):
        return -1
    for k in range(a, b):
        c = int(np.int64(data[k]))
        capital = 65 <= c <= 90
        if not capital and (k == a or not 48 <= c <= 57):
            return -1
    if data[a] == _P and b - a > 7:
        return 0
    name = 0
    for k in range(a if data[a] == _P else a + 2, b):
        name = 256 * name + int(np.int64(data[k]))
    return name


@helper
def _reception(data: ByteArray, a: int, b: int) -> float:
    """Time of reception before a sentence: NaN if there is nothing, ∞ if it is not plain."""
    while b > a and _BLANK[data[b - 1]]:
        b -= 1
    while a < b and _BLANK[data[a]]:
        a += 1
    if a == b:
        return np.nan
    while b > a and _AROUND[data[b - 1]]:
        b -= 1
    while a < b and _AROUND[data[a]]:
        a += 1
    return instant(data, a, b) if b > a else np.inf
