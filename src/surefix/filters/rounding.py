"""What velocities of few digits are worth: the noise that does to a track what rounding does.

While a velocity stays within one step of its last digit, it is off by the same amount, so that
rounding is not white. A track that follows velocities over W of them and fixes beyond has the
errors ``Σ e_j exp(−j/W)`` in it; white noise does the same if its variance is

    σ² = C₀ + 2 Σ C_j exp(−j/W),
    C_j = Δ²/(2π²) Σ_h h⁻² exp(−2π² h² (2s² + j c²)),  C₀ = Δ²/12 + s²Δ²

with C the covariance of what is rounded to Δ, if it changes by c Δ from one to the next and is
noisy by s Δ before it is rounded (Widrow, Kollár and Liu, IEEE Transactions on Instrumentation and
Measurement 45(2), 1996, for the characteristic function). W = τ/T itself depends on σ.
"""

from __future__ import annotations

import math

import numpy as np

__all__ = ["rounding_noise"]

_HARMONICS = np.arange(1.0, 6.0)
_TURNS = 40
_MOST = 700.0  # exponent of a number that there still is


def rounding_noise(
    digit: float, change: float, interval: float, weight: float, noise: float = 0.0
) -> float:
    """Standard deviation of the white noise that stands for rounding, m/s.

    Parameters
    ----------
    digit
        Step of the last digit, m/s; 0 gives ``noise``.
    change
        Root mean square change of what is rounded from one velocity to the next, m/s.
    interval
        Between velocities, s.
    weight
        Root density of the noise of the fixes, their σ times the root of their interval, m √s.
    noise
        Standard deviation before rounding, m/s.

    >>> round(rounding_noise(1.0, 1.0, 1.0, 100.0), 3)  # white, if it changes much: 1/√12
    0.289
    >>> round(rounding_noise(1.0, 0.0, 1.0, 100.0) / rounding_noise(1.0, 0.0, 1.0, 12.5), 2)
    2.0
    """
    if not digit > 0.0:
        return noise
    h, c, s = _HARMONICS, change / digit, noise / digit
    first = np.exp(-4.0 * (math.pi * h * s) ** 2) / (2.0 * (math.pi * h) ** 2)
    white = 1.0 / 12.0 + s * s
    sigma = math.sqrt(white) * digit
    for _ in range(_TURNS):
        span = weight / (sigma * interval**1.5)
        later = np.expm1(np.minimum(1.0 / span + 2.0 * (math.pi * h * c) ** 2, _MOST))
        needed = digit * math.sqrt(white + 2.0 * float((first / later).sum()))
        sigma = math.sqrt(sigma * needed)
    return sigma
