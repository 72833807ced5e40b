"""The multi-hypothesis filter on the radars of paper 004: one radar, and both in one filter.

Both radars are two sensors of one filter, so nothing is left to fuse afterwards. The noise of each
is its usual one times the running median of its own standardised innovations, as the residual scale
of the paper, so that a radar that gets noisier loses weight. The process noise, and how often and
how far measurements are wrong, are learnt from the log.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from surefix.cleaning.running_median import running_median
from surefix.filters.hypotheses import Bank, Prior, no_hypotheses
from surefix.filters.learning import learn, supposed
from surefix.filters.multi_hypothesis_modes import offline_hypotheses, realtime_hypotheses
from surefix.filters.noise import NoiseFigures, Observations
from surefix.filters.records import Epochs, Estimate, Motion
from surefix.papers.radar_series import Cartesian, Fusion, constant_velocity, epochs_of
from surefix.simulate.radar import RadarFlight
from surefix.types import BoolArray, FloatArray

__all__ = ["LONGEST_S", "SEVERAL", "TOLD_SEVERAL", "filter_several", "fuse_several"]

SEVERAL: Final = "multi-hypothesis"
TOLD_SEVERAL: Final = "one filter, told"
LONGEST_S: Final = 2.525
"""Longest run that is survived: 50 samples of 0.05 s, after which IGG3 believes it too."""

_SPEED: Final = 1e3  # m/s, of an aircraft that nothing is known about
_TO_SIGMA: Final = 1.4826
_SCALED_OVER: Final = 159  # samples of the running median, 8 s


def filter_several(
    series: Cartesian, dt: float, density: float, bank: Bank | None = None
) -> tuple[Bank, FloatArray]:
    """Filter one radar in real time: the hypotheses, and positions (n, axes).

    Parameters
    ----------
    series
        Up to three axes.
    dt
        s between samples.
    density
        Q of constant velocity, m²/s³: given, as to the Kalman filters beside it.
    bank
        From an earlier call, or None.
    """
    axes = series.position.shape[1]
    motion = constant_velocity(axes, density)
    bank = no_hypotheses(motion) if bank is None else bank
    epochs = epochs_of(series, dt, float(bank.time[0]))
    sigma = float(np.sqrt(np.median(series.variance)))
    prior = supposed(axes, sigma, 1.0, _SPEED, LONGEST_S)._replace(manoeuvre=0.0)  # they are weak
    after, found = realtime_hypotheses(motion, prior, epochs, bank)
    return after, found.mean[:, :axes].copy()


def fuse_several(
    flight: RadarFlight, a: Cartesian, b: Cartesian, density: float
) -> dict[str, Fusion]:
    """Both radars in one filter, in real time and offline, and its oracles.

    The oracles are the same filter told which measurements are wild and how noisy each radar is.

    Parameters
    ----------
    flight
        The scene: its step, and for the oracles what is wrong.
    a, b
        The radars' measurements.
    density
        Q of constant velocity to begin with, m²/s³.
    """
    both = _joined(flight.dt, (a, b))
    process, prior = _learnt(both, density)
    motion = constant_velocity(3, process**2)
    told = _told(both, flight)
    found = {}
    for offline in (False, True):
        ending = ", offline" if offline else ""
        scaled = both._replace(variance=both.variance * _scales(motion, prior, both, offline))
        for name, epochs in ((SEVERAL, scaled), (TOLD_SEVERAL, told)):
            found[name + ending] = _fusion(_estimate(motion, prior, epochs, offline))
    return found


def _joined(dt: float, radars: tuple[Cartesian, Cartesian]) -> Epochs:
    """Measurements of both, in turns, as two sensors."""
    n = len(radars[0].position)
    z, variance = np.full((2 * n, 6), np.nan), np.ones((2 * n, 6))
    for i, radar in enumerate(radars):
        z[i::2, :3], variance[i::2, :3] = radar.position, radar.variance
    free, none = np.full((2 * n, 6), np.nan), np.zeros(2 * n, np.int64)
    return Epochs(np.repeat(dt * np.arange(n), 2), z, variance, free, none, np.tile([0, 1], n))


def _learnt(epochs: Epochs, density: float) -> tuple[float, Prior]:
    """Process noise, and what is supposed of gross errors; the noise of the radars is given."""
    declared = np.sqrt(epochs.variance)
    declared[:, 3:] = np.nan
    given = NoiseFigures(np.ones(2), np.full(2, np.nan), np.nan)
    learnt = learn(
        Observations(epochs.time, epochs.z, epochs.sensor, declared),
        given,
        given._replace(
            position=np.full(2, np.median(declared[:, :3])), process=float(np.sqrt(density))
        ),
        order=2,
        period=0.0,
        speed=_SPEED,
        longest=LONGEST_S,
        floor=(1e-9, 1e-9),
    )
    return learnt.figures.process, learnt.prior


def _scales(motion: Motion, prior: Prior, epochs: Epochs, centred: bool) -> FloatArray:
    """(n, 6) squared scale of the innovations of each sensor about, or up to, each epoch."""
    off = np.abs(_estimate(motion, prior, epochs, offline=False).standardised[:, :3])
    scale = np.ones((len(off), 6))
    for sensor in (0, 1):
        mine = epochs.sensor == sensor
        medians = [running_median(axis, _SCALED_OVER, centred=centred) for axis in off[mine].T]
        scale[mine, :3] = np.square(_TO_SIGMA * np.mean(medians, axis=0))[:, None]
    return np.where(np.isfinite(scale) & (scale > 0.0), scale, 1.0)


def _told(epochs: Epochs, flight: RadarFlight) -> Epochs:
    z, variance = epochs.z.copy(), epochs.variance.copy()
    for sensor, log in enumerate(flight.radars):
        wild: BoolArray = log.wild
        z[sensor::2][wild] = np.nan
        variance[sensor::2, :3] *= log.noise[:, None] ** 2
    return epochs._replace(z=z, variance=variance, fixed=np.ones_like(epochs.fixed))


def _estimate(motion: Motion, prior: Prior, epochs: Epochs, offline: bool) -> Estimate:
    if offline:
        return offline_hypotheses(motion, prior, epochs)
    return realtime_hypotheses(motion, prior, epochs, no_hypotheses(motion))[1]


def _fusion(found: Estimate) -> Fusion:
    """What is known once both radars of an instant are in."""
    return Fusion(found.mean[1::2, :3].copy(), found.sigma[1::2, :3] ** 2)
