"""What the plain sentences of each type say, from their fields; see `surefix.io.nmea_scan`.

The values stand in the order of the record of `surefix.io.nmea_record`, without talker and type; a
day that is not known is NaN. The layouts and their meaning are those of
`surefix.io.nmea_sentence`, which is asked about every sentence that is declined here.
"""

from __future__ import annotations

import numpy as np

from surefix.io.attitude_sentence import STEEPEST
from surefix.io.nmea_fields import (
    DECLINED,
    day_of,
    decimal,
    degrees,
    digits,
    letter,
    time_of_day,
)
from surefix.io.nmea_sentence import FOOT, KMH, KNOT
from surefix.jit import helper
from surefix.types import ByteArray, FloatArray, IntArray

__all__ = ["TYPES", "decode", "heeded"]

TYPES = (
    *("GGA", "GNS", "RMC", "GLL", "VTG", "HDT", "HDM"),
    *("THS", "HDG", "VHW", "DPT", "DBT", "ZDA", "GST"),
    *("PASHR", "PSXN", "XDR"),
)
"""Sentence types that are read here, by their code."""

_GGA, _GNS, _RMC, _GLL, _VTG, _HDT, _HDM, _THS, _HDG, _VHW, _DPT, _DBT, _ZDA, _GST = range(14)
_PASHR, _PSXN, _XDR = range(14, 17)
_FIELDS = np.array([9, 9, 9, 4, 8, 2, 2, 2, 5, 8, 2, 6, 4, 8, 6, 5, 4])  # least numbers of fields
_A, _D, _E, _K, _M, _N, _S, _T, _V, _W = b"ADEKMNSTVW"
_F = ord("f"), ord("M"), ord("F")
_MANY = 24  # fields, of which `surefix.io.nmea_scan` keeps the places
_ROLL, _PITCH, _PTCH = (np.frombuffer(word, np.uint8) for word in (b"ROLL", b"PITCH", b"PTCH"))


@helper
def decode(code: int, data: ByteArray, comma: IntArray, commas: int, v: FloatArray) -> bool:
    """Read the fields of a sentence into ``v``; False if one is not plain.

    Field i lies between ``comma[i]`` and ``comma[i + 1]``; there are ``commas`` of them.
    """
    if commas < _FIELDS[code] or commas >= _MANY:
        return False
    if code == _XDR:
        return _transducers(data, comma, commas, v)
    if code in (_PASHR, _PSXN):
        return _attitude(code, data, comma, v)
    if code in (_GGA, _GNS):
        return _gga(code, data, comma, v)
    if code == _RMC:
        return _rmc(data, comma, commas, v)
    if code == _GLL:
        return _gll(data, comma, commas, v)
    if code == _VTG:
        return _vtg(data, comma, commas, v)
    if code == _HDG:
        return _hdg(data, comma, v)
    if code == _VHW:
        return _vhw(data, comma, v)
    if code == _ZDA:
        return _zda(data, comma, v)
    if code == _GST:
        return _gst(data, comma, v)
    if code in (_DPT, _DBT):
        return _depth(code, data, comma, v)
    return _heading(code, data, comma, v)


@helper
def heeded(code: int, data: ByteArray, comma: IntArray, commas: int) -> bool:
    """Whether a sentence of a type is of the kind that is read; else it is an unknown one."""
    if code < _PASHR:
        return True
    a, b = comma[0] + 1, comma[1]
    if code == _PSXN:
        return commas < 2 or a == b or not 48 <= data[a] <= 57 or _is_attitude(data, a, b)
    if code == _PASHR:
        return commas < 2 or a == b or not 65 <= data[a] <= 90
    for i in range(3, commas):
        a, b = comma[i] + 1, comma[i + 1]
        if _is(data, a, b, _ROLL) or _is(data, a, b, _PITCH) or _is(data, a, b, _PTCH):
            return True
    return commas < _FIELDS[_XDR] or commas >= _MANY


