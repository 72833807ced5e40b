"""Cleaners that decide before the filter: what they would replace is left out of it.

Each series of numbers, one axis of one sensor, is judged by itself. An observation that the cleaner
would replace gets the weight 0 for its axis; the others go through the plain Kalman filter and
smoother, so that the track and its covariance come from what was really measured.

``53h``
    |x − x₃| > k₀ s with x₃ of `surefix.cleaning.tukey53h` (paper 003) and
    s² = max(s₃, σ)² + (¼ v Δ)². s₃ is the robust scale 1.4826 med|x − x₃| of the whole series and σ
    the noise of the sample; Δ is how much the longer step beside it exceeds the usual one and v the
    usual speed, for x₃ is a mean across the gap. Looks 4 samples ahead.
``hampel``
    |x − med| > k₀ max(s, σ) with med the running median of 7 samples and s = 1.4826 med|x − med|
    over 7 of them, each from its own median: the MAD of `surefix.cleaning.hampel`, from one median
    for the whole window, grows with the speed of the vehicle. Looks 6 samples ahead.
``median``
    The median recursion with feedback (paper 004; `surefix.filters.median_recursion`): the past
    alone decides, |r| > k₀ max(s, σ). Windows of 9 samples and a gain of ½, for a vehicle that
    turns; more than 20 rejected samples on end are believed. While the windows fill, a sample is
    held against the repeated-median line.

The first two see the order of the samples and not their times. The recursion supposes equal steps:
a longer step counts as so many usual ones (the median of the last 9), and after more than four of
them without a sample the recursion begins anew.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from surefix.cleaning.hampel import MAD_TO_SIGMA, hampel, rolling_scale
from surefix.cleaning.running_median import running_median
from surefix.cleaning.tukey53h import DELAY, tukey53h
from surefix.filters.median_recursion import filter_medians, median_recursion, start_medians
from surefix.filters.median_step import MedianRecursion, MedianState
from surefix.filters.records import Epochs, Motion, Recovery, TrackState
from surefix.types import BoolArray, FloatArray, IntArray, Verdict

__all__ = ["AHEAD", "THRESHOLDS", "Decided", "Decider", "Recursion", "decide", "look_ahead"]

_HAMPEL = 7  # samples in the window
_WINDOW = 9  # samples in the windows of the recursion, and steps whose median is the usual one
_GAIN = 0.5
_LONGEST = 20  # rejected samples on end after which the recursion believes them
_MISSED = _WINDOW // 2  # usual steps without a sample that it bridges

THRESHOLDS = {"53h": 4.0, "hampel": 4.0, "median": 5.0}
"""Names of the cleaners, and k₀ of each unless it is given."""
AHEAD = {"53h": DELAY, "hampel": 2 * (_HAMPEL // 2), "median": 0}
"""How many later samples each of them looks at."""


class Decider(NamedTuple):
    """A cleaner by its name in ``THRESHOLDS``, and its threshold k₀ in standard deviations."""

    method: str
    k0: float


class Recursion(NamedTuple):
    """Where the median recursion of one series stands.

    Parameters
    ----------
    settings, state
        The recursion, settled with the first sample.
    time
        s, of the last sample.
    steps
        (9,) s, the last steps; NaN before the first.
    """

    settings: MedianRecursion
    state: MedianState
    time: float
    steps: FloatArray


class Decided(NamedTuple):
    """State of a filter with a cleaner before it: ``Decided(start(…))`` has seen nothing.

    Parameters
    ----------
    track
        Of the filter.
    series
        Of the median recursions by sensor and component; no step modifies it.
    """

    track: TrackState
    series: dict[tuple[int, int], Recursion] = {}  # noqa: RUF012


class _Series(NamedTuple):
    """The known samples of one component from one sensor: (n,) each."""

    key: tuple[int, int]
    rows: IntArray
    time: FloatArray
    x: FloatArray
    sigma: FloatArray
    period: float


def decide(
    decider: Decider,
    motion: Motion,
    recovery: Recovery,
    epochs: Epochs,
    series: dict[tuple[int, int], Recursion],
) -> tuple[dict[tuple[int, int], Recursion], Epochs, FloatArray]:
    """Fix the weight 0 of every observation that the cleaner would replace.

    Parameters
    ----------
    decider
        Which cleaner.
    motion, recovery
        Of the filter behind it; every component must have its own group.
    epochs
        n observations. Weights that are fixed beforehand stay, and such samples are witnesses.
    series
        What the recursions remember from the epochs before; 53H and Hampel remember nothing and
        want the whole log at once.

    Returns
    -------
    series, epochs
        For the next call, and the epochs with weights.
    distance
        (n, groups) what was decided on: how far the observation lay from what the cleaner held it
        against, in standard deviations; NaN where there was no observation.
    """
    fixed, after = epochs.fixed.copy(), dict(series)
    distance = np.full_like(fixed, np.nan)
    for each in _all(motion, epochs):
        if decider.method == "53h":
            far = _by_53h(each, recovery.sigma_velocity)
            wild = far > decider.k0
        elif decider.method == "hampel":
            far = _by_hampel(each)
            wild = far > decider.k0
        else:
            after[each.key], far, wild = _by_medians(decider.k0, each, series.get(each.key))
        group = motion.group[each.key[1]]
        distance[each.rows, group] = far
        rows = each.rows[wild]
        fixed[rows, group] = np.where(np.isnan(fixed[rows, group]), 0.0, fixed[rows, group])
    return after, epochs._replace(fixed=fixed), distance


def look_ahead(decider: Decider, motion: Motion, epochs: Epochs) -> float:
    """Seconds after which the slowest series usually is decided."""
    count = AHEAD[decider.method]
    steps = [np.diff(each.time) for each in _all(motion, epochs)] if count else []
    return max((count * float(np.median(each)) for each in steps if len(each)), default=0.0)


def _all(motion: Motion, epochs: Epochs) -> list[_Series]:
    """Every series that has a sample."""
    n = len(epochs.time)
    sensor = epochs.sensor if len(epochs.sensor) else np.zeros(n, np.int64)
    out = []
    for number in np.unique(sensor).tolist():
        for c in range(2 * motion.axes):
            rows = np.flatnonzero((sensor == number) & np.isfinite(epochs.z[:, c]))
            if len(rows):
                sigma = np.sqrt(epochs.variance[rows, c])
                period = motion.period if c == 0 else 0.0
                x = np.ascontiguousarray(epochs.z[rows, c])
                out.append(_Series((number, c), rows, epochs.time[rows], x, sigma, period))
    return out


def _by_53h(series: _Series, speed: float) -> FloatArray:
    """Distance from x₃ in standard deviations."""
    off = _off(series, tukey53h(series.x, np.inf, period=series.period).estimate)
    scale = MAD_TO_SIGMA * np.median(np.abs(off))
    steps = np.diff(series.time)
    longer = np.fmax(np.append(steps, 0.0), np.append(0.0, steps))
    usual = np.median(steps) if len(steps) else 0.0
    across = 0.25 * speed * np.fmax(longer - usual, 0.0)
    return np.asarray(np.abs(off) / np.hypot(np.fmax(scale, series.sigma), across))


def _by_hampel(series: _Series) -> FloatArray:
    """Distance from the running median in standard deviations."""
    off = _off(series, hampel(series.x, window=_HAMPEL, period=series.period).estimate)
    scale = rolling_scale(off, _HAMPEL, centred=True)
    return np.asarray(np.abs(off) / np.fmax(scale, series.sigma))


def _off(series: _Series, estimate: FloatArray) -> FloatArray:
    """How far the samples lie from their estimates; angles within half a turn."""
    off = series.x - estimate
    return off - series.period * np.rint(off / series.period) if series.period > 0.0 else off


def _by_medians(
    k0: float, series: _Series, before: Recursion | None
) -> tuple[Recursion, FloatArray, BoolArray]:
    """Distance from the median recursion's prediction, and what it rejects."""
    if before is None:
        settings = median_recursion(
            window=_WINDOW,
            gain=_GAIN,
            gate=k0,
            longest_burst=_LONGEST,
            floor=float(series.sigma[0]),
            period=series.period,
        )
        before = Recursion(settings, start_medians(settings)[0], np.nan, np.full(_WINDOW, np.nan))
    settings, state = before.settings, before.state
    steps = np.concatenate([before.steps, np.diff(series.time, prepend=before.time)])
    missed = _missed(steps)
    wild, far = np.zeros(len(series.x), np.bool_), np.empty(len(series.x))
    anew = np.flatnonzero(missed > _MISSED).tolist()
    for first, last in pairwise([0, *anew, len(wild)]):
        if first == last:
            continue
        at = np.cumsum(missed[first:last] + 1) - 1
        if missed[first] > _MISSED:
            state = start_medians(settings)[0]
            at -= missed[first]
        filled = np.full(at[-1] + 1, np.nan)
        filled[at] = series.x[first:last]
        filling = state.tally[0] + at < _WINDOW
        (state,), found = filter_medians(settings, filled, (state,))
        part = slice(first, last)
        far[part] = np.abs(found.residual[at]) / found.scale[at]
        rejected = found.verdict[at] == Verdict.REJECTED
        wild[part] = np.where(filling, far[part] > settings.gate, rejected)
    return Recursion(settings, state, float(series.time[-1]), steps[-_WINDOW:]), far, wild


def _missed(steps: FloatArray) -> IntArray:
    """How many usual steps without a sample lie before each, after the first 9 of ``steps``."""
    usual = running_median(steps, _WINDOW, centred=False)[_WINDOW - 1 : -1]
    step = steps[_WINDOW:]
    known = usual > 0.0
    ratio = np.ones(len(step))
    ratio[known] = step[known] / usual[known]
    return np.clip(np.rint(ratio) - 1.0, 0.0, _MISSED + 1.0).astype(np.int64)
