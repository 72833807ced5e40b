"""Draw less without showing less: extremes of equal spans, breaks at gaps, ranges of a view."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["View", "breaks", "extremes", "gapped", "outline", "pieces", "view"]

_GAP = 10.0  # median steps


def extremes(columns: FloatArray, limit: int) -> IntArray:
    """Rows that keep the look of a series: least and greatest of each column in equal spans.

    Parameters
    ----------
    columns
        (n, k) in the order of drawing; NaN is never an extreme.
    limit
        Greatest number of rows wanted; all rows if there are no more than that.

    Returns
    -------
    rows
        Increasing; the first and the last are among them.

    >>> extremes(np.array([[0.0], [9.0], [1.0], [2.0], [-5.0], [3.0]]), 4).tolist()
    [0, 1, 4, 5]
    """
    count, width = columns.shape
    if count <= limit:
        return np.arange(count)
    spans = max(1, (limit - 2) // (2 * width))
    edge = np.linspace(0, count, spans + 1).astype(np.int64)[:-1]
    kept = [np.array([0, count - 1])]
    for column in columns.T:
        for sign in (1.0, -1.0):
            value = np.where(np.isfinite(column), sign * column, np.inf)
            least = np.repeat(np.minimum.reduceat(value, edge), np.diff(edge, append=count))
            hits = np.flatnonzero(np.isfinite(value) & (value == least))
            span = np.searchsorted(edge, hits, side="right")
            kept.append(hits[np.flatnonzero(np.diff(span, prepend=0))])
    return np.unique(np.concatenate(kept))


def breaks(time: FloatArray) -> IntArray:
    """Rows at which a line starts anew: after a step longer than ten median steps.

    >>> breaks(np.array([0.0, 1.0, 2.0, 3.0, 90.0, 91.0])).tolist()
    [4]
    """
    step = np.diff(time)
    usual = step[np.isfinite(step) & (step > 0.0)]
    if usual.size == 0:
        return np.zeros(0, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        return np.flatnonzero(step > _GAP * np.median(usual)) + 1


def pieces(rows: IntArray, cuts: IntArray, good: BoolArray) -> list[IntArray]:
    """Runs of drawn rows without a cut or a bad row between them.

    Parameters
    ----------
    rows
        Drawn rows, increasing.
    cuts
        Rows at which a new piece starts.
    good
        (n,) False where there is nothing to draw.
    """
    kept = rows[good[rows]]
    bad = np.cumsum(~good[rows])[good[rows]]
    block = bad + np.searchsorted(cuts, kept, side="right") * (rows.size + 1)
    return [run for run in np.split(kept, np.flatnonzero(np.diff(block)) + 1) if run.size]


def gapped(runs: list[IntArray]) -> IntArray:
    """Join runs of rows with a −1 after each: the row of a NaN appended to the values.

    >>> gapped([np.array([0, 1]), np.array([5])]).tolist()
    [0, 1, -1, 5, -1]
    """
    return np.concatenate([np.zeros(0, dtype=np.int64), *(np.append(run, -1) for run in runs)])


def outline(low: FloatArray, high: FloatArray, runs: list[IntArray]) -> tuple[IntArray, FloatArray]:
    """Close the area between two curves, run by run, as one polygon with gaps.

    Returns
    -------
    rows
        Row of each corner, −1 at a gap.
    values
        Its ordinate, NaN at a gap.
    """
    values = [np.concatenate((low[run], high[run[::-1]], [np.nan])) for run in runs]
    rows = gapped([np.concatenate((run, run[::-1])) for run in runs])
    return rows, np.concatenate([np.zeros(0), *values])


class View(NamedTuple):
    """The part of an axis shown at first.

    Parameters
    ----------
    low, high
        Its ends.
    """

    low: float
    high: float

    def holds(self, values: FloatArray) -> BoolArray:
        """Tell which values lie in it; NaN is nowhere."""
        with np.errstate(invalid="ignore"):
            return np.asarray((values >= self.low) & (values <= self.high))


def view(core: FloatArray, doubtful: FloatArray, *, least: float) -> View:
    """Choose a range that shows all of the core and, of the doubtful, what lies not too far off.

    Doubtful values further from the core than its own width are left to the user's zoom.

    Parameters
    ----------
    core, doubtful
        Values of any shape; NaN is left out.
    least
        Smallest width worth showing.

    >>> view(np.array([0.0, 10.0]), np.array([14.0, 1e6]), least=1.0)
    View(low=-0.84, high=14.84)
    """
    core, doubtful = core[np.isfinite(core)], doubtful[np.isfinite(doubtful)]
    if core.size == 0:
        core = doubtful if doubtful.size else np.zeros(1)
    low, high = float(core.min()), float(core.max())
    reach = max(high - low, 5.0 * least)
    near = doubtful[(doubtful >= low - reach) & (doubtful <= high + reach)]
    low, high = float(min(low, near.min(initial=low))), float(max(high, near.max(initial=high)))
    pad = 0.06 * (high - low) + max(0.0, 0.5 * (least - (high - low)))
    return View(low - pad, high + pad)
