"""Motions of vehicles in units of the noise of a fix and of the interval between fixes."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from surefix.models.motion import noise_factor
from surefix.simulate.survey_motion import survey_motion
from surefix.types import FloatArray

__all__ = ["Path", "Vehicle", "drive"]

Vehicle = Literal["model", "survey", "speedboat", "buoy"]

_SPEED = 3.0  # σ per interval with which the vehicle of the model sets out
_SURVEY_SIGMA = 0.3  # m: the noise beside which a survey vehicle of half a metre a second is drawn
_FAST = (25.0, 45.0)  # σ per interval, speed of the boat between turns
_LEG = (15.0, 60.0)  # intervals between its turns …
_TURN = (3.0, 10.0)  # … each of which takes as long …
_RATE = (0.15, 0.4)  # … at so many rad per interval
_WAVE = 1.2  # σ, root mean square of the heights of the waves of a swell
_FINE = 16  # steps of the boat's and the buoy's motion in an interval


class Path(NamedTuple):
    """(n, d) position in σ and velocity in σ per interval."""

    position: FloatArray
    velocity: FloatArray


def drive(
    vehicle: Vehicle, rng: np.random.Generator, time: FloatArray, axes: int, agility: float
) -> Path:
    """Move a vehicle; the velocity is the derivative of the position.

    Parameters
    ----------
    vehicle
        ``model``: constant velocity disturbed by white acceleration, exactly as the filters
        suppose. ``survey``: lines and turns. ``speedboat``: fast, with hard turns at random.
        ``buoy``: adrift, in a swell.
    rng
        Source of it all.
    time
        (n,) increasing, in intervals, from 0.
    axes
        1 … 3: x, y, z.
    agility
        Root density of the acceleration, σ per interval^1.5; for ``model``.
    """
    if vehicle == "model":
        return _model(rng, time, axes, agility)
    fine = np.arange(0.0, time[-1] + 2.0, 1.0 / _FINE)
    match vehicle:
        case "survey":
            position, velocity, _ = survey_motion(rng, fine, speed=0.5, line=60.0, depth=0.0)
            position, velocity = position / _SURVEY_SIGMA, velocity / _SURVEY_SIGMA
        case "speedboat":
            velocity = _boat(rng, fine)
            position = _integral(velocity)
        case "buoy":
            position, velocity = _buoy(rng, fine)
    return Path(_at(time, fine, position)[:, :axes], _at(time, fine, velocity)[:, :axes])


def _model(rng: np.random.Generator, time: FloatArray, axes: int, agility: float) -> Path:
    position, velocity = np.zeros((len(time), axes)), np.zeros((len(time), axes))
    velocity[0] = _SPEED * rng.standard_normal(axes)
    for k, dt in enumerate(np.diff(time).tolist(), start=1):
        shove = noise_factor("cv", axes, dt, agility**2) @ rng.standard_normal(2 * axes)
        position[k] = position[k - 1] + dt * velocity[k - 1] + shove[:axes]
        velocity[k] = velocity[k - 1] + shove[axes:]
    return Path(position, velocity)


def _boat(rng: np.random.Generator, fine: FloatArray) -> FloatArray:
    """Velocity: straight legs, turns at a steady rate to either side, a swell."""
    rate = np.zeros_like(fine)
    begin = 0.0
    while begin < fine[-1]:
        begin += float(rng.uniform(*_LEG))
        end = begin + float(rng.uniform(*_TURN))
        turning = (fine >= begin) & (fine < end)
        rate[turning] = rng.uniform(*_RATE) * rng.choice([-1.0, 1.0])
        begin = end
    course = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(rate) / _FINE
    speed = rng.uniform(*_FAST)
    return np.column_stack(
        (speed * np.sin(course), speed * np.cos(course), _swell(rng, fine, 1).velocity[:, 0])
    )


def _buoy(rng: np.random.Generator, fine: FloatArray) -> Path:
    """Drift slowly in circles, in a swell."""
    spin = 2.0 * np.pi / 700.0
    phase = spin * fine + rng.uniform(0.0, 2.0 * np.pi)
    none = np.zeros_like(fine)
    drift = rng.normal(0.0, 0.3, 3) * np.array([1.0, 1.0, 0.0])
    position = drift * fine[:, None] + 0.4 / spin * np.column_stack(
        (np.sin(phase), np.cos(phase), none)
    )
    velocity = drift + 0.4 * np.column_stack((np.cos(phase), -np.sin(phase), none))
    swell = _swell(rng, fine, 3)
    return Path(position + swell.position, velocity + swell.velocity)


def _swell(rng: np.random.Generator, fine: FloatArray, axes: int) -> Path:
    """Six waves of 8 … 16 intervals, each of its own height along every axis."""
    position, velocity = np.zeros((len(fine), axes)), np.zeros((len(fine), axes))
    for _ in range(6):
        pulse = 2.0 * np.pi / rng.uniform(8.0, 16.0)
        phase = pulse * fine[:, None] + rng.uniform(0.0, 2.0 * np.pi, axes)
        height = _WAVE * rng.standard_normal(axes)
        position += height * np.sin(phase)
        velocity += height * pulse * np.cos(phase)
    return Path(position, velocity)


def _integral(velocity: FloatArray) -> FloatArray:
    """Trapezoidal integral on the fine grid, from 0."""
    position = np.zeros_like(velocity)
    position[1:] = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]), axis=0) / _FINE
    return position


def _at(time: FloatArray, fine: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(time, fine, column) for column in values.T])
