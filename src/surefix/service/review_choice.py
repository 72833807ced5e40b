"""Which fixes a person means by a line drawn around them, or by pointing at them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.types import BoolArray, Cleaned, FloatArray, IntArray, Verdict

__all__ = ["PANELS", "Part", "chosen_rows", "doubted", "drawn_up", "inside"]

PANELS: Final = ("plan", "east", "north", "vertical")
"""What can be drawn on: the plan view, and the axes over time."""


_DOUBTED: Final = (Verdict.DOWNWEIGHTED, Verdict.REJECTED, Verdict.EDITED)


class Part(NamedTuple):
    """One part of a choice.

    Parameters
    ----------
    panel
        One of `PANELS`; empty: the fixes of ``rows``.
    line
        (m, 2) corners of a closed line: east and north in m, or time in s and metres.
    rows
        (k,) rows of the result.
    """

    panel: str
    line: FloatArray
    rows: IntArray


def chosen_rows(cleaned: Cleaned, parts: Sequence[Part], verdicts: Sequence[Verdict]) -> IntArray:
    """Rows that any of the parts means, all of them, drawn or not.

    Parameters
    ----------
    cleaned
        The result that is shown, n rows.
    parts
        Of the choice.
    verdicts
        Those that are shown: what is hidden is not meant by a line around it.
    """
    count = len(cleaned.track.time)
    meant = np.zeros(count, np.bool_)
    shown = np.isin(cleaned.verdicts.verdict, list(verdicts))
    for part in parts:
        if part.panel:
            meant |= shown & inside(part.line, *_coordinates(cleaned, part.panel))
        else:
            meant[part.rows[(part.rows >= 0) & (part.rows < count)]] = True
    return np.flatnonzero(meant)


def _coordinates(cleaned: Cleaned, panel: str) -> tuple[FloatArray, FloatArray]:
    raw = cleaned.raw_position
    return raw[:, 0] if panel == "plan" else cleaned.track.time, drawn_up(cleaned, panel, raw)


def drawn_up(cleaned: Cleaned, panel: str, position: FloatArray) -> FloatArray:
    """What is drawn upwards on a panel of positions, (n, 3) m; depth, if it is one, as such."""
    if panel == "plan":
        return position[:, 1]
    values = position[:, PANELS.index(panel) - 1]
    return -values if panel == "vertical" and cleaned.has_depth else values


def inside(line: FloatArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """Tell which points lie inside a closed line, by the parity of the edges left of them.

    Parameters
    ----------
    line
        (m, 2) its corners; fewer than three have no inside.
    x, y
        (n,) the points; NaN is never inside.

    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> inside(square, np.array([1.0, 3.0, np.nan]), np.array([1.0, 1.0, 1.0])).tolist()
    [True, False, False]
    """
    found = np.zeros(len(x), np.bool_)
    if len(line) < 3:
        return found
    (left, low), (right, high) = line.min(axis=0), line.max(axis=0)
    near = np.flatnonzero((x >= left) & (x <= right) & (y >= low) & (y <= high))
    px, py = x[near], y[near]
    odd = np.zeros(len(near), np.bool_)
    for (ax, ay), (bx, by) in zip(line, np.roll(line, -1, axis=0), strict=True):
        crosses = (ay > py) != (by > py)
        if ay != by:
            odd ^= crosses & (px < ax + (py - ay) * ((bx - ax) / (by - ay)))
    found[near] = odd
    return found


def doubted(cleaned: Cleaned, row: int | None, by: int) -> int | None:
    """Find the next fix that was not simply used, forward (1) or backward (−1); None at the end."""
    rows = np.flatnonzero(np.isin(cleaned.verdicts.verdict, _DOUBTED))
    if by > 0:
        rows = rows[rows > (-1 if row is None else row)]
    else:
        rows = rows[rows < (len(cleaned.track.time) if row is None else row)][::-1]
    return int(rows[0]) if len(rows) else None
