"""Smooth what was decided, and judge every sight by what all the others say of it.

The decided sights are linearised at the track as it is known so far; a Kalman filter and an RTS
smoother then give a better one, until it stands still: Gauss–Newton on the whole track.

Source: Bell, The iterated Kalman smoother as a Gauss–Newton method, SIAM J. Optimization 1994.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypothesis_branches import wrapped
from surefix.filters.sight_fit import POORER
from surefix.filters.sight_hypotheses import predict_sight
from surefix.filters.sight_records import SightModel, SightPrior, Sights
from surefix.jit import helper, kernel
from surefix.models.sights import expected, period_of, sight
from surefix.types import BoolArray, FloatArray

__all__ = ["add_bowl", "deleted_sights", "review_sights", "settle", "smooth_pass", "smooth_sights"]

_PI = math.pi
_LOG_2PI = math.log(2.0 * math.pi)
_STILL = 0.05  # standard deviations that the track may still move by
_ROUNDS = 30
_HALVINGS = 6
_FOLLOWS = 3  # epochs whose likelihood is that of the start


@kernel
def _filter(
    model: SightModel,
    prior: SightPrior,
    sights: Sights,
    weight: FloatArray,
    restarts: BoolArray,
    about: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
) -> float:
    """Filter with every sight linearised at ``about``; the first row holds the start."""
    d, n = model.axes, 2 * model.axes
    H, g = np.empty(n), np.empty(n)
    evidence = 0.0
    for k in range(mean.shape[0]):
        m, P = mean[k], covariance[k]
        if k > 0:
            m[:] = mean[k - 1]
            P[:] = covariance[k - 1]
            dt = sights.time[k] - sights.time[k - 1]
            predict_sight(m, P, d, dt, model.density)
            if restarts[k]:
                for a in range(d):
                    P[a, a] += prior.reach * prior.reach
                    P[d + a, d + a] += prior.speed * prior.speed
        for c in range(weight.shape[1]):
            w = weight[k, c]
            if not w > 0.0 or math.isnan(sights.z[k, c]):
                continue
            value = sight(model.kind[c], sights.anchor[k, c], about[k], d, H)
            nu = wrapped(sights.z[k, c] - value, period_of(model.kind[c]))
            for a in range(n):
                nu -= H[a] * (m[a] - about[k, a])
                g[a] = 0.0
                for b in range(n):
                    g[a] += P[a, b] * H[b]
            S = sights.variance[k, c] / w
            for a in range(n):
                S += H[a] * g[a]
            if k >= _FOLLOWS:
                evidence -= 0.5 * (nu * nu / S + math.log(S) + _LOG_2PI)
            for a in range(n):
                m[a] += g[a] / S * nu
                for b in range(n):
                    P[a, b] -= g[a] * g[b] / S
    return evidence


def smooth_pass(
    model: SightModel,
    prior: SightPrior,
    sights: Sights,
    weight: FloatArray,
    restarts: BoolArray,
    about: FloatArray,
    start: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray, float]:
    """Filter decided sights that are linearised at a given track.

    Parameters
    ----------
    model, prior, sights
        As given to the filter.
    weight
        (n, c) with which each sight is used, 0 for not.
    restarts
        (n,) epochs before which the track goes on somewhere else.
    about
        (n, 2d) the track.
    start
        Mean (2d,) and covariance (2d, 2d) at the first epoch.

    Returns
    -------
    mean, covariance, evidence
        (n, 2d), (n, 2d, 2d), and the log-likelihood of the sights after the first few epochs.
    """
    n, s = about.shape
    mean, covariance = np.empty((n, s)), np.empty((n, s, s))
    mean[0], covariance[0] = start
    evidence = _filter(model, prior, sights, weight, restarts, about, mean, covariance)
    return mean, covariance, float(evidence)


def smooth_sights(
    model: SightModel,
    prior: SightPrior,
    time: FloatArray,
    restarts: BoolArray,
    mean: FloatArray,
    covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Rauch–Tung–Striebel smoother of the full state.

    Parameters
    ----------
    model, prior, time, restarts
        As given to the filter, n epochs.
    mean, covariance
        (n, 2d) and (n, 2d, 2d) filtered; not modified.

    Returns
    -------
    mean, covariance
        Smoothed, of the same shapes.
    """
    d, s = model.axes, 2 * model.axes
    dt = np.diff(time)[:, None, None]
    F = np.eye(s) + np.where(np.eye(s, k=d) > 0.0, dt, 0.0)
    Q = np.zeros((len(dt), s, s))
    i = np.arange(d)
    Q[:, i, i] = model.density * dt[:, 0] ** 3 / 3.0
    Q[:, i, d + i] = Q[:, d + i, i] = model.density * dt[:, 0] ** 2 / 2.0
    Q[:, d + i, d + i] = model.density * dt[:, 0]
    moved = np.flatnonzero(restarts[1:])[:, None]
    Q[moved, i, i] += prior.reach**2
    Q[moved, d + i, d + i] += prior.speed**2
    ahead = F @ covariance[:-1] @ F.mT + Q
    gain = np.linalg.solve(ahead, F @ covariance[:-1]).mT
    m, P = mean.copy(), covariance.copy()
    for k in range(len(time) - 2, -1, -1):
        m[k] += gain[k] @ (m[k + 1] - F[k] @ mean[k])
        P[k] += gain[k] @ (P[k + 1] - ahead[k]) @ gain[k].T
    return m, 0.5 * (P + P.mT)


