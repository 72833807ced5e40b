"""The unscented Kalman filter with additive noise, in square-root form, for one state or a stack.

A function of a Gaussian is evaluated at its mean and at ``±γ`` times each column of its factor.
With ``eᵢ = yᵢ − y₀`` and ``d = Σ wᵢ eᵢ`` over the outer points, the scaled unscented transform is

    mean ``ȳ = y₀ + d``,  covariance ``Σ wᵢ eᵢ eᵢᵀ + (β − α²) d dᵀ``,
    ``γ² = α²(n + κ)``,  ``wᵢ = 1 / (2γ²)``,

the same numbers as with the usual weights of the central point, but a sum of squares for every
``β ≥ α²``. Covariances therefore stay factors throughout: predict and update each are one
triangularisation, and none can lose its positive semi-definiteness.

All arrays may have leading axes (…): independent states (runs, platforms) are then filtered at
once. The covariance of a stack is ``x.factor @ x.factor.mT``.

Source: Julier, The scaled unscented transformation, Proc. ACC 2002; van der Merwe and Wan, The
square-root unscented Kalman filter, Proc. ICASSP 2001. Paper 001, section 2.2, uses the filter.

>>> x = Gaussian(np.array([30.0, 40.0]), np.diag([3.0, 3.0]))
>>> x = predict(x, lambda points: points + [10.0, 0.0], np.eye(2))
>>> x, seen = update(x, [58.0], lambda p: np.hypot(p[..., :1], p[..., 1:]), [[0.25]])
>>> x.mean.round(2), seen.residual.round(2)
(array([40.93, 40.93]), array([1.34]))
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.filters.kalman import Gaussian, Innovation
from surefix.robust.loss import Loss, LossCode, weights
from surefix.types import FloatArray

__all__ = ["Model", "Spread", "predict", "transform", "update"]

Model = Callable[[FloatArray], FloatArray]
"""Maps points (…, n) to their images (…, m), point by point."""

Difference = Callable[[FloatArray, FloatArray], FloatArray]


class Spread(NamedTuple):
    """Where the sigma points lie and what their curvature counts.

    Parameters
    ----------
    alpha, kappa
        The points lie ``α √(n + κ)`` standard deviations out.
    beta
        Weight of the curvature in the covariance; 2 is right for the square of a normal variable.
    """

    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0


_SPREAD = Spread()


class _Image(NamedTuple):
    """A function of a Gaussian.

    Parameters
    ----------
    mean
        (…, m).
    columns
        (…, m, 2n+1) whose squares add up to the covariance.
    state
        (…, n, 2n+1), the columns of the state that belong to them.
    """

    mean: FloatArray
    columns: FloatArray
    state: FloatArray


def transform(x: Gaussian, function: Model, spread: Spread = _SPREAD) -> Gaussian:
    """Mean and covariance of a function of a Gaussian by the scaled unscented transform.

    Parameters
    ----------
    x
        ``mean`` (…, n), ``factor`` (…, n, n).
    function
        Receives points (…, 2n+1, n), gives (…, 2n+1, m).

    Raises
    ------
    OptionsError
        ``n + κ`` or α is not positive, or ``β < α²``.
    """
    image = _image(x, function, spread, np.subtract)
    return Gaussian(image.mean, _lower(image.columns))


def predict(x: Gaussian, f: Model, Q: ArrayLike, spread: Spread = _SPREAD) -> Gaussian:
    """Predict through ``x' = f(x) + w``, w of covariance Q.

    Parameters
    ----------
    x
        State, (…, n).
    f
        Motion, from points (…, 2n+1, n) to as many.
    Q
        (…, n, n), positive semi-definite.

    Raises
    ------
    OptionsError
        Q is not positive semi-definite, or see `transform`.
    """
    image = _image(x, f, spread, np.subtract)
    noise = np.broadcast_to(_root(Q, "Q"), x.factor.shape)
    return Gaussian(image.mean, _lower(np.concatenate((image.columns, noise), axis=-1)))


def update(
    x: Gaussian,
    z: ArrayLike,
    h: Model,
    R: ArrayLike,
    *,
    spread: Spread = _SPREAD,
    difference: Difference = np.subtract,
    loss: Loss | None = None,
) -> tuple[Gaussian, Innovation]:
    """Update with ``z = h(x) + v``, v of covariance R; NaN components are left out.

    With a loss, each component is weighed by its distance from the prediction in standard
    deviations of the innovation, ``R̄_ij = R_ij / √(w_i w_j)``; weight 0 leaves it out. The
    threshold weighting of paper 001, section 2.1, is the loss ``igg1``: full weight up to k₀,
    ``k₀/d`` up to k₁, prediction only beyond.

    Parameters
    ----------
    x
        State, (…, n).
    z
        (…, m) observation; NaN is missing.
    h
        From points (…, 2n+1, n) to their observations (…, 2n+1, m).
    R
        (…, m, m), positive definite.
    spread
        See `Spread`.
    difference
        ``a − b`` of two observations: wrap it where a component is an angle.
    loss
        From `surefix.robust.loss.loss_named`; None for the plain filter.

    Returns
    -------
    x, innovation
        The state, and residuals, squared distances, distances and weights, (…, m) each.

    Raises
    ------
    OptionsError
        R is not positive definite, the loss is Student-t, or see `transform`.
    """
    if loss is not None and loss.code == LossCode.STUDENT_T:
        raise OptionsError(
            "loss 'student-t'", "a loss of the innovation", "use huber, igg1 or igg3"
        )
    observed = np.asarray(z, dtype=np.float64)
    image = _image(x, h, spread, difference)
    noise = _root(R, "R", definite=True)
    residual = difference(observed, image.mean)
    variance = np.square(image.columns).sum(axis=-1) + np.square(noise).sum(axis=-1)
    nis = np.square(residual) / variance
    weight = np.where(np.isnan(nis), np.nan, 1.0)
    if loss is not None:
        weight = weights(np.ravel(nis), 1, loss).reshape(nis.shape)
    seen = Innovation(residual, nis, np.sqrt(nis), weight)
    return _absorb(x, image, noise, seen), seen


def _absorb(x: Gaussian, image: _Image, noise: FloatArray, seen: Innovation) -> Gaussian:
    """Triangularise ``[Z, N; X, 0]`` to ``[L, 0; K, S⁺]``: the gain is ``K L⁻¹``.

    A component that is not used has its row of ``[Z, N]`` replaced by a unit of its own.
    """
    m, n = image.mean.shape[-1], x.mean.shape[-1]
    used = seen.weight > 0.0  # false for NaN
    scale = 1.0 / np.sqrt(np.where(used, seen.weight, 1.0))
    noise = np.broadcast_to(noise * scale[..., None], (*image.mean.shape, m))
    observed = np.where(used[..., None], np.concatenate((image.columns, noise), axis=-1), 0.0)
    unit = np.where(used[..., None], 0.0, np.eye(m))
    state = np.concatenate((image.state, np.zeros((*x.mean.shape, 2 * m))), axis=-1)
    lower = _lower(np.concatenate((np.concatenate((observed, unit), axis=-1), state), axis=-2))
    step = np.where(used, seen.residual, 0.0)[..., None]
    white = np.linalg.solve(lower[..., :m, :m], step)
    moved = x.mean + (lower[..., m:, :m] @ white)[..., 0]
    return Gaussian(moved, np.ascontiguousarray(lower[..., m:, m : m + n]))


def _image(x: Gaussian, function: Model, spread: Spread, difference: Difference) -> _Image:
    n = x.mean.shape[-1]
    reach = spread.alpha**2 * (n + spread.kappa)
    if not (reach > 0.0 and spread.alpha > 0.0 and spread.beta >= spread.alpha**2):
        raise OptionsError(
            f"{spread} for {n} states", "α > 0, n + κ > 0, β ≥ α²", "try the default Spread()"
        )
    offsets = np.sqrt(reach) * x.factor.mT
    centre = x.mean[..., None, :]
    points = np.concatenate((centre, centre + offsets, centre - offsets), axis=-2)
    values = np.asarray(function(points), dtype=np.float64)
    away = difference(values[..., 1:, :], values[..., :1, :]) / np.sqrt(2.0 * reach)
    shift = away.sum(axis=-2) / np.sqrt(2.0 * reach)
    bend = np.sqrt(spread.beta - spread.alpha**2) * shift
    columns = np.concatenate((away, bend[..., None, :]), axis=-2).mT
    half = x.factor / np.sqrt(2.0)
    state = np.concatenate((half, -half, np.zeros((*x.mean.shape, 1))), axis=-1)
    return _Image(values[..., 0, :] + shift, columns, state)


def _lower(columns: FloatArray) -> FloatArray:
    """Square lower factor of ``A Aᵀ`` for ``A`` of at least as many columns as rows."""
    short = columns.shape[-2] - columns.shape[-1]
    if short > 0:
        columns = np.concatenate((columns, np.zeros((*columns.shape[:-1], short))), axis=-1)
    return np.asarray(np.linalg.qr(columns.mT, mode="r")).mT


def _root(covariance: ArrayLike, name: str, *, definite: bool = False) -> FloatArray:
    """Factor of a (stack of) noise covariance."""
    P = np.asarray(covariance, dtype=np.float64)
    if P.ndim >= 2 and P.shape[-1] == P.shape[-2] and np.isfinite(P).all():
        try:
            return np.asarray(np.linalg.cholesky(P))
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(P)
        floor = -1e-9 * np.abs(values).max(initial=0.0)
        if not definite and values.min(initial=0.0) >= floor:
            return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None))[..., None, :])
    raise OptionsError(
        f"{name} of shape {P.shape}",
        f"finite, positive {'' if definite else 'semi-'}definite (…, k, k)",
    )
