"""Pieces of a log as records: plain lines by the kernel, all others as frames.

The pieces come in the order of the log, and say the same however its bytes are cut.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from math import isnan
from typing import NamedTuple

import numpy as np

from surefix.io.acoustic_record import Attitude
from surefix.io.nmea import parse
from surefix.io.nmea_decode import TYPES
from surefix.io.nmea_frame import Frame, Framing, frame
from surefix.io.nmea_record import (
    Clock,
    Depth,
    Heading,
    Motion,
    Position,
    Record,
    Refused,
    Sigma,
    WaterSpeed,
)
from surefix.io.nmea_scan import DECLINED, UNKNOWN, Lines, scan
from surefix.types import IntArray

__all__ = ["Plain", "pieces"]

_MOST = 1000  # addresses that are remembered
_UNKNOWN: dict[bytes, bool] = {}  # whether `parse` does not know an address either
_Values = tuple[float, ...]
_TYPE = 3  # letters of a type behind a talker


class Plain(NamedTuple):
    """Plain lines, one after the other.

    Parameters
    ----------
    total
        How many records there are.
    records
        Of each line its number, from 1, its time of reception, s, NaN if it has none, and what its
        sentence says, made when it is asked for. Lines of unknown types are left out.
    unknown
        How many sentences there are of each unknown type.
    """

    total: int
    records: Iterator[tuple[int, float, Record]]
    unknown: dict[str, int]


def pieces(state: Framing, data: bytes) -> Iterator[tuple[Framing, Plain | list[Frame]]]:
    r"""Lines that the next bytes of a log complete, and each time the state to go on with.

    >>> (_, found), _ = pieces(Framing(), b"$HEHDT,218.53,T*12\r\n")
    >>> list(found.records)
    [(1, nan, Heading(talker='HE', type='HDT', true=218.53, magnetic=nan))]
    """
    if state.skipping:
        yield frame(state, data)
        return
    if state.returned and data[:1] == b"\n":
        data = data[1:]
    data = state.rest + data
    whole = data.rfind(b"\n") + 1
    number = state.line
    if whole:
        lines = scan(data[:whole])
        _decline_known(data, lines)
        edges = np.flatnonzero(np.diff(lines.code == DECLINED)) + 1
        for a, b in zip([0, *edges.tolist()], [*edges.tolist(), len(lines.code)], strict=True):
            if lines.code[a] != DECLINED:
                yield Framing(line=number + b - a), _plain(data, lines, a, b, number)
                number += b - a
                continue
            after, frames = frame(Framing(line=number), data[lines.begin[a] : lines.begin[b]])
            number = after.line
            yield after, frames
    yield frame(Framing(line=number), data[whole:])


def _decline_known(data: bytes, lines: Lines) -> None:
    """Leave to `parse` the sentences that it knows and the kernel does not."""
    rows = np.flatnonzero(lines.code == UNKNOWN)
    places = lines.address[rows].tolist()
    sample = {data[begin:end]: k for k, (begin, end) in zip(rows.tolist(), places, strict=True)}
    known = [address for address, k in sample.items() if not _is_unknown(address, data, lines, k)]
    if known:
        again = np.array([data[begin:end] in known for begin, end in places])
        lines.code[rows[again]] = DECLINED


def _is_unknown(address: bytes, data: bytes, lines: Lines, k: int) -> bool:
    found = _UNKNOWN.get(address)
    if found is None:
        said = parse(data[lines.address[k, 0] - 1 : lines.begin[k + 1]])
        found = isinstance(said, Refused) and said.kind == "unknown-type"
        if len(_UNKNOWN) < _MOST:
            _UNKNOWN[address] = found
    return found


def _plain(data: bytes, lines: Lines, a: int, b: int, number: int) -> Plain:
    rows = np.flatnonzero(lines.code[a:b] >= 0) + a
    others = lines.address[a:b][lines.code[a:b] == UNKNOWN].tolist()
    addresses = Counter(data[begin:end].decode() for begin, end in others)
    unknown: Counter[str] = Counter()
    for address, count in addresses.items():
        unknown[address if address[0] == "P" else address[2:]] += count
    return Plain(len(rows), _records(data, lines, rows, number - a), unknown)


def _records(
    data: bytes, lines: Lines, rows: IntArray, first: int
) -> Iterator[tuple[int, float, Record]]:
    columns = (column.tolist() for column in lines.values[rows].T)
    for line, code, begin, received, values in zip(
        (rows + first).tolist(),
        lines.code[rows].tolist(),
        lines.address[rows, 0].tolist(),
        lines.received[rows].tolist(),
        zip(*columns, strict=True),
        strict=True,
    ):
        talker = data[begin : begin + 2].decode() if len(TYPES[code]) == _TYPE else ""
        yield line, received, _BUILD[code](talker, TYPES[code], values)


def _day(value: float) -> int | None:
    return None if isnan(value) else int(value)


def _position(talker: str, kind: str, v: _Values) -> Position:
    return Position(
        talker, kind, v[0], v[1], v[2], v[3] == 1.0, int(v[4]), v[5], v[6], v[7], _day(v[8])
    )


def _motion(talker: str, kind: str, v: _Values) -> Motion:
    return Motion(talker, kind, v[0], v[1])


def _heading(talker: str, kind: str, v: _Values) -> Heading:
    return Heading(talker, kind, v[0], v[1])


def _water_speed(talker: str, kind: str, v: _Values) -> WaterSpeed:
    return WaterSpeed(talker, kind, v[0], v[1], v[2])


def _depth(talker: str, kind: str, v: _Values) -> Depth:
    return Depth(talker, kind, v[0])


def _clock(talker: str, kind: str, v: _Values) -> Clock:
    return Clock(talker, kind, v[0], _day(v[1]))


def _sigma(talker: str, kind: str, v: _Values) -> Sigma:
    return Sigma(talker, kind, v[0], v[1], v[2], v[3])


def _attitude(talker: str, kind: str, v: _Values) -> Attitude:
    return Attitude(talker, kind, v[0], v[1], v[2], v[3])


def _transducers(talker: str, kind: str, v: _Values) -> Attitude:
    return Attitude(talker, kind, v[0], None, v[2] if v[4] else None, v[3] if v[5] else None)


_BUILDERS: dict[str, Callable[[str, str, _Values], Record]] = {
    "GGA": _position,
    "GNS": _position,
    "RMC": _position,
    "GLL": _position,
    "VTG": _motion,
    "HDT": _heading,
    "HDM": _heading,
    "THS": _heading,
    "HDG": _heading,
    "VHW": _water_speed,
    "DPT": _depth,
    "DBT": _depth,
    "ZDA": _clock,
    "GST": _sigma,
    "PASHR": _attitude,
    "PSXN": _attitude,
    "XDR": _transducers,
}
_BUILD = [_BUILDERS[name] for name in TYPES]
