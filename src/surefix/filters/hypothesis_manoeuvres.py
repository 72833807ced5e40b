"""Kernels on what velocities tell of manoeuvres, and on velocities that are wrong on end."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import Bank, Prior
from surefix.filters.hypothesis_axis import agility, reach
from surefix.filters.hypothesis_density import wild_product, wrapped
from surefix.filters.records import Motion
from surefix.jit import inner, lean_helper
from surefix.types import FloatArray

__all__ = ["belied", "learn_slip", "slipped", "swift"]

_ALIKE = 36.0  # squared distance within which a wrong velocity is off as the one before was


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
def slipped(
    motion: Motion, prior: Prior, bank: Bank, k: int, a: int, time: float, sensor: int
) -> tuple[float, float]:
    """What velocities of axis a that are off alike would show now, and its variance.

    It is the track's own velocity and what they are off by, and changes as the former does. It is
    known from them alone, whatever fixes say meanwhile of how much of it is which. Where fixes may
    be in a drag, what velocities are off by must stay when the track leaves them for the fixes.
    """
    gap = _since(bank.heard[sensor, motion.axes + a], time)
    change = reach(motion.order, 1, gap)
    q: float = motion.density[a]
    if prior.drag > 0.0:
        off, r = bank.slip[k, a, 2], bank.slip[k, a, 1]
        return bank.mean[k, a, 1] + off, 2.0 * q * gap * change * change + 0.5 * r
    level, variance = bank.slip[k, a, 0], bank.slip[k, a, 1] + q * gap * change * change
    if motion.order > 2:
        level += gap * bank.mean[k, a, 2]
        variance += gap * gap * bank.covariance[k, a, 2, 2]
    return level, variance


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
def belied(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    k: int,
    z: FloatArray,
    time: float,
    sensor: int,
) -> float:
    """How much less likely a manoeuvre that only a fix shows makes the velocities left out since.

    They were judged by the velocity before it. After it they would be off by as much more, and yet
    just so that nothing seems to have happened: on the logarithmic scale, at most 0.
    """
    d, b = motion.axes, bank
    before = after = 0.0
    seen = 0
    for a in range(d):
        gap = _since(b.touched[k, a], time)
        if math.isnan(z[a]) or not gap > 0.0:
            continue
        heard = (b.faulty[k] >> sensor) & 1 != 0 and not math.isnan(z[d + a])
        for s in range(b.heard.shape[0] if b.faulty[k] != 0 and not heard else 0):
            heard = heard or ((b.faulty[k] >> s) & 1 != 0 and b.heard[s, d + a] > b.touched[k, a])
        if not heard:
            continue
        nu = wrapped(z[a] - b.mean[k, a, 0], motion.period)
        change = nu * reach(motion.order, 1, gap) / reach(motion.order, 0, gap)
        off = b.slip[k, a, 0] - b.mean[k, a, 1]
        w = prior.spread[d + a] ** 2 + b.slip[k, a, 1] + b.covariance[k, a, 1, 1]
        before += off * off / w
        after += (off - change) ** 2 / w
        seen += 1
    return min(0.5 * (seen + 1) * (math.log1p(before) - math.log1p(after)), 0.0)


@lean_helper
def learn_slip(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    k: int,
    z: FloatArray,
    variance: FloatArray,
    time: float,
    sensor: int,
) -> None:
    """Remember what wrong velocities of hypothesis k show, in the mean of those off alike."""
    d, distance = motion.axes, 0.0
    for a in range(d):
        if not math.isnan(z[d + a]):
            level, P = slipped(motion, prior, bank, k, a, time, sensor)
            distance += (z[d + a] - level) ** 2 / (P + variance[d + a])
    alike = (bank.faulty[k] >> sensor) & 1 != 0 and distance < _ALIKE
    for a in range(d):
        if not math.isnan(z[d + a]):
            level, P = slipped(motion, prior, bank, k, a, time, sensor)
            r = variance[d + a]
            gain = P / (P + r) if alike else 1.0
            if prior.drag > 0.0:
                gain, r = 0.5 if alike else 1.0, r / (0.5 if alike else 1.0)
            bank.slip[k, a, 0] = level + gain * (z[d + a] - level)
            bank.slip[k, a, 1] = gain * r
            bank.slip[k, a, 2] = bank.slip[k, a, 0] - bank.mean[k, a, 1]
        elif not alike:
            spread = prior.spread[d + a]
            bank.slip[k, a, 0], bank.slip[k, a, 2] = bank.mean[k, a, 1], 0.0
            bank.slip[k, a, 1] = bank.covariance[k, a, 1, 1] + spread * spread
