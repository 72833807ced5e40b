"""The unscented Kalman filter over a whole series of ranges, bearings and other sights.

`surefix.filters.sigma_point` takes any function as a model, one step at a time; here the models are
built in (`surefix.models.sights`), so that a whole series is compiled code. The motion is linear,
for which the unscented transform is exact and needs no points. Points stand on the columns of the
lower Cholesky factor, whose later columns do not move the position: sights of the position alone
are evaluated at 2d + 1 points of d axes, whatever the number of states.

The state is carried as a covariance. Where a prior is vaguer than the sights by six orders of
magnitude, take the square-root form of `surefix.filters.sigma_point`.
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
        codes,
        np.ascontiguousarray(places).reshape(-1, d),
        moving,
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
def _columns(P: FloatArray, L: FloatArray, y: FloatArray, count: int, states: Size) -> None:
    """Put the first columns of the Cholesky factor of P into the rows of L."""
    for j in range(count):
        copy_row(y, 0, P, j, states)
        for k in range(j):
            add_row(y, 0, -L[k, j], L, k, states)
        pivot = y[0, j]
        clear_row(L, j, states)
        add_row(L, j, 1.0 / math.sqrt(pivot) if pivot > 0.0 else 0.0, y, 0, states)


@inlined
def _points(
    x: FloatArray,
    L: FloatArray,
    gamma: float,
    moving: int,
    ones: FloatArray,
    signs: FloatArray,
    X: FloatArray,
    states: Size,
    points: Size,
) -> None:
    """Put the points into the columns of X: the centre, then ± γ times each column of L."""
    for i in range(width(states)):
        clear_row(X, i, points)
        add_row(X, i, x[0, i], ones, 0, points)
        for j in range(moving):
            add_row(X, i, gamma * L[j, i], signs, j, points)


@kernel
def _run(
    model: LinearModel,
    loss: Loss,
    kind: IntArray,
    anchors: FloatArray,
    moving: int,
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
    states, components = model.states, model.components
    n, m = width(states), width(components)
    reach, bend = spread
    gamma, share = math.sqrt(reach), 0.5 / reach
    x, y, e = scratch(ONE, states), scratch(ONE, states), scratch(ONE, components)
    used, root = scratch(ONE, components), scratch(ONE, components)
    P, A, L = scratch(states, states), scratch(states, states), scratch(states, states)
    B, S = scratch(components, states), scratch(components, components)
    T, shift = scratch(components, components), scratch(ONE, components)
    X, Y = scratch(states, points), scratch(components, points)
    ones, signs, off = scratch(ONE, points), scratch(states, points), scratch(_AXES, points)
    F, F_T, Q, R = model.F, model.F_T, model.Q, model.R
    f_step, q_step = n * (F.shape[0] > n), n * (Q.shape[0] > n)
    r_step, a_step = m * (R.shape[0] > m), m * (anchors.shape[0] > m)
    copy_row(x, 0, start, 0, states)
    for i in range(n):
        copy_row(P, i, first, i, states)
    for p in range(width(points)):
        ones[0, p] = 1.0
        for j in range(moving):
            signs[j, p] = 1.0 if p == 1 + j else -1.0 if p == 1 + moving + j else 0.0
    for k in range(z.shape[0]):
        move_row(x, 0, F_T, f_step * k, y, 0, states)
        copy_row(x, 0, y, 0, states)
        predict_rows(P, A, F, F_T, f_step * k, Q, q_step * k, states)
        _columns(P, L, y, moving, states)
        _points(x, L, gamma, moving, ones, signs, X, states, points)
        r, a = r_step * k, a_step * k
        for c in range(m):
            sight_row(kind[c], anchors, a + c, X, ones, off, Y, c, points)
            centre = Y[c, 0]
            add_row(Y, c, -centre, ones, 0, points)
            if kind[c] == BEARING:
                turn_row(Y, c, _TURN, points)
            shift[0, c] = share * dot_rows(Y, c, ones, 0, points)
            e[0, c] = z[k, c] - centre - shift[0, c]
            if kind[c] == BEARING:
                e[0, c] -= _TURN * np.rint(e[0, c] / _TURN)
            clear_row(B, c, states)
            for j in range(moving):
                slope = 0.5 / gamma * (Y[c, 1 + j] - Y[c, 1 + moving + j])
                add_row(B, c, slope, L, j, states)
        for c in range(m):
            for d in range(c + 1):
                S[c, d] = R[r + c, d] + bend * shift[0, c] * shift[0, d]
                S[c, d] += share * dot_rows(Y, c, Y, d, points)
                S[d, c] = S[c, d]
            seen = e[0, c] if abs(e[0, c]) < np.inf else np.nan
            residual[k, c] = seen
            nis[k, c] = seen * seen / S[c, c]
        weigh_rows(e, S, R, r, used, root, loss, False, components)
        for c in range(m):
            w = used[0, c] / (root[0, c] * root[0, c])
            weights[k, c] = np.nan if math.isnan(nis[k, c]) else w
        eliminate_rows(B, S, T, used, states, components)
        absorb_rows(x, 0, e, B, S, used, states, components)
        for c in range(m):
            for i in range(n):
                add_row(P, i, -B[c, i] * used[0, c], B, c, states)
        copy_row(mean, k, x, 0, states)
        for i in range(n):
            copy_row(covariance, k * n + i, P, i, states)
