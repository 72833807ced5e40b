"""Kernels that follow the noise: innovations of the likeliest hypothesis, and what they teach."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import Bank, Found, Prior
from surefix.filters.hypothesis_density import best_of, wrapped
from surefix.filters.records import Motion
from surefix.jit import inner, lean_helper
from surefix.types import FloatArray, IntArray

__all__ = ["adapt", "innovate"]

_LARGEST = 9.0  # no squared innovation counts for more when noise is adapted …
_MEAN_SQUARE = (
    math.erf(math.sqrt(0.5 * _LARGEST))
    - math.sqrt(2.0 * _LARGEST / math.pi) * math.exp(-0.5 * _LARGEST)
    + _LARGEST * math.erfc(math.sqrt(0.5 * _LARGEST))
)  # … and then they have this mean, if all is well
_QUIET, _LOUD = 0.01, 100.0  # factors of a variance within which it is adapted


@inner
def innovate(
    motion: Motion,
    bank: Bank,
    place: IntArray,
    k: int,
    z: FloatArray,
    r: FloatArray,
    out: Found,
    share: FloatArray,
) -> None:
    """Standardised innovations of the likeliest hypothesis; nought where nothing is observed.

    ``share`` becomes what part of the variance of each axis is that of the position observed.
    """
    d = motion.axes
    best = place[best_of(bank.weight, bank.number[0])]
    for a in range(d):
        out.weight[k, a] = np.nan if math.isnan(z[a]) else 0.0
        out.weight[k, d + a] = np.nan if math.isnan(z[d + a]) else 0.0
        if bank.seen[best, a]:
            nu = wrapped(z[a] - bank.mean[best, a, 0], motion.period)
            S = bank.covariance[best, a, 0, 0] + r[a]
            out.standardised[k, a] = nu / math.sqrt(S)
            share[a] = r[a] / S
        nu = z[d + a] - bank.mean[best, a, 1]
        S = bank.covariance[best, a, 1, 1] + r[d + a]
        out.standardised[k, d + a] = nu / math.sqrt(S)


@lean_helper
def adapt(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    k: int,
    sensor: int,
    share: FloatArray,
    out: Found,
) -> None:
    """Let the noise of the positions follow the innovations that were used.

    Squares that are larger than supposed call for more noise of the sensor, in proportion to its
    share of the variance.
    """
    total, whole = 0.0, 0.0
    for a in range(motion.axes):
        s = out.standardised[k, a]
        if not out.weight[k, a] > 0.5 or math.isnan(s):
            continue
        total += share[a] * (min(s * s, _LARGEST) - _MEAN_SQUARE)
        whole += share[a]
    step = math.exp(prior.adapt[sensor] * total / max(whole, 1e-9))
    bank.scale[sensor] = min(max(bank.scale[sensor] * step, _QUIET), _LOUD)
