"""The Kalman filter as two pure steps on a Gaussian, in square-root form.

``predict`` and ``update`` take any linear (or linearised) model; `surefix.filters.track` runs the
same arithmetic over whole series of the motion models.

>>> import numpy as np
>>> from surefix.models.motion import noise_factor, transition
>>> x = gaussian([0.0, 0.0], np.diag([1.0, 4.0]))
>>> G = noise_factor("cv", 1, 1.0, 0.01)
>>> x = predict(x, transition("cv", 1, 1.0), G @ G.T)
>>> x, seen = update(x, [1.2], [[1.0, 0.0]], [[0.25]])
>>> np.round(x.mean, 3), np.round(seen.nis, 3)
(array([1.143, 0.915]), array([0.274]))
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.jit import kernel
from surefix.linalg import absorb, cholesky, multiply, solve_lower, triangularize
from surefix.robust.loss import Loss, loss_named, weight
from surefix.types import FloatArray, IntArray

__all__ = ["Gaussian", "Innovation", "Spread", "gaussian", "predict", "update"]

Spread = Literal["innovation", "noise"]
"""What a residual is divided by before it is weighed: the root of HPHᵀ + R, or of R alone."""


class Gaussian(NamedTuple):
    """A state estimate: ``mean`` (…, n) and ``factor`` S, (…, n, n), of its covariance ``S Sᵀ``."""

    mean: FloatArray
    factor: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """Covariance P = S Sᵀ, (…, n, n)."""
        return self.factor @ np.swapaxes(self.factor, -1, -2)


class Innovation(NamedTuple):
    """What an update saw.

    Parameters
    ----------
    residual
        (m,) ``z − H x``; NaN where not observed.
    nis
        (groups,) squared Mahalanobis distance of each group of components.
    sigma
        (groups,) what the loss weighed: its root, as a one-axis equivalent; of R alone, where the
        spread was ``noise``.
    weight
        (groups,) weight the loss gave; NaN where not observed.
    """

    residual: FloatArray
    nis: FloatArray
    sigma: FloatArray
    weight: FloatArray


def gaussian(mean: ArrayLike, covariance: ArrayLike) -> Gaussian:
    """Make a Gaussian from a mean (n,) and a covariance (n, n).

    Raises
    ------
    OptionsError
        The covariance is not finite, symmetric and positive semi-definite.
    """
    m = np.array(mean, dtype=np.float64).reshape(-1)
    return Gaussian(m, _factor(covariance, len(m), "covariance"))


def predict(x: Gaussian, F: ArrayLike, Q: ArrayLike) -> Gaussian:
    """Predict through ``x' = F x + w``, w of covariance Q.

    Parameters
    ----------
    x
        State of size n.
    F, Q
        (n, n) transition and process noise.
    """
    n = len(x.mean)
    transition = np.asarray(F, dtype=np.float64).reshape(n, n)
    A = np.hstack([transition @ x.factor, _factor(Q, n, "Q")])
    _reduce(A)
    return Gaussian(transition @ x.mean, np.ascontiguousarray(A[:, :n]))


def update(
    x: Gaussian,
    z: ArrayLike,
    H: ArrayLike,
    R: ArrayLike,
    loss: Loss | None = None,
    group: ArrayLike | None = None,
    spread: Spread = "innovation",
) -> tuple[Gaussian, Innovation]:
    """Update with ``z = H x + v``, v of covariance R, weighting the components by a robust loss.

    Weights come from the standardised innovation; ``R̄_ij = R_ij / √(w_i w_j)`` (bifactor
    equivalent weights, so correlated observations keep their correlation), ``w = 0`` removes the
    component. Source: paper 000, eqs 14–19; Yang, Song and Xu, J. Geodesy 76, 2002.

    Parameters
    ----------
    x
        State of size n.
    z
        (m,) observation; NaN is missing.
    H, R
        (m, n) and (m, m).
    loss
        From `surefix.robust.loss.loss_named`; None for the plain filter. Student-t needs the
        iteration of `surefix.filters.track` and is refused here.
    group
        (m,) which components share a weight; each its own by default.
    spread
        What standardises the innovation: its covariance ``HPHᵀ + R``, or ``noise``, R alone. The
        latter takes a doubtful prediction for a doubtful observation.

    Raises
    ------
    OptionsError
        R is not finite, symmetric and positive, or the shapes do not agree.
    """
    observed = np.array(z, dtype=np.float64).reshape(-1)
    m, n = len(observed), len(x.mean)
    if spread not in get_args(Spread):
        raise OptionsError(f"spread {spread!r}", "one of " + ", ".join(get_args(Spread)))
    loss = loss or loss_named("kalman")
    if loss.code == 6:
        raise OptionsError(
            "loss 'student-t'", "a loss of the innovation", "use huber, igg1 or igg3"
        )
    rows = np.array(H, dtype=np.float64)
    if rows.shape != (m, n):
        raise OptionsError(f"H of shape {rows.shape}", f"({m}, {n})")
    noise = np.array(R, dtype=np.float64)
    _factor(noise, m, "R", definite=True)
    groups = np.arange(m) if group is None else np.asarray(group, dtype=np.int64)
    count = int(groups.max(initial=-1)) + 1
    seen = Innovation(
        observed - rows @ x.mean,
        np.full(count, np.nan),
        np.full(count, np.nan),
        np.full(count, np.nan),
    )
    after = Gaussian(x.mean.copy(), np.ascontiguousarray(x.factor, dtype=np.float64).copy())
    _update(after, seen, rows, noise, groups, loss, spread == "noise")
    return after, seen


def _factor(covariance: ArrayLike, n: int, name: str, *, definite: bool = False) -> FloatArray:
    P = np.asarray(covariance, dtype=np.float64)
    expected = f"a finite, symmetric, positive {'' if definite else 'semi-'}definite ({n}, {n})"
    if P.shape != (n, n) or not np.isfinite(P).all() or not np.allclose(P, P.T, rtol=1e-9, atol=0):
        raise OptionsError(f"{name} = {P.tolist()}", expected)
    try:
        lower: FloatArray = np.linalg.cholesky(P).astype(np.float64)
        return lower
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(P)
    if definite or values.min(initial=0.0) < -1e-9 * np.abs(values).max(initial=0.0):
        raise OptionsError(f"{name} = {P.tolist()}", expected)
    root: FloatArray = vectors * np.sqrt(np.clip(values, 0.0, None))
    return root


@kernel
def _reduce(A: FloatArray) -> None:
    triangularize(A, A.shape[0], A.shape[1])


@kernel
def _update(
    x: Gaussian,
    seen: Innovation,
    H: FloatArray,
    R: FloatArray,
    group: IntArray,
    loss: Loss,
    by_noise: bool,
) -> None:
    """Weigh the groups, decorrelate what is left, absorb it one scalar at a time."""
    m, n = H.shape
    seen_through = np.empty((m, n))
    multiply(H, x.factor, seen_through)
    component_weight = np.ones(m)
    for g in range(seen.weight.shape[0]):
        index = np.array([c for c in range(m) if group[c] == g and not np.isnan(seen.residual[c])])
        size = len(index)
        if size == 0:
            continue
        C = np.empty((size, size))
        e = np.empty(size)
        for i in range(size):
            e[i] = seen.residual[index[i]]
            for j in range(size):
                C[i, j] = R[index[i], index[j]]
                for k in range(n):
                    C[i, j] += seen_through[index[i], k] * seen_through[index[j], k]
        if not cholesky(C, size):
            continue
        solve_lower(C, e, size)
        scale = 1.0 if size == 1 else loss.scale2 if size == 2 else loss.scale3
        seen.nis[g] = np.sum(e * e)
        if by_noise:
            for i in range(size):
                e[i] = seen.residual[index[i]]
                for j in range(size):
                    C[i, j] = R[index[i], index[j]]
            cholesky(C, size)
            solve_lower(C, e, size)
        seen.sigma[g] = np.sqrt(np.sum(e * e)) / scale
        seen.weight[g] = weight(seen.sigma[g], loss.code, loss.k0, loss.k1)
        for i in range(size):
            component_weight[index[i]] = seen.weight[g]
    kept = np.array(
        [c for c in range(m) if component_weight[c] > 0.0 and not np.isnan(seen.residual[c])]
    )
    size = len(kept)
    L = np.empty((size, size))
    white = np.empty((size, n + 1))
    for i in range(size):
        a = kept[i]
        white[i, n] = seen.residual[a]
        for j in range(n):
            white[i, j] = H[a, j]
            white[i, n] += H[a, j] * x.mean[j]
        for j in range(size):
            b = kept[j]
            L[i, j] = R[a, b] / np.sqrt(component_weight[a] * component_weight[b])
    if size == 0 or not cholesky(L, size):
        return
    gain = np.empty(n)
    phi = np.empty(n)
    for i in range(size):
        for j in range(n + 1):
            for l in range(i):
                white[i, j] -= L[i, l] * white[l, j]
            white[i, j] /= L[i, i]
        residual = white[i, n]
        for j in range(n):
            residual -= white[i, j] * x.mean[j]
            phi[j] = 0.0
            for l in range(n):
                phi[j] += x.factor[l, j] * white[i, l]
        absorb(x.mean, x.factor, phi, gain, residual, 1.0)
