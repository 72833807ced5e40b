"""Results made by hand, so that the report is tested without the pipeline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surefix.simulate.rov_dive import RovDive, simulate
from surefix.types import (
    Cleaned,
    CleanedChannel,
    Event,
    FloatArray,
    Noise,
    Problem,
    Reason,
    Track,
    Verdict,
    Verdicts,
)

START = 1_700_000_000.0


def judged(standardised: FloatArray) -> Verdicts:
    """Verdicts as a three-part loss would give them."""
    known = np.isfinite(standardised)
    size = np.sqrt(np.where(known, standardised**2, 0.0).sum(axis=1) / known.sum(axis=1).clip(1))
    missing = ~known.any(axis=1)
    verdict = np.select(
        [missing, size > 4.0, size > 2.0],
        [Verdict.MISSING, Verdict.REJECTED, Verdict.DOWNWEIGHTED],
        Verdict.USED,
    )
    reason = np.select([missing, size > 2.0], [Reason.NO_POSITION, Reason.OFF], Reason.AGREES)
    return Verdicts(
        verdict=verdict.astype(np.int64),
        weight=np.select([missing | (size > 4.0), size > 2.0], [0.0, 2.0 / size.clip(1e-9)], 1.0),
        innovation_sigma=np.where(missing, np.nan, size),
        standardised=standardised,
        reason=reason.astype(np.int64),
        detail=np.full(size.size, np.nan),
        offset=np.full((size.size, 3), np.nan),
    )


def cleaned(time: FloatArray, raw: FloatArray, clean: FloatArray, *, sigma: float = 0.5) -> Cleaned:
    """Put a raw and a clean track into a result."""
    count = time.size
    return Cleaned(
        sources=("dive.csv",),
        sensors=("USBL",),
        track=Track(
            time=time,
            position=clean,
            velocity=np.gradient(clean, time, axis=0) if count > 1 else np.zeros((count, 3)),
            sigma_position=np.full((count, 3), 0.4 * sigma) + 0.0 * clean,
            sigma_velocity=np.full((count, 3), 0.05),
            geodetic=None,
        ),
        verdicts=judged((raw - clean) / sigma),
        raw_position=raw,
        raw_coordinates=raw,
        sensor=np.zeros(count, dtype=np.int64),
        row=np.arange(count),
        has_depth=False,
        resampled=None,
        channels=(),
        noise=(Noise("USBL", "position", sigma, "m", "estimated"),),
        events=(Event("gap", float(time[0]) if count else np.nan, "no fix for 32 s"),),
        problems=(Problem("checksum", 3, "line 12: $GPGGA,1", "check the cable"),),
        settings={"method": "igg3", "surefix": "0.1.0"},
    )


def channel(name: str, time: FloatArray, raw: FloatArray, period: float = 0.0) -> CleanedChannel:
    """Make a channel whose clean values are its raw ones."""
    return CleanedChannel(
        name=name,
        sensor="gyro",
        time=time,
        raw=raw,
        value=raw.copy(),
        rate=np.zeros_like(raw),
        sigma=np.full(raw.size, 0.1),
        period=period,
        verdicts=judged(np.random.default_rng(0).standard_normal((raw.size, 1))),
        noise=(),
    )


def from_dive(dive: RovDive) -> Cleaned:
    """Result that a perfect estimator would give of a simulated dive."""
    result = cleaned(dive.fixes.time, dive.fixes.position, dive.fix_position)
    depth = channel("depth_m", dive.depth.time, dive.depth.value)
    heading = channel("heading_deg", dive.heading.time, dive.heading.value, 360.0)
    return replace(result, channels=(depth, heading))


def dive_result(minutes: float = 8.0) -> Cleaned:
    """Result of a short dive."""
    return from_dive(simulate(2, minutes=minutes))


def straight(count: int, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, raw and clean positions of a straight track with 5 % gross errors."""
    rng = np.random.default_rng(seed)
    time = START + np.arange(count, dtype=np.float64)
    clean = np.outer(time - START, [0.5, 0.3, 0.0])
    raw = clean + 0.5 * rng.standard_normal((count, 3))
    raw[rng.uniform(size=count) < 0.05] += 15.0
    return time, raw, clean
