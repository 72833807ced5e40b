"""The figures a client reads first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.types import Cleaned, FloatArray, Verdict, Verdicts

__all__ = ["Headline", "counts", "headline"]

_NOT_A_FIX = (Verdict.MISSING, Verdict.DUPLICATE)


class Headline(NamedTuple):
    """Figures of a whole track; NaN where one cannot be told.

    Parameters
    ----------
    fixes
        Number of records.
    counts
        How many had each verdict.
    start, end
        s, first and last time.
    distance
        m along the clean track.
    raw_speed, clean_speed
        Median and greatest, m/s; raw from one fix to the next.
    sigma_horizontal, sigma_vertical
        Median 2σ, m.
    """

    fixes: int
    counts: dict[Verdict, int]
    start: float
    end: float
    distance: float
    raw_speed: tuple[float, float]
    clean_speed: tuple[float, float]
    sigma_horizontal: float
    sigma_vertical: float


def counts(verdicts: Verdicts) -> dict[Verdict, int]:
    """How many observations had each verdict."""
    return {verdict: int((verdicts.verdict == verdict).sum()) for verdict in Verdict}


def headline(cleaned: Cleaned) -> Headline:
    """Work out the headline figures of a result."""
    track = cleaned.track
    times = [track.time, *(channel.time for channel in cleaned.channels)]
    time = np.concatenate(times)
    time = time[np.isfinite(time)]
    axes = _moving_axes(cleaned)
    clean = np.isfinite(track.position[:, axes]).all(axis=1) & np.isfinite(track.time)
    fix = ~np.isin(cleaned.verdicts.verdict, _NOT_A_FIX) & np.isfinite(track.time)
    fix &= np.isfinite(cleaned.raw_position[:, axes]).all(axis=1)
    step = np.linalg.norm(np.diff(track.position[clean][:, axes], axis=0), axis=1)
    sigma = track.sigma_position
    return Headline(
        fixes=int(cleaned.verdicts.verdict.size),
        counts=counts(cleaned.verdicts),
        start=float(time.min()) if time.size else float("nan"),
        end=float(time.max()) if time.size else float("nan"),
        distance=float(step.sum()) if clean.any() else float("nan"),
        raw_speed=_speeds(cleaned.raw_position[fix][:, axes], track.time[fix]),
        clean_speed=_middle_and_top(np.linalg.norm(track.velocity[:, axes], axis=1)),
        sigma_horizontal=2.0 * _median(np.sqrt(0.5 * (sigma[:, 0] ** 2 + sigma[:, 1] ** 2))),
        sigma_vertical=2.0 * _median(sigma[:, 2]),
    )


def _moving_axes(cleaned: Cleaned) -> list[int]:
    """East and north where they were observed, else the height."""
    flat = [i for i in (0, 1) if np.isfinite(cleaned.raw_position[:, i]).any()]
    return flat or [2]


def _speeds(position: FloatArray, time: FloatArray) -> tuple[float, float]:
    step = np.diff(time)
    length = np.linalg.norm(np.diff(position, axis=0), axis=1)
    return _middle_and_top(length[step > 0.0] / step[step > 0.0])


def _middle_and_top(values: FloatArray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return _median(finite), float(finite.max()) if finite.size else float("nan")


def _median(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")
