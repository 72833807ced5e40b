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
from surefix.filters.linear_step import LinearModel, eliminate_rows, predict_rows, weigh_rows
from surefix.filters.sigma_point import Spread
from surefix.jit import inlined, kernel
from surefix.models.sights import BEARING, COMPONENT, value_of
from surefix.robust.loss import Loss, loss_named
from surefix.rows import ONE, Size, add_row, clear_row, copy_row, scratch, width
from surefix.types import FloatArray, IntArray

__all__ = ["filter_sights"]

_TURN = 2.0 * math.pi


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
    points = spread or Spread()
    reach = points.alpha**2 * (n + points.kappa)
    if not (reach > 0.0 and points.alpha > 0.0 and points.beta >= points.alpha**2):
        raise OptionsError(f"{points} for {n} states", "α > 0, n + κ > 0, β ≥ α²")
    loss = loss or loss_named("kalman")
    if loss.code == 6:
        raise OptionsError("loss 'student-t'", "a loss of the innovation", "use huber or igg3")
    model = linear_model(F, Q, np.zeros((m, n)), R, (n, m, N))
    mean, covariance = np.empty((N, n)), np.empty((N * n, n))
    found = tuple(np.empty(seen.shape) for _ in range(3))
    _run(
        model,
        loss,
        codes,
        np.ascontiguousarray(places).reshape(-1, d),
        d if (codes < COMPONENT + d).all() else n,
        (reach, points.beta - points.alpha**2),
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
def _evaluate(
    kind: IntArray,
    anchors: FloatArray,
    first: int,
    point: FloatArray,
    d: int,
    centre: FloatArray,
    out: FloatArray,
    j: int,
    components: Size,
) -> None:
    """Sights of one point, less those of the centre, into row j."""
    for c in range(width(components)):
        away = value_of(kind[c], anchors, first + c, point, d) - centre[0, c]
        out[j, c] = _turned(away, kind[c])


@inlined
def _turned(angle: float, kind: int) -> float:
    return float(angle - _TURN * np.rint(angle / _TURN)) if kind == BEARING else angle


@kernel
def _run(
    model: LinearModel,
    loss: Loss,
    kind: IntArray,
    anchors: FloatArray,
    moving: int,
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
    n, m, d = width(states), width(components), anchors.shape[1]
    reach, bend = spread
    gamma, share = math.sqrt(reach), 0.5 / reach
    x, y, point = scratch(ONE, states), scratch(ONE, states), scratch(ONE, states)
    e, centre, shift = scratch(ONE, components), scratch(ONE, components), scratch(ONE, components)
    used, root = scratch(ONE, components), scratch(ONE, components)
    P, A, L = scratch(states, states), scratch(states, states), scratch(states, states)
    up, down = scratch(states, components), scratch(states, components)
    B, S = scratch(components, states), scratch(components, components)
    T = scratch(components, components)
    F, F_T, Q, R = model.F, model.F_T, model.Q, model.R
    f_step, q_step = n * (F.shape[0] > n), n * (Q.shape[0] > n)
    r_step, a_step = m * (R.shape[0] > m), m * (anchors.shape[0] > m)
    copy_row(x, 0, start, 0, states)
    for i in range(n):
        copy_row(P, i, first, i, states)
    for k in range(z.shape[0]):
        predict_rows(x, P, y, A, F, F_T, f_step * k, Q, q_step * k, states)
        _columns(P, L, y, moving, states)
        r, a = r_step * k, a_step * k
        clear_row(shift, 0, components)
        clear_row(centre, 0, components)
        for c in range(m):
            centre[0, c] = value_of(kind[c], anchors, a + c, x, d)
        for j in range(moving):
            copy_row(point, 0, x, 0, states)
            add_row(point, 0, gamma, L, j, states)
            _evaluate(kind, anchors, a, point, d, centre, up, j, components)
            add_row(point, 0, -2.0 * gamma, L, j, states)
            _evaluate(kind, anchors, a, point, d, centre, down, j, components)
            add_row(shift, 0, share, up, j, components)
            add_row(shift, 0, share, down, j, components)
        for c in range(m):
            copy_row(S, c, R, r + c, components)
            add_row(S, c, bend * shift[0, c], shift, 0, components)
            clear_row(B, c, states)
            for j in range(moving):
                add_row(S, c, share * up[j, c], up, j, components)
                add_row(S, c, share * down[j, c], down, j, components)
                add_row(B, c, 0.5 / gamma * (up[j, c] - down[j, c]), L, j, states)
            e[0, c] = _turned(z[k, c] - centre[0, c] - shift[0, c], kind[c])
            seen = e[0, c] if abs(e[0, c]) < np.inf else np.nan
            residual[k, c] = seen
            nis[k, c] = seen * seen / S[c, c]
        weigh_rows(e, S, R, r, used, root, loss, False, components)
        for c in range(m):
            w = used[0, c] / (root[0, c] * root[0, c])
            weights[k, c] = np.nan if math.isnan(nis[k, c]) else w
        eliminate_rows(x, e, B, S, T, used, states, components)
        for c in range(m):
            for i in range(n):
                add_row(P, i, -B[c, i] * used[0, c], B, c, states)
        copy_row(mean, k, x, 0, states)
        for i in range(n):
            copy_row(covariance, k * n + i, P, i, states)
