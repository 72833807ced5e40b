"""Fusion by information gain: the more an observation told a filter, the more its estimate counts.

With the entropy ``H = ½ ln((2πe)ⁿ |P|)`` of a Gaussian, the gain of an update is
``g = H⁻ − H⁺ = ½ ln(|P⁻| / |P⁺|)``, and the estimates are fused with ``wᵢ = gᵢ / Σ gⱼ``.

One number per source cannot say that a source is good along one axis and poor along another, and a
gain says what an observation added, not how good the estimate is: see the limits in the
documentation of paper 001.

Source: paper 001, sections 2.3 and 3, eqs 20–31.
"""

from __future__ import annotations

import numpy as np

from surefix.fusion.track import Estimate, weighted_mean
from surefix.types import FloatArray

__all__ = ["entropy", "fuse_by_gain", "gain_weights", "information_gain"]


def entropy(covariance: FloatArray) -> FloatArray:
    """Entropy of a Gaussian in nats, (…): ``½ ln((2πe)ⁿ |P|)``; −∞ where P is singular.

    Parameters
    ----------
    covariance
        (…, n, n).

    Examples
    --------
    >>> entropy(np.eye(2)).round(4).item()
    2.8379
    """
    n = covariance.shape[-1]
    return np.asarray(0.5 * (n * np.log(2.0 * np.pi * np.e) + np.linalg.slogdet(covariance)[1]))


def information_gain(prior: FloatArray, posterior: FloatArray) -> FloatArray:
    """Gain of an update in nats, (…): entropy before less entropy after.

    Parameters
    ----------
    prior, posterior
        (…, n, n) covariances before and after, positive definite.

    Examples
    --------
    >>> information_gain(4.0 * np.eye(3), np.eye(3)).round(4).item()
    2.0794
    """
    before, after = np.linalg.slogdet(prior)[1], np.linalg.slogdet(posterior)[1]
    return np.asarray(0.5 * (before - after))


def gain_weights(gain: FloatArray) -> FloatArray:
    """Weights ``wᵢ = gᵢ / Σ gⱼ`` over the last axis.

    A gain that is negative counts as none. Where no source has gained anything, those that are
    there share equally; a source whose gain is NaN is missing and has weight 0; where all are
    missing, the weights are NaN.

    Parameters
    ----------
    gain
        (…, N) nats.

    Examples
    --------
    >>> gain_weights(np.array([0.1385, 0.1764, 0.1421])).round(4).tolist()  # Table 2 of paper 001
    [0.3031, 0.386, 0.3109]
    >>> gain_weights(np.array([0.0, 0.0, np.nan])).tolist()
    [0.5, 0.5, 0.0]
    """
    known = np.isfinite(gain)
    share = np.where(known, np.maximum(gain, 0.0), 0.0)
    share = np.where(share.sum(axis=-1, keepdims=True) > 0.0, share, known)
    total = share.sum(axis=-1, keepdims=True)
    return np.asarray(share / np.where(total > 0.0, total, np.nan))


def fuse_by_gain(
    mean: FloatArray,
    posterior: FloatArray,
    gain: FloatArray,
    joint: FloatArray | None = None,
) -> tuple[Estimate, FloatArray]:
    """Fuse estimates by their information gains.

    Parameters
    ----------
    mean, posterior
        (…, N, n) and (…, N, n, n).
    gain
        (…, N) of the last update of each, from `information_gain`.
    joint
        (…, N, N, n, n) covariance of all errors; without it the covariance of the result is an
        upper bound. The paper gives none.

    Returns
    -------
    estimate, weights
        See `weighted_mean` and `gain_weights`.
    """
    weight = gain_weights(gain)
    return weighted_mean(mean, posterior, weight, joint), weight
