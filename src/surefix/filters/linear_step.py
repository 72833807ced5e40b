"""Kernels of the filter of a linear model: one epoch, series, and many series at once.

Covariance form. The innovation covariance is reduced to ``S = L D Lᵀ`` while the same row
operations turn ``H P`` into ``L⁻¹ H P``; each pivot then takes its share from P. That loses as many
digits as the noise is smaller than the prediction, so epochs in which a variance falls by more than
`_FALL` go by Joseph's form, ``(I − K H) P (I − K H)ᵀ + K R̄ Kᵀ``, which loses none.

Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977; Joseph's form:
Bar-Shalom, Li and Kirubarajan, 2001, 5.2.3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.jit import inlined, kernel, threaded_kernel
from surefix.robust.loss import Loss, weight
from surefix.rows import ONE, Size, add_row, clear_row, copy_row, part, scratch, width
from surefix.types import FloatArray

__all__ = ["LinearModel", "eliminate_rows", "predict_rows", "run", "step", "weigh_rows"]

_FALL = 1e4  # ratio of S to R̄ above which the short form would lose more than four digits


class LinearModel(NamedTuple):
    """``x' = F x + w``, ``z = H x + v``.

    Matrices stand one below the other: k is 1 for the same at all epochs, or N for one for each.

    Parameters
    ----------
    F, F_T, Q
        (k·n, n) transition, its transpose, and process noise.
    H, H_T
        (k·m, n) and (k·n, m).
    R
        (k·m, m).
    states, components
        Sizes n and m for the compiler, see `surefix.rows`.
    """

    F: FloatArray
    F_T: FloatArray
    Q: FloatArray
    H: FloatArray
    H_T: FloatArray
    R: FloatArray
    states: Size
    components: Size


@inlined
def predict_rows(
    x: FloatArray,
    P: FloatArray,
    y: FloatArray,
    A: FloatArray,
    F: FloatArray,
    F_T: FloatArray,
    f: int,
    Q: FloatArray,
    q: int,
    states: Size,
) -> None:
    """``x = F x``, ``P = F P Fᵀ + Q`` with the matrices that begin at rows f and q."""
    n = width(states)
    clear_row(y, 0, states)
    for i in range(n):
        add_row(y, 0, x[0, i], F_T, f + i, states)
    copy_row(x, 0, y, 0, states)
    for i in range(n):
        clear_row(A, i, states)
        for j in range(n):
            add_row(A, i, F[f + i, j], P, j, states)
    for i in range(n):
        copy_row(P, i, Q, q + i, states)
        for j in range(n):
            add_row(P, i, A[i, j], F_T, f + j, states)


@inlined
def _innovate(
    x: FloatArray,
    P: FloatArray,
    e: FloatArray,
    B: FloatArray,
    S: FloatArray,
    H: FloatArray,
    H_T: FloatArray,
    h: int,
    R: FloatArray,
    r: int,
    states: Size,
    components: Size,
) -> None:
    """``e = z − H x`` in place of z, ``B = H P`` and ``S = H P Hᵀ + R``."""
    n, m = width(states), width(components)
    for j in range(n):
        add_row(e, 0, -x[0, j], H_T, h * n + j, components)
    for c in range(m):
        clear_row(B, c, states)
        for j in range(n):
            add_row(B, c, H[h * m + c, j], P, j, states)
        copy_row(S, c, R, r + c, components)
        for j in range(n):
            add_row(S, c, B[c, j], H_T, h * n + j, components)


@inlined
def weigh_rows(
    e: FloatArray,
    S: FloatArray,
    R: FloatArray,
    r: int,
    used: FloatArray,
    root: FloatArray,
    loss: Loss,
    by_noise: bool,
    components: Size,
) -> bool:
    """Weigh the components, ``R̄_ij = R_ij / √(w_i w_j)``; whether some variance falls far.

    ``used`` is 0 for what is left out, whose innovation becomes 0; ``root`` is ``1 / √w``.
    """
    m = width(components)
    changed = far = False
    for c in range(m):
        root[0, c] = 1.0
        used[0, c] = 1.0
        if not abs(e[0, c]) < np.inf:
            used[0, c] = e[0, c] = 0.0
        elif loss.code != 0:
            variance = R[r + c, c] if by_noise else S[c, c]
            w = weight(abs(e[0, c]) / math.sqrt(variance), loss.code, loss.k0, loss.k1)
            if w < 1.0:
                changed = True
                used[0, c] = 1.0 if w > 0.0 else 0.0
                root[0, c] = 1.0 / math.sqrt(w) if w > 0.0 else 1.0
        if S[c, c] > _FALL * R[r + c, c]:
            far = True
    if changed:
        for c in range(m):
            if root[0, c] == 1.0:
                continue
            for d in range(m):
                more = R[r + c, d] * (root[0, c] * root[0, d] - 1.0)
                S[c, d] += more
                if root[0, d] == 1.0:
                    S[d, c] += more
    return far


@inlined
def eliminate_rows(
    x: FloatArray,
    e: FloatArray,
    B: FloatArray,
    S: FloatArray,
    L: FloatArray,
    used: FloatArray,
    states: Size,
    components: Size,
) -> None:
    """``B = L⁻¹ H P``, the mean, and the inverse pivots in ``used``; −L below its diagonal."""
    m = width(components)
    for c in range(m):
        inverse = used[0, c] / S[c, c]
        used[0, c] = inverse
        share = inverse * e[0, c]
        add_row(x, 0, share, B, c, states)
        for d in range(c + 1, m):
            l = -S[d, c] * inverse
            L[d, c] = l
            add_row(S, d, l, S, c, components)
            add_row(B, d, l, B, c, states)
        add_row(e, 0, -share, S, c, components)


@inlined
def _joseph(
    P: FloatArray,
    A: FloatArray,
    B: FloatArray,
    L: FloatArray,
    used: FloatArray,
    root: FloatArray,
    H: FloatArray,
    h: int,
    R: FloatArray,
    r: int,
    states: Size,
    components: Size,
) -> None:
    """Joseph's form in the innovations ``L⁻¹ e``, whose gains are ``B[c] · used[c]``."""
    n, m = width(states), width(components)
    rows, noise = scratch(components, states), scratch(components, components)
    turned, W = scratch(components, components), scratch(states, states)
    W_T, spread = scratch(states, states), scratch(components, states)
    for c in range(m):
        copy_row(rows, c, H, h + c, states)
        for d in range(m):
            noise[c, d] = R[r + c, d] * root[0, c] * root[0, d]
    for c in range(m):
        for d in range(c + 1, m):
            add_row(rows, d, L[d, c], rows, c, states)
            add_row(noise, d, L[d, c], noise, c, components)
    for c in range(m):
        for d in range(m):
            turned[c, d] = noise[d, c]
    for c in range(m):
        for d in range(c + 1, m):
            add_row(turned, d, L[d, c], turned, c, components)
    for i in range(n):
        clear_row(W, i, states)
        W[i, i] = 1.0
        for c in range(m):
            add_row(W, i, -B[c, i] * used[0, c], rows, c, states)
        for j in range(n):
            W_T[j, i] = W[i, j]
    for i in range(n):
        clear_row(A, i, states)
        for j in range(n):
            add_row(A, i, W[i, j], P, j, states)
    for c in range(m):
        clear_row(spread, c, states)
        for d in range(m):
            add_row(spread, c, turned[c, d] * used[0, d], B, d, states)
    for i in range(n):
        clear_row(P, i, states)
        for j in range(n):
            add_row(P, i, A[i, j], W_T, j, states)
        for c in range(m):
            add_row(P, i, B[c, i] * used[0, c], spread, c, states)


