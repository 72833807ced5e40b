"""Kernels that fit one hypothesis to the sights of one epoch.

The prediction of a hypothesis is Gaussian, ``ξ = root · step`` with ``step ~ N(0, I)``. All sights
taken in the epoch are fitted together by Gauss–Newton, with steps halved where they do not help, so
that none is linearised at a place which the next ones deny. What the sights tell of the hypothesis
is Laplace's evidence ``−½|step|² − ½Σ(e²/R + log 2πR) − ½ log|A|``, A the information at the
optimum; both are exact where the sights are linear.

Where a range is known well and the direction badly, what is likely is bent like a bowl about the
anchor. ξ is therefore laid on the sphere: across the line of sight it turns the direction from the
anchor, along it changes the distance. A flat Gaussian would need tangential deviations below
``√(2ρσ)`` to be honest.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypothesis_density import wrapped
from surefix.filters.sight_records import SightBank, SightModel
from surefix.jit import helper
from surefix.linalg import cholesky, solve_lower
from surefix.models.sights import RANGE, period_of, sight
from surefix.types import FloatArray

__all__ = ["POORER", "finish", "fit", "innovation", "prepare"]

POORER = 4.0
"""Factor on the variance of a poor sight."""

_ITERATIONS = 30
_ENOUGH = 1e-4  # nats that the next step would gain
_LOG_2PI = math.log(2.0 * math.pi)


@helper
def prepare(model: SightModel, bank: SightBank, i: int, z: FloatArray, anchor: FloatArray) -> None:
    """Take the predicted state of hypothesis i for the prior of an epoch; no sight is taken yet."""
    d, n = model.axes, 2 * model.axes
    for a in range(n):
        bank.base[i, a] = bank.mean[i, a]
        bank.step[i, a] = 0.0
        for b in range(n):
            bank.root[i, a, b] = bank.covariance[i, a, b]
            bank.normal[i, a, b] = 1.0 if a == b else 0.0
    if not cholesky(bank.root[i], n):
        for a in range(n):
            for b in range(n):
                bank.root[i, a, b] = bank.covariance[i, a, b]
            bank.root[i, a, a] += 1e-9 + 1e-9 * bank.covariance[i, a, a]
        cholesky(bank.root[i], n)
    for a in range(n):
        for b in range(a + 1, n):
            bank.root[i, a, b] = 0.0
    bank.evidence[i] = 0.0
    bank.used[i] = 0
    bank.poor[i] = 0
    square, spread = 0.0, 0.0
    pole = _pole(model, z, anchor)
    for a in range(d):
        square += (bank.base[i, a] - pole[a]) ** 2
        spread += bank.covariance[i, a, a]
    bank.curved[i] = d > 1 and spread < square


@helper
def _pole(model: SightModel, z: FloatArray, anchor: FloatArray) -> FloatArray:
    """Middle of the anchors of the epoch's ranges; NaN where there are none."""
    d = model.axes
    pole = np.zeros(d)
    count = 0
    for c in range(len(model.kind)):
        if model.kind[c] == RANGE and not math.isnan(z[c]):
            count += 1
            for a in range(d):
                pole[a] += anchor[c, a]
    for a in range(d):
        pole[a] = pole[a] / count if count > 0 else np.nan
    return pole


@helper
def _chart(
    bank: SightBank,
    i: int,
    d: int,
    pole: FloatArray,
    step: FloatArray,
    x: FloatArray,
    T: FloatArray,
) -> None:
    """State of a step and its derivative by ξ, (2d, 2d)."""
    n = 2 * d
    for a in range(n):
        total = 0.0
        for b in range(a + 1):
            total += bank.root[i, a, b] * step[b]
        x[a] = total
        for b in range(n):
            T[a, b] = 1.0 if a == b else 0.0
    if not bank.curved[i]:
        for a in range(n):
            x[a] += bank.base[i, a]
        return
    u, w = np.empty(d), np.empty(d)
    rho = 0.0
    for a in range(d):
        u[a] = bank.base[i, a] - pole[a]
        rho += u[a] * u[a]
    rho = math.sqrt(rho)
    along = 0.0
    for a in range(d):
        u[a] /= rho
        along += u[a] * x[a]
    length = 0.0
    for a in range(d):
        w[a] = u[a] + (x[a] - along * u[a]) / rho
        length += w[a] * w[a]
    length = math.sqrt(length)
    r = rho + along
    for a in range(d):
        w[a] /= length
    for a in range(d):
        x[a] = pole[a] + r * w[a]
        for b in range(d):
            across = (1.0 if a == b else 0.0) - u[a] * u[b]
            turn = (across - w[a] * (w[b] - _dot(w, u, d) * u[b])) / (rho * length)
            T[a, b] = w[a] * u[b] + r * turn
    for a in range(d, n):
        x[a] += bank.base[i, a]


@helper
def _dot(a: FloatArray, b: FloatArray, n: int) -> float:
    total = 0.0
    for i in range(n):
        total += a[i] * b[i]
    return total


