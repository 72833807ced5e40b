"""A robust recursion on medians: predict with a median velocity, gate by a median scale.

Each axis on its own, samples at equal steps; a missing sample is NaN and keeps its step. With
running medians (`surefix.cleaning.running_median`) over the last m samples, K the gain and c the
gate:

    v̂ = med Δy,   ŷ = x̂ + v̂,   r = y − ŷ,   s = 1.4826 med |r|,
    x̂ = ŷ + K r  where |r| ≤ c s,  else  x̂ = ŷ.

Medians reach up to the sample before, so v̂, ŷ and the gate are a prediction. Three forms:

``printed``
    First differences, and every sample enters the medians. The median of 38 first differences of
    white noise σ is wrong by about 0.16 σ a sample, and so is every step of dead reckoning: after
    some rejected samples on end the state has left its own gate.
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

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surefix.cleaning.running_median import sorted_window
from surefix.errors import OptionsError
from surefix.filters.median_step import FORMS, MedianRecursion, MedianState, Recursed, run
from surefix.types import FloatArray

__all__ = [
    "filter_medians",
    "median_recursion",
    "start_medians",
]

_T = TypeVar("_T", np.float64, np.int64, np.bool_)


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
    period: float = 0.0,
) -> MedianRecursion:
    """Settle the settings.

    Parameters
    ----------
    form
        ``printed``, ``repeated-median`` or ``feedback``.
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
    period
        One turn for angles, else 0. Estimates of angles go on beyond a turn.

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
    promise = longest_burst if form == "feedback" else 0
    return MedianRecursion(code, order, window, lag, gain, gate, promise, floor, period)


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
        run(options, np.ascontiguousarray(columns[i]), state, found, i)
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
