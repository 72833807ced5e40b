"""Parts of which the kernels of linear models are made: predict, innovate, weigh, eliminate.

Covariance form. The innovation covariance is reduced to ``S = L D Lᵀ`` while the same row
operations turn ``H P`` into ``L⁻¹ H P``; each pivot then takes its share from P. That loses as many
digits as the noise is smaller than the prediction, so epochs in which a variance falls by more than
`_FALL` go by Joseph's form, ``(I − K H) P (I − K H)ᵀ + K R̄ Kᵀ``, which loses none.

What is done to the mean is apart from what is done to the covariance, which series may share.

Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977; Joseph's form:
Bar-Shalom, Li and Kirubarajan, 2001, 5.2.3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.jit import inlined
from surefix.robust.loss import Loss, weight
from surefix.rows import Size, add_row, clear_row, copy_row, scratch, width
from surefix.types import FloatArray

__all__ = [
    "LinearModel",
    "absorb_rows",
    "eliminate_rows",
    "innovate_row",
    "joseph_rows",
    "move_row",
    "note_row",
    "observe_rows",
    "predict_rows",
    "weigh_rows",
]

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
def move_row(
    x: FloatArray, i: int, F_T: FloatArray, f: int, y: FloatArray, k: int, states: Size
) -> None:
    """``y[k] = F x[i]`` with the matrix that begins at row f."""
    clear_row(y, k, states)
    for j in range(width(states)):
        add_row(y, k, x[i, j], F_T, f + j, states)


@inlined
def predict_rows(
    P: FloatArray,
    A: FloatArray,
    F: FloatArray,
    F_T: FloatArray,
    f: int,
    Q: FloatArray,
    q: int,
    states: Size,
) -> None:
    """``P = F P Fᵀ + Q`` with the matrices that begin at rows f and q."""
    n = width(states)
    for i in range(n):
        clear_row(A, i, states)
        for j in range(n):
            add_row(A, i, F[f + i, j], P, j, states)
    for i in range(n):
        copy_row(P, i, Q, q + i, states)
        for j in range(n):
            add_row(P, i, A[i, j], F_T, f + j, states)


@inlined
def innovate_row(
    x: FloatArray,
    i: int,
    H_T: FloatArray,
    h: int,
    z: FloatArray,
    k: int,
    e: FloatArray,
    states: Size,
    components: Size,
) -> None:
    """``e = z[k] − H x[i]``."""
    copy_row(e, 0, z, k, components)
    for j in range(width(states)):
        add_row(e, 0, -x[i, j], H_T, h + j, components)


@inlined
def observe_rows(
    P: FloatArray,
    B: FloatArray,
    S: FloatArray,
    H: FloatArray,
    h: int,
    H_T: FloatArray,
    h_T: int,
    R: FloatArray,
    r: int,
    states: Size,
    components: Size,
) -> None:
    """``B = H P`` and ``S = H P Hᵀ + R``."""
    n, m = width(states), width(components)
    for c in range(m):
        clear_row(B, c, states)
        for j in range(n):
            add_row(B, c, H[h + c, j], P, j, states)
        copy_row(S, c, R, r + c, components)
        for j in range(n):
            add_row(S, c, B[c, j], H_T, h_T + j, components)


@inlined
def note_row(
    e: FloatArray,
    variance: FloatArray,
    residual: FloatArray,
    nis: FloatArray,
    k: int,
    components: Size,
) -> None:
    """Put down innovations and their squares over their variance; NaN where not observed."""
    for c in range(width(components)):
        seen = e[0, c] if abs(e[0, c]) < np.inf else np.nan
        residual[k, c] = seen
        nis[k, c] = seen * seen / variance[0, c]


@inlined
def weigh_rows(
    e: FloatArray,
    variance: FloatArray,
    S: FloatArray,
    R: FloatArray,
    r: int,
    used: FloatArray,
    root: FloatArray,
    weights: FloatArray,
    k: int,
    loss: Loss,
    by_noise: bool,
    components: Size,
) -> bool:
    """Weigh the components, ``R̄_ij = R_ij / √(w_i w_j)``; whether some variance falls far.

    ``used`` is 0 for what is left out, whose innovation becomes 0; ``root`` is ``1 / √w``, and w
    itself, NaN where not observed, goes to ``weights[k]``. What R̄ has more than R is added to
    ``S``; ``variance`` (1, m) is that of the innovations.
    """
    m = width(components)
    changed = far = False
    for c in range(m):
        w = root[0, c] = used[0, c] = 1.0
        if not abs(e[0, c]) < np.inf:
            used[0, c] = e[0, c] = 0.0
            w = np.nan
        elif loss.code != 0:
            square = R[r + c, c] if by_noise else variance[0, c]
            w = weight(abs(e[0, c]) / math.sqrt(square), loss.code, loss.k0, loss.k1)
            if w < 1.0:
                changed = True
                used[0, c] = 1.0 if w > 0.0 else 0.0
                root[0, c] = 1.0 / math.sqrt(w) if w > 0.0 else 1.0
        weights[k, c] = w
        if variance[0, c] > _FALL * R[r + c, c]:
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
    B: FloatArray, S: FloatArray, L: FloatArray, used: FloatArray, states: Size, components: Size
) -> None:
    """``B = L⁻¹ H P``, the inverse pivots in ``used``, −L below its diagonal, D Lᵀ in S."""
    m = width(components)
    for c in range(m):
        inverse = used[0, c] / S[c, c]
        used[0, c] = inverse
        for d in range(c + 1, m):
            l = -S[d, c] * inverse
            L[d, c] = l
            add_row(S, d, l, S, c, components)
            add_row(B, d, l, B, c, states)


@inlined
def absorb_rows(
    x: FloatArray,
    i: int,
    e: FloatArray,
    B: FloatArray,
    S: FloatArray,
    used: FloatArray,
    states: Size,
    components: Size,
) -> None:
    """Let innovations e move ``x[i]``, by what `eliminate_rows` made; e is used up."""
    for c in range(width(components)):
        share = used[0, c] * e[0, c]
        add_row(x, i, share, B, c, states)
        add_row(e, 0, -share, S, c, components)


@inlined
def joseph_rows(
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
