"""From what the filter decided to one verdict with its reason per row."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.deciding import Decided, decide, look_ahead
from surefix.filters.hypotheses import Bank, Prior, no_hypotheses
from surefix.filters.modes import lagged, realtime
from surefix.filters.multi_hypothesis_modes import (
    lagged_hypotheses,
    offline_hypotheses,
    realtime_hypotheses,
)
from surefix.filters.offline import offline
from surefix.filters.records import Epochs, Estimate, Motion, Recovery, TrackState
from surefix.filters.track import start
from surefix.pipelines.options import CleanOptions
from surefix.types import BoolArray, FloatArray, IntArray, Reason, Verdict, Verdicts

__all__ = [
    "FilterState",
    "Status",
    "begin",
    "blank_status",
    "by_velocity",
    "estimate",
    "join_status",
    "unjudged",
    "verdicts",
    "without_position",
]

_BY_THE_FILTER = (Reason.AGREES, Reason.OFF, Reason.ISOLATED, Reason.JUMP)
_WHOLE = 0.98  # a weight from here on counts as used
_NONE = 0.02  # a weight up to here counts as rejected
_DOUBTFUL = 0.5  # … and a probability below this, where a weight is one


FilterState = TrackState | Decided | Bank
"""What a filter remembers: one hypothesis, perhaps with a cleaner before it, or several."""


def begin(
    options: CleanOptions, motion: Motion, recovery: Recovery, prior: Prior | None
) -> FilterState:
    """State of a filter that has seen nothing."""
    if prior is not None:
        return no_hypotheses(motion)
    track = start(motion, recovery)
    return track if options.decider is None else Decided(track)


class Status(NamedTuple):
    """What is known of a row before any filter sees it.

    Parameters
    ----------
    verdict
        (n,) code of `Verdict`, −1 where the filter decides.
    reason
        (n,) code of `Reason`.
    detail
        (n,) figure that goes with it.
    """

    verdict: IntArray
    reason: IntArray
    detail: FloatArray

    def mark(self, where: BoolArray, verdict: Verdict, reason: Reason) -> None:
        """Set verdict and reason of the rows that have none yet."""
        rows = where & (self.verdict < 0)
        self.verdict[rows] = verdict
        self.reason[rows] = reason


def blank_status(n: int) -> Status:
    """Leave every row to the filter."""
    return Status(np.full(n, -1), np.zeros(n, np.int64), np.full(n, np.nan))


def estimate(
    options: CleanOptions,
    motion: Motion,
    recovery: Recovery,
    prior: Prior | None,
    lag: float,
    epochs: Epochs,
    wanted: BoolArray,
    state: FilterState,
) -> tuple[FilterState, Estimate]:
    """Estimate a series in the mode the options ask for; only real time goes on from ``state``.

    ``wanted`` (n,) marks the epochs whose estimate becomes a row of the output.
    """
    if prior is not None:
        if options.mode == "lagged":
            return state, lagged_hypotheses(motion, prior, epochs, lag, wanted)
        if options.mode == "offline":
            return state, offline_hypotheses(motion, prior, epochs)
        assert isinstance(state, Bank)
        return realtime_hypotheses(motion, prior, epochs, state)
    if isinstance(state, Decided):
        assert options.decider is not None
        series, epochs, far = decide(options.decider, motion, recovery, epochs, state.series)
        lag = max(lag - look_ahead(options.decider, motion, epochs), 0.0)
        track, found = estimate(options, motion, recovery, prior, lag, epochs, wanted, state.track)
        assert isinstance(track, TrackState)
        return Decided(track, series), found._replace(distance=far)
    assert isinstance(state, TrackState)
    if options.mode == "realtime":
        return realtime(motion, options.loss, recovery, epochs, state)
    if options.mode == "lagged":
        return state, lagged(motion, options.loss, recovery, epochs, lag, wanted)
    return state, offline(motion, options.loss, recovery, epochs)


def verdicts(
    found: Estimate,
    epochs: Epochs,
    motion: Motion,
    status: Status,
    axes: tuple[int, ...],
    *,
    several: bool,
) -> Verdicts:
    """Give every row its verdict.

    The weight is the smallest of the position groups that were observed. A fix is rejected where
    its horizontal position (or its only group) is, on one axis or both; a height rejected alone
    leaves it down-weighted. Where each axis is judged by itself, the right ones are used.

    Parameters
    ----------
    found, epochs, motion
        What the filter made of which observations.
    status
        What was known before.
    axes
        Which of x, y, z the filter runs on.
    several
        Whether weights are probabilities under several hypotheses.
    """
    n, d = len(epochs.time), motion.axes
    groups = int(motion.group[:d].max()) + 1
    apart = groups == d  # each axis is judged by itself
    weight = np.minimum(found.weight[:, :groups], 1.0)
    distance = found.distance[:, :groups]
    smallest = _fold(np.fmin, weight)
    verdict = np.full(n, int(Verdict.USED))
    verdict[smallest < _WHOLE] = Verdict.DOWNWEIGHTED
    leading = _leading(weight, axes, apart)
    verdict[leading < _DOUBTFUL if several else leading <= _NONE] = Verdict.REJECTED
    reason = np.full(n, int(Reason.AGREES))
    reason[verdict != Verdict.USED] = Reason.OFF
    if several:
        reason[verdict == Verdict.REJECTED] = Reason.ISOLATED
    detail = np.full(n, np.nan)
    if groups > 1:
        low = np.nan_to_num(weight, nan=1.0) < (_DOUBTFUL if several else _WHOLE)
        part = low.any(axis=1) & ~low.all(axis=1) & (np.isfinite(weight).sum(axis=1) > 1)
        reason[part] = Reason.AXIS_OFF
        detail[part] = (low[part] * _bits(axes, apart)).sum(axis=1)
    run = (found.run > 1) & (verdict == Verdict.REJECTED)
    reason[run], detail[run] = np.where(found.drag, Reason.DRAG, Reason.RUN)[run], found.run[run]
    since = found.since[:, :groups]
    jumped = np.isfinite(since).any(axis=1)
    reason[jumped & (verdict != Verdict.REJECTED)] = Reason.JUMP
    detail[jumped] = np.nanmin(since[jumped], axis=1)
    decided = status.verdict >= 0
    verdict = np.where(decided, status.verdict, verdict)
    reason = np.where(decided, status.reason, reason)
    detail = np.where(decided, status.detail, detail)
    weight_out = np.where(np.isnan(smallest), 0.0, smallest)
    return Verdicts(
        verdict.astype(np.int64),
        weight_out,
        _fold(np.fmax, distance),
        found.standardised[:, :d],
        reason.astype(np.int64),
        detail,
        np.where(np.isin(reason, (Reason.RUN, Reason.DRAG))[:, None], found.offset, np.nan),
    )


def by_velocity(
    judged: Verdicts, found: Estimate, motion: Motion, supporting: BoolArray, *, several: bool
) -> Verdicts:
    """Judge ``supporting`` rows (n,) that brought nothing but a velocity by that; others stay."""
    d = motion.axes
    weight = found.weight[:, int(motion.group[:d].max()) + 1 :]
    alone = supporting & np.isnan(judged.standardised).all(axis=1)
    alone &= np.isfinite(weight).any(axis=1) & (judged.verdict == Verdict.USED)
    leading = _fold(np.fmin, weight) if weight.shape[1] else np.full(len(alone), np.nan)
    out = leading < _DOUBTFUL if several else leading <= _NONE
    standardised = judged.standardised.copy()
    standardised[alone, :d] = found.standardised[alone, d : 2 * d]
    return judged._replace(
        verdict=np.where(alone & out, int(Verdict.REJECTED), judged.verdict),
        standardised=standardised,
    )


def _leading(weight: FloatArray, axes: tuple[int, ...], apart: bool) -> FloatArray:
    """Weight that a fix as a whole is judged by: the horizontal one, or the only one there is."""
    leading = weight[:, 0].copy()
    for g in range(1, weight.shape[1]):
        beside = apart and axes[g] < 2
        worst = np.fmin(leading, weight[:, g]) if beside else leading
        leading = np.where(np.isnan(worst), weight[:, g], worst)
    return leading


def _bits(axes: tuple[int, ...], apart: bool) -> IntArray:
    """Bits of `Reason.AXIS_OFF` for each group: blocks or single axes, but for both the same."""
    if apart:
        return np.array([1 << axis for axis in axes])
    kinds = list(dict.fromkeys(axis == 2 for axis in axes))
    return np.array([4 if kind else 3 for kind in kinds])


def _fold(function: np.ufunc, columns: FloatArray) -> FloatArray:
    """Smallest or largest of the columns, NaN where all are; column by column is sooner."""
    found = columns[:, 0].copy()
    for column in columns.T[1:]:
        function(found, column, out=found)
    return found


def join_status(status: Status, order: IntArray, extra: int) -> Status:
    """Put the status of rows in the order of their epochs, ``extra`` regular times among them."""
    more = blank_status(extra)
    return Status._make(np.concatenate([a, b])[order] for a, b in zip(status, more, strict=True))


def without_position(judged: Verdicts, lost: BoolArray) -> Verdicts:
    """Call a fix missing that brought a velocity at best, unless more is known of it."""
    where = lost & np.isin(judged.reason, _BY_THE_FILTER)
    return judged._replace(
        verdict=np.where(where, int(Verdict.MISSING), judged.verdict),
        reason=np.where(where, int(Reason.NO_POSITION), judged.reason),
    )


def unjudged(status: Status) -> Verdicts:
    """Verdicts where there is nothing to filter."""
    n = len(status.verdict)
    return Verdicts(
        np.where(status.verdict < 0, int(Verdict.MISSING), status.verdict),
        np.zeros(n),
        np.full(n, np.nan),
        np.full((n, 3), np.nan),
        np.where(status.verdict < 0, int(Reason.NO_POSITION), status.reason),
        status.detail,
        np.full((n, 3), np.nan),
    )
