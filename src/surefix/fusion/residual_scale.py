"""Weighted fusion of filtered series by the scales of their residuals.

Sources s of one quantity, each with the robust scale σ_s of its own filter's residuals (paper 004,
eqs 1–5 and 12):

    W_s = σ_s⁻² / Σ σ_j⁻²,   x̂ = Σ W_s x̂_s,   σ²_min = 1 / Σ σ_j⁻².

The weights are optimal where σ_s² is proportional to the error variance of source s and the errors
are independent: they are, for equal filters on independent noise, where no source is biased. σ²_min
is then the variance of the *measurements* so weighted, not that of the estimate, which is smaller
by what the filters smooth. `noise_gain` says how much that is on a straight line.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.filters.median_step import FORMS, MedianRecursion
from surefix.types import FloatArray

__all__ = ["Fused", "fuse_by_scale", "noise_gain"]


class Fused(NamedTuple):
    """What the fusion gives.

    Parameters
    ----------
    estimate
        (…) x̂; NaN where no source is known.
    variance
        (…) σ²_min = 1/Σ σ⁻².
    weight
        (s, …) W; 0 for a source that is not known.
    """

    estimate: FloatArray
    variance: FloatArray
    weight: FloatArray


def fuse_by_scale(estimates: ArrayLike, scales: ArrayLike) -> Fused:
    """Fuse s sources, component by component.

    Parameters
    ----------
    estimates
        (s, …) in any unit; NaN is missing.
    scales
        (s, …) σ of each, in the same unit. A scale that is NaN, infinite or not positive says
        nothing: its source has no say.

    Examples
    --------
    >>> fused = fuse_by_scale([1.0, 4.0], [1.0, 2.0])
    >>> round(float(fused.estimate), 3), round(float(fused.variance), 3), fused.weight.tolist()
    (1.6, 0.8, [0.8, 0.2])
    """
    x, sigma = np.asarray(estimates, dtype=np.float64), np.asarray(scales, dtype=np.float64)
    known = np.isfinite(x) & np.isfinite(sigma) & (sigma > 0.0)
    information = np.where(known, np.where(known, sigma, 1.0) ** -2.0, 0.0)
    total = information.sum(axis=0)
    variance = 1.0 / np.where(total > 0.0, total, np.nan)
    weight = information * np.where(total > 0.0, variance, 0.0)
    estimate = np.sum(weight * np.where(known, x, 0.0), axis=0)
    return Fused(np.asarray(np.where(total > 0.0, estimate, np.nan)), np.asarray(variance), weight)


def noise_gain(options: MedianRecursion) -> tuple[float, float]:
    """Variances of the recursion's error and of its residual, for white noise of variance 1.

    On a straight line, no sample rejected. The median of differences is taken for their mean plus
    an independent error that makes its variance π/2 times as large; the response of the recursion
    to one unit sample gives the rest. Right to 4 % for gains from 0.1. The forms with short
    differences and with repeated medians are not linear enough for it.

    Parameters
    ----------
    options
        Of the form ``feedback`` and constant velocity.

    Returns
    -------
    error, residual
        Var(x̂ − x) and Var(y − ŷ); s² · error/residual is the variance of the estimate.

    Raises
    ------
    OptionsError
        Another form, or constant acceleration.

    Examples
    --------
    >>> from surefix.filters.median_recursion import median_recursion
    >>> error, residual = noise_gain(median_recursion(gain=0.1))
    >>> round(error, 2), round(residual, 2)
    (0.08, 1.09)
    """
    if FORMS[options.form] != "feedback" or options.order != 2:
        raise OptionsError(f"form {FORMS[options.form]!r}, order {options.order}", "feedback, cv")
    m, h, K = options.window, options.lag, options.gain
    pairs = m - h
    length = 2 * m + math.ceil(30.0 / K)
    rate = np.zeros(length)  # response of the mean difference, known one sample later
    rate[1 : pairs + 1] += 1.0 / (pairs * h)
    rate[h + 1 : h + pairs + 1] -= 1.0 / (pairs * h)
    direct, through_rate, error, ahead = 0.0, 0.0, 0.0, 0.0
    more = 0.5 * math.pi - 1.0
    for k in range(length):
        through_rate += rate[k]
        ahead += (direct + through_rate) ** 2 + more * through_rate**2
        direct = (1.0 - K) * direct + (K if k == 0 else 0.0)
        through_rate *= 1.0 - K
        error += (direct + through_rate) ** 2 + more * through_rate**2
    return float(error), float(1.0 + ahead)
