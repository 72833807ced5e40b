"""Pieces of a log as records: plain lines by the kernel, all others as frames.

The pieces come in the order of the log, and say the same however its bytes are cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from surefix.io.nmea_decode import TYPES
from surefix.io.nmea_frame import Frame, Framing, frame
from surefix.io.nmea_record import (
    Clock,
    Depth,
    Heading,
    Motion,
    Position,
    Record,
    Sigma,
    WaterSpeed,
)
from surefix.io.nmea_scan import DECLINED, UNKNOWN, Lines, scan

__all__ = ["Plain", "pieces"]

_Values = list[float]


class Plain(NamedTuple):
    """A plain line.

    Parameters
    ----------
    line
        Its number, from 1.
    received
        Time of reception, s; NaN if the line has none.
    record
        What its sentence says; the type alone, if that is not known.
    """

    line: int
    received: float
    record: Record | str


def pieces(state: Framing, data: bytes) -> Iterator[tuple[Framing, list[Plain] | list[Frame]]]:
    r"""Lines that the next bytes of a log complete, and each time the state to go on with.

    >>> [(_, found)] = pieces(Framing(), b"$HEHDT,218.53,T*12\r\n")
    >>> found[0].record
    Heading(talker='HE', type='HDT', true=218.53, magnetic=nan)
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
        edges = np.flatnonzero(np.diff(lines.code == DECLINED)) + 1
        for a, b in zip([0, *edges.tolist()], [*edges.tolist(), len(lines.code)], strict=True):
            if lines.code[a] != DECLINED:
                yield Framing(line=number + b - a), _plain(data, lines, a, b, number)
                number += b - a
                continue
            some = data[lines.begin[a] : lines.begin[b]]
            after, frames = frame(Framing(line=number), some)
            number = after.line
            yield after, frames
    rest = frame(Framing(line=number), data[whole:])
    yield rest


def _plain(data: bytes, lines: Lines, a: int, b: int, number: int) -> list[Plain]:
    out = []
    for k, (code, (begin, end), received, values) in enumerate(
        zip(
            lines.code[a:b].tolist(),
            lines.address[a:b].tolist(),
            lines.received[a:b].tolist(),
            lines.values[a:b].tolist(),
            strict=True,
        ),
        number,
    ):
        address = data[begin:end].decode()
        if code == UNKNOWN:
            kind: Record | str = address if address[0] == "P" else address[2:]
            out.append(Plain(k, received, kind))
        else:
            out.append(Plain(k, received, _BUILD[code](address[:2], address[2:], values)))
    return out


def _day(value: float) -> int | None:
    return int(value) if value == value else None


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
}
_BUILD = [_BUILDERS[name] for name in TYPES]