def settle(
    model: SightModel,
    prior: SightPrior,
    sights: Sights,
    weight: FloatArray,
    restarts: BoolArray,
    mean: FloatArray,
    start: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Smooth decided sights by Gauss–Newton from a first track, steps halved where they do harm.

    Parameters
    ----------
    model, prior, sights, weight, restarts, start
        As for `smooth_pass`.
    mean
        (n, 2d) the first track.

    Returns
    -------
    mean, covariance
        (n, 2d) and (n, 2d, 2d).
    """
    about, covariance = mean, np.empty(0)
    least = _cost(model, prior, sights, weight, restarts, about, start)
    for _ in range(_ROUNDS):
        m, P, _ = smooth_pass(model, prior, sights, weight, restarts, about, start)
        m, covariance = smooth_sights(model, prior, sights.time, restarts, m, P)
        sigma = np.sqrt(np.maximum(np.einsum("kii->ki", covariance), 1e-18))
        step = m - about
        if float(np.abs(step / sigma).max()) < _STILL:
            break
        for _ in range(_HALVINGS):
            cost = _cost(model, prior, sights, weight, restarts, about + step, start)
            if cost < least:
                break
            step *= 0.5
        if not cost < least:
            break
        about, least = about + step, cost
    return about, covariance


def _cost(
    model: SightModel,
    prior: SightPrior,
    sights: Sights,
    weight: FloatArray,
    restarts: BoolArray,
    track: FloatArray,
    start: tuple[FloatArray, FloatArray],
) -> float:
    """Squares that a track leaves: of the sights, of the accelerations, and of the start."""
    d = model.axes
    e = sights.z - expected(model.kind, sights.anchor, track)
    turn = np.array([period_of(kind) for kind in model.kind.tolist()])
    e -= np.where(turn > 0.0, turn * np.rint(e / np.where(turn > 0.0, turn, 1.0)), 0.0)
    seen = np.nansum(weight * e * e / sights.variance)
    dt = np.diff(sights.time)
    go = (dt > 0.0) & ~restarts[1:]
    h = dt[go, None]
    p = (track[1:, :d] - track[:-1, :d])[go] - h * track[:-1, d:][go]
    v = (track[1:, d:] - track[:-1, d:])[go]
    moved = (12.0 * p * p / h**3 - 12.0 * p * v / h**2 + 4.0 * v * v / h) / model.density
    off = track[0] - start[0]
    return float(seen + moved.sum() + off @ np.linalg.solve(start[1], off))


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
        wild = -math.log(_PI) - 0.5 * np.log(wide) - np.log1p(e2 / wide)
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