@inlined
def _series(
    model: LinearModel,
    loss: Loss,
    by_noise: bool,
    start: FloatArray,
    first: FloatArray,
    z: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    residual: FloatArray,
    nis: FloatArray,
    weights: FloatArray,
) -> None:
    """Filter z (N, m) from the mean (1, n) and covariance (n, n); covariances go to (N·n, n)."""
    states, components = model.states, model.components
    n, m = width(states), width(components)
    x, y, e = scratch(ONE, states), scratch(ONE, states), scratch(ONE, components)
    used, root = scratch(ONE, components), scratch(ONE, components)
    P, A = scratch(states, states), scratch(states, states)
    B, S, L = (
        scratch(components, states),
        scratch(components, components),
        scratch(components, components),
    )
    F, F_T, Q, H, H_T, R = model.F, model.F_T, model.Q, model.H, model.H_T, model.R
    f_step, q_step = n * (F.shape[0] > n), n * (Q.shape[0] > n)
    h_step, r_step = 1 * (H.shape[0] > m), m * (R.shape[0] > m)
    copy_row(x, 0, start, 0, states)
    for i in range(n):
        copy_row(P, i, first, i, states)
    for k in range(z.shape[0]):
        f, q, h, r = f_step * k, q_step * k, h_step * k, r_step * k
        predict_rows(x, P, y, A, F, F_T, f, Q, q, states)
        copy_row(e, 0, z, k, components)
        _innovate(x, P, e, B, S, H, H_T, h, R, r, states, components)
        for c in range(m):
            seen = e[0, c] if abs(e[0, c]) < np.inf else np.nan
            residual[k, c] = seen
            nis[k, c] = seen * seen / S[c, c]
        far = weigh_rows(e, S, R, r, used, root, loss, by_noise, components)
        for c in range(m):
            w = used[0, c] / (root[0, c] * root[0, c])
            weights[k, c] = np.nan if math.isnan(nis[k, c]) else w
        eliminate_rows(x, e, B, S, L, used, states, components)
        if far:
            _joseph(P, A, B, L, used, root, H, h * m, R, r, states, components)
        else:
            for c in range(m):
                for i in range(n):
                    add_row(P, i, -B[c, i] * used[0, c], B, c, states)
        copy_row(mean, k, x, 0, states)
        for i in range(n):
            copy_row(covariance, k * n + i, P, i, states)


