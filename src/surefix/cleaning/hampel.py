"""The Hampel identifier: a sample is held against the median and the MAD of its window.

    x(k) becomes med where |x(k) − med| > n_σ · 1.4826 · MAD

(Davies and Gather, The identification of multiple outliers, JASA 88, 1993). Unlike 53H its
threshold follows the noise of the series. The window is kept in order as samples enter and leave;
the MAD is read from it exactly, from the middle outwards.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surefix.cleaning.replacement import Replaced, continued, edited
from surefix.cleaning.running_median import running_median
from surefix.errors import OptionsError
from surefix.jit import helper, kernel
from surefix.types import FloatArray

__all__ = ["MAD_TO_SIGMA", "hampel", "rolling_scale"]

MAD_TO_SIGMA = 1.482602218505602
"""Standard deviation of a normal distribution over its median absolute deviation."""


def hampel(
    x: ArrayLike,
    *,
    window: int = 11,
    n_sigma: float = 3.0,
    floor: float = 0.0,
    causal: bool = False,
    period: float = 0.0,
) -> Replaced:
    """Replace what lies further than ``n_sigma`` robust standard deviations from the median.

    Parameters
    ----------
    x
        (n,) samples in any unit; NaN is missing: it has no say and stays missing.
    window
        Samples in the window, odd, at least 3: half of the others before and half after, or, if
        ``causal``, the last ones up to the sample itself. At the ends the window holds what there
        is.
    n_sigma
        Threshold in robust standard deviations.
    floor
        Least standard deviation, in the unit of ``x``: where digits are coarse more than half of a
        window is often equal, and without a floor every other value would be replaced.
    causal
        True looks at no later sample.
    period
        One turn for angles, else 0.

    Raises
    ------
    OptionsError
        An even or a small window, or a threshold or floor that is negative.

    Examples
    --------
    >>> hampel([1.0, 1.2, 9.0, 1.1, 0.9], window=5).value.tolist()
    [1.0, 1.2, 1.1, 1.1, 0.9]
    """
    if window < 3 or window % 2 == 0:
        raise OptionsError(f"window {window}", "an odd number from 3")
    if not (n_sigma >= 0.0 and floor >= 0.0):
        raise OptionsError(f"n_sigma {n_sigma}, floor {floor}", "numbers from 0")
    raw = np.atleast_1d(np.asarray(x, dtype=np.float64))
    turned, _ = continued(raw, period)
    median, mad = _median_and_mad(turned, window, 0 if causal else window // 2)
    limit = n_sigma * np.maximum(MAD_TO_SIGMA * mad, floor)
    return edited(raw, turned, median, limit, period)


def rolling_scale(residual: ArrayLike, window: int, *, centred: bool = False) -> FloatArray:
    """Robust standard deviation of residuals about 0 over a running window: 1.4826 · med|r|.

    Parameters
    ----------
    residual
        (n,) or (n, columns) in any unit; NaN is left out.
    window, centred
        As in `surefix.cleaning.running_median.running_median`.

    Examples
    --------
    >>> rolling_scale([1.0, -1.0, 50.0, 1.0], 3).round(2).tolist()
    [1.48, 1.48, 1.48, 1.48]
    """
    size = np.abs(np.asarray(residual, dtype=np.float64))
    return MAD_TO_SIGMA * running_median(size, window, centred=centred)


@kernel
def _median_and_mad(x: FloatArray, window: int, ahead: int) -> tuple[FloatArray, FloatArray]:
    """Median and median absolute deviation of x(k + ahead − window + 1) … x(k + ahead)."""
    n = len(x)
    median, mad = np.full(n, np.nan), np.full(n, np.nan)
    ordered = np.empty(window + 1)
    count = 0
    for k in range(n + ahead):
        if k < n and not np.isnan(x[k]):
            place = count
            while place > 0 and ordered[place - 1] > x[k]:
                ordered[place] = ordered[place - 1]
                place -= 1
            ordered[place] = x[k]
            count += 1
        if k >= window and not np.isnan(x[k - window]):
            place = _place(ordered, count, x[k - window])
            for i in range(place, count - 1):
                ordered[i] = ordered[i + 1]
            count -= 1
        if k >= ahead and count > 0:
            middle = 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2])
            median[k - ahead] = middle
            mad[k - ahead] = _mad(ordered, count, middle)
    return median, mad


@helper
def _place(ordered: FloatArray, count: int, value: float) -> int:
    """How many of the first ``count`` values are smaller than one."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if ordered[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@helper
def _mad(ordered: FloatArray, count: int, middle: float) -> float:
    """Median of |ordered − middle|: the nearest values are taken from the middle outwards."""
    right = _place(ordered, count, middle)
    left = right - 1
    before = last = 0.0
    for _ in range(count // 2 + 1):
        before = last
        if left < 0 or (right < count and ordered[right] - middle <= middle - ordered[left]):
            last = ordered[right] - middle
            right += 1
        else:
            last = middle - ordered[left]
            left -= 1
    return last if count % 2 == 1 else 0.5 * (before + last)
