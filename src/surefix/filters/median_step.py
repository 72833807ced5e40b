"""Kernel of `surefix.filters.median_recursion`, and the records it works on."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from surefix.cleaning.running_median import SortedWindow, middle, push
from surefix.jit import helper, kernel
from surefix.robust.repeated_median import fit_line
from surefix.types import BoolArray, FloatArray, IntArray, Verdict

__all__ = ["FORMS", "MedianRecursion", "MedianState", "Recursed", "run"]

FORMS: Final = ("printed", "repeated-median", "feedback")
"""Readings of the recursion; a `MedianRecursion` holds the index."""

_SCALE: Final = 1.4826022185056018  # σ of a normal distribution over its median absolute deviation
_USED, _REJECTED, _MISSING = int(Verdict.USED), int(Verdict.REJECTED), int(Verdict.MISSING)
_REPEATED, _FEEDBACK = FORMS.index("repeated-median"), FORMS.index("feedback")


class MedianRecursion(NamedTuple):
    """Settings of the recursion, made by `median_recursion`.

    Parameters
    ----------
    form
        Index into ``FORMS``.
    order
        2 constant velocity, 3 constant acceleration.
    window, lag
        Samples m in the window, and h between the ends of a difference.
    gain, gate
        K of the update and c of the gate.
    longest_burst
        Rejected samples on end that are survived; 0 never restarts.
    floor
        Least scale s, in the unit of the samples.
    period
        One turn for angles, else 0: samples are laid beside the estimate.
    """

    form: int
    order: int
    window: int
    lag: int
    gain: float
    gate: float
    longest_burst: int
    floor: float
    period: float = 0.0


class MedianState(NamedTuple):
    """All the recursion remembers of one axis; changed in place by the kernel alone.

    Parameters
    ----------
    level
        (1,) estimate x̂; NaN before the first sample.
    tally
        (3,) samples since the first, rejected samples on end, samples since the first of those.
    raw, clean
        (m,) last samples in a ring, as observed and as they entered the medians.
    first, second, size
        Windows of the first and second differences over h, and of the size of the residuals.
    """

    level: FloatArray
    tally: IntArray
    raw: FloatArray
    clean: FloatArray
    first: SortedWindow
    second: SortedWindow
    size: SortedWindow

    def copy(self) -> MedianState:
        """Copy the state, so that the copy can go its own way."""
        return MedianState(
            self.level.copy(), self.tally.copy(), self.raw.copy(), self.clean.copy(),
            self.first.copy(), self.second.copy(), self.size.copy(),
        )  # fmt: skip


class Recursed(NamedTuple):
    """What the recursion found at each sample; arrays of the shape of the samples.

    Parameters
    ----------
    estimate
        x̂, in the unit of the samples; NaN before the first sample.
    rate
        v̂ a step, as used for the prediction.
    residual
        r = y − ŷ, before the update; NaN where the sample is missing.
    scale
        s after the sample; too small while the first few samples come in.
    verdict
        Codes of `surefix.types.Verdict`: used, rejected or missing.
    restart
        Where the state restarted because more than L samples on end had been rejected.
    """

    estimate: FloatArray
    rate: FloatArray
    residual: FloatArray
    scale: FloatArray
    verdict: IntArray
    restart: BoolArray


@kernel
def run(
    options: MedianRecursion, values: FloatArray, state: MedianState, out: Recursed, i: int
) -> None:
    """Filter one axis, row i of ``out``; ``state`` is overwritten."""
    m, h, floor = options.window, options.lag, options.floor
    level, tally, raw, clean = state.level, state.tally, state.raw, state.clean
    first, second, size = state.first, state.second, state.size
    feedback = options.form == _FEEDBACK
    for k in range(len(values)):
        y = values[k]
        missing = np.isnan(y)
        out.verdict[i, k] = _MISSING if missing else _USED
        if missing and tally[0] == 0:
            continue
        at = tally[0]
        if options.period > 0.0 and at > 0:
            y -= options.period * np.rint((y - level[0]) / options.period)
        raw[at % m] = y
        tally[0] += 1
        if at < m:
            rate = _restart(options, state, at + 1, at == m - 1)
            predicted = level[0]
        else:
            rate = _rate(options, tally[0], raw, first, second)
            predicted = level[0] + rate
        residual = y - predicted
        out.rate[i, k], out.residual[i, k] = rate, residual
        if at >= m:
            used = abs(residual) <= options.gate * max(_SCALE * middle(size), floor)
            level[0] = predicted + options.gain * residual if used else predicted
            believed = used or not feedback
            if believed and not missing:
                push(size, abs(residual))
            _remember(clean, first, second, h, options.order, y if believed else predicted, at)
            if used:
                tally[1], tally[2] = 0, 0
            elif not missing or tally[1] > 0:
                tally[1] += 0 if missing else 1
                tally[2] += 1
            if not used and not missing:
                out.verdict[i, k] = _REJECTED
            if options.longest_burst > 0 and tally[1] > options.longest_burst:
                _restart(options, state, min(tally[2], m), True)
                out.restart[i, k] = True
                out.verdict[i, k] = _USED
        out.estimate[i, k] = level[0]
        out.scale[i, k] = max(_SCALE * middle(size), floor)


@helper
def _rate(
    options: MedianRecursion, seen: int, raw: FloatArray, first: SortedWindow, second: SortedWindow
) -> float:
    """Velocity a step: the median of differences, carried on to now, or the repeated median."""
    if options.form == _REPEATED:
        return fit_line(_last(raw, seen - 1, options.window - 1))[1]
    rate = middle(first) / options.lag
    if np.isnan(rate):
        return 0.0
    if options.order == 3:
        bent = middle(second)
        if not np.isnan(bent):
            rate += 0.5 * options.window * bent / (options.lag * options.lag)
    return rate


@helper
def _last(raw: FloatArray, seen: int, count: int) -> FloatArray:
    """The last samples of the ring, in the order of time; NaN before the first."""
    out = np.full(count, np.nan)
    for i in range(min(count, seen)):
        out[count - 1 - i] = raw[(seen - 1 - i) % len(raw)]
    return out


@helper
def _remember(
    clean: FloatArray,
    first: SortedWindow,
    second: SortedWindow,
    lag: int,
    order: int,
    value: float,
    at: int,
) -> None:
    """Let sample number ``at`` into the windows of the differences."""
    m = len(clean)
    clean[at % m] = value
    before = clean[(at - lag) % m]
    push(first, value - before)
    if order == 3:
        push(second, value - 2.0 * before + clean[(at - 2 * lag) % m])


@helper
def _restart(options: MedianRecursion, state: MedianState, count: int, fill: bool) -> float:
    """Begin anew at the repeated-median line through the last ``count`` samples; gives its slope.

    If ``fill``, the windows are filled: the form ``feedback`` takes what is near the line, and else
    the line itself.
    """
    m, seen = options.window, state.tally[0]
    samples = _last(state.raw, seen, m)
    level, slope = fit_line(samples[m - count :])
    line = level + slope * np.arange(1.0 - m, 1.0)
    off = np.abs(samples - line)
    off[: m - count] = np.nan
    for k in range(m):
        push(state.size, off[k])
    state.level[0] = level
    state.tally[1], state.tally[2] = 0, 0
    if not fill:
        return slope
    gate = options.gate * max(_SCALE * middle(state.size), options.floor)
    for k in range(m):
        if options.form == _FEEDBACK and not off[k] <= gate:
            samples[k], off[k] = line[k], np.nan
    for k in range(m):
        push(state.size, off[k])
        _remember(
            state.clean, state.first, state.second, options.lag, options.order,
            samples[k], seen - m + k,
        )  # fmt: skip
    return slope
