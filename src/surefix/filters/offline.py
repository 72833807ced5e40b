"""Offline estimation: both directions, and no decision that the whole log contradicts.

The filter's decisions are only a beginning. It runs forward and backward in time, and what either
pass doubts is left out at first. Jumps are dated back to where they happened, the series is
smoothed, and every observation is judged again by what all the *others* say of it (its
deleted residual); the weights that follow are used in the next sweep, until they stand still. That
is M-estimation of the whole track by iteratively reweighted least squares.
"""

from __future__ import annotations

import itertools

import numpy as np

from surefix.filters.modes import from_filtered, from_smoothed
from surefix.filters.records import Epochs, Estimate, Filtered, Motion, Recovery
from surefix.filters.rts import Smoothed, leave_one_out, smooth
from surefix.filters.track import filter_track, start
from surefix.models.motion import add_noise_factor, propagate_rows
from surefix.robust.loss import Loss, weights
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["backward", "needed_jumps", "offline"]

_SWEEPS = 8
_STILL = 0.02  # largest change of a weight that counts as standing still
_DOUBT = 0.5  # a weight below it, in either direction, leaves an observation out at first
_SHORT = 5  # observations that a stretch between jumps needs to be believed
_SAME = 4.5  # standard deviations within which both sides of a jump agree


def offline(motion: Motion, loss: Loss, recovery: Recovery, epochs: Epochs) -> Estimate:
    """Estimate every epoch from the whole series.

    Parameters
    ----------
    motion, loss, recovery, epochs
        As for the filter. Weights and jumps that ``epochs`` fixes beforehand stay.

    Returns
    -------
    Estimate
        ``distance`` and ``standardised`` are deleted residuals; ``since`` marks the jumps.
    """
    if not len(epochs.time) or loss.code == 0:
        _, first, _ = filter_track(motion, loss, recovery, epochs, start(motion, recovery))
        smoothed = smooth(motion, recovery, epochs.time, first)
        return _judged(motion, loss, epochs, first, smoothed)
    decided = _doubted(motion, loss, recovery, epochs)
    for _ in range(_SWEEPS):
        found, jump = _swept(motion, loss, recovery, epochs, decided)
        if not np.array_equal(jump, decided.jump):
            decided = decided._replace(jump=jump)
            continue
        fixed = _reweighted(motion, loss, epochs, decided, found)
        change = np.nanmax(np.abs(fixed - decided.fixed), initial=0.0)
        if change < _STILL:
            break
        decided = decided._replace(fixed=fixed)
    return found


def _doubted(motion: Motion, loss: Loss, recovery: Recovery, epochs: Epochs) -> Epochs:
    """Leave out what either direction doubts."""
    fixed, jump = _decided(motion, loss, recovery, epochs)
    against, back = _decided(motion, loss, recovery, backward(motion, epochs))
    jump |= _only_backward(motion, epochs, jump, back[::-1], recovery.after)
    doubted = np.fmin(fixed, against[::-1])
    doubted[doubted < _DOUBT] = 0.0
    for g in range(motion.groups):
        _drop_short(g, doubted, jump, np.isfinite(epochs.fixed))
    return epochs._replace(fixed=doubted, jump=jump)


def _decided(
    motion: Motion, loss: Loss, recovery: Recovery, epochs: Epochs
) -> tuple[FloatArray, IntArray]:
    """Weights and jumps that one direction decides on; its states are not kept."""
    _, found, _ = filter_track(motion, loss, recovery, epochs, start(motion, recovery))
    return _dated_back(epochs, found)


def _swept(
    motion: Motion, loss: Loss, recovery: Recovery, epochs: Epochs, decided: Epochs
) -> tuple[Estimate, IntArray]:
    """Filter and smooth as decided: the estimate, and the jumps that are still needed."""
    _, filtered, _ = filter_track(motion, loss, recovery, decided, start(motion, recovery))
    smoothed = smooth(motion, recovery, epochs.time, filtered)
    found = _judged(motion, loss, epochs, filtered, smoothed)
    return found, needed_jumps(motion, epochs, decided.jump, smoothed)


def backward(motion: Motion, epochs: Epochs) -> Epochs:
    """Give the series as one sees it who travels back in time: velocities change sign."""
    sign = np.repeat([1.0, -1.0], motion.axes)
    jump = np.zeros_like(epochs.jump)
    jump[1:] = epochs.jump[:0:-1]
    parts = (
        -epochs.time[::-1],
        epochs.z[::-1] * sign,
        epochs.variance[::-1],
        epochs.fixed[::-1],
        jump,
        epochs.sensor[::-1],
    )
    return Epochs(*(np.ascontiguousarray(part) for part in parts))


def _only_backward(
    motion: Motion, epochs: Epochs, jump: IntArray, back: IntArray, apart: float
) -> IntArray:
    """Jumps of the backward pass that have none of the forward pass within ``apart`` seconds.

    Each is put before the observation that follows its run in time.
    """
    more = np.zeros_like(back)
    for g in range(motion.groups):
        observed = np.isfinite(epochs.z[:, motion.group == g]).any(axis=1)
        rows = np.flatnonzero(observed)
        known = epochs.time[((jump >> g) & 1).astype(np.bool_)]
        for k in np.flatnonzero((back >> g) & 1):
            later = np.searchsorted(rows, k, side="right")
            alone = not len(known) or np.min(np.abs(known - epochs.time[k])) > apart
            if alone and later < len(rows):
                more[rows[later]] |= 1 << g
    return more


