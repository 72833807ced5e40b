"""Fusion of what each filter's last observation added, instead of what each filter believes.

Estimates of one state share the process noise and the start, so that no weights bring back what
the local filters have lost by smoothing each with its own few observations. What an observation
*added* is new to everybody. It can be read off a filter without the observation itself,

    Y_i = (P_i⁺)⁻¹ − (P_i⁻)⁻¹,   y_i = (P_i⁺)⁻¹ x_i⁺ − (P_i⁻)⁻¹ x_i⁻,

and the receiver adds it to its own prediction: P⁻¹ ← P⁻¹ + Σ Y_i, P⁻¹ x ← P⁻¹ x + Σ y_i. With
linear observations that is the centralised filter itself; with others it differs by where each
master linearised. Each message must be used once.

Source: Drummond, Tracklets and a hybrid fusion with process noise, Proc. SPIE 3163, 1997; the
information filter is that of any textbook.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.fusion.track import Estimate, known_sources
from surefix.types import FloatArray

__all__ = ["Tracklet", "tracklet", "use_tracklets"]


class Tracklet(NamedTuple):
    """What an observation added: information Y, (…, n, n), and the vector y, (…, n)."""

    information: FloatArray
    vector: FloatArray


def tracklet(prior: Estimate, posterior: Estimate) -> Tracklet:
    """Read what an observation added off the filter that used it.

    Parameters
    ----------
    prior, posterior
        The filter's estimate, (…, n) and (…, n, n), before and after; covariances positive
        definite. Where either is NaN nothing was added.

    >>> before = Estimate(np.zeros(1), np.array([[4.0]]))
    >>> after = Estimate(np.array([1.6]), np.array([[0.8]]))  # it was 2, of variance 1
    >>> tracklet(before, after)
    Tracklet(information=array([[1.]]), vector=array([2.]))
    """
    known = known_sources(*prior) & known_sources(*posterior)
    eye = np.eye(prior.mean.shape[-1])
    parts = []
    for estimate in (posterior, prior):
        P = np.where(known[..., None, None], estimate.covariance, eye)
        m = np.where(known[..., None], estimate.mean, 0.0)
        parts.append((np.linalg.inv(P), np.linalg.solve(P, m[..., None])[..., 0]))
    (Y, y), (before, vector) = parts
    return Tracklet(Y - before, y - vector)


def use_tracklets(prediction: Estimate, added: Tracklet) -> Estimate:
    """Add tracklets of one instant to a prediction for it.

    Parameters
    ----------
    prediction
        (…, n) and (…, n, n), positive definite.
    added
        Of N sources: (…, N, n, n) and (…, N, n).
    """
    Y = np.linalg.inv(prediction.covariance)
    y = (Y @ prediction.mean[..., None])[..., 0] + added.vector.sum(axis=-2)
    P = np.linalg.inv(Y + added.information.sum(axis=-3))
    return Estimate((P @ y[..., None])[..., 0], 0.5 * (P + P.mT))
