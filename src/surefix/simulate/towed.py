"""A towed sonar survey: truth, GPS at the surface, compass and log all the time, gross errors.

A ship tows the body along parallel lines joined by half turns. Heading and speed of the body walk
at random about those of the ship, the current is a Gauss–Markov process, and all noises may be
ε-contaminated: with probability ε a value is drawn from a normal distribution that is ``spread``
times as wide. GPS fixes exist only while the body is at the surface. A gust is a step of the
current that fades as the process does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from surefix.filters.kalman import Gaussian, gaussian
from surefix.geo.angle import wrap
from surefix.models.towed import TowedModel, radii, towed_model
from surefix.simulate.faults import irregular_times
from surefix.types import BoolArray, FloatArray

__all__ = ["TowedSurvey", "simulate"]

_STEP = 0.1  # s between the epochs of the truth; sensors sample on them
_SECOND = 10  # of them
_TURN = 90.0  # s for half a turn
_START_SIGMA = (5.0, 5.0, 0.15, 0.15, np.radians(2.0), 0.1)  # m, m, m/s, m/s, rad, m/s


@dataclass(frozen=True, kw_only=True)
class TowedSurvey:
    """A simulated survey.

    Parameters
    ----------
    seed
        What it was drawn from.
    model
        What drives the truth, without its gross errors.
    time
        (N,) s from the start.
    truth
        (N, 6) `surefix.models.towed.STATES`: rad, rad, m/s, m/s, rad, m/s; longitude in ±π,
        heading continued across full turns.
    z
        (N, 4) measured latitude, longitude, heading (0 … 2π), speed; NaN where there is none.
    bad
        (N, 4) which of them were drawn from the wide distribution.
    sigma
        (4,) standard deviations of the others: m, m, rad, m/s.
    surfaced
        (N,) whether the body was at the surface.
    rates
        (N, 2) turn rate and acceleration of the ship over the step before, rad/s and m/s².
    start
        What is known at the first epoch: the truth with an error drawn from its covariance.
    """

    seed: int
    model: TowedModel
    time: FloatArray
    truth: FloatArray
    z: FloatArray
    bad: BoolArray
    sigma: FloatArray
    surfaced: BoolArray
    rates: FloatArray
    start: Gaussian


def simulate(
    seed: int,
    *,
    minutes: float = 20.0,
    interval_s: float = 1.0,
    jitter: float = 0.2,
    stretch_s: float = 240.0,
    latitude_deg: float = 36.0,
    longitude_deg: float = 121.0,
    speed_mps: float = 2.5,
    line_s: float = 240.0,
    sigma_position_m: float = 3.0,
    sigma_heading_deg: float = 1.0,
    sigma_speed_mps: float = 0.05,
    contamination: float = 0.1,
    spread: float = 20.0,
    state_contamination: float = 0.0,
    state_spread: float = 10.0,
    gust_mps: float = 0.0,
    model: TowedModel | None = None,
) -> TowedSurvey:
    """Draw one survey; the same seed and options give the same bits.

    Truth, clock and noise come from generators of their own: surveys of one seed that differ only
    in contamination or gust share everything else.

    Parameters
    ----------
    seed
        Of ``numpy.random.default_rng``.
    minutes
        Duration.
    interval_s, jitter
        Nominal step of the epochs and its scatter as a share of it, below 0.5.
    stretch_s
        Length of the alternating stretches at the surface (first) and below.
    latitude_deg, longitude_deg
        Where the survey begins.
    speed_mps, line_s
        Of the ship along a line; a fifth slower in the turns. Duration of a line.
    sigma_position_m, sigma_heading_deg, sigma_speed_mps
        Noise of GPS per axis, compass and log.
    contamination, spread
        ε and the width of the wide distribution, of each measured component.
    state_contamination, state_spread
        The same for the noises that drive position, current, heading and speed, second by second.
    gust_mps
        Step of the current, in a random direction, a third into each stretch at the surface but
        the first.
    model
        What drives the truth; `towed_model` with its defaults otherwise.
    """
    course, motion, faults, clock, noise, begin = np.random.default_rng(seed).spawn(6)
    model = model or towed_model()
    elapsed = np.arange(0.0, 60.0 * minutes + 0.5 * _STEP, _STEP)
    ship = _ship(course, elapsed, speed_mps, line_s)
    wide = _wide(faults, elapsed.size, state_contamination, state_spread)
    truth = np.empty((elapsed.size, 6))
    truth[:, 4:] = ship + _walks(motion, wide, model)
    truth[:, 2:4] = _current(motion, wide, model) + _gusts(
        course, elapsed, model.beta, stretch_s, gust_mps
    )
    truth[:, :2] = _positions(motion, wide, truth, model, latitude_deg, longitude_deg)
    nominal = irregular_times(clock, 0.0, 60.0 * minutes, interval_s, jitter)
    at = np.unique(np.round(nominal / _STEP).astype(np.int64))
    at = at[at < elapsed.size]
    sigma = np.array(
        [sigma_position_m, sigma_position_m, np.radians(sigma_heading_deg), sigma_speed_mps]
    )
    bad = noise.uniform(size=(at.size, 4)) < contamination
    error = sigma * noise.standard_normal(bad.shape) * np.where(bad, spread, 1.0)
    surfaced = np.floor(elapsed[at] / stretch_s).astype(np.int64) % 2 == 0
    known = truth[at[0]].copy()
    slips = np.array(_START_SIGMA) * begin.standard_normal(6)
    known[:2] = _shifted(known[:2], slips[:2])
    known[2:] += slips[2:]
    rates = np.zeros((at.size, 2))
    rates[1:] = np.diff(ship[at], axis=0) / np.diff(elapsed[at])[:, None]
    return TowedSurvey(
        seed=seed,
        model=model,
        time=elapsed[at],
        truth=truth[at],
        z=_measured(truth[at], error, surfaced),
        bad=bad & (surfaced[:, None] | np.array([False, False, True, True])),
        sigma=sigma,
        surfaced=surfaced,
        rates=rates,
        start=gaussian(known, np.diag(np.square(_START_SIGMA))),
    )


def _ship(rng: np.random.Generator, elapsed: FloatArray, speed: float, line: float) -> FloatArray:
    """Heading and speed of the ship, (n, 2): lines, and half turns to alternating sides."""
    first = rng.uniform(0.0, 2.0 * np.pi)
    leg = np.floor(elapsed / (line + _TURN))
    turned = np.clip((elapsed - leg * (line + _TURN) - line) / _TURN, 0.0, 1.0)
    side = np.where(leg % 2 == 0, 1.0, -1.0)
    heading = first + np.pi * (leg % 2) + side * np.pi * turned
    slower = 0.2 * np.sin(np.pi * turned) ** 2
    return np.column_stack((heading, speed * (1.0 - slower)))


def _wide(rng: np.random.Generator, count: int, share: float, spread: float) -> FloatArray:
    """Width of the noise that drives position, current, heading, speed at each step, (n, 4)."""
    seconds = rng.uniform(size=(count // _SECOND + 1, 4)) < share
    return np.repeat(np.where(seconds, spread, 1.0), _SECOND, axis=0)[:count]


def _walks(rng: np.random.Generator, wide: FloatArray, model: TowedModel) -> FloatArray:
    step = np.sqrt(np.array([model.heading, model.speed]) * _STEP)
    return np.cumsum(step * rng.standard_normal((len(wide), 2)) * wide[:, 2:], axis=0)


def _current(rng: np.random.Generator, wide: FloatArray, model: TowedModel) -> FloatArray:
    """Gauss–Markov process of two components, stationary from the first step, (n, 2)."""
    keep = np.exp(-model.beta * _STEP)
    drive = rng.standard_normal((len(wide), 2)) * np.sqrt(1.0 - keep * keep)
    drive[1:] *= wide[1:, 1:2]
    drive[0] /= np.sqrt(1.0 - keep * keep)
    return np.asarray(model.current * lfilter([1.0], [1.0, -keep], drive, axis=0))


def _gusts(
    rng: np.random.Generator, elapsed: FloatArray, beta: float, stretch: float, size: float
) -> FloatArray:
    total = np.zeros((elapsed.size, 2))
    for begin in np.arange(2.0 * stretch, elapsed[-1], 2.0 * stretch):
        way = rng.uniform(0.0, 2.0 * np.pi)
        since = elapsed - (begin + stretch / 3.0)
        fading = np.where(since >= 0.0, np.exp(-beta * np.maximum(since, 0.0)), 0.0)
        total += size * fading[:, None] * np.array([np.cos(way), np.sin(way)])
    return total


def _positions(
    rng: np.random.Generator,
    wide: FloatArray,
    truth: FloatArray,
    model: TowedModel,
    latitude: float,
    longitude: float,
) -> FloatArray:
    """Integrate ``φ' = n'/M, λ' = e'/(N cos φ)`` by trapezoids, (n, 2) rad."""
    heading, speed = truth[:, 4], truth[:, 5]
    velocity = truth[:, 2:4] + speed[:, None] * np.column_stack((np.cos(heading), np.sin(heading)))
    steps = np.zeros_like(velocity)
    steps[1:] = 0.5 * _STEP * (velocity[1:] + velocity[:-1])
    steps[1:] += (
        np.sqrt(model.position * _STEP) * rng.standard_normal(steps[1:].shape) * wide[1:, :1]
    )
    phi = np.full(len(truth), np.radians(latitude))
    for _ in range(3):
        phi = np.radians(latitude) + np.cumsum(steps[:, 0] / radii(phi)[0])
    middle = phi - 0.5 * np.diff(phi, prepend=phi[0])
    turned = np.cumsum(steps[:, 1] / (radii(middle)[1] * np.cos(middle)))
    return np.column_stack((phi, wrap(np.radians(longitude) + turned, 2.0 * np.pi)))


def _shifted(position: FloatArray, metres: FloatArray) -> FloatArray:
    """Move positions (…, 2) rad by small errors north and east in metres."""
    meridian, across = radii(position[..., 0])
    scale = np.stack((meridian, across * np.cos(position[..., 0])), axis=-1)
    there = position + metres / scale
    there[..., 1] = wrap(there[..., 1], 2.0 * np.pi)
    return np.asarray(there)


def _measured(truth: FloatArray, error: FloatArray, surfaced: BoolArray) -> FloatArray:
    z = np.empty((len(truth), 4))
    z[:, :2] = np.where(surfaced[:, None], _shifted(truth[:, :2], error[:, :2]), np.nan)
    z[:, 2] = np.mod(truth[:, 4] + error[:, 2], 2.0 * np.pi)
    z[:, 3] = truth[:, 5] + error[:, 3]
    return z
