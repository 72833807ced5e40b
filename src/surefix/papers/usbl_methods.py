"""The methods of paper 000 and those they are measured against, on one simulated track.

A `Reading` is one way to fill what the paper leaves open: Q, R, the constants of the weights, and
what a residual is divided by.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from surefix.filters.kalman import Spread, gaussian, update
from surefix.filters.linear import filter_linear
from surefix.models.motion import noise_factor, transition
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import MULTI_HYPOTHESIS, CleanOptions, Mode
from surefix.robust.loss import loss_named
from surefix.simulate.usbl_track import UsblTrack
from surefix.types import BoolArray, FloatArray

__all__ = [
    "METHODS",
    "PROCESS",
    "SENSORS",
    "SEVERAL",
    "Estimate",
    "Reading",
    "compare",
    "estimate",
    "printed_gain",
]

METHODS: Mapping[str, str] = {
    "KF": "kalman",
    "Huber": "huber",
    "IGG1": "igg1",
    "IGG3": "igg3",
    "IGG3 (Yang)": "igg3-yang",
}
"""Rows of the tables and the loss each one is."""

PROCESS = 0.02
"""m/s^1.5: root of the density of a velocity noise that suits the simulated motion."""


class Reading(NamedTuple):
    """One reading of what the paper leaves open.

    Parameters
    ----------
    q
        Q = q·I₆ each step, as printed; None for the integrated noise of the motion model.
    sensors
        R from the geometry of the array and the noise of the velocities, instead of I₆.
    spread
        What standardises a residual: ``noise`` is the residual in metres where R = I.
    k0, k1
        Constants of the weights.
    """

    q: float | None = 0.1
    sensors: bool = False
    spread: Spread = "noise"
    k0: float = 1.0
    k1: float = 3.0


SENSORS = Reading(None, True, "innovation", 1.5, 4.5)
"""What the sensors and the motion say of Q and R, and the usual constants."""

SEVERAL = MULTI_HYPOTHESIS
"""Rows of `surefix clean --method multi-hypothesis`."""


class Estimate(NamedTuple):
    """(n, 3) positions in m, and their (n, 3, 3) covariance, NaN where a method gives none."""

    position: FloatArray
    covariance: FloatArray


def compare(track: UsblTrack, reading: Reading) -> dict[str, Estimate]:
    """Run every row of Tables 1 and 2: the paper's methods, then what they are measured against."""
    found = {row: estimate(track, row, reading) for row in METHODS}
    found["oracle"] = estimate(track, "KF", reading, left_out=track.gross)
    found["raw fixes"] = Estimate(track.fixes, track.fix_covariance)
    found["IGG3, sensor noise"] = estimate(track, "IGG3", SENSORS)
    found["surefix, real time"] = _cleaned(track, "realtime")
    found["surefix, offline"] = _cleaned(track, "offline")
    found[f"{SEVERAL}, real time"] = _cleaned(track, "realtime", SEVERAL)
    found[f"{SEVERAL}, offline"] = _cleaned(track, "offline", SEVERAL)
    found["oracle, sensor noise"] = estimate(track, "KF", SENSORS, left_out=track.gross)
    told = replace(track, fixes=np.where(track.gross[:, None], np.nan, track.fixes))
    found["oracle, offline"] = _cleaned(told, "offline", "kalman")
    return found


def estimate(
    track: UsblTrack, row: str, reading: Reading, left_out: BoolArray | None = None
) -> Estimate:
    """Filter a track with one of `METHODS`: [X Y Z VX VY VZ], H = I₆ (eqs 10–19).

    Parameters
    ----------
    track
        Simulated.
    row
        A name of `METHODS`.
    reading
        Q, R and the weights.
    left_out
        (n,) fixes that are withheld: for the oracle, which is told the gross errors.
    """
    z = _observations(track, left_out)
    step = float(track.time[1] - track.time[0])
    G = noise_factor("cv", 3, step, PROCESS**2)
    Q = G @ G.T if reading.q is None else reading.q * np.eye(6)
    R = _sensor_noise(track) if reading.sensors else np.eye(6)
    first = R[0] if reading.sensors else R
    found = filter_linear(
        gaussian(z[0], first),
        z[1:],
        transition("cv", 3, step),
        Q,
        np.eye(6),
        R[1:] if reading.sensors else R,
        loss_named(METHODS[row], **_constants(row, reading)),
        reading.spread,
    )
    return Estimate(
        np.vstack([z[:1, :3], found.mean[:, :3]]),
        np.concatenate([first[None, :3, :3], found.covariance[:, :3, :3]]),
    )


def printed_gain(track: UsblTrack, row: str, reading: Reading) -> Estimate:
    """Read eq 13 word for word: the weight of every prediction is 10·I₆, whatever came before.

    Parameters
    ----------
    track, row, reading
        As for `estimate`; Q has no part in it.
    """
    z = _observations(track, None)
    F = transition("cv", 3, float(track.time[1] - track.time[0]))
    loss = loss_named(METHODS[row], **_constants(row, reading))
    states = np.empty_like(z)
    states[0] = z[0]
    predicted, I = gaussian(z[0], 0.1 * np.eye(6)), np.eye(6)
    for k in range(1, len(z)):
        before = predicted._replace(mean=F @ states[k - 1])
        states[k] = update(before, z[k], I, I, loss, spread=reading.spread)[0].mean
    return Estimate(states[:, :3], np.full((len(z), 3, 3), np.nan))


def _constants(row: str, reading: Reading) -> dict[Literal["k0", "k1"], float]:
    if row == "KF":
        return {}
    return {"k0": reading.k0} if row == "Huber" else {"k0": reading.k0, "k1": reading.k1}


def _observations(track: UsblTrack, left_out: BoolArray | None) -> FloatArray:
    z = np.hstack([track.fixes, track.measured_velocity])
    if left_out is not None:
        z[left_out, :3] = np.nan
    return z


def _sensor_noise(track: UsblTrack) -> FloatArray:
    """(n, 6, 6); a fix that is missing has some noise, for it is not used."""
    R = np.zeros((len(track.time), 6, 6))
    R[:, :3, :3] = np.where(np.isnan(track.fix_covariance), np.eye(3), track.fix_covariance)
    R[:, 3:, 3:] = track.sigma_velocity**2 * np.eye(3)
    return R


def _cleaned(track: UsblTrack, mode: Mode, method: str = "igg3") -> Estimate:
    """What `surefix clean` makes of the same log, told the same noise figures."""
    variance = np.nanmean(np.diagonal(track.fix_covariance, axis1=1, axis2=2), axis=0)
    options = CleanOptions(
        mode=mode,
        method=method,
        model="cv",
        sigma_position=float(np.sqrt(variance[:2].mean())),
        sigma_height=float(np.sqrt(variance[2])),
        sigma_velocity=track.sigma_velocity,
        process=PROCESS,
    )
    log = {"time": track.time}
    log |= dict(zip(("x", "y", "z"), track.fixes.T, strict=True))
    log |= dict(zip(("ve", "vn", "vu"), track.measured_velocity.T, strict=True))
    found = clean_sources(open_inputs([log]), options).track
    return Estimate(found.position, found.sigma_position[:, :, None] ** 2 * np.eye(3))
