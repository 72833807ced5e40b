"""Kernels on what velocities tell of manoeuvres, and on velocities that are wrong on end."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import Bank
from surefix.filters.hypothesis_axis import agility, reach
from surefix.filters.hypothesis_density import wild_product, wrapped
from surefix.filters.records import Motion
from surefix.jit import inner, lean_helper
from surefix.types import FloatArray

__all__ = ["learn_slip", "slipped", "swift"]

_SLIPPED = 1.5  # variance of a velocity beside what it was off by in the mean, in its own
_LEARNS = 0.5  # of how much a velocity is off by a further one that is off alike, …
_ALIKE = 36.0  # … within this squared distance


@inner
def _since(touched: float, time: float) -> float:
    """Seconds since an axis was last observed; 0 if it never was."""
    return 0.0 if math.isnan(touched) else time - touched


@inner
def _freed(motion: Motion, a: int, c: int, gap: float, S: float) -> float:
    """Scale, squared, of component c of axis a if the highest rate changed ``gap`` seconds ago."""
    change = agility(motion.density[a], gap) * reach(motion.order, c, gap)
    return change * change + S


@inner
def slipped(motion: Motion, bank: Bank, a: int, time: float, sensor: int, r: float) -> float:
    """Variance of how a wrong velocity of axis a differs from what it was off by before.

    What the track's own velocity is off by is the same in both, but for what it changed meanwhile.
    """
    gap = _since(bank.heard[sensor, motion.axes + a], time)
    change = reach(motion.order, 1, gap)
    q: float = motion.density[a]
    return 2.0 * q * gap * change * change + _SLIPPED * r


@lean_helper
def swift(
    motion: Motion, bank: Bank, k: int, c: int, z: FloatArray, variance: FloatArray, time: float
) -> float:
    """Log-density of an observed component c after a manoeuvre; NaN where there is no time for one.

    Component 0 is the position, 1 the velocity; ``z`` and ``variance`` (axes,) are those of it.
    """
    square = longest = 0.0
    volume = 1.0
    seen = 0
    for a in range(motion.axes):
        if math.isnan(z[a]):
            continue
        nu = z[a] - bank.mean[k, a, c]
        if c == 0:
            nu = wrapped(nu, motion.period)
        gap = _since(bank.touched[k, a], time)
        longest = max(longest, gap)
        free = _freed(motion, a, c, gap, bank.covariance[k, a, c, c] + variance[a])
        square += nu * nu / free
        volume *= free
        seen += 1
    return wild_product(square, volume, seen) if longest > 0.0 else np.nan


@lean_helper
def learn_slip(
    motion: Motion,
    bank: Bank,
    k: int,
    z: FloatArray,
    variance: FloatArray,
    time: float,
    sensor: int,
) -> None:
    """Remember what a wrong velocity of hypothesis k is off by, in the mean of those alike."""
    d, distance = motion.axes, 0.0
    for a in range(d):
        if not math.isnan(z[d + a]):
            off = z[d + a] - bank.mean[k, a, 1] - bank.slip[k, a]
            distance += off * off / slipped(motion, bank, a, time, sensor, variance[d + a])
    alike = (bank.faulty[k] >> sensor) & 1 != 0 and distance < _ALIKE
    for a in range(d):
        if not math.isnan(z[d + a]):
            off = z[d + a] - bank.mean[k, a, 1] - bank.slip[k, a]
            bank.slip[k, a] += _LEARNS * off if alike else off
