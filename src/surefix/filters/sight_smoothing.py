"""Smooth what was decided: Gauss–Newton on the whole track.

The decided sights are linearised at the track as it is known so far; a Kalman filter and an RTS
smoother then give a better one, until it stands still.

Source: Bell, The iterated Kalman smoother as a Gauss–Newton method, SIAM J. Optimization 1994.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypothesis_density import wrapped
from surefix.filters.sight_hypotheses import predict_sight
from surefix.filters.sight_records import SightModel, SightPrior, Sights
from surefix.jit import kernel
from surefix.models.sights import expected, period_of, sight
from surefix.types import BoolArray, FloatArray

__all__ = ["settle", "smooth_pass", "smooth_sights"]

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
    predicted = (F @ mean[:-1, :, None])[..., 0]
    _back(np.ascontiguousarray(gain), ahead, predicted, m, P)
    return m, 0.5 * (P + P.mT)


@kernel
def _back(
    gain: FloatArray, ahead: FloatArray, predicted: FloatArray, m: FloatArray, P: FloatArray
) -> None:
    """Carry what comes later back to every epoch."""
    n = m.shape[1]
    half = np.empty((n, n))
    for k in range(gain.shape[0] - 1, -1, -1):
        G = gain[k]
        for a in range(n):
            for b in range(n):
                m[k, a] += G[a, b] * (m[k + 1, b] - predicted[k, b])
                half[a, b] = 0.0
                for e in range(n):
                    half[a, b] += G[a, e] * (P[k + 1, e, b] - ahead[k, e, b])
        for a in range(n):
            for b in range(n):
                for e in range(n):
                    P[k, a, b] += half[a, e] * G[b, e]


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
    least = _cost(model, sights, weight, restarts, about, start)
    for _ in range(_ROUNDS):
        m, P, _ = smooth_pass(model, prior, sights, weight, restarts, about, start)
        m, covariance = smooth_sights(model, prior, sights.time, restarts, m, P)
        sigma = np.sqrt(np.maximum(np.einsum("kii->ki", covariance), 1e-18))
        step = m - about
        if float(np.abs(step / sigma).max()) < _STILL:
            break
        for _ in range(_HALVINGS):
            cost = _cost(model, sights, weight, restarts, about + step, start)
            if cost < least:
                break
            step *= 0.5
        if not cost < least:
            break
        about, least = about + step, cost
    return about, covariance


def _cost(
    model: SightModel,
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
