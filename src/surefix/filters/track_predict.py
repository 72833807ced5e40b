"""Kernels of the prediction of the track filter: the factor of its covariance, cut at jumps."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.records import Motion, Recovery
from surefix.jit import helper
from surefix.models.motion import add_noise_factor, propagate_rows
from surefix.types import FloatArray

__all__ = ["VAGUE", "VAGUE_RATE", "load", "predict_factor", "store"]

VAGUE = 1e6
"""m: standard deviation of a position nothing is known about."""
VAGUE_RATE = 1e3
"""m/s, or m/s²: … and of the change of a rate that was decided beforehand."""


@helper
def load(A: FloatArray, S: FloatArray, n: int) -> None:
    """Write ``[S, 0]`` into ``A`` (n, 2n)."""
    for i in range(n):
        for j in range(n):
            A[i, j] = S[i, j]
            A[i, n + j] = 0.0


@helper
def store(S: FloatArray, A: FloatArray, n: int) -> None:
    """Take S back out of the first n columns of ``A``."""
    for i in range(n):
        for j in range(n):
            S[i, j] = A[i, j]


@helper
def _vague(
    A: FloatArray,
    motion: Motion,
    mask: int,
    sigma_position: float,
    sigma_velocity: float,
) -> None:
    """Forget the states of the masked groups: fresh independent columns in the factor."""
    d, n = motion.axes, motion.order * motion.axes
    for c in range(2 * d):
        if not (mask >> motion.group[c]) & 1:
            continue
        for s in range(c, n, d):
            for j in range(2 * n):
                A[s, j] = 0.0
            A[s, n + s] = sigma_position if s < d else sigma_velocity


@helper
def _cut(A: FloatArray, motion: Motion, dt: float, mask: int) -> None:
    """Cut positions, or the highest rates, from the past; the noise of what goes on is its own.

    A rate that is cut has changed by 0 ± `VAGUE_RATE` before the step.
    """
    d, m = motion.axes, motion.order
    n = m * d
    B = np.zeros((m, m + 1))
    L = np.zeros((m, m))
    for c in range(d):
        placed = (mask >> motion.group[c]) & 1
        turned = (mask >> motion.group[d + c]) & 1
        if not (placed or turned):
            continue
        for i in range(m):
            for j in range(m):
                B[i, j] = A[c + i * d, n + c + j * d]
            B[i, m] = 0.0
        if turned:
            B[m - 1, m] = VAGUE_RATE
            B[m - 2, m] = dt * VAGUE_RATE
            if m == 3:
                B[0, m] = 0.5 * dt * dt * VAGUE_RATE
        first = 1 if placed else 0
        for i in range(first, m):  # Gram and Schmidt on the rows
            for l in range(first, i):
                L[i, l] = 0.0
                for j in range(m + 1):
                    L[i, l] += B[i, j] * B[l, j]
                for j in range(m + 1):
                    B[i, j] -= L[i, l] * B[l, j]
            length = 0.0
            for j in range(m + 1):
                length += B[i, j] * B[i, j]
            L[i, i] = math.sqrt(length)
            if length > 0.0:
                for j in range(m + 1):
                    B[i, j] /= L[i, i]
        for i in range(first, m):
            for j in range(m):
                A[c + i * d, n + c + j * d] = L[i, j] if first <= j <= i else 0.0
        if placed:
            for j in range(2 * n):
                A[c, j] = 0.0
            A[c, n + c] = VAGUE


@helper
def predict_factor(
    A: FloatArray,
    S: FloatArray,
    motion: Motion,
    dt: float,
    jump: int,
    recovery: Recovery,
) -> None:
    """Write ``[F S, G]`` into ``A`` (n, 2n): a factor of the predicted covariance, not yet square.

    Groups in the bit mask ``jump`` restart: their rows become vague and independent of the past.
    With ``recovery.keeps_rate`` those of positions leave the rates alone, and the other way round.
    """
    n = motion.order * motion.axes
    load(A, S, n)
    propagate_rows(A, motion.order, motion.axes, dt, n)
    add_noise_factor(A, motion.order, motion.axes, dt, motion.density, n)
    if jump and recovery.keeps_rate:
        _cut(A, motion, dt, jump)
    elif jump:
        _vague(A, motion, jump, VAGUE, recovery.sigma_velocity)