def _judged(
    motion: Motion, loss: Loss, epochs: Epochs, filtered: Filtered, smoothed: Smoothed
) -> Estimate:
    """Smoothed estimate with deleted residuals in the place of innovations."""
    nis, standardised = leave_one_out(motion, epochs.z, epochs.variance, filtered.weight, smoothed)
    distance = np.sqrt(nis)
    for g in range(motion.groups):
        distance[:, g] /= _scale(motion, loss, g)
    since = np.where(_bits(filtered.jump, motion.groups), epochs.time[:, None], np.nan)
    decided = from_filtered(filtered)._replace(
        distance=distance, standardised=standardised, since=since
    )
    return from_smoothed(smoothed, decided)


def _scale(motion: Motion, loss: Loss, g: int) -> float:
    size = int((motion.group == g).sum())
    return {1: 1.0, 2: loss.scale2, 3: loss.scale3}[size]


def _bits(mask: IntArray, groups: int) -> BoolArray:
    return ((mask[:, None] >> np.arange(groups)) & 1).astype(np.bool_)


def _dated_back(epochs: Epochs, first: Filtered) -> tuple[FloatArray, IntArray]:
    """Turn each recovery of the filter into a jump at the start of the run it believed."""
    fixed = np.where(np.isnan(epochs.fixed), first.weight, epochs.fixed)
    jump = epochs.jump.copy()
    user = np.isfinite(epochs.fixed)
    for k, g in zip(*np.nonzero(np.isfinite(first.since)), strict=True):
        run = slice(int(np.searchsorted(epochs.time, first.since[k, g])), k + 1)
        jump[run.start] |= 1 << g
        believed = np.isfinite(first.weight[run, g]) & ~user[run, g]
        fixed[run, g][believed] = 1.0
    return fixed, jump


def _drop_short(g: int, fixed: FloatArray, jump: IntArray, user: BoolArray) -> None:
    """Reject stretches between jumps that hold too few observations, and join their sides."""
    cuts = [0, *np.flatnonzero((jump >> g) & 1).tolist(), len(jump)]
    for begin, end in itertools.pairwise(cuts):
        used = fixed[begin:end, g] > 0.5
        if len(cuts) > 2 and used.sum() < _SHORT:
            fixed[begin:end, g][used & ~user[begin:end, g]] = 0.0
            at = end if end < len(jump) else begin
            jump[at] &= ~(1 << g)


def _reweighted(
    motion: Motion, loss: Loss, epochs: Epochs, decided: Epochs, found: Estimate
) -> FloatArray:
    """Weights of the deleted residuals; an observation that stands alone keeps its own."""
    fixed = decided.fixed.copy()
    for g in range(motion.groups):
        size = np.isfinite(epochs.z[:, motion.group == g]).sum(axis=1)
        nis = (found.distance[:, g] * _scale(motion, loss, g)) ** 2
        if loss.by_noise:
            nis = _over_noise(motion, epochs, found, g)
        for m in np.unique(size[size > 0]):
            rows = (size == m) & np.isnan(epochs.fixed[:, g])
            judged = weights(nis[rows], int(m), loss)
            fixed[rows, g] = np.where(np.isnan(judged), fixed[rows, g], judged)
    return fixed


def _over_noise(motion: Motion, epochs: Epochs, found: Estimate, c: int) -> FloatArray:
    """Squared residuals of one component from the smoothed track, over its noise variance.

    Weights of these lead to the minimum of the squares of prediction and Huber's ρ of observation.
    """
    off = epochs.z[:, c] - found.mean[:, c]
    if motion.period > 0.0 and c == 0:
        off -= motion.period * np.rint(off / motion.period)
    return np.asarray(off**2 / epochs.variance[:, c])


def needed_jumps(motion: Motion, epochs: Epochs, jump: IntArray, smoothed: Smoothed) -> IntArray:
    """The jumps across which the smoothed track does not agree with itself."""
    needed = jump.copy()
    for k in np.flatnonzero(jump).tolist():
        if k == 0:
            needed[k] = epochs.jump[k]
            continue
        mean, covariance = _predicted(motion, epochs.time[k] - epochs.time[k - 1], k - 1, smoothed)
        gap = smoothed.mean[k] - mean
        spread = covariance + smoothed.covariance[k]
        for g in range(motion.groups):
            c = np.flatnonzero(motion.group == g)
            d2 = gap[c] @ np.linalg.solve(spread[np.ix_(c, c)], gap[c])
            if d2 < _SAME**2 and not (epochs.jump[k] >> g) & 1:
                needed[k] &= ~(1 << g)
    return needed


def _predicted(
    motion: Motion, dt: float, k: int, smoothed: Smoothed
) -> tuple[FloatArray, FloatArray]:
    n = motion.order * motion.axes
    F, G = np.eye(n), np.zeros((n, n))
    propagate_rows(F, motion.order, motion.axes, dt, n)
    add_noise_factor(G, motion.order, motion.axes, dt, motion.density, 0)
    return F @ smoothed.mean[k], F @ smoothed.covariance[k] @ F.T + G @ G.T
