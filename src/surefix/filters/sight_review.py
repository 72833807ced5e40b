"""Judge every sight by what all the others say of it, and cover what a Gaussian cannot."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypothesis_density import wrapped
from surefix.filters.sight_fit import POORER
from surefix.filters.sight_records import SightModel, SightPrior, Sights
from surefix.jit import helper, kernel
from surefix.models.sights import period_of, sight
from surefix.types import FloatArray

__all__ = ["add_bowl", "deleted_sights", "review_sights"]

_LOG_2PI = math.log(2.0 * math.pi)


@helper
def _variance_of(H: FloatArray, P: FloatArray) -> float:
    total = 0.0
    for a in range(len(H)):
        for b in range(len(H)):
            total += H[a] * P[a, b] * H[b]
    return max(total, 0.0)


@kernel
def _deleted(
    model: SightModel,
    sights: Sights,
    weight: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    residual: FloatArray,
    variance: FloatArray,
) -> None:
    H = np.empty(2 * model.axes)
    for k in range(residual.shape[0]):
        for c in range(residual.shape[1]):
            if math.isnan(sights.z[k, c]):
                continue
            value = sight(model.kind[c], sights.anchor[k, c], mean[k], model.axes, H)
            e = wrapped(sights.z[k, c] - value, period_of(model.kind[c]))
            V = _variance_of(H, covariance[k])
            R = sights.variance[k, c]
            gain = 1.0
            if weight[k, c] > 0.0:
                own = R / weight[k, c]
                gain = own / max(own - V, 1e-9 * own)
            residual[k, c] = e * gain
            variance[k, c] = R + V * gain


def deleted_sights(
    model: SightModel,
    sights: Sights,
    weight: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Residual of each sight from what all others say, and its variance; NaN if there is none.

    Parameters
    ----------
    model, sights, weight
        As given to the filter.
    mean, covariance
        (n, 2d) and (n, 2d, 2d) smoothed.

    Returns
    -------
    residual, variance
        (n, c) each.
    """
    residual, variance = np.full_like(sights.z, np.nan), np.full_like(sights.z, np.nan)
    _deleted(model, sights, weight, mean, covariance, residual, variance)
    return residual, variance


def review_sights(
    prior: SightPrior, sights: Sights, residual: FloatArray, variance: FloatArray
) -> FloatArray:
    """Decide anew which sights belong to the track.

    Each is judged by its deleted residual under the accounts of the filter. The states of a
    channel, right or wrong, are a Markov chain: a sight is left out where the probability that it
    is wrong, given all of its channel, is above one half.

    Parameters
    ----------
    prior, sights
        As given to the filter.
    residual, variance
        From `deleted_sights`.

    Returns
    -------
    weight
        (n, c) new decisions, 0 where there is no sight; those fixed beforehand stay.
    """
    out = np.zeros_like(residual)
    for c in range(residual.shape[1]):
        k = np.flatnonzero(np.isfinite(residual[:, c]))
        e2, S, R = residual[k, c] ** 2, variance[k, c], sights.variance[k, c]
        usual = np.log1p(-prior.poor) + _normal(e2, S)
        noisy = np.log(prior.poor) + _normal(e2, S + (POORER - 1.0) * R)
        wide = prior.spread[c] ** 2 + S
        wild = -math.log(math.pi) - 0.5 * np.log(wide) - np.log1p(e2 / wide)
        wrong = _chain(np.logaddexp(usual, noisy) - wild, prior.wrong[c], prior.again[c])
        out[k, c] = np.where(wrong > 0.5, 0.0, np.where(usual >= noisy, 1.0, 1.0 / POORER))
    return np.where(np.isnan(sights.fixed), out, sights.fixed)


def _normal(e2: FloatArray, S: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (e2 / S + np.log(S) + _LOG_2PI))


@kernel
def _chain(odds: FloatArray, wrong: float, again: float) -> FloatArray:
    """Probability that each sight of a channel is wrong; ``odds`` are logarithms, for right."""
    n = odds.shape[0]
    ahead = np.empty(n)  # probability of wrong by the sights up to here
    p = wrong / (wrong + 1.0 - again)
    for k in range(n):
        p = p * again + (1.0 - p) * wrong
        p = p / (p + (1.0 - p) * math.exp(min(odds[k], 300.0)))
        ahead[k] = p
    back = 0.5  # likelihood of the sights from the next on, of wrong against right
    out = np.empty(n)
    for k in range(n - 1, -1, -1):
        out[k] = ahead[k] * back / (ahead[k] * back + (1.0 - ahead[k]) * (1.0 - back))
        bad, good = back, (1.0 - back) * math.exp(min(odds[k], 300.0))
        bad, good = bad / (bad + good), good / (bad + good)
        of_bad = again * bad + (1.0 - again) * good
        of_good = wrong * bad + (1.0 - wrong) * good
        back = of_bad / (of_bad + of_good)
    return out


def add_bowl(mean: FloatArray, covariance: FloatArray, pole: FloatArray) -> FloatArray:
    """Covariance that covers the sphere on which a badly known direction lies.

    What is uncertain across the line of sight by M bends away from the tangent plane by
    ``ξᵀξ/2ρ``; its mean square ``((tr M)² + 2 tr M²)/4ρ²`` is added along the line of sight.

    Parameters
    ----------
    mean, covariance
        (n, 2d) and (n, 2d, 2d).
    pole
        (n, d) m, middle of the anchors; NaN where there is none.

    Returns
    -------
    covariance
        (n, 2d, 2d).
    """
    d = pole.shape[1]
    off = mean[:, :d] - pole
    square = np.maximum((off * off).sum(axis=1), 1e-9)
    u = off / np.sqrt(square)[:, None]
    across = np.eye(d) - u[:, :, None] * u[:, None, :]
    M = across @ covariance[:, :d, :d] @ across
    trace = np.einsum("kii->k", M)
    bend = (trace**2 + 2.0 * np.einsum("kij,kij->k", M, M)) / (4.0 * square)
    bend = np.where(np.isfinite(bend), np.minimum(bend, np.maximum(trace, 0.0)), 0.0)
    out = covariance.copy()
    out[:, :d, :d] += (bend[:, None, None] * u[:, :, None] * u[:, None, :]) if d > 1 else 0.0
    return np.where(np.isnan(out), covariance, out)
