"""The methods of paper 004 and those they are measured against, on one simulated flight."""

from __future__ import annotations

from typing import Final

import numpy as np

from surefix.filters.current_statistical import filter_current
from surefix.filters.median_recursion import filter_medians, median_recursion
from surefix.filters.median_step import MedianRecursion
from surefix.filters.records import Recovery, TrackState
from surefix.filters.track import filter_track, start
from surefix.fusion.registration import reference_bias, register
from surefix.fusion.residual_scale import fuse_by_scale, noise_gain
from surefix.fusion.track import inverse_covariance
from surefix.models.radar import unbiased
from surefix.models.singer import singer
from surefix.papers.radar_hypotheses import SEVERAL, filter_several, fuse_several
from surefix.papers.radar_series import Cartesian, Fusion, constant_velocity, epochs_of
from surefix.robust.loss import loss_named
from surefix.simulate.radar import RadarFlight, RadarLog
from surefix.types import FloatArray

__all__ = [
    "BEFORE",
    "COUNTED",
    "CURRENT",
    "OURS",
    "OURS_CA",
    "PRINTED",
    "PRINTED_CA",
    "ROBUST",
    "SEVERAL_ONE",
    "TOLD",
    "TOLD_CV",
    "cartesian",
    "current_statistical",
    "cv_names",
    "filter_cv",
    "filter_one",
    "fuse_both",
    "systematic",
]

COUNTED: Final = "residual scale, smoothing counted"
BEFORE: Final = "before filtering"
CURRENT: Final = "current statistical"
PRINTED: Final = "medians, printed"
OURS: Final = "medians, feedback"
PRINTED_CA: Final = "medians, printed, acceleration"
OURS_CA: Final = "medians, feedback, acceleration"
ROBUST: Final = "IGG3 Kalman, 20Q0"
SEVERAL_ONE: Final = f"{SEVERAL}, 20Q0"
TOLD: Final = "oracle"
TOLD_CV: Final = "CV Kalman, 20Q0, told"

_FACTORS: Final = (1, 9, 20)
_ALPHA, _HIGHEST = 1.0 / 20.0, 10.0  # 1/s, evasion lasts 10–30 s; m/s²
_EVERY: Final = 20  # of the samples used for registration without a reference
_NEVER, _LATER = Recovery(np.inf, 1e3), Recovery(2.5, 1e3)  # 2.5 s are 50 samples


def cv_names() -> tuple[str, ...]:
    """Name the Kalman filters of constant velocity, by multiples of Q₀."""
    return tuple(f"CV Kalman, {factor if factor > 1 else ''}Q0" for factor in _FACTORS)


def systematic(flight: RadarFlight, settle: int) -> dict[str, FloatArray]:
    """Systematic errors of both radars, (2, 3) m and rad each, as each way to register finds them.

    Parameters
    ----------
    flight
        The scene.
    settle
        Samples after which the running median against the reference is read.
    """
    logs = flight.radars
    given = [log.polar[::_EVERY] for log in logs], [log.at for log in logs]
    sigma = np.array([log.sigma for log in logs])
    medians = [
        reference_bias(log.polar[:settle], flight.reference[:settle], log.at, settle).bias[-1]
        for log in logs
    ]
    return {
        "before": np.zeros((2, 3)),
        "least squares, A and B": register(*given, sigma, loss=loss_named("kalman")).bias,
        "robust least squares, A and B": register(*given, sigma).bias,
        "running median, reference": np.array(medians),
    }


def cartesian(log: RadarLog, bias: FloatArray) -> Cartesian:
    """Bring a radar's measurements to the common frame, less its systematic errors (3,)."""
    position, covariance = unbiased(log.polar - bias, log.sigma, log.at)
    return Cartesian(position, np.ascontiguousarray(np.diagonal(covariance, axis1=1, axis2=2)))


def filter_cv(
    series: Cartesian,
    dt: float,
    density: float,
    state: TrackState | None = None,
    *,
    robust: bool = False,
) -> tuple[TrackState, FloatArray, FloatArray]:
    """Kalman filter of constant velocity: state, positions (n, 3) and their variances (n, 3).

    Parameters
    ----------
    series
        Up to three axes.
    dt
        s between samples.
    density
        Q as a spectral density of the acceleration, m²/s³.
    state
        From an earlier call, or None.
    robust
        Weigh by IGG3, and believe what was rejected for 2.5 s on end, as `surefix clean` does.
    """
    recovery, loss = (_LATER, "igg3") if robust else (_NEVER, "kalman")
    axes = series.position.shape[1]
    motion = constant_velocity(axes, density)
    state = start(motion, recovery) if state is None else state
    epochs = epochs_of(series, dt, state.time)
    state, found, _ = filter_track(motion, loss_named(loss), recovery, epochs, state)
    rows = found.factor[:, :axes]
    return state, found.mean[:, :axes].copy(), np.sum(rows * rows, axis=-1)


