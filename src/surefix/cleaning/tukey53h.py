"""Tukey's 53H: medians of five, of three, a Hanning mean, and a threshold.

    x₁(i) = med{x(i−2) … x(i+2)},   x₂(k) = med{x₁(k−1), x₁(k), x₁(k+1)},
    x₃(l) = ¼x₂(l−1) + ½x₂(l) + ¼x₂(l+1);   x(l) becomes x₃(l) where |x(l) − x₃(l)| > T

(paper 003, section 1; the last line and the threshold test reconstructed). x₃(l) is made of
x(l−4) … x(l+4): a sample is decided four samples later, and the first and the last four need
something beyond the ends of the series (``ends``):

- ``none``: they are kept as they are;
- ``reversal``: the paper's *improved* 53H, which smooths the series with its first, or last, eight
  samples in reversed order. Sample 1 then lies beside sample 9, which biases a ramp by 3.5, 1, ¼
  and 0 samples of its slope, from the end inwards. Decided as soon as sample 12 is there;
- ``odd``: the series is continued by odd reflection, 2x(1) − x(1+j): no bias on a ramp; but a wild
  end sample is its own witness, is kept, and drags its neighbour along;
- ``line``: odd reflection about the end of a repeated-median line through the five end samples: no
  bias on a ramp either, and a wild end sample is found like any other.

NaN is missing: it has no say in the medians and stays missing. The median of an even number of
samples is the mean of the middle two.

What no threshold mends: a median of five gives way to three wild samples of five. Bursts of three
and more that agree with each other are kept; see `surefix.cleaning.plausibility` for what stops
them.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from surefix.cleaning.replacement import RECENT, Replaced, continued, edited
from surefix.cleaning.window_medians import narrow_medians
from surefix.errors import OptionsError
from surefix.types import FloatArray

__all__ = ["DELAY", "Ends", "State53H", "push", "tukey53h"]

DELAY = 4
"""Samples after which a sample is decided."""

Ends = Literal["none", "reversal", "odd", "line"]

_REACH = 2 * DELAY + 1
_END = 5  # samples of the line; one more than are reflected
_TURNED = 8  # samples that the paper reverses
_HELD = _TURNED + DELAY


class State53H(NamedTuple):
    """What is carried from sample to sample; ``State53H()`` begins a series.

    Parameters
    ----------
    x, turned, threshold
        (h,) the last samples, at most 12, as measured and continued across the seam, and their
        thresholds.
    decided
        How many of them are decided.
    begun
        Whether earlier samples were let go.
    recent
        (5,) what angles are continued from.
    """

    x: FloatArray = np.empty(0)
    turned: FloatArray = np.empty(0)
    threshold: FloatArray = np.empty(0)
    decided: int = 0
    begun: bool = False
    recent: FloatArray = np.full(RECENT, np.nan)


def tukey53h(
    x: ArrayLike, threshold: ArrayLike, *, ends: Ends = "line", period: float = 0.0
) -> Replaced:
    """Clean a whole series.

    Parameters
    ----------
    x
        (n,) samples in any unit; NaN is missing.
    threshold
        Scalar or (n,), in the unit of ``x``, not negative; `surefix.cleaning.thresholds` derives it
        from what the vessel can do. A sample whose threshold is NaN is kept.
    ends
        How the first and the last four samples are judged: ``none``, ``reversal``, ``odd`` or
        ``line``.
    period
        One turn for angles, else 0. Replaced angles lie within one turn from 0.

    Raises
    ------
    OptionsError
        A negative threshold, a negative period, or no such treatment of the ends.

    Examples
    --------
    >>> tukey53h([0.0, 1.0, 2.0, 90.0, 4.0, 5.0, 6.0, 7.0, 8.0], 3.0).value.round(2).tolist()
    [0.0, 1.0, 2.0, 3.75, 4.0, 5.0, 6.0, 7.0, 8.0]
    """
    return push(x, threshold, State53H(), ends=ends, period=period, final=True)[0]


def push(
    x: ArrayLike,
    threshold: ArrayLike,
    state: State53H,
    *,
    ends: Ends = "line",
    period: float = 0.0,
    final: bool = False,
) -> tuple[Replaced, State53H]:
    """Clean the next samples on-line: one by one or in parts of any size, with the same numbers.

    Parameters
    ----------
    x, threshold, ends, period
        As for `tukey53h`; ``x`` may be empty, and ``ends`` and ``period`` are those of the first
        call.
    state
        From the call before, or ``State53H()``.
    final
        True with the last samples: what was held back is decided.

    Returns
    -------
    cleaned
        The samples decided now, in order; all but the last four that were given so far (with
        ``reversal`` none before the twelfth).
    state
        For the next call; after the final one a fresh one.

    Raises
    ------
    OptionsError
        As `tukey53h`.
    """
    new, limit = _checked(x, threshold, ends, period)
    new_turned, recent = continued(new, period, state.recent)
    raw = np.concatenate([state.x, new])
    turned = np.concatenate([state.turned, new_turned])
    limits = np.concatenate([state.threshold, limit])
    n = len(raw)
    if final:
        last = n
    else:
        wait = ends == "reversal" and not state.begun and n < _HELD
        last = state.decided if wait else max(n - DELAY, state.decided)
    estimate = _estimate(turned, ends, first=not state.begun, final=final)
    part = slice(state.decided, last)
    cleaned = edited(raw[part], turned[part], estimate[part], limits[part], period)
    if final:
        return cleaned, State53H()
    drop = max(n - _HELD, 0)
    held = State53H(
        raw[drop:], turned[drop:], limits[drop:], last - drop, state.begun or drop > 0, recent
    )
    return cleaned, held


def _checked(
    x: ArrayLike, threshold: ArrayLike, ends: str, period: float
) -> tuple[FloatArray, FloatArray]:
    """Samples and one threshold for each."""
    if ends not in get_args(Ends):
        raise OptionsError(f"ends {ends!r}", f"one of {', '.join(get_args(Ends))}")
    if not period >= 0.0:
        raise OptionsError(f"period {period}", "one turn of an angle, or 0")
    limit = np.asarray(threshold, dtype=np.float64)
    if np.any(limit < 0.0):
        raise OptionsError(f"threshold {np.min(limit)}", "a threshold from 0")
    new = np.atleast_1d(np.asarray(x, dtype=np.float64))
    return new, np.broadcast_to(limit, new.shape)


def _estimate(turned: FloatArray, ends: Ends, *, first: bool, final: bool) -> FloatArray:
    """Give x₃ of every sample that has one; ``first`` and ``final`` say which ends are ends."""
    n = len(turned)
    left = _beyond(turned, ends) if first else np.empty(0)
    right = _beyond(turned[::-1], ends)[::-1] if final else np.empty(0)
    estimate = np.full(n, np.nan)
    inner = _x3(np.concatenate([left, turned, right]))
    begin = DELAY - len(left)
    estimate[begin : begin + len(inner)] = inner
    if ends == "reversal" and n >= _HELD:
        if first:
            estimate[:DELAY] = _reversed_end(turned)
        if final:
            estimate[n - DELAY :] = _reversed_end(turned[::-1])[::-1]
    return estimate


def _beyond(turned: FloatArray, ends: Ends) -> FloatArray:
    """Four samples before the first one by odd reflection, or none."""
    if ends not in ("odd", "line") or not len(turned):
        return np.empty(0)
    pivot = turned[0] if ends == "odd" else _line_end(turned[:_END])
    beyond = np.full(DELAY, np.nan)
    known = turned[1:_END]
    beyond[DELAY - len(known) :] = (2.0 * pivot - known)[::-1]
    return beyond


def _line_end(x: FloatArray) -> float:
    """Value at the first sample of the repeated-median line (Siegel 1982) through the samples."""
    at = np.flatnonzero(np.isfinite(x)).astype(np.float64)
    y = x[np.isfinite(x)]
    if len(y) < 2:
        return float(y[0]) if len(y) else float("nan")
    run, rise = at[:, None] - at, y[:, None] - y
    others = ~np.eye(len(y), dtype=np.bool_)
    each = (rise[others] / run[others]).reshape(len(y), -1)
    slope = np.median(np.median(each, axis=1))
    return float(np.median(y - slope * at))


def _reversed_end(x: FloatArray) -> FloatArray:
    """Give x₃ of the first four samples by the paper: the first eight in reversed order."""
    turned = np.concatenate([x[_TURNED - 1 :: -1], x[_TURNED:_HELD]])
    return _x3(turned)[::-1]


def _x3(x: FloatArray) -> FloatArray:
    """Give x₃ of the samples that have four neighbours on both sides, (n − 8,)."""
    if len(x) < _REACH:
        return np.empty(0)
    x2 = narrow_medians(narrow_medians(x, 5), 3)
    return 0.25 * x2[:-2] + 0.5 * x2[1:-1] + 0.25 * x2[2:]
