"""The three modes: real time, fixed lag, offline; all made of the same filter steps."""

from __future__ import annotations

import numpy as np

from surefix.filters.records import Epochs, Estimate, Filtered, Motion, Recovery, TrackState
from surefix.filters.rts import Smoothed, smooth_lag
from surefix.filters.track import blank, filter_track, start
from surefix.robust.loss import Loss
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = [
    "from_filtered",
    "from_smoothed",
    "lagged",
    "realtime",
    "rows_of",
    "smoothed_stretch",
    "state_before",
    "write_rows",
]

_BLOCK = 5000  # epochs filtered in one call while waiting for a recovery


def realtime(
    motion: Motion, loss: Loss, recovery: Recovery, epochs: Epochs, state: TrackState
) -> tuple[TrackState, Estimate]:
    """Estimate every epoch from the past and itself alone; takes and gives the filter's state."""
    after, filtered, _ = filter_track(motion, loss, recovery, epochs, state)
    return after, from_filtered(filtered)


def from_filtered(filtered: Filtered) -> Estimate:
    """Read the filter's own output as an estimate."""
    return Estimate(
        filtered.mean,
        np.sqrt(np.einsum("kij,kij->ki", filtered.factor, filtered.factor)),
        filtered.weight,
        filtered.sigma,
        filtered.standardised,
        filtered.jump,
        filtered.since,
        np.zeros(len(filtered.jump), np.int64),
        np.full((len(filtered.jump), filtered.standardised.shape[1] // 2), np.nan),
        np.zeros(len(filtered.jump), np.bool_),
        np.ones(len(filtered.jump)),
    )


def from_smoothed(smoothed: Smoothed, decided: Estimate) -> Estimate:
    """Put smoothed states in the place of the filter's; verdicts stay as decided."""
    variance = np.maximum(np.einsum("kii->ki", smoothed.covariance), 0.0)
    return decided._replace(mean=smoothed.mean, sigma=np.sqrt(variance))


def lagged(
    motion: Motion,
    loss: Loss,
    recovery: Recovery,
    epochs: Epochs,
    lag: float,
    wanted: BoolArray,
) -> Estimate:
    """Estimate every epoch from the past and the ``lag`` seconds that follow it.

    When a run of rejections turns out to be a jump, the epochs from its start are filtered again
    with the jump dated back; what had left the window by then stays as it was.

    Parameters
    ----------
    motion, loss, recovery, epochs
        As for the filter.
    lag
        Seconds ≥ 0.
    wanted
        (n,) epochs that are smoothed; the others keep the filter's estimate.
    """
    time, n = epochs.time, len(epochs.time)
    last = np.searchsorted(time, time + lag, side="right") - 1
    epochs = epochs._replace(jump=epochs.jump.copy())  # jumps that are dated back are added to it
    since = np.full((n, motion.groups), np.nan)
    kept = blank(motion, n)
    parts: list[Estimate] = []
    state, head, done = start(motion, recovery), 0, 0
    while head < n:
        rows = rows_of(epochs, head, min(head + _BLOCK, n))
        state, out, count = filter_track(motion, loss, recovery, rows, state, until_recovery=True)
        write_rows(kept, head, out, count)
        head += count
        jumped = kept.jump[head - 1] & ~epochs.jump[head - 1]
        if not jumped:
            continue
        ready = max(int(np.searchsorted(last, head - 1)), done)
        parts.append(smoothed_stretch(motion, recovery, time, kept, last, wanted, done, ready))
        done = ready
        began = kept.since[head - 1].copy()
        first = np.maximum(np.searchsorted(time, began), done)
        for g in np.flatnonzero(np.isfinite(began)):
            epochs.jump[first[g]] |= 1 << g
            since[first[g], g] = began[g]
        begin = int(first[np.isfinite(began)].min())
        before = state_before(motion, recovery, time, kept, begin, state)
        again = rows_of(epochs, begin, head)
        state, redo, count = filter_track(motion, loss, recovery, again, before)
        write_rows(kept, begin, redo, count)
        kept.since[begin:head] = np.fmin(kept.since[begin:head], since[begin:head])
    parts.append(smoothed_stretch(motion, recovery, time, kept, last, wanted, done, n))
    return Estimate(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


def rows_of(epochs: Epochs, first: int, last: int) -> Epochs:
    """Epochs ``first`` … ``last`` − 1."""
    return Epochs(*(field[first:last] for field in epochs))  # type: ignore[arg-type]


def _cut(filtered: Filtered, first: int, last: int) -> Filtered:
    return Filtered(*(field[first:last] for field in filtered))  # type: ignore[arg-type]


def write_rows(kept: Filtered, at: int, out: Filtered, count: int) -> None:
    """Put the first ``count`` epochs of ``out`` into ``kept``, from epoch ``at`` on."""
    for whole, part in zip(kept, out, strict=True):
        whole[at : at + count] = part[:count]


def smoothed_stretch(
    motion: Motion,
    recovery: Recovery,
    time: FloatArray,
    kept: Filtered,
    last: IntArray,
    wanted: BoolArray,
    first: int,
    until: int,
) -> Estimate:
    """Smoothed estimates of the epochs ``first`` … ``until`` − 1."""
    end = int(last[until - 1]) + 1 if until > first else first
    stretch = _cut(kept, first, end)
    decided = from_filtered(_cut(kept, first, until))
    rows = np.flatnonzero(wanted[first:until])
    if not len(rows):
        return decided
    smoothed = smooth_lag(
        motion, recovery, time[first:end], stretch, rows, last[first:until][rows] - first
    )
    mean, sigma = decided.mean.copy(), decided.sigma.copy()
    part = from_smoothed(smoothed, decided)
    mean[rows], sigma[rows] = part.mean, part.sigma
    return decided._replace(mean=mean, sigma=sigma)


def state_before(
    motion: Motion,
    recovery: Recovery,
    time: FloatArray,
    kept: Filtered,
    begin: int,
    now: TrackState,
) -> TrackState:
    """The filter's state just before epoch ``begin``, from what it kept."""
    if begin == 0:
        return start(motion, recovery)
    return now._replace(
        time=float(time[begin - 1]), mean=kept.mean[begin - 1], factor=kept.factor[begin - 1]
    )