@threaded_kernel
def run(
    model: LinearModel,
    loss: Loss,
    by_noise: bool,
    start: FloatArray,
    first: FloatArray,
    z: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
    residual: FloatArray,
    nis: FloatArray,
    weights: FloatArray,
) -> None:
    """Filter series one after the other; a leading axis on all arrays of `_series`."""
    for t in range(z.shape[0]):
        _series(
            model,
            loss,
            by_noise,
            start[t],
            first[t],
            z[t],
            mean[t],
            covariance[t],
            residual[t],
            nis[t],
            weights[t],
        )


@kernel
def step(
    packed: FloatArray,
    states: Size,
    components: Size,
    state: FloatArray,
    z: FloatArray,
    after: FloatArray,
    seen: FloatArray,
) -> None:
    """One epoch; for `surefix.filters.linear.advance`, which says what goes in and out.

    ``packed`` holds F, Fᵀ, Q, H, Hᵀ, R, and code, k₀ and k₁ of the loss: a call with one array is
    sooner than with nine, and results that the caller made are sooner than new ones.
    """
    n, m = width(states), width(components)
    a, b, c = n * n, 3 * n * n, 3 * n * n + 2 * n * m
    d = c + m * m
    model = LinearModel(
        part(packed, 0, states, states),
        part(packed, a, states, states),
        part(packed, 2 * a, states, states),
        part(packed, b, components, states),
        part(packed, b + n * m, states, components),
        part(packed, c, components, components),
        states,
        components,
    )
    loss = Loss(int(packed[d]), packed[d + 1], packed[d + 2], 1.0, 1.0, 0)
    _series(
        model,
        loss,
        False,
        part(state, 0, ONE, states),
        part(state, n, states, states),
        part(z, 0, ONE, components),
        part(after, 0, ONE, states),
        part(after, n, states, states),
        part(seen, 0, ONE, components),
        part(seen, m, ONE, components),
        part(seen, 2 * m, ONE, components),
    )
