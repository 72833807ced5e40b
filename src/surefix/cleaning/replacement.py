"""What a cleaner of a series gives, and how it treats angles: shared by all of them.

A cleaner makes an *estimate* of each sample from its neighbours. An *editor* (53H, Hampel,
Lagrange) keeps the samples that lie near their estimate, bit for bit, and puts the estimate in the
place of the others; a *smoother* (least squares) puts it in the place of all. A missing sample
stays missing: no cleaner invents one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.jit import kernel
from surefix.robust.repeated_median import first_median
from surefix.types import BoolArray, FloatArray

__all__ = ["RECENT", "Replaced", "continued", "edited", "reduced", "smoothed"]

RECENT = 5
"""Samples whose median an angle is continued from: two wild ones on end do not turn it."""


class Replaced(NamedTuple):
    """A cleaned series.

    Parameters
    ----------
    value
        (n,) the cleaned samples; NaN where the sample is missing.
    estimate
        (n,) what each sample was held against; NaN where there was nothing to hold it against.
    replaced
        (n,) whether the estimate took the place of the sample.
    """

    value: FloatArray
    estimate: FloatArray
    replaced: BoolArray


def edited(
    x: FloatArray, turned: FloatArray, estimate: FloatArray, threshold: ArrayLike, period: float
) -> Replaced:
    """Put the estimate in the place of each sample that is further than the threshold from it.

    Parameters
    ----------
    x
        (n,) the samples as measured.
    turned
        (n,) the samples, continued across the seam if they are angles.
    estimate
        (n,) beside ``turned``; where it is NaN the sample is kept.
    threshold
        Scalar or (n,), in the unit of ``x``; a sample whose threshold is NaN is kept.
    period
        One turn for angles, else 0.
    """
    with np.errstate(invalid="ignore"):
        replaced = np.abs(turned - estimate) > threshold
    shown = reduced(estimate, period)
    return Replaced(np.where(replaced, shown, _finite(x)), shown, replaced)


def smoothed(x: FloatArray, estimate: FloatArray, period: float) -> Replaced:
    """Put the estimate in the place of every sample; arguments as for `edited`."""
    known = np.isfinite(x) & np.isfinite(estimate)
    shown = reduced(estimate, period)
    return Replaced(np.where(known, shown, _finite(x)), shown, known)


def reduced(x: FloatArray, period: float) -> FloatArray:
    """Angles within one turn from 0; with ``period`` 0 the values as they are."""
    return np.mod(x, period) if period > 0.0 else x


def continued(
    x: FloatArray, period: float, recent: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Continue angles across the seam: whole turns are added, after a median of those before.

    A wild sample does not turn those that follow it, as it would if each were laid beside its
    predecessor. What is not finite becomes NaN.

    Parameters
    ----------
    x
        (n,) in the unit of ``period``.
    period
        One turn for angles, else 0.
    recent
        (RECENT,) from the part before; None begins.

    Returns
    -------
    turned
        (n,) the samples plus whole turns.
    recent
        For the next part.

    Examples
    --------
    >>> continued(np.array([350.0, 359.0, 180.0, 8.0, 10.0]), 360.0)[0].tolist()
    [350.0, 359.0, 180.0, 368.0, 370.0]
    """
    before = np.full(RECENT, np.nan) if recent is None else recent
    clean = _finite(x)
    if period <= 0.0:
        return clean, before
    after = before.copy()
    return _continue(clean, period, after), after


def _finite(x: FloatArray) -> FloatArray:
    return np.where(np.isfinite(x), x, np.nan)


@kernel
def _continue(x: FloatArray, period: float, recent: FloatArray) -> FloatArray:
    """Lay each angle within half a turn of the median of ``recent``, which is kept up to date."""
    turned, known = np.full(len(x), np.nan), np.empty(RECENT)
    for k in range(len(x)):
        if np.isnan(x[k]):
            continue
        turned[k] = x[k]
        count = 0
        for value in recent:
            if not np.isnan(value):
                known[count] = value
                count += 1
        if count > 0:
            reference = first_median(known, count)
            turned[k] -= period * np.floor((x[k] - reference) / period + 0.5)
        for i in range(RECENT - 1):
            recent[i] = recent[i + 1]
        recent[RECENT - 1] = turned[k]
    return turned
