"""The second half of the ship's chain: the sensors of one quantity become one value, without jumps.

In each quantity one sensor is the most trusted. The others are *aligned* to it: their offset from
it, and its drift, come from running medians of the differences, so they can stand in for it. The
aligned values z_s are combined by inverse variance,

    y = Σ w_s z_s / Σ w_s,   w_s = 1/σ_s²,   σ_y² = 1/Σ w_s

(angles on the circle, about a prediction). Where sensors contradict each other, the minority is
left out; two sensors have the prediction as third voter, and a single one is held against it. When
a sensor fails, returns, is left out or jumps alone, the combination before and after would differ;
that difference is carried over and fades out, and meanwhile the record is marked as doubtful and
σ_y contains it.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from surefix.cleaning.hampel import MAD_TO_SIGMA
from surefix.cleaning.running_median import running_median
from surefix.geo.angle import wrap
from surefix.jit import helper, kernel
from surefix.types import FloatArray, IntArray

__all__ = ["Aligned", "Fused", "Quality", "align", "fuse"]

_FORGET = 0.02  # per epoch, of how far predictions were off
_LEARNT = 10  # epochs after which a prediction may be held against a sensor
_MEDIAN_LOSS = 0.5 * np.pi  # variance of a median over that of a mean, normal noise


class Quality(IntEnum):
    """How a value of the integrated record is marked."""

    VALID = 0
    DOUBTFUL = 1
    INVALID = 2


class Aligned(NamedTuple):
    """Sensors of one quantity on common epochs, the most trusted first.

    Parameters
    ----------
    value
        (n, s) in the unit of the quantity, offsets removed; NaN where there is none.
    offset
        (n, s) what was removed.
    variance
        (n, s) of noise and offset.
    agreement
        (n,) robust variance of the differences between the sensors, 0 for one sensor.
    """

    value: FloatArray
    offset: FloatArray
    variance: FloatArray
    agreement: FloatArray


class Fused(NamedTuple):
    """One quantity of the integrated record.

    Parameters
    ----------
    value, sigma
        (n,) and its standard deviation; NaN where there is none.
    sources
        (n,) bit s is set where sensor s was used.
    quality
        (n,) codes of `Quality`.
    """

    value: FloatArray
    sigma: FloatArray
    sources: IntArray
    quality: IntArray


def align(
    value: FloatArray, sigma: FloatArray, step: float, window: int, drift: float, period: float
) -> Aligned:
    """Remove from each sensor its offset from the first one.

    The offset now is extrapolated from running medians of the differences, b, and of their epochs,
    m: b(k) + (b(k) − b(k−W))/(m(k) − m(k−W)) · (now − m(k)), exact for an offset that changes
    steadily; the median alone would lag by half a window. A window holds the last W differences
    there were, however old: wrong ones among them stay the minority through an interruption.

    Parameters
    ----------
    value, sigma
        (n, s) on common epochs; NaN is missing.
    step
        s between epochs.
    window
        W, differences.
    drift
        Growth of the offset's standard deviation, per second that the differences are older than
        they would be without an interruption.
    period
        One turn for angles, else 0.
    """
    n = len(value)
    offset, variance, agreement = np.zeros_like(value), sigma**2, np.zeros(n)
    for s in range(1, value.shape[1]):
        difference = value[:, s] - value[:, 0]
        difference = wrap(difference, period) if period else difference
        at = np.flatnonzero(np.isfinite(difference))
        if not at.size:
            continue
        seen = difference[at]
        median = running_median(seen, window, centred=False)
        middle = running_median(at.astype(np.float64), window, centred=False)
        early = np.maximum(np.arange(at.size) - window, 0)
        rate = (median - median[early]) / np.maximum(middle - middle[early], 1.0)
        rate[:window] = 0.0
        now = median + rate * (at - middle)
        scale = MAD_TO_SIGMA * running_median(np.abs(seen - now), window, centred=False)
        latest = np.searchsorted(at, np.arange(n), side="right") - 1
        known = latest >= 0
        later = np.where(known, np.arange(n) - at[latest], 0)
        offset[:, s] = np.where(known, now[latest] + rate[latest] * later, 0.0)
        age = np.where(known, np.arange(n) - middle[latest] - 0.5 * (window - 1), 0.0)
        spread = np.where(known, scale[latest], 0.0) ** 2
        agreement = np.maximum(agreement, spread)
        variance[:, s] += (
            2.5 * _MEDIAN_LOSS * spread / window + (drift * step * np.maximum(age, 0.0)) ** 2
        )
    return Aligned(value - offset, offset, variance, agreement)


def fuse(
    aligned: Aligned, step: float, *, gate: float, fade_s: float, period: float, systematic: float
) -> Fused:
    """Combine aligned sensors epoch by epoch.

    Parameters
    ----------
    aligned
        From `align`.
    step
        s between epochs.
    gate
        Standard deviations at which a sensor contradicts the others.
    fade_s
        Time constant with which a carried-over difference fades out, s.
    period
        One turn for angles, else 0.
    systematic
        Standard deviation added to σ.
    """
    n = len(aligned.value)
    fused = Fused(
        np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, np.int64), np.full(n, 2, np.int64)
    )
    known = np.isfinite(aligned.value) & (aligned.variance > 0.0)
    z = np.where(known, aligned.value, np.nan)
    keep = float(np.exp(-step / fade_s))
    _combine(
        z, aligned.offset, aligned.variance, aligned.agreement, gate * gate, period, keep,
        fade_s / step, *fused,
    )  # fmt: skip
    total = np.sqrt(fused.sigma**2 + systematic**2)
    value = np.mod(fused.value, period) if period else fused.value
    return Fused(value, total, fused.sources, fused.quality)


@kernel
def _combine(
    z: FloatArray,
    offset: FloatArray,
    variance: FloatArray,
    agreement: FloatArray,
    gate2: float,
    period: float,
    keep: float,
    patience: float,
    y: FloatArray,
    sigma: FloatArray,
    sources: IntArray,
    quality: IntArray,
) -> None:
    """Fill ``y``, ``sigma``, ``sources`` and ``quality``; ``patience`` epochs bridge a gap."""
    n, s = z.shape
    here, before = np.full(s, np.nan), np.full(s, np.nan)
    votes, doubts = np.empty(s + 1), np.empty(s + 1)
    last, spread, rate, carry, missed, used, seen, gap = np.nan, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0
    for k in range(n):
        gap += 1.0
        if gap > patience:
            last, rate, carry, missed, used, seen = np.nan, 0.0, 0.0, 0.0, 0, 0
        expected = last + rate * gap  # of the mean; y is the mean and what is carried over
        present, reference = 0, expected
        for i in range(s):
            here[i] = z[k, i]
            if np.isnan(here[i]):
                continue
            if period > 0.0 and not np.isnan(reference):
                here[i] -= period * np.floor((here[i] - reference) / period + 0.5)
            if np.isnan(reference):
                reference = here[i]
            _vote(votes, doubts, present, here[i], variance[k, i])
            present += 1
        if present == 0:
            continue
        count = present
        if seen >= _LEARNT:
            _vote(votes, doubts, count, expected, spread + missed)
            count += 1
        low, high = (count - 1) // 2, count // 2
        centre, doubt = 0.5 * (votes[low] + votes[high]), max(doubts[low], doubts[high])
        if present == 1 and count == 2:
            centre, doubt = expected, spread + missed
        weight, total, chosen, dropped, best = 0.0, 0.0, 0, 0, -1
        for i in range(s):
            off = here[i] - centre
            if np.isnan(off):
                continue
            if best < 0 or abs(off) < abs(here[best] - centre):
                best = i
            if count > 1 and off * off > gate2 * (variance[k, i] + agreement[k] + doubt):
                dropped += 1
                continue
            weight += 1.0 / variance[k, i]
            total += here[i] / variance[k, i]
            chosen |= 1 << i
        if chosen == 0:
            weight, total = 1.0 / variance[k, best], here[best] / variance[k, best]
            chosen = 1 << best
        mean = total / weight
        changed = chosen != used or gap > 1.0 or dropped == present
        if not np.isnan(last):
            seen += 1
            off2 = (mean - expected) ** 2
            if seen > _LEARNT:  # jumps count as 3σ at most
                off2 = min(off2, 9.0 * (missed + 1.0 / weight))
            missed += max(_FORGET, 1.0 / seen) * (off2 - missed)
        if not np.isnan(last) and changed:
            moved, shared = 0.0, 0.0
            for i in range(s):
                both = (chosen & used) >> i & 1 and dropped < present
                if both and gap == 1.0 and not np.isnan(before[i]):
                    step = here[i] + offset[k, i] - before[i]
                    if period > 0.0:
                        step -= period * np.floor(step / period + 0.5)
                    moved += step / variance[k, i]
                    shared += 1.0 / variance[k, i]
            carry += (last + moved / shared if shared > 0.0 else expected) - mean
        if not np.isnan(last) and not changed:
            rate += max(0.1, 1.0 / seen) * ((mean - last) / gap - rate)
            carry *= keep
        y[k] = mean + carry
        sigma[k] = np.sqrt(1.0 / weight + carry * carry)
        sources[k] = chosen
        quality[k] = 1 if dropped > 0 or carry * carry * weight > 1.0 else 0
        last, spread, used, gap = mean, 1.0 / weight, chosen, 0.0
        before[:] = here + offset[k]


@helper
def _vote(votes: FloatArray, doubts: FloatArray, count: int, value: float, variance: float) -> None:
    """Insert a value and its variance into the first ``count`` votes, which rise."""
    place = count
    while place > 0 and votes[place - 1] > value:
        votes[place], doubts[place] = votes[place - 1], doubts[place - 1]
        place -= 1
    votes[place], doubts[place] = value, variance
