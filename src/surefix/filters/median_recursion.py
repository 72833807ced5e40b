"""A robust recursion on medians: predict with a median velocity, gate by a median scale.

Each axis on its own, samples at equal steps; a missing sample is NaN and keeps its step. With
running medians (`surefix.cleaning.running_median`) over the last m samples, K the gain and c the
gate:

    v̂ = med Δy,   ŷ = x̂ + v̂,   r = y − ŷ,   s = 1.4826 med |r|,
    x̂ = ŷ + K r  where |r| ≤ c s,  else  x̂ = ŷ.

Medians reach up to the sample before, so v̂, ŷ and the gate are a prediction. Three forms:

``printed``
    First differences, and every sample enters the medians. The median of 38 first differences of
    white noise σ is wrong by about 0.28 σ a sample, and so is every step of dead reckoning: after a
    few rejected samples on end the state has left its own gate.
``repeated-median``
    The velocity is the repeated median of the slopes between all pairs of samples
    (`surefix.robust.repeated_median`): breakdown point one half, at O(m²) a sample.
``feedback``
    Differences over h ≈ m/2 samples, divided by h: wrong by about 0.02 σ a sample, at the O(log m)
    of a running median. A rejected or missing sample enters the medians as its prediction, so that
    no burst reaches them.

The last would believe its own prediction for ever after a true jump. Hence its promise: **a burst
of up to L samples is survived, and after more than L rejected samples on end the state restarts**
at the repeated-median line through them. All forms begin so, too, over their first m samples.

The model ``cv`` is a straight line. ``ca`` carries the velocity on from the middle of the window,
to which its median belongs, with the median of the second differences over h ≈ m/3.

Source: paper 004, section 2.3; its equations 7–11 are lost, docs/papers/radar.md says how they were
read. Siegel 1982, *Robust regression using repeated medians*, Biometrika 69, 242–244.
"""

from __future__ import annotations

from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surefix.cleaning.running_median import SortedWindow, middle, push, sorted_window
from surefix.errors import OptionsError
from surefix.jit import helper, kernel
from surefix.robust.repeated_median import fit_line
from surefix.types import BoolArray, FloatArray, IntArray, Verdict

__all__ = [
    "FORMS",
    "MedianRecursion",
    "MedianState",
    "Recursed",
    "filter_medians",
    "median_recursion",
    "start_medians",
]

FORMS: Final = ("printed", "repeated-median", "feedback")
"""Readings of the recursion; a `MedianRecursion` holds the index."""