@helper
def _seen(
    model: SightModel,
    bank: SightBank,
    i: int,
    c: int,
    anchor: FloatArray,
    x: FloatArray,
    T: FloatArray,
    H: FloatArray,
    g: FloatArray,
) -> float:
    """Value of channel c at x; its derivative by the step goes to ``g``."""
    n = 2 * model.axes
    value = sight(model.kind[c], anchor, x, model.axes, H)
    for b in range(n):
        g[b] = 0.0
    for a in range(n):
        total = 0.0
        for e in range(n):
            total += H[e] * T[e, a]
        for b in range(a + 1):
            g[b] += total * bank.root[i, a, b]
    return value


@helper
def fit(
    model: SightModel,
    bank: SightBank,
    i: int,
    z: FloatArray,
    variance: FloatArray,
    anchor: FloatArray,
    used: int,
    poor: int,
    step: FloatArray,
    normal: FloatArray,
) -> float:
    """Fit the sights of a bit mask to hypothesis i.

    Parameters
    ----------
    used, poor
        Sights to be taken, and which of them are poor.
    step, normal
        (2d,) where to begin, and where it ends; (2d, 2d) Cholesky factor of the information there.

    Returns
    -------
    evidence
        Logarithm of the likelihood of the sights.
    """
    d, n = model.axes, 2 * model.axes
    pole = _pole(model, z, anchor)
    x, H, g = np.empty(n), np.empty(n), np.empty(n)
    T = np.empty((n, n))
    old, move = np.empty(n), np.zeros(n)
    before = np.inf
    cost = 0.0
    for a in range(n):
        old[a] = step[a]
    for attempt in range(_ITERATIONS):
        _chart(bank, i, d, pole, step, x, T)
        cost = 0.0
        for a in range(n):
            cost += step[a] * step[a]
            g[a] = 0.0
        gradient = -step
        for a in range(n):
            for b in range(n):
                normal[a, b] = 1.0 if a == b else 0.0
        for c in range(len(model.kind)):
            if not (used >> c) & 1:
                continue
            R = variance[c] * (POORER if (poor >> c) & 1 else 1.0)
            e = wrapped(
                z[c] - _seen(model, bank, i, c, anchor[c], x, T, H, g), period_of(model.kind[c])
            )
            cost += e * e / R + math.log(R) + _LOG_2PI
            for a in range(n):
                gradient[a] += g[a] * e / R
                for b in range(a + 1):
                    normal[a, b] += g[a] * g[b] / R
        if cost > before + _ENOUGH and attempt < _ITERATIONS - 1:  # too far
            for a in range(n):
                move[a] *= 0.5
                step[a] = old[a] + move[a]
            continue
        before = cost
        cholesky(normal, n)
        for a in range(n):
            old[a] = step[a]
            move[a] = gradient[a]
        solve_lower(normal, move, n)
        gain = _dot(move, move, n)
        if gain < _ENOUGH:
            break
        _solve_upper(normal, move, n)
        for a in range(n):
            step[a] += move[a]
    logs = 0.0
    for a in range(n):
        logs += math.log(normal[a, a])
    return -0.5 * cost - logs


@helper
def _solve_upper(L: FloatArray, b: FloatArray, n: int) -> None:
    """Overwrite ``b`` with ``L⁻ᵀ b``."""
    for i in range(n - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, n):
            total -= L[k, i] * b[k]
        b[i] = total / L[i, i]


@helper
def innovation(
    model: SightModel, bank: SightBank, i: int, c: int, z: FloatArray, r: FloatArray, a: FloatArray
) -> tuple[float, float]:
    """Residual of channel c from what hypothesis i has taken so far, and its variance.

    Parameters
    ----------
    z, r, a
        (c,) sights and variances, (c, d) anchors.
    """
    n = 2 * model.axes
    x, H, g = np.empty(n), np.empty(n), np.empty(n)
    T = np.empty((n, n))
    _chart(bank, i, model.axes, _pole(model, z, a), bank.step[i], x, T)
    value = _seen(model, bank, i, c, a[c], x, T, H, g)
    solve_lower(bank.normal[i], g, n)
    return wrapped(z[c] - value, period_of(model.kind[c])), r[c] + _dot(g, g, n)


@helper
def finish(model: SightModel, bank: SightBank, i: int, z: FloatArray, anchor: FloatArray) -> None:
    """Write mean and covariance of hypothesis i from what it has taken in the epoch."""
    n = 2 * model.axes
    x, T = np.empty(n), np.empty((n, n))
    _chart(bank, i, model.axes, _pole(model, z, anchor), bank.step[i], x, T)
    rows = np.empty((n, n))  # of T · root · normal⁻ᵀ
    for a in range(n):
        bank.mean[i, a] = x[a]
        for b in range(n):
            total = 0.0
            for e in range(n):
                total += T[a, e] * bank.root[i, e, b]
            rows[a, b] = total
        solve_lower(bank.normal[i], rows[a], n)
    for a in range(n):
        for b in range(a + 1):
            total = _dot(rows[a], rows[b], n)
            bank.covariance[i, a, b] = total
            bank.covariance[i, b, a] = total
