"""Is a track right, and is its uncertainty honest? Figures for tests, benchmarks and documents.

Errors are estimate minus truth. With the covariance P an estimator claims, the normalised error
squared (NEES) e'P⁻¹e has the mean d if the claim is honest; averaged over independent runs it lies
within χ² bounds (Bar-Shalom, Li & Kirubarajan 2001, *Estimation with Applications to Tracking and
Navigation*, section 5.4). The same holds for innovations and their covariance S (the NIS).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.types import BoolArray, FloatArray

__all__ = ["Rates", "mean_bounds", "normalised_squares", "rejection_rates", "rmse"]


class Rates(NamedTuple):
    """How well gross errors were told from good fixes.

    Parameters
    ----------
    detected
        Share of the gross errors that were rejected; NaN if there were none.
    false_alarms
        Share of the good fixes that were rejected; NaN if there were none.
    """

    detected: float
    false_alarms: float


def rmse(error: FloatArray) -> FloatArray:
    """Root mean square of each axis, over the rows where it is known; NaN where none is.

    Parameters
    ----------
    error
        (n, d) in any unit; NaN is left out.

    Returns
    -------
    rmse
        (d,) in the unit of the errors.

    Examples
    --------
    >>> rmse(np.array([[3.0, 1.0], [-4.0, np.nan], [0.0, 1.0]])).round(3).tolist()
    [2.887, 1.0]
    """
    known = ~np.isnan(error)
    total = np.sum(np.where(known, error, 0.0) ** 2, axis=0)
    count = known.sum(axis=0)
    return np.asarray(np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan)))


def normalised_squares(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """NEES of estimates, or NIS of innovations: e'P⁻¹e of each row.

    Parameters
    ----------
    error
        (…, d).
    covariance
        (…, d, d), positive definite.

    Returns
    -------
    squares
        (…,) with mean d where the covariance is honest.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance is singular.
    """
    solved = np.linalg.solve(covariance, error[..., None])[..., 0]
    return np.asarray(np.sum(error * solved, axis=-1))


def mean_bounds(degrees: int, runs: int, level: float = 0.95) -> tuple[float, float]:
    """Interval in which the mean of independent NEES or NIS lies with the probability `level`.

    Parameters
    ----------
    degrees
        Degrees of freedom d of each.
    runs
        Number of independent ones averaged; samples along one run are not independent.
    level
        Probability, 0 … 1.

    Examples
    --------
    >>> [round(bound, 2) for bound in mean_bounds(4, 50)]
    [3.25, 4.82]
    """
    from scipy.stats import chi2

    low, high = chi2.interval(level, degrees * runs)
    return float(low) / runs, float(high) / runs


def rejection_rates(rejected: BoolArray, gross: BoolArray) -> Rates:
    """Compare the rejected fixes with those known to be gross errors.

    Parameters
    ----------
    rejected, gross
        (n,).

    Examples
    --------
    >>> rejection_rates(np.array([True, True, False, False]), np.array([True, False, False, False]))
    Rates(detected=1.0, false_alarms=0.3333333333333333)
    """
    return Rates(_share(rejected[gross]), _share(rejected[~gross]))


def _share(flags: BoolArray) -> float:
    return float(flags.mean()) if flags.size else float("nan")
