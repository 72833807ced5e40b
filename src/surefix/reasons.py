"""Verdicts in words: the sentence a surveyor reads beside each fix."""

from __future__ import annotations

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


def _where(mask: int) -> str:
    """Which axes an axis mask means."""
    flat = [name for i, name in enumerate(_AXES) if (mask >> i) & 1]
    named = ["horizontally" if len(flat) == 2 else f"along {name}" for name in flat[:1]]
    return " and ".join([*named, *(["vertically"] if mask & 4 else [])])


def vector(offset: Sequence[float]) -> str:
    """An offset in the axes that have one; metres, if it has several."""
    known = [f"{value:.1f}".replace("-", "−") for value in offset if math.isfinite(value)]
    return f"({', '.join(known)}) m" if len(offset) > 1 else ", ".join(known)


def _text(
    reason: int,
    verdict: int,
    weight: float,
    sigma: float,
    detail: float,
    offset: Sequence[float],
) -> str:
    match reason:
        case Reason.OFF if verdict == Verdict.REJECTED:
            return f"{sigma:.1f} σ off"
        case Reason.OFF:
            return f"{sigma:.1f} σ off, weight {weight:.2f}"
        case Reason.ISOLATED:
            return f"isolated error, {sigma:.1f} σ off"
        case Reason.AXIS_OFF:
            return f"{sigma:.1f} σ off {_where(int(detail))}, the rest used"
        case Reason.RUN:
            known = any(math.isfinite(value) for value in offset)
            by = f" with offset {vector(offset)}" if known else ""
            return f"in a run of {int(detail)}{by}, {sigma:.1f} σ off"
        case Reason.DRAG:
            return (
                f"in a drag of {int(detail)} fixes, offset now {vector(offset)}, {sigma:.1f} σ off"
            )
        case Reason.JUMP:
            return f"jump accepted, dated back to {clock(detail)}"
        case Reason.REPEATED:
            return f"the same record again, first at {clock(detail)}"
        case Reason.HELD:
            return f"held: the fix of {clock(detail)} polled again"
        case Reason.LATE:
            return f"arrived after the fix of {clock(detail)} was already out"
        case _:
            return _FIXED[reason]


def texts(verdicts: Verdicts) -> list[str]:
    """One sentence per observation."""
    found = np.empty(len(verdicts.reason), dtype=object)
    for reason in np.unique(verdicts.reason).tolist():
        rows = np.flatnonzero(verdicts.reason == reason)
        if reason in _FIXED:
            found[rows] = _FIXED[reason]
            continue
        found[rows] = [
            _text(reason, *row)
            for row in zip(
                verdicts.verdict[rows].tolist(),
                verdicts.weight[rows].tolist(),
                verdicts.innovation_sigma[rows].tolist(),
                verdicts.detail[rows].tolist(),
                verdicts.offset[rows].tolist(),
                strict=True,
            )
        ]
    return found.tolist()