@helper
def _is(data: ByteArray, a: int, b: int, word: ByteArray) -> bool:
    """Whether a field is a certain word, in capitals or not."""
    if b - a != len(word):
        return False
    for k in range(len(word)):
        c = int(np.int64(data[a + k]))
        if c != word[k] and c - 32 != word[k]:
            return False
    return True


@helper
def _transducers(data: ByteArray, comma: IntArray, commas: int, v: FloatArray) -> bool:
    """The first roll and the first pitch; behind the two, whether each is told at all."""
    v[0], v[1], v[2], v[3], v[4], v[5] = np.nan, np.nan, np.nan, np.nan, 0.0, 0.0
    for i in range(0, commas - 3, 4):
        a, b = comma[i + 3] + 1, comma[i + 4]
        roll = _is(data, a, b, _ROLL)
        known = roll or _is(data, a, b, _PITCH) or _is(data, a, b, _PTCH)
        place = 2 if roll else 3
        plain = _letter(data, comma, i) == _A and _letter(data, comma, i + 2) == _D
        if known and plain and v[place + 2] == 0.0:
            v[place], v[place + 2] = _number(data, comma, i + 1, True), 1.0
            if np.abs(v[place]) > STEEPEST:
                return False
    return bool(v[4] + v[5] > 0.0)


@helper
def _is_attitude(data: ByteArray, a: int, b: int) -> bool:
    """Whether the number of a PSXN sentence is 23."""
    return b - a == 2 and digits(data, a, b) == 23