_T = TypeVar("_T", np.float64, np.int64, np.bool_)
_SCALE: Final = 1.4826022185056018  # σ of a normal distribution over its median absolute deviation
_REPEATED, _FEEDBACK = FORMS.index("repeated-median"), FORMS.index("feedback")
_USED, _REJECTED, _MISSING = int(Verdict.USED), int(Verdict.REJECTED), int(Verdict.MISSING)


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
    """

    form: int
    order: int
    window: int
    lag: int
    gain: float
    gate: float
    longest_burst: int
    floor: float


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


def median_recursion(
    form: str = "feedback",
    *,
    model: str = "cv",
    window: int = 39,
    lag: int | None = None,
    gain: float | None = None,
    gate: float = 4.0,
    longest_burst: int = 50,
    floor: float = 0.0,
) -> MedianRecursion:
    """Settle the settings.

    Parameters
    ----------
    form
        One of ``FORMS``.
    model
        ``cv`` or ``ca``; the repeated median only knows ``cv``.
    window
        Samples m, at least 5. Not longer than the target keeps its velocity: 2 s in paper 004.
    lag
        Samples h between the ends of a difference. By default 1 if printed; else m/2, or m/3 for
        ``ca``.
    gain
        K in 0 … 1. By default 0.1, but 0.4 for the printed form and 0.3 for ``ca``, whose
        velocities are too noisy for less.
    gate
        c in standard deviations, above 0.
    longest_burst
        L, the rejected samples on end that the form ``feedback`` survives, at least 1. The other
        forms need no restart: after a jump their scale grows until they follow.
    floor
        Least scale, in the unit of the samples: half a digit of quantised samples, say.

    Raises
    ------
    OptionsError
        An option is out of its range, or the window is too short for the lag.
    """
    if form not in FORMS:
        raise OptionsError(f"form {form!r}", f"one of {', '.join(FORMS)}")
    if model not in ("cv", "ca"):
        raise OptionsError(f"model {model!r}", "cv or ca")
    if model == "ca" and form == "repeated-median":
        raise OptionsError("model 'ca' of repeated medians", "cv", "use the form feedback")
    order, printed = (2 if model == "cv" else 3), form == "printed"
    lag = (1 if printed else window // order) if lag is None else lag
    gain = (0.4 if printed else 0.1 if order == 2 else 0.3) if gain is None else gain
    if not window >= 5 or not 1 <= lag * (order - 1) < window:
        raise OptionsError(
            f"window {window}, lag {lag}", "a window of at least 5 samples, longer than its lags"
        )
    if not 0.0 < gain <= 1.0 or not gate > 0.0 or not 0.0 <= floor < np.inf or longest_burst < 1:
        raise OptionsError(
            f"gain {gain}, gate {gate}, floor {floor}, longest burst {longest_burst}",
            "0 < gain ≤ 1, gate > 0, floor ≥ 0 and a longest burst of at least 1",
        )
    code = FORMS.index(form)
    promise = longest_burst if code == _FEEDBACK else 0
    return MedianRecursion(code, order, window, lag, gain, gate, promise, floor)


def start_medians(options: MedianRecursion, axes: int = 1) -> tuple[MedianState, ...]:
    """Make the states of as many axes, before the first sample."""
    m, h = options.window, options.lag
    return tuple(
        MedianState(
            np.full(1, np.nan),
            np.zeros(3, np.int64),
            np.full(m, np.nan),
            np.full(m, np.nan),
            sorted_window(m - h),
            sorted_window(max(m - 2 * h, 1)),
            sorted_window(m),
        )
        for _ in range(axes)
    )


def filter_medians(
    options: MedianRecursion, values: ArrayLike, states: tuple[MedianState, ...] | None = None
) -> tuple[tuple[MedianState, ...], Recursed]:
    """Run the recursion over a series; one call over it and one per sample give the same bits.

    Parameters
    ----------
    options
        From `median_recursion`.
    values
        (n,) or (n, axes) samples at equal steps in any unit; NaN is missing.
    states
        One per axis, from `start_medians` or an earlier call; not modified. None to begin.

    Returns
    -------
    states, recursed
        The states after the series, and what was found.

    Raises
    ------
    OptionsError
        Not as many states as axes.

    Examples
    --------
    >>> _, seen = filter_medians(median_recursion(window=5), [0.0, 1.1, 1.9, 3.0, 4.1, 50.0, 6.0])
    >>> seen.estimate.round(1).tolist(), int(seen.verdict[5])
    ([0.0, 1.1, 1.9, 3.0, 4.1, 5.0, 6.1], 2)
    """
    given = np.asarray(values, dtype=np.float64)
    columns = np.atleast_2d(given.T)
    states = start_medians(options, len(columns)) if states is None else states
    if len(states) != len(columns):
        raise OptionsError(f"{len(states)} states for {len(columns)} axes", "one state per axis")
    after = tuple(state.copy() for state in states)
    shape = columns.shape
    found = Recursed(
        np.full(shape, np.nan),
        np.full(shape, np.nan),
        np.full(shape, np.nan),
        np.full(shape, np.nan),
        np.zeros(shape, np.int64),
        np.zeros(shape, np.bool_),
    )
    for i, state in enumerate(after):
        _run(options, np.ascontiguousarray(columns[i]), state, found, i)
    return after, Recursed(
        _shaped(found.estimate, given),
        _shaped(found.rate, given),
        _shaped(found.residual, given),
        _shaped(found.scale, given),
        _shaped(found.verdict, given),
        _shaped(found.restart, given),
    )


def _shaped(rows: NDArray[_T], like: FloatArray) -> NDArray[_T]:
    return np.ascontiguousarray(rows.T).reshape(like.shape)


@kernel
def _run(
    options: MedianRecursion, values: FloatArray, state: MedianState, out: Recursed, i: int
) -> None:
    """Filter one axis: row i of ``out``."""
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
        raw[at % m] = y
        tally[0] += 1
        if at < m:
            _restart(options, state, at + 1)
        rate = _rate(options, tally[0], raw, first, second)
        predicted = level[0] if at < m else level[0] + rate
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
                _restart(options, state, min(tally[2], m))
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
        # the newest sample is not yet known when the state is predicted
        return fit_line(_last(raw, seen - 1, options.window))[1]
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
def _restart(options: MedianRecursion, state: MedianState, count: int) -> None:
    """Begin anew at the repeated-median line through the last ``count`` samples.

    The form ``feedback`` fills the windows with what is near the line, and else with the line.
    """
    m, seen = options.window, state.tally[0]
    samples = _last(state.raw, seen, m)
    level, slope = fit_line(samples[m - count :])
    line = level + slope * np.arange(1.0 - m, 1.0)
    off = np.abs(samples - line)
    off[: m - count] = np.nan
    for k in range(m):
        push(state.size, off[k])
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
    state.level[0] = level
    state.tally[1], state.tally[2] = 0, 0
