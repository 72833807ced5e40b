"""The first half of the ship's chain, one sensor at a time: plausibility, 53H, evaluation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.cleaning.hampel import rolling_scale
from surefix.cleaning.plausibility import Bounds, Check, plausibility
from surefix.cleaning.replacement import Replaced
from surefix.cleaning.tukey53h import tukey53h
from surefix.filters.noise import grain
from surefix.geo.angle import wrap
from surefix.pipelines.ship_options import PERIODS, ShipOptions, thresholds
from surefix.types import BoolArray, FloatArray, IntArray, Reason, Verdict, Verdicts

__all__ = ["CleanStream", "Stream", "clean_stream", "resolution"]

_WHITE = 0.6898  # robust scale of x − x₃ over that of x, where x is white normal noise
_REPEATING = 0.05  # share of repeated values from which digits are coarse
_LEAST_SIGMA = 0.01  # of the threshold: noise of a series that never changes
_HALF_PI = 0.5 * np.pi
_RANGES = {
    "latitude": (-_HALF_PI, _HALF_PI),
    "longitude": (-2.0 * np.pi, 2.0 * np.pi),
    "roll": (-_HALF_PI, _HALF_PI),
    "pitch": (-_HALF_PI, _HALF_PI),
    "depth": (0.0, 12_000.0),
}
_RATES = {
    Check.MISSING: (Verdict.MISSING, Reason.NO_VALUE),
    Check.INVALID: (Verdict.REJECTED, Reason.INVALID),
    Check.RANGE: (Verdict.REJECTED, Reason.OFF),
    Check.FROZEN: (Verdict.DUPLICATE, Reason.HELD),
    Check.RATE: (Verdict.REJECTED, Reason.OFF),
}


class Stream(NamedTuple):
    """One quantity as one sensor measures it.

    Parameters
    ----------
    sensor
        Its name.
    quantity
        One of those of `surefix.pipelines.ship_options.thresholds`.
    time
        (n,) s, rising.
    value
        (n,) rad, m/s or m; NaN is missing.
    valid
        (n,) the sensor's own validity bit.
    """

    sensor: str
    quantity: str
    time: FloatArray
    value: FloatArray
    valid: BoolArray


class CleanStream(NamedTuple):
    """A stream after plausibility check, 53H and evaluation.

    Parameters
    ----------
    stream
        What came in.
    value
        (n,) cleaned: implausible samples are NaN, wild ones replaced by 53H.
    sigma
        (n,) noise of the sensor, evaluated from the samples up to each; NaN before there are any.
    check
        (n,) codes of `surefix.cleaning.plausibility.Check`.
    replaced
        (n,) which samples 53H replaced.
    verdicts
        What was done with each sample, and why.
    """

    stream: Stream
    value: FloatArray
    sigma: FloatArray
    check: IntArray
    replaced: BoolArray
    verdicts: Verdicts


def clean_stream(stream: Stream, latitude: FloatArray, options: ShipOptions) -> CleanStream:
    """Take one stream through plausibility check, 53H and evaluation.

    The noise is 1.4826 · med|x − x₃| over the window, scaled to that of white noise. It holds what
    changes from sample to sample, and no bias or drift; a seaway counts as noise.

    Parameters
    ----------
    stream
        One quantity of one sensor.
    latitude
        (m,) rad, of the ship.
    options
        Of the chain.
    """
    time, period = stream.time, PERIODS.get(stream.quantity, 0.0)
    limit = thresholds(stream.quantity, time, latitude, options)
    check = plausibility(
        stream.value, time, _bounds(stream, limit, options), valid=stream.valid, period=period
    )
    possible = np.where(check == Check.PASSED, stream.value, np.nan)
    cleaned = tukey53h(possible, limit, ends=options.ends, period=period)
    residual = _difference(possible, cleaned.estimate, period)
    kept = np.where(cleaned.replaced, np.nan, residual)
    samples = max(round(options.evaluation_s / _median_step(time)), 5)
    sigma = rolling_scale(kept, samples) / _WHITE
    sigma = np.fmax(sigma, resolution(stream.value) / np.sqrt(12.0))
    sigma = np.where(sigma == 0.0, _LEAST_SIGMA * limit, sigma)
    off = _difference(stream.value, cleaned.estimate, period)
    return CleanStream(
        stream,
        cleaned.value,
        sigma,
        check,
        cleaned.replaced,
        _verdicts(stream, check, cleaned, off, sigma),
    )


def resolution(value: FloatArray) -> float:
    """Last digit of a series; 0 where its values do not repeat, for then there is none to see.

    >>> resolution(np.array([1.5, 1.5, 1.0, 2.0, 2.5])), resolution(np.array([0.1, 0.6, 1.1, 1.6]))
    (0.5, 0.0)
    """
    known = value[np.isfinite(value)]
    repeats = np.count_nonzero(np.diff(known) == 0.0)
    return grain(known) if repeats > _REPEATING * known.size else 0.0


def _bounds(stream: Stream, limit: FloatArray, options: ShipOptions) -> Bounds:
    """What is possible: the rates that the thresholds are made of, with a margin."""
    lower, upper = _RANGES.get(stream.quantity, (-np.inf, np.inf))
    step = _median_step(stream.time)
    known = limit[np.isfinite(limit)]
    usual = float(np.median(known)) if known.size else np.inf
    return Bounds(
        lower=lower,
        upper=upper,
        rate=options.rate_margin * usual / step,
        frozen=options.frozen,
    )


def _median_step(time: FloatArray) -> float:
    steps = np.diff(time)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if steps.size else 1.0


def _difference(x: FloatArray, reference: FloatArray, period: float) -> FloatArray:
    return wrap(x - reference, period) if period else x - reference


def _verdicts(
    stream: Stream, check: IntArray, cleaned: Replaced, off: FloatArray, sigma: FloatArray
) -> Verdicts:
    n = len(check)
    verdict, reason = np.full(n, int(Verdict.USED)), np.full(n, int(Reason.AGREES))
    for code, (what, why) in _RATES.items():
        verdict[check == code], reason[check == code] = what, why
    verdict[cleaned.replaced], reason[cleaned.replaced] = Verdict.REJECTED, Reason.OFF
    standardised = off / sigma
    held = np.maximum.accumulate(np.where(check == Check.FROZEN, 0, np.arange(n)))
    return Verdicts(
        verdict=verdict,
        weight=(verdict == Verdict.USED).astype(np.float64),
        innovation_sigma=np.abs(standardised),
        standardised=standardised[:, None],
        reason=reason,
        detail=np.where(check == Check.FROZEN, stream.time[held], np.nan),
        offset=np.full((n, 1), np.nan),
    )
