"""Densities of an observation that belongs to the track, is poor, is wild, or is the first."""

from __future__ import annotations

import math

import numpy as np

from surefix.jit import inner
from surefix.types import FloatArray

__all__ = [
    "best_of",
    "first_fix",
    "log_normal",
    "log_sum",
    "log_wild",
    "usual_or_poor",
    "wild_product",
    "wrapped",
]

_ABSURD = 1e50  # squared errors beyond it are no less likely: its fourth power is a number
_PI = math.pi
_LOG_2PI = math.log(2.0 * math.pi)


@inner
def log_wild(square: float, log_scale: float, count: int) -> float:
    """Log-density of a gross error: Cauchy in ``count`` dimensions, so that no size is impossible.

    Parameters
    ----------
    square
        Sum of squares of the errors over their scales.
    log_scale
        Sum of the logarithms of the scales.
    """
    if count == 1:
        constant = -math.log(_PI)
    elif count == 2:
        constant = -math.log(2.0 * _PI)
    else:
        constant = -2.0 * math.log(_PI)
    return constant - log_scale - 0.5 * (count + 1) * math.log1p(square)


@inner
def wild_product(square: float, volume: float, count: int) -> float:
    """`log_wild` with the product of the squared scales, and with one logarithm."""
    tail = 1.0 + min(square, _ABSURD)
    power = tail * tail
    if count > 1:
        power *= tail
    if count > 2:
        power *= tail
    constant = -2.0 * math.log(_PI)
    if count < 3:
        constant = -math.log(_PI) if count == 1 else -math.log(2.0 * _PI)
    return constant - 0.5 * math.log(volume * power)


@inner
def wrapped(nu: float, period: float) -> float:
    """Innovation of an angle, within half a turn; unchanged if ``period`` is 0."""
    return nu - period * np.rint(nu / period) if period > 0.0 else nu


@inner
def log_normal(nu: float, S: float) -> float:
    """Log-density of an innovation ν of variance S."""
    return -0.5 * (nu * nu / S + math.log(S) + _LOG_2PI)


@inner
def log_sum(a: float, b: float) -> float:
    """Logarithm of the sum of two exponentials."""
    return max(a, b) + math.log1p(math.exp(-abs(a - b)))


@inner
def usual_or_poor(
    distance: float, volume: float, near: float, wider: float, count: int, poor: float
) -> tuple[float, bool]:
    """Log-density of ``count`` components of which it is open whether they are poor.

    ``log((1 − π) N(ν; S) + π N(ν; S + 3R))`` with one logarithm.

    Parameters
    ----------
    distance, volume
        Sum of ν²/S and product of S.
    near, wider
        The same with S + 3R.
    poor
        π.

    Returns
    -------
    density, poorer
        And whether poor is the likelier.
    """
    root = math.sqrt(volume)
    usual = (1.0 - poor) * math.exp(0.5 * (near - distance))
    noisy = poor * root / math.sqrt(wider)
    return math.log((usual + noisy) / root) - 0.5 * (near + count * _LOG_2PI), noisy > usual


@inner
def first_fix(square: float) -> float:
    """Variance under which a normal density is at its middle that of a first fix.

    That is the density of a gross error of the usual size, ``square`` its scale squared.
    """
    return 2.0 * _PI * square


@inner
def best_of(weight: FloatArray, count: int) -> int:
    """Place of the greatest of the first ``count`` weights."""
    best = 0
    for k in range(1, count):
        if weight[k] > weight[best]:
            best = k
    return best
