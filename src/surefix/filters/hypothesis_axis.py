"""Kernels on one axis of one hypothesis: predict, update, open, close and commit a run.

The state of an axis is ``[p, v, (a), b]`` with covariance P, b the offset of a run of wrong fixes.
A fix that belongs to the track observes p, one of the run observes p + b.
"""

from __future__ import annotations

import math

from surefix.jit import inner, lean_helper
from surefix.types import FloatArray

__all__ = [
    "HASTE",
    "agility",
    "begin_anew",
    "change_rate",
    "commit",
    "forget",
    "open_run",
    "predict_axis",
    "reach",
    "update_axis",
]

HASTE = 2.0
"""A rate that is forgotten may be so many times what the next fix says."""
_SWIFT = 30.0  # standard deviations


@inner
def predict_axis(m: FloatArray, P: FloatArray, order: int, dt: float, q: float) -> None:
    """Advance one axis by ``dt`` seconds under white noise of density q; b stays.

    Parameters
    ----------
    m, P
        (order + 1,) and (order + 1, order + 1); overwritten.
    """
    n = order + 1
    if order == 3:
        h = 0.5 * dt * dt
        m[0] += dt * m[1] + h * m[2]
        m[1] += dt * m[2]
        for j in range(n):
            P[0, j] += dt * P[1, j] + h * P[2, j]
            P[1, j] += dt * P[2, j]
        for i in range(n):
            P[i, 0] += dt * P[i, 1] + h * P[i, 2]
            P[i, 1] += dt * P[i, 2]
        d2, d3 = dt * dt, dt * dt * dt
        P[0, 0] += q * d3 * d2 / 20.0
        P[0, 1] += q * d2 * d2 / 8.0
        P[1, 0] = P[0, 1]
        P[0, 2] += q * d3 / 6.0
        P[2, 0] = P[0, 2]
        P[1, 1] += q * d3 / 3.0
        P[1, 2] += q * d2 / 2.0
        P[2, 1] = P[1, 2]
        P[2, 2] += q * dt
        return
    m[0] += dt * m[1]
    P[0, 0] += dt * (2.0 * P[0, 1] + dt * P[1, 1]) + q * dt * dt * dt / 3.0
    P[0, 1] += dt * P[1, 1] + 0.5 * q * dt * dt
    P[1, 0] = P[0, 1]
    P[1, 1] += q * dt
    P[0, 2] += dt * P[1, 2]
    P[2, 0] = P[0, 2]


@inner
def update_axis(
    m: FloatArray, P: FloatArray, n: int, c: int, shifted: bool, nu: float, r: float
) -> None:
    """Update one axis with one scalar: component c, plus the offset b if ``shifted``.

    Parameters
    ----------
    n
        Size of the state, b included.
    nu, r
        Innovation and variance of the observation.
    """
    g0 = P[0, c]
    g1 = P[1, c]
    g2 = P[2, c]
    g3 = P[3, c] if n > 3 else 0.0
    b = n - 1
    if shifted:
        g0 += P[0, b]
        g1 += P[1, b]
        g2 += P[2, b]
        if n > 3:
            g3 += P[3, b]
    S = r
    if c == 0:
        S += g0
    else:
        S += g1
    if shifted:
        S += g3 if n > 3 else g2
    if not S > 0.0:
        return
    inverse = 1.0 / S
    k0, k1, k2 = g0 * inverse, g1 * inverse, g2 * inverse
    m[0] += k0 * nu
    m[1] += k1 * nu
    m[2] += k2 * nu
    # What was observed is known to its last digit: no difference of large numbers.
    left = r * inverse
    place, rate = not shifted and c == 0, not shifted and c != 0
    P[0, 0] = max(g0 * left if place else P[0, 0] - k0 * g0, 0.0)
    P[1, 1] = max(g1 * left if rate else P[1, 1] - k1 * g1, 0.0)
    P[2, 2] = max(P[2, 2] - k2 * g2, 0.0)
    P[0, 1] = g1 * left if place else g0 * left if rate else P[0, 1] - k0 * g1
    P[0, 2] = g2 * left if place else P[0, 2] - k0 * g2
    P[1, 2] = g2 * left if rate else P[1, 2] - k1 * g2
    P[1, 0], P[2, 0], P[2, 1] = P[0, 1], P[0, 2], P[1, 2]
    if n > 3:
        k3 = g3 * inverse
        m[3] += k3 * nu
        P[0, 3] = g3 * left if place else P[0, 3] - k0 * g3
        P[1, 3] = g3 * left if rate else P[1, 3] - k1 * g3
        P[2, 3] -= k2 * g3
        P[3, 3] = max(P[3, 3] - k3 * g3, 0.0)
        P[3, 0], P[3, 1], P[3, 2] = P[0, 3], P[1, 3], P[2, 3]


@lean_helper
def reach(order: int, c: int, gap: float) -> float:
    """How far component c is moved in ``gap`` seconds by a unit of the highest rate."""
    if c == order - 1:
        return 1.0
    return gap if c == order - 2 else 0.5 * gap * gap


@lean_helper
def agility(q: float, gap: float) -> float:
    """Scale of a change of the highest rate: a gross error of what is usual in ``gap`` seconds."""
    return _SWIFT * math.sqrt(q * gap)


@lean_helper
def change_rate(P: FloatArray, order: int, gap: float, sigma: float) -> None:
    """Let the highest rate have changed at once by 0 ± ``sigma``, ``gap`` seconds ago."""
    for i in range(order):
        for j in range(order):
            P[i, j] += reach(order, i, gap) * reach(order, j, gap) * sigma * sigma


@lean_helper
def begin_anew(m: FloatArray, P: FloatArray, n: int, speed: float) -> None:
    """Forget how fast the vehicle goes: its rates are 0 ± ``speed``, and where it is stays."""
    for i in range(n):
        for j in range(n):
            if i > 0 or j > 0:
                P[i, j] = 0.0
        if 0 < i < n - 1:
            P[i, i] = speed * speed
        if i > 0:
            m[i] = 0.0


@lean_helper
def open_run(m: FloatArray, P: FloatArray, n: int, nu: float, r: float) -> None:
    """Begin a run: nothing was known of b, so it is the innovation and the track is not changed."""
    b = n - 1
    m[b] = nu
    for j in range(b):
        P[b, j] = -P[0, j]
        P[j, b] = -P[0, j]
    P[b, b] = P[0, 0] + r


@lean_helper
def forget(m: FloatArray, P: FloatArray, n: int) -> None:
    """End a run: b is dropped."""
    b = n - 1
    m[b] = 0.0
    for j in range(n):
        P[b, j] = 0.0
        P[j, b] = 0.0


@lean_helper
def commit(m: FloatArray, P: FloatArray, n: int) -> None:
    """Take the offset for a true jump: ``p += b``."""
    b = n - 1
    m[0] += m[b]
    P[0, 0] += 2.0 * P[0, b] + P[b, b]
    for j in range(1, b):
        P[0, j] += P[b, j]
        P[j, 0] = P[0, j]
    forget(m, P, n)
