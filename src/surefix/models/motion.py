"""Motion models: constant velocity and constant acceleration driven by white noise.

The state stacks position, velocity (and acceleration) of d axes: ``[p₁…p_d, v₁…v_d, (a₁…a_d)]``.
Order 2 is constant velocity (white acceleration), order 3 constant acceleration (white jerk). The
noise is continuous white noise of spectral density q per axis, so any time step is right:
``Q = q [[Δt³/3, Δt²/2], [Δt²/2, Δt]]`` for order 2.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation,
2001, 6.2.2 and 6.2.3.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.errors import OptionsError
from surefix.jit import helper
from surefix.types import FloatArray

__all__ = ["MODELS", "add_noise_factor", "noise_factor", "propagate_rows", "transition"]

MODELS = {"cv": 2, "ca": 3}
"""Names of the motion models and their order: how many derivatives the state holds."""


@helper
def propagate_rows(A: FloatArray, order: int, axes: int, dt: float, columns: int) -> None:
    """Overwrite the rows of ``A`` (order·axes, ≥ columns) with ``F A``."""
    for i in range(axes):
        for k in range(columns):
            if order == 3:
                A[i, k] += dt * A[axes + i, k] + 0.5 * dt * dt * A[2 * axes + i, k]
                A[axes + i, k] += dt * A[2 * axes + i, k]
            else:
                A[i, k] += dt * A[axes + i, k]


@helper
def add_noise_factor(
    A: FloatArray, order: int, axes: int, dt: float, q: FloatArray, column: int
) -> None:
    """Write the lower factor of Q into ``A[:, column:]``, which must be zero.

    Parameters
    ----------
    A
        (≥ order·axes, ≥ column + order·axes).
    q
        (axes,) spectral density: m²/s³ for order 2, m²/s⁵ for order 3.
    """
    for i in range(axes):
        root = math.sqrt(q[i] * dt)
        v = axes + i
        if order == 3:
            a = 2 * axes + i
            A[i, column + i] = root * dt * dt / math.sqrt(20.0)
            A[v, column + i] = root * dt * math.sqrt(20.0) / 8.0
            A[a, column + i] = root * math.sqrt(20.0) / 6.0
            A[v, column + v] = root * dt / math.sqrt(48.0)
            A[a, column + v] = root * math.sqrt(48.0) / 12.0
            A[a, column + a] = root / 3.0
        else:
            A[i, column + i] = root * dt / math.sqrt(3.0)
            A[v, column + i] = root * math.sqrt(3.0) / 2.0
            A[v, column + v] = root / 2.0


def transition(model: str, axes: int, dt: float) -> FloatArray:
    """Transition matrix F, (n, n), over a step of ``dt`` seconds.

    >>> transition("cv", 1, 2.0)
    array([[1., 2.],
           [0., 1.]])
    """
    F = np.eye(_order(model) * axes)
    propagate_rows(F, _order(model), axes, dt, F.shape[1])
    return F


def noise_factor(model: str, axes: int, dt: float, q: float | FloatArray) -> FloatArray:
    """Lower factor G, (n, n), of the process noise ``Q = G Gᵀ`` over ``dt`` seconds.

    >>> G = noise_factor("cv", 1, 2.0, 3.0)
    >>> np.round(G @ G.T, 12)
    array([[8., 6.],
           [6., 6.]])
    """
    n = _order(model) * axes
    G = np.zeros((n, n))
    density = np.broadcast_to(np.asarray(q, dtype=np.float64), (axes,)).copy()
    add_noise_factor(G, _order(model), axes, dt, density, 0)
    return G


def _order(model: str) -> int:
    if model not in MODELS:
        raise OptionsError(f"motion model {model!r}", "one of " + ", ".join(MODELS))
    return MODELS[model]