@helper
def _attitude(code: int, data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    v[0] = np.nan
    roll, heading = (3, 1) if code == _PASHR else (1, 3)
    if code == _PASHR:
        v[0] = time_of_day(data, comma[0] + 1, comma[1])
        if not _mark(data, comma, 2, _T):
            return False
    elif not _is_attitude(data, comma[0] + 1, comma[1]):
        return False
    v[1] = _number(data, comma, heading, False)
    v[2], v[3] = _number(data, comma, roll, True), _number(data, comma, roll + 1, True)
    # DECLINED is infinite
    plain = v[0] != DECLINED and not v[1] > 360.0
    return plain and not np.abs(v[2]) > STEEPEST and not np.abs(v[3]) > STEEPEST


@helper
def _number(data: ByteArray, comma: IntArray, i: int, signed: bool) -> float:
    return decimal(data, comma[i] + 1, comma[i + 1], signed)


@helper
def _letter(data: ByteArray, comma: IntArray, i: int) -> int:
    return letter(data, comma[i] + 1, comma[i + 1])


@helper
def _mark(data: ByteArray, comma: IntArray, i: int, one: int) -> bool:
    """Whether a field is empty or one certain letter."""
    c = _letter(data, comma, i)
    return c in (0, one)


@helper
def _mode(data: ByteArray, comma: IntArray, commas: int, i: int) -> int:
    """The optional capital of a field, 0 where there is none; −1 declines it."""
    c = _letter(data, comma, i) if i < commas else 0
    return c if c == 0 or 65 <= c <= 90 else -1


@helper
def _place(data: ByteArray, comma: IntArray, i: int, valid: bool, v: FloatArray) -> bool:
    """Latitude and longitude from field ``i`` on; a valid fix must have both."""
    a, b = comma[i] + 1, comma[i + 1]
    latitude = degrees(data, a, b, _letter(data, comma, i + 1), True)
    longitude = degrees(data, comma[i + 2] + 1, comma[i + 3], _letter(data, comma, i + 3), False)
    if DECLINED in (latitude, longitude):
        return False
    missing = np.isnan(latitude) or np.isnan(longitude)
    if valid and missing:
        return False
    if missing or (not valid and latitude == 0.0 and longitude == 0.0):
        v[1], v[2] = np.nan, np.nan
    else:
        v[1], v[2] = latitude, longitude
    v[3] = 1.0 if valid else 0.0
    v[4] = -3.0 if np.isnan(latitude) else b - a - 5.0
    for k in range(5, 9):
        v[k] = np.nan
    return True


@helper
def _gga(code: int, data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    v[0] = time_of_day(data, comma[0] + 1, comma[1])
    a, b = comma[5] + 1, comma[6]
    valid = False
    if code == _GGA:
        quality = letter(data, a, b)
        if quality != 0 and not 48 <= quality <= 57:
            return False
        valid = quality > 48
    else:
        for k in range(a, b):
            if not 65 <= data[k] <= 90:
                return False
            valid = valid or data[k] != _N
    satellites = comma[7] - comma[6] - 1
    plain = satellites == 0 or digits(data, comma[6] + 1, comma[7]) >= 0
    plain = plain and satellites <= (2 if code == _GGA else 3) and b - a <= 8
    plain = plain and comma[8] - comma[7] <= 7 and _number(data, comma, 7, False) != DECLINED
    plain = plain and _place(data, comma, 1, valid, v)
    v[5] = _number(data, comma, 8, True)
    return plain and v[0] != DECLINED and v[5] != DECLINED


@helper
def _rmc(data: ByteArray, comma: IntArray, commas: int, v: FloatArray) -> bool:
    v[0] = time_of_day(data, comma[0] + 1, comma[1])
    status, mode = _letter(data, comma, 1), 0
    if commas > 11:
        side = _letter(data, comma, 10)
        mode = _mode(data, comma, commas, 11)
        if mode < 0 or not (side == 0 or side in (_E, _W)):
            return False
    valid = status == _A and mode != _N
    if v[0] == DECLINED or not (valid or status in (_A, _V)):
        return False
    speed, course = _number(data, comma, 6, False), _number(data, comma, 7, False)
    day = _date(data, comma[8] + 1, comma[9])
    if DECLINED in (speed, course, day):
        return False
    plain = _place(data, comma, 2, valid, v)
    v[8] = day
    if valid:
        v[6], v[7] = speed * KNOT, course
    return plain and not (valid and course > 360.0)


@helper
def _date(data: ByteArray, a: int, b: int) -> float:
    """``ddmmyy`` as a day number."""
    if a == b:
        return np.nan
    if b - a != 6:
        return DECLINED
    number = digits(data, a, b)
    if number < 0:
        return DECLINED
    year = number % 100
    return day_of(year + (1900 if year >= 80 else 2000), number // 100 % 100, number // 10_000)


@helper
def _gll(data: ByteArray, comma: IntArray, commas: int, v: FloatArray) -> bool:
    status, mode = 0, 0
    v[0] = np.nan
    if commas > 4:
        v[0] = time_of_day(data, comma[4] + 1, comma[5])
    if commas > 5:
        status, mode = _letter(data, comma, 5), _mode(data, comma, commas, 6)
    if v[0] == DECLINED or mode < 0 or not (status == 0 or status in (_A, _V)):
        return False
    return _place(data, comma, 0, status != _V and mode != _N, v)


@helper
def _vtg(data: ByteArray, comma: IntArray, commas: int, v: FloatArray) -> bool:
    course = _number(data, comma, 0, False)
    knots, kmh = _number(data, comma, 4, False), _number(data, comma, 6, False)
    mode = _mode(data, comma, commas, 8)
    plain = _letter(data, comma, 1) == _T and _mark(data, comma, 3, _M)
    plain = plain and _mark(data, comma, 5, _N) and _mark(data, comma, 7, _K) and mode >= 0
    v[0], v[1] = (kmh * KMH if np.isnan(knots) else knots * KNOT), course
    if mode == _N:
        v[0], v[1] = np.nan, np.nan
    return plain and DECLINED not in (knots, kmh) and not course > 360.0


@helper
def _heading(code: int, data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    heading, side = _number(data, comma, 0, False), _letter(data, comma, 1)
    v[0], v[1] = heading, np.nan
    if code == _HDT:
        plain = side in (0, _T)
    elif code == _HDM:
        plain = side in (0, _M)
        v[0], v[1] = np.nan, heading
    else:
        plain = side == 0 or side in (_A, _E, _M, _S, _V)
        v[0] = np.nan if side == _V else heading
    return plain and not heading > 360.0


@helper
def _signed(data: ByteArray, comma: IntArray, i: int) -> float:
    """Deviation or variation and its side, east positive."""
    value, side = _number(data, comma, i, False), _letter(data, comma, i + 1)
    if not (side == 0 or side in (_E, _W)) or value > 180.0:
        return DECLINED
    return np.nan if side == 0 else -value if side == _W else value


@helper
def _hdg(data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    heading = _number(data, comma, 0, False)
    deviation, variation = _signed(data, comma, 1), _signed(data, comma, 3)
    if heading > 360.0 or DECLINED in (deviation, variation):
        return False
    if not np.isnan(deviation):
        heading = (heading + deviation) % 360.0
    v[0], v[1] = np.nan, heading
    if not np.isnan(variation):
        v[0], v[1] = (heading + variation) % 360.0, np.nan
    return True


@helper
def _vhw(data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    true, magnetic = _number(data, comma, 0, False), _number(data, comma, 2, False)
    knots, kmh = _number(data, comma, 4, False), _number(data, comma, 6, False)
    plain = _mark(data, comma, 1, _T) and _mark(data, comma, 3, _M)
    plain = plain and _mark(data, comma, 5, _N) and _mark(data, comma, 7, _K)
    v[0], v[1], v[2] = (kmh * KMH if np.isnan(knots) else knots * KNOT), true, magnetic
    plain = plain and not true > 360.0 and not magnetic > 360.0
    return plain and DECLINED not in (knots, kmh)


@helper
def _depth(code: int, data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    if code == _DPT:
        depth, offset = _number(data, comma, 0, False), _number(data, comma, 1, True)
        v[0] = depth + (offset if offset > 0.0 else 0.0)
        return DECLINED not in (depth, offset)
    feet, metres = _number(data, comma, 0, False), _number(data, comma, 2, False)
    fathoms = _number(data, comma, 4, False)
    plain = _mark(data, comma, 1, _F[0]) and _mark(data, comma, 3, _F[1])
    plain = plain and _mark(data, comma, 5, _F[2])
    plain = plain and DECLINED not in (feet, metres, fathoms)
    v[0] = FOOT * (6.0 * fathoms if np.isnan(feet) else feet) if np.isnan(metres) else metres
    return plain


@helper
def _zda(data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    v[0], v[1] = time_of_day(data, comma[0] + 1, comma[1]), np.nan
    sizes = comma[2] - comma[1] - 1, comma[3] - comma[2] - 1, comma[4] - comma[3] - 1
    if sizes == (2, 2, 4):
        day, month = digits(data, comma[1] + 1, comma[2]), digits(data, comma[2] + 1, comma[3])
        year = digits(data, comma[3] + 1, comma[4])
        if day < 0 or month < 0 or year < 0:
            return False
        v[1] = day_of(year, month, day)
    elif sizes != (0, 0, 0):
        return False
    return DECLINED not in (v[0], v[1])


@helper
def _gst(data: ByteArray, comma: IntArray, v: FloatArray) -> bool:
    v[0] = time_of_day(data, comma[0] + 1, comma[1])
    north, east, up = (
        _number(data, comma, 5, False),
        _number(data, comma, 6, False),
        _number(data, comma, 7, False),
    )
    if DECLINED in (v[0], north, east, up):
        return False
    v[1] = np.nan if east == 0.0 else east
    v[2] = np.nan if north == 0.0 else north
    v[3] = np.nan if up == 0.0 else up
    return True
