"""The unscented Kalman filter over a whole series of ranges, bearings and other sights.

`surefix.filters.sigma_point` takes any function as a model, one step at a time; here the models are
built in (`surefix.models.sights`), so that a whole series is compiled code. The motion is linear,
for which the unscented transform is exact and needs no points. Points stand on the columns of the
lower Cholesky factor, whose later columns do not move the position: sights of the position alone
are evaluated at 2d + 1 points of d axes, whatever the number of states.

What moves is carried as the factor that the points stand on, and only the rest as a covariance:
where variances of a prior are 10¹² those of the sights, nine digits remain. Beyond that take the
square-root form of `surefix.filters.sigma_point`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.filters.kalman import Gaussian
from surefix.filters.linear import LinearTrack, linear_model
from surefix.filters.linear_parts import (
    LinearModel,
    absorb_rows,
    eliminate_rows,
    move_row,
    note_row,
    predict_rows,
    weigh_rows,
)
from surefix.filters.sigma_point import Spread
from surefix.jit import inlined, kernel
from surefix.models.sights import BEARING, COMPONENT, sight_row
from surefix.robust.loss import Loss, loss_named
from surefix.rows import (
    ONE,
    Size,
    add_product,
    add_row,
    clear_row,
    copy_row,
    dot_rows,
    scratch,
    size_of,
    turn_row,
    width,
)
from surefix.types import FloatArray, IntArray

__all__ = ["filter_sights"]

_TURN = 2.0 * math.pi
_LANES = 4  # of a vector; spare ones repeat the centre, which adds nothing
_AXES: Size = (None, None, None)


def filter_sights(
    x: Gaussian,
    z: ArrayLike,
    F: ArrayLike,
    Q: ArrayLike,
    kind: ArrayLike,
    anchor: ArrayLike,
    R: ArrayLike,
    loss: Loss | None = None,
    spread: Spread | None = None,
) -> LinearTrack:
    """Filter N epochs of m sights from known places by the unscented transform.

    Parameters
    ----------
    x
        State of size n, one step before the first epoch; it begins with the position on d axes, m.
    z
        (N, m) m or rad; what is not finite is missing.
    F, Q, R
        (n, n), (n, n) and (m, m), or a leading N for one each epoch: F and Q lead to it.
    kind
        (m,) codes of `surefix.models.sights`.
    anchor
        (m, d) or (N, m, d) m, where each sight is taken from.
    loss
        As for `surefix.filters.sigma_point.update`: each component is weighed by itself.
    spread
        Where the points lie.

    Returns
    -------
    LinearTrack
        ``residual`` is ``z − E[h(x)]``, of bearings within half a turn.

    Raises
    ------
    OptionsError
        Q or R is no covariance, shapes or codes do not agree, the loss is Student-t, or the spread
        is none (see `surefix.filters.sigma_point.transform`).
    """
    seen = np.ascontiguousarray(z, dtype=np.float64)
    codes = np.ascontiguousarray(kind, dtype=np.int64)
    n, m, N = len(x.mean), len(codes), len(seen)
    if seen.shape != (N, m):
        raise OptionsError(f"z of shape {seen.shape}", f"(N, {m})")
    places = np.asarray(anchor, dtype=np.float64)
    d = places.shape[-1] if places.ndim else 0
    if places.shape not in {(m, d), (N, m, d)} or not 1 <= d <= min(n, 3):
        raise OptionsError(f"anchors of shape {places.shape}", f"({m}, d) or ({N}, {m}, d), d ≤ 3")
    if not ((codes >= 0) & (codes < COMPONENT + n)).all():
        raise OptionsError(f"kinds {codes.tolist()}", "codes of surefix.models.sights")
    if d == 1 and ((codes > 0) & (codes < COMPONENT)).any():
        raise OptionsError("an angle on one axis", "anchors on two axes or three")
    at = spread or Spread()
    reach = at.alpha**2 * (n + at.kappa)
    if not (reach > 0.0 and at.alpha > 0.0 and at.beta >= at.alpha**2):
        raise OptionsError(f"{at} for {n} states", "α > 0, n + κ > 0, β ≥ α²")
    loss = loss or loss_named("kalman")
    if loss.code == 6:
        raise OptionsError("loss 'student-t'", "a loss of the innovation", "use huber or igg3")
    model = linear_model(F, Q, np.zeros((m, n)), R, (n, m, N))
    moving = d if (codes < COMPONENT + d).all() else n
    mean, covariance = np.empty((N, n)), np.empty((N * n, n))
    found = tuple(np.empty(seen.shape) for _ in range(3))
    _run(
        model,
        loss,
        int(np.count_nonzero(model.R)) > len(model.R),
        codes,
        np.ascontiguousarray(places).reshape(-1, d),
        size_of(moving),
        size_of(2 * moving),
        size_of(-(-(2 * moving + 1) // _LANES) * _LANES),
        (reach, at.beta - at.alpha**2),
        np.ascontiguousarray(x.mean[None], dtype=np.float64),
        np.ascontiguousarray(x.covariance),
        seen,
        mean,
        covariance,
        *found,
    )
    return LinearTrack(mean, covariance.reshape(N, n, n), *found)


@inlined
def _columns(
    P: FloatArray,
    L: FloatArray,
    y: FloatArray,
    root: FloatArray,
    keep: FloatArray,
    states: Size,
    moving: Size,
) -> None:
    """Put the first columns of the Cholesky factor of P into the rows of L, and take them from P.

    ``keep`` (1, n) is 0 for the components that move: nothing is left of them, not even rounding.
    """
    k = width(moving)
    for j in range(k):
        copy_row(L, j, P, j, states)
        for i in range(j):
            add_row(L, j, -L[i, j] * root[0, i], L, i, states)
        root[0, j] = 1.0 / L[j, j] if L[j, j] > 0.0 else 0.0
    for j in range(k):
        copy_row(y, 0, L, j, states)
        clear_row(L, j, states)
        add_row(L, j, math.sqrt(root[0, j]), y, 0, states)
    for i in range(width(states)):
        copy_row(y, 0, P, i, states)
        clear_row(P, i, states)
        if i >= k:
            for j in range(k):
                add_row(y, 0, -L[j, i], L, j, states)
            add_product(P, i, keep, 0, y, 0, states)


@inlined
def _points(
    x: FloatArray,
    L: FloatArray,
    gamma: float,
    ones: FloatArray,
    signs: FloatArray,
    X: FloatArray,
    moving: Size,
    points: Size,
) -> None:
    """Put the points into the columns of X: the centre, then ± γ times each column of L."""
    for i in range(width(moving)):
        clear_row(X, i, points)
        add_row(X, i, x[0, i], ones, 0, points)
        for j in range(width(moving)):
            add_row(X, i, gamma * L[j, i], signs, j, points)


@inlined
def _latent(
    reach: float, bend: float, signs: FloatArray, turn: FloatArray, moving: Size, points: Size
) -> None:
    """Make the signs of the points, and the map from their sights to the columns of `_run`.

    Over the outer points, ``S − R = Σ (y yᵀ) / (2γ²) + (β − α²) d dᵀ`` with ``d = Σ y / (2γ²)``.
    With ``o = (y₊ − y₋) / 2γ`` and ``q = (y₊ + y₋) / 2γ`` of each pair this is ``Σ o oᵀ + Σ q qᵀ``
    and a share of ``(Σ q)(Σ q)ᵀ``, which is the same as ``Σ o oᵀ + Σ r rᵀ`` with ``r = q + c Σ q``.
    """
    k, half = width(moving), 0.5 / math.sqrt(reach)
    more = half * (math.sqrt(1.0 + k * bend / reach) - 1.0) / k
    for p in range(width(points)):
        for j in range(k):
            plus, minus = 1.0 * (p == 1 + j), 1.0 * (p == 1 + k + j)
            outer = 1.0 * (1 <= p <= 2 * k)
            signs[j, p] = plus - minus
            turn[p, j] = half * (plus + minus) + more * outer
            turn[p, k + j] = half * (plus - minus)


@kernel
def _run(
    model: LinearModel,
    loss: Loss,
    correlated: bool,
    kind: IntArray,
    anchors: FloatArray,
    moving: Size,
    latent: Size,
    points: Size,
    spread: tuple[float, float],
    start: FloatArray,
    first: FloatArray,
    z: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    residual: FloatArray,
    nis: FloatArray,
    weights: FloatArray,
) -> None:
    """Run the filter; ``latent`` is twice ``moving``.

    ``h(x)`` is seen as ``mean + C u``, u of covariance I, and x as ``mean + L u`` and a rest that
    no sight tells of. Given the sights u has the information ``M = I + Cᵀ R̄⁻¹ C``: that is reduced,
    as the covariance of innovations is in a linear filter, but there are fewer u than sights.
    """
    states, components = model.states, model.components
    n, m, k_ = width(states), width(components), width(moving)
    reach, bend = spread
    gamma, share = math.sqrt(reach), 0.5 / reach
    x, y, e = scratch(ONE, states), scratch(ONE, states), scratch(ONE, components)
    used, root = scratch(ONE, components), scratch(ONE, components)
    variance, keep = scratch(ONE, components), scratch(ONE, states)
    P, A, L = scratch(states, states), scratch(states, states), scratch(moving, states)
    C, W, T = (
        scratch(components, latent),
        scratch(components, components),
        scratch(components, components),
    )
    M, V, U = scratch(latent, latent), scratch(latent, states), scratch(latent, latent)
    g, known = scratch(ONE, latent), scratch(ONE, latent)
    pivots = scratch(ONE, states)
    X, Y = scratch(moving, points), scratch(components, points)
    ones, signs, off = scratch(ONE, points), scratch(moving, points), scratch(_AXES, points)
    turn, unit = scratch(points, latent), scratch(latent, latent)
    F, F_T, Q, R = model.F, model.F_T, model.Q, model.R
    f_step, q_step = n * (F.shape[0] > n), n * (Q.shape[0] > n)
    r_step, a_step = m * (R.shape[0] > m), m * (anchors.shape[0] > m)
    copy_row(x, 0, start, 0, states)
    for i in range(n):
        copy_row(P, i, first, i, states)
        keep[0, i] = 1.0 if i >= k_ else 0.0
    for p in range(width(points)):
        ones[0, p] = 1.0
    for i in range(2 * k_):
        for j in range(2 * k_):
            unit[i, j] = 1.0 * (i == j)
    _latent(reach, bend, signs, turn, moving, points)
    for k in range(z.shape[0]):
        r, a = r_step * k, a_step * k
        move_row(x, 0, F_T, f_step * k, y, 0, states)
        copy_row(x, 0, y, 0, states)
        predict_rows(P, A, F, F_T, f_step * k, Q, q_step * k, states)
        _columns(P, L, y, pivots, keep, states, moving)
        _points(x, L, gamma, ones, signs, X, moving, points)
        for c in range(m):
            sight_row(kind[c], anchors, a + c, X, ones, off, Y, c, points)
        for c in range(m):
            centre = Y[c, 0]
            add_row(Y, c, -centre, ones, 0, points)
            if kind[c] == BEARING:
                turn_row(Y, c, _TURN, points)
            e[0, c] = z[k, c] - centre
            clear_row(C, c, latent)
            for p in range(1, 2 * k_ + 1):
                add_row(C, c, Y[c, p], turn, p, latent)
            copy_row(W, c, R, r + c, components)
        for c in range(m):
            e[0, c] -= share * dot_rows(Y, c, ones, 0, points)
            if kind[c] == BEARING:
                e[0, c] -= _TURN * np.rint(e[0, c] * (1.0 / _TURN))
            variance[0, c] = R[r + c, c] + dot_rows(C, c, C, c, latent)
        note_row(e, variance, residual, nis, k, components)
        weigh_rows(e, variance, W, R, r, used, root, weights, k, loss, False, components)
        clear_row(g, 0, latent)
        if correlated:
            eliminate_rows(C, W, T, used, latent, components)
            absorb_rows(g, 0, e, C, W, used, latent, components)
        else:
            for c in range(m):
                used[0, c] /= W[c, c]
                add_row(g, 0, used[0, c] * e[0, c], C, c, latent)
        for i in range(2 * k_):
            copy_row(M, i, unit, i, latent)
            known[0, i] = 1.0
            for c in range(m):
                add_row(M, i, used[0, c] * C[c, i], C, c, latent)
            clear_row(V, i, states)
            if i >= k_:
                copy_row(V, i, L, i - k_, states)
        eliminate_rows(V, M, U, known, states, latent)
        absorb_rows(x, 0, g, V, M, known, states, latent)
        for j in range(k_, 2 * k_):
            for i in range(n):
                add_row(P, i, V[j, i] * known[0, j], V, j, states)
        copy_row(mean, k, x, 0, states)
        for i in range(n):
            copy_row(covariance, k * n + i, P, i, states)
