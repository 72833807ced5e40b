"""Robust filtering of a towed body: position fixes, heading and speed through water to a track.

The motion is that of `surefix.models.towed`, the update that of `surefix.filters.m_estimation`.
Missing components are left out, so a log in which the body surfaces and dives is one series: with
GPS fixes at the surface, by dead reckoning below.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.filters.kalman import Gaussian
from surefix.filters.m_estimation import check_losses, m_step
from surefix.jit import helper, kernel
from surefix.linalg import multiply, multiply_transpose, triangularize
from surefix.models.towed import (
    OBSERVED,
    TowedModel,
    add_noise_factor,
    fill_transition,
    moved,
    noise_factor,
    offset,
    transition,
)
from surefix.robust.loss import Loss, loss_named
from surefix.types import FloatArray, IntArray

__all__ = ["TowedTrack", "filter_towed", "smooth_towed"]


class TowedTrack(NamedTuple):
    """Filtered states of N epochs, and what was decided.

    Parameters
    ----------
    mean
        (N, 6) `surefix.models.towed.STATES`: rad, rad, m/s, m/s, rad (continued across full
        turns), m/s.
    covariance
        (N, 6, 6) of the errors in metres north, metres east, m/s, m/s, rad, m/s.
    residual
        (N, 4) observation less prediction in m, m, rad, m/s; NaN where not observed.
    weight
        (N, 4) of the observation; NaN where not observed.
    state_weight
        (N, 6) of the prediction.
    sweeps
        (N,) iterations of the update; 0 without an observation.
    """

    mean: FloatArray
    covariance: FloatArray
    residual: FloatArray
    weight: FloatArray
    state_weight: FloatArray
    sweeps: IntArray


def filter_towed(
    start: Gaussian,
    time: ArrayLike,
    z: ArrayLike,
    sigma: ArrayLike,
    model: TowedModel,
    *,
    rates: ArrayLike | None = None,
    loss: Loss | None = None,
    state_loss: Loss | None = None,
    standardise: Literal["noise", "innovation"] = "noise",
    sweeps: int = 1,
    tolerance: float = 1e-6,
) -> TowedTrack:
    """Filter the log of a towed body.

    Parameters
    ----------
    start
        Prediction for the first epoch: mean as in `TowedTrack`, factor of a covariance in metres.
    time
        (N,) s, not decreasing; any steps.
    z
        (N, 4) latitude, longitude, heading, each in rad and in any turn, and speed in m/s; what is
        not finite is missing. A position counts only whole.
    sigma
        (4,) or (N, 4) standard deviations: m, m, rad, m/s; positive.
    model
        From `surefix.models.towed.towed_model`.
    rates
        (N, 2) turn rate and acceleration of the towing ship over the step that ends at each epoch,
        rad/s and m/s²; what is not finite counts as 0, and so does None.
    loss, state_loss
        ρ₂ and ρ₁ of `surefix.filters.m_estimation.m_update`; None for the plain Kalman filter.
    standardise, sweeps, tolerance
        As there: 1 sweep is the filter as printed, more the iterated one.

    Raises
    ------
    OptionsError
        Shapes do not agree, the times decrease, a sigma is not positive, or as `m_update`.
    """
    t = _times(time)
    observed = np.array(z, dtype=np.float64)
    count = len(t)
    if observed.shape != (count, 4) or start.mean.shape != (6,):
        shapes = f"z {observed.shape}, start {start.mean.shape}"
        raise OptionsError(shapes, f"z ({count}, 4) and start (6,)")
    spread = np.array(np.broadcast_to(np.asarray(sigma, dtype=np.float64), (count, 4)))
    if not (np.isfinite(spread).all() and (spread > 0.0).all()):
        raise OptionsError("a sigma that is not positive", "finite standard deviations > 0")
    nominal = _nominal(rates, count)
    loss, state_loss = loss or loss_named("kalman"), state_loss or loss_named("kalman")
    check_losses(state_loss, standardise, sweeps, tolerance)
    observed[~np.isfinite(observed)] = np.nan
    observed[np.isnan(observed[:, :2]).any(axis=1), :2] = np.nan
    track = TowedTrack(
        np.empty((count, 6)),
        np.empty((count, 6, 6)),
        np.empty((count, 4)),
        np.full((count, 4), np.nan),
        np.ones((count, 6)),
        np.zeros(count, dtype=np.int64),
    )
    x = Gaussian(start.mean.copy(), np.array(start.factor, dtype=np.float64, order="C"))
    rules = (loss, state_loss, int(standardise == "innovation"), sweeps, tolerance)
    _run(x, t, observed, spread, nominal, model, rules, track)
    return track


def smooth_towed(
    track: TowedTrack, time: ArrayLike, model: TowedModel, *, rates: ArrayLike | None = None
) -> TowedTrack:
    """Smooth a filtered track backward (Rauch–Tung–Striebel): offline, each state from all data.

    Covariances are sums of positive semi-definite terms,
    ``(I − G Φ) P (I − G Φ)ᵀ + G (Q + P_s) Gᵀ``. The filter's weights are kept.

    Parameters
    ----------
    track
        From `filter_towed`.
    time, model, rates
        As given to it.

    Raises
    ------
    OptionsError
        As `filter_towed`.
    """
    t = _times(time)
    mean, covariance = track.mean.copy(), track.covariance.copy()
    nominal = _nominal(rates, len(t))
    for k in range(len(t) - 2, -1, -1):
        dt, P = t[k + 1] - t[k], track.covariance[k]
        x = track.mean[k].copy()
        heading, speed = x[4:] + 0.5 * nominal[k + 1] * dt
        F, G = transition(heading, speed, model.beta, dt), noise_factor(heading, speed, dt, model)
        _move(x, F, dt, nominal[k + 1])
        Q = G @ G.T
        gain = np.linalg.lstsq(F @ P @ F.T + Q, F @ P, rcond=1e-15)[0].T
        ahead = mean[k + 1] - x
        ahead[:2] = offset(x[0], x[1], mean[k + 1, 0], mean[k + 1, 1])
        change = gain @ ahead
        mean[k] += change
        mean[k, :2] = moved(track.mean[k, 0], track.mean[k, 1], change[0], change[1])
        rest = np.eye(6) - gain @ F
        P = rest @ P @ rest.T + gain @ (Q + covariance[k + 1]) @ gain.T
        covariance[k] = 0.5 * (P + P.T)
    return track._replace(mean=mean, covariance=covariance)


def _times(time: ArrayLike) -> FloatArray:
    t = np.array(time, dtype=np.float64).reshape(-1)
    if not (np.isfinite(t).all() and (np.diff(t) >= 0.0).all()):
        raise OptionsError("times that decrease or are missing", "finite times in order", "sort")
    return t


def _nominal(rates: ArrayLike | None, count: int) -> FloatArray:
    given = np.zeros((count, 2)) if rates is None else np.asarray(rates, dtype=np.float64)
    if given.shape != (count, 2):
        raise OptionsError(f"rates of shape {given.shape}", f"({count}, 2)")
    return np.where(np.isfinite(given), given, 0.0)


@kernel
def _run(
    x: Gaussian,
    time: FloatArray,
    z: FloatArray,
    sigma: FloatArray,
    rates: FloatArray,
    model: TowedModel,
    rules: tuple[Loss, Loss, int, int, float],
    track: TowedTrack,
) -> None:
    loss, state_loss, by_innovation, sweeps, tolerance = rules
    F, R, A = np.empty((6, 6)), np.zeros((4, 4)), np.empty((6, 16))
    local = np.empty(6)
    for k in range(len(time)):
        if k > 0:
            _predict(x, F, A, time[k] - time[k - 1], rates[k], model)
        residual = track.residual[k]
        residual[0], residual[1] = offset(x.mean[0], x.mean[1], z[k, 0], z[k, 1])
        turn = z[k, 2] - x.mean[4]
        residual[2] = turn - 2.0 * math.pi * np.floor(turn / (2.0 * math.pi) + 0.5)
        residual[3] = z[k, 3] - x.mean[5]
        for i in range(4):
            R[i, i] = sigma[k, i] ** 2
        local[:] = x.mean
        local[:2] = 0.0
        track.sweeps[k], _ = m_step(
            local,
            x.factor,
            residual,
            OBSERVED,
            R,
            loss,
            state_loss,
            by_innovation,
            sweeps,
            tolerance,
            track.weight[k],
            track.state_weight[k],
        )
        x.mean[0], x.mean[1] = moved(x.mean[0], x.mean[1], local[0], local[1])
        x.mean[2:] = local[2:]
        track.mean[k] = x.mean
        multiply_transpose(x.factor, track.covariance[k], 6, 6)


@helper
def _predict(
    x: Gaussian, F: FloatArray, A: FloatArray, dt: float, rates: FloatArray, model: TowedModel
) -> None:
    """Move the mean along the motion, the factor through Φ and Q at mid-step heading and speed."""
    heading, speed = x.mean[4] + 0.5 * rates[0] * dt, x.mean[5] + 0.5 * rates[1] * dt
    fill_transition(F, heading, speed, model.beta, dt)
    _move(x.mean, F, dt, rates)
    A[:] = 0.0
    multiply(F, x.factor, A[:, :6])
    add_noise_factor(A, heading, speed, dt, model, 6)
    triangularize(A, 6, 16)
    x.factor[:] = A[:, :6]


@helper
def _move(m: FloatArray, F: FloatArray, dt: float, rates: FloatArray) -> None:
    """Move a mean: the current as Φ has it, heading and speed as they are halfway."""
    heading, speed = m[4] + 0.5 * rates[0] * dt, m[5] + 0.5 * rates[1] * dt
    north = F[0, 2] * m[2] + speed * dt * math.cos(heading)
    east = F[1, 3] * m[3] + speed * dt * math.sin(heading)
    m[0], m[1] = moved(m[0], m[1], north, east)
    m[2] *= F[2, 2]
    m[3] *= F[3, 3]
    m[4] += rates[0] * dt
    m[5] += rates[1] * dt
