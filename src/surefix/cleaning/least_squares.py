"""Sliding least squares: a polynomial through a window of samples, read off at the sample.

These are the smoothers that paper 003 compares with. They are linear, so a wild sample is spread
over its neighbours, smaller but never gone. With equal weights they are the filter of Savitzky and
Golay (Analytical Chemistry 36, 1964); the *five-point cubic* is the one of degree 3 over five
samples, (−3, 12, 17, 12, −3)/35 inside the series. The paper gives no window for its weighted form;
here the weights fall off from the middle as (1 − |u|³)³ (Cleveland, JASA 74, 1979).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.cleaning.replacement import Replaced, continued, smoothed
from surefix.errors import OptionsError
from surefix.jit import helper, kernel
from surefix.linalg import cholesky, solve_lower
from surefix.types import FloatArray

__all__ = ["five_point_cubic", "sliding_least_squares"]


def sliding_least_squares(
    x: ArrayLike,
    *,
    window: int = 11,
    degree: int = 2,
    weighted: bool = True,
    period: float = 0.0,
) -> Replaced:
    """Smooth a series by a weighted polynomial in a window that slides along.

    Parameters
    ----------
    x
        (n,) samples in any unit, evenly spaced; NaN is missing: it has no say and stays missing.
        Where a window holds too few samples the degree is lowered.
    window
        Samples in the window, odd. At the ends the first, or last, whole window is used.
    degree
        0 … 3, below ``window``.
    weighted
        Weights (1 − |u|³)³ over the window, u = ±1 just beyond its ends; otherwise all alike.
    period
        One turn for angles, else 0.

    Raises
    ------
    OptionsError
        A window that is even, or a degree that is out of range.
    """
    if window < 1 or window % 2 == 0:
        raise OptionsError(f"window {window}", "an odd number from 1")
    if not 0 <= degree <= min(3, window - 1):
        raise OptionsError(f"degree {degree}", "0 … 3, below the window")
    raw = np.atleast_1d(np.asarray(x, dtype=np.float64))
    turned, _ = continued(raw, period)
    half = window // 2
    u = np.arange(-half, half + 1) / (half + 1)
    weight = (1.0 - np.abs(u) ** 3) ** 3 if weighted else np.ones(window)
    return smoothed(raw, _fit(turned, weight, degree), period)


def five_point_cubic(x: ArrayLike, *, period: float = 0.0) -> Replaced:
    """Smooth by a cubic through five samples; arguments as for `sliding_least_squares`.

    >>> five_point_cubic([0.0, 0.0, 35.0, 0.0, 0.0]).value.round(9).tolist()
    [-3.0, 12.0, 17.0, 12.0, -3.0]
    """
    return sliding_least_squares(x, window=5, degree=3, weighted=False, period=period)


@kernel
def _fit(x: FloatArray, weight: FloatArray, degree: int) -> FloatArray:
    """Fit each window by its normal equations, in the basis (j − k)/half about the sample k."""
    n, window = len(x), len(weight)
    half = window // 2
    scale = 1.0 / max(half, 1)
    estimate = np.full(n, np.nan)
    A, b, powers = np.empty((4, 4)), np.empty(4), np.empty(4)
    for k in range(n):
        if np.isnan(x[k]):
            continue
        first = min(max(k - half, 0), max(n - window, 0))
        last = min(first + window, n)
        size = 0
        for j in range(first, last):
            size += not np.isnan(x[j])
        order = min(degree + 1, size)
        A[:] = 0.0
        b[:] = 0.0
        for j in range(first, last):
            if np.isnan(x[j]):
                continue
            powers[0] = 1.0
            for p in range(1, order):
                powers[p] = powers[p - 1] * (j - k) * scale
            w = weight[j - first]
            for p in range(order):
                b[p] += w * powers[p] * (x[j] - x[k])
                for q in range(p + 1):
                    A[p, q] += w * powers[p] * powers[q]
        estimate[k] = x[k] + _constant(A, b, order)
    return estimate


@helper
def _constant(A: FloatArray, b: FloatArray, order: int) -> float:
    """First component of the solution of ``A c = b``; 0 where A is not positive."""
    if not cholesky(A, order):
        return 0.0
    solve_lower(A, b, order)
    for p in range(order - 1, -1, -1):
        for q in range(p + 1, order):
            b[p] -= A[q, p] * b[q]
        b[p] /= A[p, p]
    return float(b[0])
