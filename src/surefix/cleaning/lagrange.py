"""Prediction by Lagrange interpolation from the last samples, and comparison with what came.

    x̂(t) = Σ_j x(t_j) Π_{i≠j} (t − t_i)/(t_j − t_i);   x becomes x̂ where |x − x̂| > T

One of the methods that paper 003 names before its own; it decides at once, but it needs good
samples before, and its prediction is noisier than they are: by √19 ≈ 4.4 from three samples, √69 ≈
8.3 from four.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.cleaning.replacement import Replaced, continued, edited
from surefix.errors import OptionsError
from surefix.jit import helper, kernel
from surefix.types import FloatArray

__all__ = ["lagrange"]


def lagrange(
    x: ArrayLike,
    time: ArrayLike,
    threshold: ArrayLike,
    *,
    points: int = 3,
    patience: int = 5,
    period: float = 0.0,
) -> Replaced:
    """Replace what lies too far from its prediction; no later sample is looked at.

    Parameters
    ----------
    x
        (n,) samples in any unit; NaN is missing: it is left out and stays missing.
    time
        (n,) s; a sample whose time is unknown or does not advance is kept and not built upon.
    threshold
        Scalar or (n,), in the unit of ``x``.
    points
        Samples that a prediction is made from, 1 … 6; a replaced sample counts with its
        replacement.
    patience
        Samples in sequence that may be replaced, or missing; after them the next one is believed
        and the prediction begins anew.
    period
        One turn for angles, else 0.

    Raises
    ------
    OptionsError
        ``points`` or ``patience`` out of range.

    Examples
    --------
    >>> lagrange([0.0, 1.0, 4.0, 99.0, 16.0], [0, 1, 2, 3, 4], 5.0).value.tolist()
    [0.0, 1.0, 4.0, 9.0, 16.0]
    """
    if not 1 <= points <= 6:
        raise OptionsError(f"points {points}", "1 … 6")
    if patience < 0:
        raise OptionsError(f"patience {patience}", "a whole number from 0")
    raw = np.atleast_1d(np.asarray(x, dtype=np.float64))
    t = np.atleast_1d(np.asarray(time, dtype=np.float64))
    limit = np.broadcast_to(np.asarray(threshold, dtype=np.float64), raw.shape)
    turned, _ = continued(raw, period)
    return edited(raw, turned, _predict(turned, t, limit, points, patience), limit, period)


@kernel
def _predict(
    x: FloatArray, t: FloatArray, limit: FloatArray, points: int, patience: int
) -> FloatArray:
    """Give the prediction of each sample; NaN where there is none, or it is believed again."""
    predicted = np.full(len(x), np.nan)
    at, seen = np.empty(points), np.empty(points)
    count = doubted = missing = 0
    for k in range(len(x)):
        if np.isnan(x[k]):
            missing += 1
            continue
        if np.isnan(t[k]) or (count > 0 and not t[k] > at[count - 1]):
            continue
        if missing > patience or doubted >= patience:
            count = 0
        missing = 0
        value, wild = x[k], False
        if count == points:
            predicted[k] = _extrapolate(at, seen, t[k])
            wild = abs(x[k] - predicted[k]) > limit[k]
            value = predicted[k] if wild else x[k]
            for i in range(points - 1):
                at[i], seen[i] = at[i + 1], seen[i + 1]
            count -= 1
        at[count], seen[count] = t[k], value
        count += 1
        doubted = doubted + 1 if wild else 0
    return predicted


@helper
def _extrapolate(at: FloatArray, seen: FloatArray, t: float) -> float:
    total = 0.0
    for j in range(len(at)):
        part = seen[j]
        for i in range(len(at)):
            if i != j:
                part *= (t - at[i]) / (at[j] - at[i])
        total += part
    return total
