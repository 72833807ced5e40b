"""Robust Kalman update by M-estimation (Cipra and Romera): Huber's ρ in place of squares.

The update that minimises ``Σ ρ₁(ε_i) + Σ ρ₂(η_j)`` with the whitened residuals
``ε = P^{-1/2}(x − x⁻)`` of the prediction and ``η = R^{-1/2}(z − H x)`` of the observation
(paper 002, eq. 15). With the weights ``w = ψ(r)/r`` held, the solution is a Kalman update with
``P̄ = P^{1/2} W₁⁻¹ P^{1/2}`` and ``R̄ = R^{1/2} W₂⁻¹ R^{1/2}`` (eqs 19).

**As printed** (``sweeps=1``) the weights are those at the prediction. There ε is 0, so W₁ is the
identity, and what is left is a Kalman update with R/w. **Iterated**, the weights are taken anew at
each estimate until it no longer moves; the minimum of eq. 15 is reached and W₁ counts. No damping
is needed: every loss here has a weight that does not grow with the residual, hence a ρ that is
concave in the square of the residual, and each sweep minimises a quadratic that touches the
objective from above. The objective cannot rise (Huber and Ronchetti, Robust Statistics, 2009, 7.8).

The root of P is its Cholesky factor (eq. 19 does not say which): unlike the symmetric root it does
not depend on the units. ε_i is then the error of state i given the states before it. At one sweep
all roots give the same.

Source: Cipra and Romera, Kybernetika 27, 1991; paper 002, eqs 10–19.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.filters.kalman import Gaussian, gaussian
from surefix.jit import helper, kernel
from surefix.linalg import absorb, cholesky, multiply, triangularize
from surefix.robust.loss import Loss, LossCode, loss_named, weight
from surefix.types import FloatArray

__all__ = ["Weighing", "check_losses", "m_step", "m_update"]

_KEEPING = (LossCode.NONE, LossCode.HUBER, LossCode.STUDENT_T)
_STANDARDS = ("noise", "innovation")


class Weighing(NamedTuple):
    """What an M-estimation update saw and decided.

    Parameters
    ----------
    residual
        (m,) ``z − H x⁻``; NaN where not observed.
    weight
        (m,) diagonal of W₂, one per whitened component; NaN where not observed.
    state_weight
        (n,) diagonal of W₁.
    sweeps
        How often the weights were taken; 0 if nothing was observed.
    change
        Largest move of a whitened state in the last sweep; converged if ≤ the tolerance.
    """

    residual: FloatArray
    weight: FloatArray
    state_weight: FloatArray
    sweeps: int
    change: float


def m_update(
    x: Gaussian,
    z: ArrayLike,
    H: ArrayLike,
    R: ArrayLike,
    loss: Loss,
    *,
    state_loss: Loss | None = None,
    standardise: Literal["noise", "innovation"] = "noise",
    sweeps: int = 1,
    tolerance: float = 1e-9,
) -> tuple[Gaussian, Weighing]:
    """Update with ``z = H x + v``, v of covariance R, by M-estimation.

    The covariance returned is that of eq. 19e, ``(I − K H) P̄ = (P̄⁻¹ + Hᵀ R̄⁻¹ H)⁻¹`` with the last
    weights: the inverse of the curvature of the quadratic that touches the objective at the
    estimate. It is symmetric and positive semi-definite by construction.

    Parameters
    ----------
    x
        Predicted state of size n.
    z
        (m,) observation; a component that is not finite is missing.
    H, R
        (m, n) and (m, m).
    loss
        ρ₂ of the observation, from `surefix.robust.loss.loss_named`.
    state_loss
        ρ₁ of the prediction: kalman (the default, W₁ = I), huber or student-t. Losses that
        reject would discard the prediction and are refused.
    standardise
        ``noise``: residuals over R^{1/2}, as printed. ``innovation``: whitened residuals over the
        roots of their variances, prediction included, so that a vague prediction does not make
        good observations look bad; at the prediction only, so with one sweep. For a diagonal R
        this is `surefix.filters.kalman.update`.
    sweeps
        1 as printed; more is the cap of the iteration.
    tolerance
        The iteration ends when no whitened state moves by more.

    Raises
    ------
    OptionsError
        R is not finite, symmetric and positive; shapes or options do not agree.

    Examples
    --------
    >>> x = gaussian([0.0], [[1.0]])
    >>> after, seen = m_update(x, [10.0], [[1.0]], [[1.0]], loss_named("huber"))
    >>> float(after.mean[0].round(3)), float(seen.weight[0])
    (1.304, 0.15)
    """
    observed = np.array(z, dtype=np.float64).reshape(-1)
    m, n = len(observed), len(x.mean)
    rows = np.array(H, dtype=np.float64)
    if rows.shape != (m, n):
        raise OptionsError(f"H of shape {rows.shape}", f"({m}, {n})")
    noise = gaussian(np.zeros(m), R).covariance
    state_loss = state_loss or loss_named("kalman")
    check_losses(state_loss, standardise, sweeps, tolerance)
    after = Gaussian(x.mean.copy(), np.array(x.factor, dtype=np.float64, order="C"))
    residual = np.where(np.isfinite(observed), observed, np.nan) - rows @ x.mean
    w, w_state = np.full(m, np.nan), np.ones(n)
    code = _STANDARDS.index(standardise)
    done, change = _update(
        after, residual, rows, noise, loss, state_loss, code, sweeps, tolerance, w, w_state
    )
    if done < 0:
        raise OptionsError(f"R = {noise.tolist()}", "positive definite")
    return after, Weighing(residual, w, w_state, done, change)


def check_losses(state_loss: Loss, standardise: str, sweeps: int, tolerance: float) -> None:
    """Refuse options of `m_update` that would not do what they say.

    Raises
    ------
    OptionsError
        As `m_update`.
    """
    if state_loss.code not in _KEEPING:
        raise OptionsError(
            f"state loss {LossCode(state_loss.code).name.lower()}",
            "kalman, huber or student-t",
            "a weight of 0 would discard the prediction",
        )
    if standardise not in _STANDARDS:
        raise OptionsError(f"standardise {standardise!r}", "one of " + ", ".join(_STANDARDS))
    if sweeps < 1 or (sweeps > 1 and standardise == "innovation"):
        raise OptionsError(
            f"{sweeps} sweeps standardised by {standardise}",
            "at least 1, and 1 for innovations",
            "the innovation is known at the prediction only",
        )
    if not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise OptionsError(f"tolerance {tolerance}", "a number ≥ 0")


@helper
def m_step(
    x: FloatArray,
    S: FloatArray,
    residual: FloatArray,
    H: FloatArray,
    R: FloatArray,
    loss: Loss,
    state_loss: Loss,
    by_innovation: int,
    sweeps: int,
    tolerance: float,
    w: FloatArray,
    w_state: FloatArray,
) -> tuple[int, float]:
    """Update mean and factor in place; works in whitened states, ``x = x⁻ + L e``, ``P = L Lᵀ``.

    Parameters
    ----------
    x, S
        (n,) predicted mean and (n, n) factor; overwritten.
    residual
        (m,) z − H x⁻, NaN where missing: the caller can wrap angles.
    H, R, loss, state_loss, sweeps, tolerance
        As `m_update`.
    by_innovation
        1 to standardise by the innovation.
    w, w_state
        (m,) and (n,); overwritten where observed, and with the last state weights.

    Returns
    -------
    sweeps, change
        As `Weighing`; sweeps −1 if R is not positive definite.
    """
    n = x.shape[0]
    seen = np.array([j for j in range(residual.shape[0]) if not np.isnan(residual[j])])
    count = len(seen)
    w_state[:] = 1.0
    if count == 0:
        return 0, 0.0
    triangularize(S, n, n)
    L = np.empty((count, count))
    rows = np.empty((count, n + 1))  # whitened: [R^{-1/2} H L | R^{-1/2} residual]
    for i in range(count):
        for j in range(n):
            rows[i, j] = 0.0
            for l in range(j, n):
                rows[i, j] += H[seen[i], l] * S[l, j]
        rows[i, n] = residual[seen[i]]
        for j in range(count):
            L[i, j] = R[seen[i], seen[j]]
    if not cholesky(L, count):
        return -1, 0.0
    for i in range(count):
        for k in range(n + 1):
            for l in range(i):
                rows[i, k] -= L[i, l] * rows[l, k]
            rows[i, k] /= L[i, i]
    e, D = np.zeros(n), np.zeros((n, n))
    moved, phi, gain = np.empty(n), np.empty(n), np.empty(n)
    change, done = np.inf, 0
    while done < sweeps and change > tolerance:
        done += 1
        for i in range(n):
            D[i] = 0.0
            w_state[i] = _weight(abs(e[i]), state_loss)
            D[i, i] = 1.0 / math.sqrt(w_state[i])
            moved[i] = 0.0
        for i in range(count):
            scale2 = 1.0
            for k in range(n):
                scale2 += by_innovation * rows[i, k] * rows[i, k]
            r = abs(_remainder(rows[i], e)) / math.sqrt(scale2)
            w[seen[i]] = _weight(r, loss)
        for i in range(count):
            if w[seen[i]] > 0.0:
                for k in range(n):
                    phi[k] = 0.0
                    for l in range(n):
                        phi[k] += D[l, k] * rows[i, l]
                absorb(moved, D, phi, gain, _remainder(rows[i], moved), 1.0 / w[seen[i]])
        change = 0.0
        for k in range(n):
            change = max(change, abs(moved[k] - e[k]))
            e[k] = moved[k]
    root = S.copy()
    multiply(root, D, S)
    for k in range(n):
        for l in range(n):
            x[k] += root[k, l] * e[l]
    return done, change


@helper
def _remainder(row: FloatArray, e: FloatArray) -> float:
    """What a whitened observation, the last of its row, differs from what the states say."""
    total: float = row[-1]
    for k in range(e.shape[0]):
        total -= row[k] * e[k]
    return total


@helper
def _weight(v: float, loss: Loss) -> float:
    """Weight of one whitened residual, Student-t included."""
    if loss.code == 6:
        return (loss.k0 + 1.0) / (loss.k0 + v * v)
    return weight(v, loss.code, loss.k0, loss.k1)


@kernel
def _update(
    x: Gaussian,
    residual: FloatArray,
    H: FloatArray,
    R: FloatArray,
    loss: Loss,
    state_loss: Loss,
    by_innovation: int,
    sweeps: int,
    tolerance: float,
    w: FloatArray,
    w_state: FloatArray,
) -> tuple[int, float]:
    return m_step(
        x.mean,
        x.factor,
        residual,
        H,
        R,
        loss,
        state_loss,
        by_innovation,
        sweeps,
        tolerance,
        w,
        w_state,
    )
