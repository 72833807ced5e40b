"""Verdicts in words: the sentence a surveyor reads beside each fix."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from surefix.types import Reason, Verdict, Verdicts

__all__ = ["CALENDAR_FROM", "clock", "texts", "vector"]

CALENDAR_FROM = 1e8
"""s: smaller times count from the start of a log and carry no date."""

_FIXED: dict[int, str] = {
    Reason.AGREES: "agrees",
    Reason.NO_POSITION: "no position",
    Reason.NO_VALUE: "no value",
    Reason.NO_TIME: "no time",
    Reason.INVALID: "marked invalid by the sensor",
    Reason.ACCEPTED_BY_USER: "accepted by the user",
    Reason.REJECTED_BY_USER: "rejected by the user",
}
_AXES = ("x", "y")


def clock(time: float) -> str:
    """Time of day of a Unix time, or seconds where the time has no date.

    >>> clock(1699643598.72), clock(12.5)
    ('19:13:18.7', '12.5 s')
    """
    if not math.isfinite(time):
        return "an unknown time"
    if abs(time) < CALENDAR_FROM:
        return f"{time:.1f} s"
    tenths = round(time * 10.0)
    return f"{datetime.fromtimestamp(tenths // 10, UTC):%H:%M:%S}.{tenths % 10}"


@functools.cache
def _where(mask: int) -> str:
    """Which axes an axis mask means."""
    flat = [name for i, name in enumerate(_AXES) if (mask >> i) & 1]
    named = ["horizontally" if len(flat) == 2 else f"along {name}" for name in flat[:1]]
    return " and ".join([*named, *(["vertically"] if mask & 4 else [])])


def vector(offset: Sequence[float]) -> str:
    """An offset in the axes that have one; metres, if it has several."""
    known = [f"{value:.1f}".replace("-", "−") for value in offset if math.isfinite(value)]
    return f"({', '.join(known)}) m" if len(offset) > 1 else ", ".join(known)


def _sentences(reason: int, some: Verdicts) -> list[str]:
    """Sentences of verdicts that all have one reason, not a fixed one."""
    sigmas, detail = some.innovation_sigma.tolist(), some.detail.tolist()
    match reason:
        case Reason.OFF:
            rejected = (some.verdict == Verdict.REJECTED).tolist()
            return [
                f"{sigma:.1f} σ off" if out else f"{sigma:.1f} σ off, weight {weight:.2f}"
                for sigma, weight, out in zip(sigmas, some.weight.tolist(), rejected, strict=True)
            ]
        case Reason.ISOLATED:
            return [f"isolated error, {sigma:.1f} σ off" for sigma in sigmas]
        case Reason.AXIS_OFF:
            where = zip(sigmas, detail, strict=True)
            return [
                f"{sigma:.1f} σ off {_where(int(mask))}, the rest used" for sigma, mask in where
            ]
        case Reason.RUN | Reason.DRAG:
            lasting = zip(detail, some.offset.tolist(), sigmas, strict=True)
            said = _run if reason == Reason.RUN else _drag
            return [
                f"{said(int(count), offset)}, {sigma:.1f} σ off" for count, offset, sigma in lasting
            ]
        case Reason.JUMP:
            return [f"jump accepted, dated back to {clock(time)}" for time in detail]
        case Reason.REPEATED:
            return [f"the same record again, first at {clock(time)}" for time in detail]
        case Reason.HELD:
            return [f"held: the fix of {clock(time)} polled again" for time in detail]
        case Reason.LATE:
            return [f"arrived after the fix of {clock(time)} was already out" for time in detail]
        case _:
            raise ValueError(reason)


def _run(count: int, offset: Sequence[float]) -> str:
    known = any(math.isfinite(value) for value in offset)
    return f"in a run of {count}" + (f" with offset {vector(offset)}" if known else "")


def _drag(count: int, offset: Sequence[float]) -> str:
    return f"in a drag of {count} fixes, offset now {vector(offset)}"


def texts(verdicts: Verdicts) -> list[str]:
    """One sentence per observation."""
    found = np.empty(len(verdicts.reason), dtype=object)
    for reason in np.unique(verdicts.reason).tolist():
        rows = np.flatnonzero(verdicts.reason == reason)
        if reason in _FIXED:
            found[rows] = _FIXED[reason]
        else:
            found[rows] = _sentences(reason, Verdicts._make(column[rows] for column in verdicts))
    return found.tolist()
