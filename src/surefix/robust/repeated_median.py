"""A straight line through equally spaced samples that half of them may spoil.

Siegel's repeated median: the slope is the median over i of the median over j of the slopes between
samples i and j, and the level is the median of what is left. Its breakdown point is one half, the
highest there is, at a cost of O(n²).

Source: Siegel 1982, *Robust regression using repeated medians*, Biometrika 69, 242–244.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.jit import helper, kernel
from surefix.types import FloatArray

__all__ = ["first_median", "fit_line", "repeated_median"]


def repeated_median(values: ArrayLike) -> tuple[float, float]:
    """Level at the last sample, and slope per sample, of a line through a series.

    Parameters
    ----------
    values
        (n,) at equal steps, in any unit; NaN is missing.

    Returns
    -------
    level, slope
        In the unit of the values; NaN where all are missing, and slope 0 of a single sample.

    Examples
    --------
    >>> repeated_median([0.0, 1.0, 2.0, 90.0, -70.0, 5.0, 6.0])
    (6.0, 1.0)
    """
    level, slope = fit_line(np.asarray(values, dtype=np.float64).reshape(-1))
    return float(level), float(slope)


@kernel
def fit_line(values: FloatArray) -> tuple[float, float]:
    """Kernel of `repeated_median`."""
    n = len(values)
    at = np.empty(n, np.int64)
    known = np.empty(n)
    m = 0
    for k in range(n):
        if not np.isnan(values[k]):
            at[m] = k - n + 1
            known[m] = values[k]
            m += 1
    if m == 0:
        return np.nan, np.nan
    slope = 0.0
    if m > 1:
        inner = np.empty(m)
        slopes = np.empty(m - 1)
        apart = np.arange(1.0 - n, n)
        apart[n - 1] = 1.0
        inverse = 1.0 / apart
        for i in range(m):
            for j in range(m):
                if j != i:
                    rise = known[j] - known[i]
                    slopes[j if j < i else j - 1] = rise * inverse[at[j] - at[i] + n - 1]
            inner[i] = first_median(slopes, m - 1)
        slope = first_median(inner, m)
    for i in range(m):
        known[i] -= slope * at[i]
    return first_median(known, m), slope


@helper
def first_median(values: FloatArray, n: int) -> float:
    """Median of the first n ≥ 1 values, which change their order (Hoare's quickselect)."""
    upper = _select(values, n, n // 2)
    if n % 2 == 1:
        return upper
    lower = values[0]
    for i in range(1, n // 2):
        lower = max(lower, values[i])
    return 0.5 * float(lower) + 0.5 * upper


@helper
def _select(values: FloatArray, n: int, rank: int) -> float:
    """Bring the value of one rank to its place, smaller ones before it and larger ones behind."""
    low, high = 0, n - 1
    while low < high:
        pivot = values[rank]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if j < rank:
            low = i
        if rank < i:
            high = j
    return float(values[rank])
