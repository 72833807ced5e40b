"""Graduated non-convexity on a whole track, for comparison offline."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.special import chdtri

from surefix.filters.modes import from_filtered, from_smoothed
from surefix.filters.records import Epochs, Estimate, Motion, Recovery
from surefix.filters.rts import smooth
from surefix.filters.track import filter_track, start
from surefix.robust.loss import loss_named
from surefix.types import FloatArray

__all__ = ["gnc", "truncated_weights"]

_TAIL: Final = 0.0027  # probability that a good observation is farther off than the truncation
_GROWTH: Final = 1.4  # of the convexity from one sweep to the next, as in the paper
_SWEEPS: Final = 200


def gnc(
    motion: Motion, recovery: Recovery, epochs: Epochs, state: object
) -> tuple[object, Estimate]:
    """Smooth a whole track under truncated least squares, by graduated non-convexity.

    Minimises ``Σ min(r_g², c²) + Σ |x_k − F x_{k−1}|²_{Q⁻¹}`` over the track, where ``r_g²`` is the
    squared distance of a group of components (both horizontal axes of a fix, say) from the track in
    standard deviations of their noise, and c² the quantile of χ² that one good group in 370 passes.
    All observations have weight 1 at first, and the loss is nearly convex; from sweep to sweep it
    comes nearer to the truncated one, until every weight is 0 or 1.

    Source: Yang, Antonante, Tzoumas and Carlone, IEEE Robotics and Automation Letters 5(2), 2020,
    eqs 12–14 and remark 5.

    Parameters
    ----------
    motion, recovery, epochs, state
        Of `surefix.pipelines.clean.Estimator`; the whole series in one call.
    """
    n = len(epochs.time)
    weight = np.ones((n, motion.groups))
    limit = _limits(motion, epochs)
    convexity = np.nan
    for _ in range(_SWEEPS):
        decided = epochs._replace(fixed=weight)
        begin = start(motion, recovery)
        _, filtered, _ = filter_track(motion, loss_named("kalman"), recovery, decided, begin)
        smoothed = smooth(motion, recovery, epochs.time, filtered)
        ratio = _squares(motion, epochs, smoothed.mean) / limit
        if np.isnan(convexity):
            farthest = float(np.max(ratio, initial=0.0, where=np.isfinite(ratio)))
            if farthest <= 1.0:
                break
            convexity = 1.0 / (2.0 * farthest - 1.0)
        else:
            convexity *= _GROWTH
        after = truncated_weights(ratio, convexity)
        binary = ((after == 0.0) | (after == 1.0)).all()
        if binary and (after == weight).all():
            break
        weight = after
    return state, from_smoothed(smoothed, from_filtered(filtered))


def truncated_weights(ratio: FloatArray, convexity: float) -> FloatArray:
    """Weights of truncated least squares made convex to a degree.

    ``w = 1`` where ``r² ≤ μ/(μ+1) c²``, 0 where ``r² ≥ (μ+1)/μ c²``, between them
    ``c/r √(μ(μ+1)) − μ``.

    Parameters
    ----------
    ratio
        r²/c² of each group; NaN where it was not observed gives 1.
    convexity
        μ > 0: small is nearly convex, infinity truncates.

    >>> truncated_weights(np.array([0.1, 1.0, 9.0]), 1.0).round(3)
    array([1.   , 0.414, 0.   ])
    """
    known = np.nan_to_num(ratio, nan=0.0, posinf=np.inf)
    low, high = convexity / (convexity + 1.0), (convexity + 1.0) / convexity
    between = np.sqrt(convexity * (convexity + 1.0) / np.clip(known, low, high)) - convexity
    return np.asarray(np.where(known <= low, 1.0, np.where(known >= high, 0.0, between)))


def _limits(motion: Motion, epochs: Epochs) -> FloatArray:
    """(n, groups) c²: the quantile of χ² with as many degrees as components were observed."""
    seen = np.isfinite(epochs.z)
    count = np.stack([seen[:, motion.group == g].sum(axis=1) for g in range(motion.groups)], axis=1)
    return np.asarray(chdtri(np.maximum(count, 1), _TAIL))


def _squares(motion: Motion, epochs: Epochs, mean: FloatArray) -> FloatArray:
    """(n, groups) r² from the track; NaN where nothing was observed."""
    off = (epochs.z - mean[:, : epochs.z.shape[1]]) ** 2 / epochs.variance
    out = np.full((len(off), motion.groups), np.nan)
    for g in range(motion.groups):
        mine = off[:, motion.group == g]
        seen = np.isfinite(mine).any(axis=1)
        out[seen, g] = np.nansum(mine[seen], axis=1)
    return out