def current_statistical(series: Cartesian, dt: float) -> FloatArray:
    """Filter with the current statistical model: positions (n, d)."""
    model = singer(_ALPHA, dt)
    return np.ascontiguousarray(
        filter_current(model, _HIGHEST, series.position, series.variance)[1][..., 0]
    )


def filter_one(
    flight: RadarFlight, series: Cartesian, density: float, window: int
) -> dict[str, FloatArray]:
    """Radar A before filtering and under every method: name → (n, 3) m.

    The last is the most agile CV Kalman filter, told which measurements are wild.
    """
    cv = {
        name: filter_cv(series, flight.dt, factor * density)[1]
        for name, factor in zip(cv_names(), _FACTORS, strict=True)
    }
    found = {BEFORE: series.position} | cv
    found[CURRENT] = current_statistical(series, flight.dt)
    forms = ((PRINTED, "printed", "cv"), (OURS, "feedback", "cv"))
    for name, form, model in (*forms, (PRINTED_CA, "printed", "ca"), (OURS_CA, "feedback", "ca")):
        options = median_recursion(form, model=model, window=window)
        found[name] = filter_medians(options, series.position)[1].estimate
    found[ROBUST] = filter_cv(series, flight.dt, _FACTORS[-1] * density, robust=True)[1]
    found[SEVERAL_ONE] = filter_several(series, flight.dt, _FACTORS[-1] * density)[1]
    found[TOLD_CV] = filter_cv(_told(flight, series), flight.dt, _FACTORS[-1] * density)[1]
    return found


def fuse_both(
    flight: RadarFlight, a: Cartesian, b: Cartesian, density: float, window: int
) -> tuple[dict[str, Fusion], FloatArray]:
    """Both radars, each way to fuse them, and the weight (n, 3) that the residual scale gave A."""
    found: dict[str, Fusion] = {}
    options = median_recursion("feedback", window=window)
    smoothing = _smoothing(options)
    both = [filter_medians(options, series.position)[1] for series in (a, b)]
    positions = np.array([each.estimate for each in both])
    usual = np.array([a.variance, b.variance])
    for name, position in zip(("A, medians", "B, medians"), positions, strict=True):
        found[name] = Fusion(position, np.full_like(position, np.nan))
    found["mean"] = Fusion(positions.mean(axis=0), np.full_like(positions[0], np.nan))
    fused = fuse_by_scale(positions, np.array([each.scale for each in both]))
    found["residual scale"] = Fusion(fused.estimate, fused.variance)
    found[COUNTED] = Fusion(fused.estimate, smoothing * fused.variance)
    by_usual = fuse_by_scale(positions, np.sqrt(usual))
    found["usual noise"] = Fusion(by_usual.estimate, smoothing * by_usual.variance)
    for robust, name in ((False, "CV Kalman"), (True, "IGG3 Kalman")):
        made = _fused_cv(flight, a, b, density, robust)
        found[f"{name}, inverse covariance"] = made
    found |= fuse_several(flight, a, b, _FACTORS[-1] * density)
    told = np.array([filter_medians(options, _told(flight, a).position)[1].estimate, positions[1]])
    real = usual * np.array([log.noise[:, None] ** 2 for log in flight.radars])
    best = fuse_by_scale(told, np.sqrt(real))
    found[TOLD] = Fusion(best.estimate, smoothing * best.variance)
    return found, fused.weight[0]


def _smoothing(options: MedianRecursion) -> float:
    error, residual = noise_gain(options)
    return error / residual


def _told(flight: RadarFlight, series: Cartesian) -> Cartesian:
    wild = flight.radars[0].wild[:, None]
    return series._replace(position=np.where(wild, np.nan, series.position))


def _fused_cv(
    flight: RadarFlight, a: Cartesian, b: Cartesian, density: float, robust: bool
) -> Fusion:
    """The most agile CV Kalman filter of each radar, fused by inverse covariance, axis by axis."""
    mean, variance = zip(
        *(
            filter_cv(series, flight.dt, _FACTORS[-1] * density, robust=robust)[1:]
            for series in (a, b)
        ),
        strict=True,
    )
    diagonal = np.stack(variance, axis=1)[..., None] * np.eye(3)
    fused = inverse_covariance(np.stack(mean, axis=1), diagonal)
    return Fusion(fused.mean, np.diagonal(fused.covariance, axis1=1, axis2=2).copy())
