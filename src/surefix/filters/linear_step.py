"""Kernels of the filter of a linear model: one epoch, series, and many series at once.

Made of `surefix.filters.linear_parts`, which says how it is done.
"""

from __future__ import annotations

import numpy as np

from surefix.filters.linear_parts import (
    LinearModel,
    absorb_rows,
    eliminate_rows,
    innovate_row,
    joseph_rows,
    move_row,
    note_row,
    observe_rows,
    predict_rows,
    weigh_rows,
)
from surefix.jit import inlined, kernel, threaded_kernel
from surefix.robust.loss import Loss
from surefix.rows import ONE, Size, add_row, copy_row, part, scratch, width
from surefix.types import FloatArray

__all__ = ["follow", "run", "step"]


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
    variance = scratch(ONE, components)
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
        move_row(x, 0, F_T, f, y, 0, states)
        copy_row(x, 0, y, 0, states)
        predict_rows(P, A, F, F_T, f, Q, q, states)
        innovate_row(x, 0, H_T, h * n, z, k, e, states, components)
        observe_rows(P, B, S, H, h * m, H_T, h * n, R, r, states, components)
        for c in range(m):
            variance[0, c] = S[c, c]
        note_row(e, variance, residual, nis, k, components)
        far = weigh_rows(e, variance, S, R, r, used, root, weights, k, loss, by_noise, components)
        eliminate_rows(B, S, L, used, states, components)
        absorb_rows(x, 0, e, B, S, used, states, components)
        if far:
            joseph_rows(P, A, B, L, used, root, H, h * m, R, r, states, components)
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


@threaded_kernel
def follow(
    model: LinearModel,
    loss: Loss,
    covariance: FloatArray,
    first: FloatArray,
    start: FloatArray,
    z: FloatArray,
    mean: FloatArray,
    residual: FloatArray,
    nis: FloatArray,
) -> None:
    """Filter T series whose covariances are known, the same for all: the gains serve all of them.

    Nothing is weighed, and all have the same gaps. First (n, n) and then (N·n, n) covariances;
    start (T, n), and the epochs of all series one after the other: z (T·N, m), mean (T·N, n).
    """
    states, components = model.states, model.components
    n, m = width(states), width(components)
    T, N = start.shape[0], covariance.shape[0] // n
    e, variance = scratch(ONE, components), scratch(ONE, components)
    used, root, weight = (
        scratch(ONE, components),
        scratch(ONE, components),
        scratch(ONE, components),
    )
    P, A = scratch(states, states), scratch(states, states)
    B, S, L = (
        scratch(components, states),
        scratch(components, components),
        scratch(components, components),
    )
    F, F_T, Q, H, H_T, R = model.F, model.F_T, model.Q, model.H, model.H_T, model.R
    f_step, q_step = n * (F.shape[0] > n), n * (Q.shape[0] > n)
    h_step, r_step = 1 * (H.shape[0] > m), m * (R.shape[0] > m)
    for k in range(N):
        f, q, h, r = f_step * k, q_step * k, h_step * k, r_step * k
        for i in range(n):
            if k == 0:
                copy_row(P, i, first, i, states)
            else:
                copy_row(P, i, covariance, (k - 1) * n + i, states)
        predict_rows(P, A, F, F_T, f, Q, q, states)
        observe_rows(P, B, S, H, h * m, H_T, h * n, R, r, states, components)
        for c in range(m):
            variance[0, c] = S[c, c]
        copy_row(e, 0, z, k, components)
        weigh_rows(e, variance, S, R, r, used, root, weight, 0, loss, False, components)
        eliminate_rows(B, S, L, used, states, components)
        for t in range(T):
            row = t * N + k
            if k == 0:
                move_row(start, t, F_T, f, mean, row, states)
            else:
                move_row(mean, row - 1, F_T, f, mean, row, states)
            innovate_row(mean, row, H_T, h * n, z, row, e, states, components)
            note_row(e, variance, residual, nis, row, components)
            for c in range(m):
                e[0, c] = e[0, c] if abs(e[0, c]) < np.inf else 0.0
            absorb_rows(mean, row, e, B, S, used, states, components)


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
