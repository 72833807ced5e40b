"""Noise figures and the motion model of a log: what the user gave, else what the data say."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.noise import NoiseFigures, Observations, estimate_noise, grain
from surefix.models.motion import MODELS
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import METRES_PER_DEGREE, Rows
from surefix.types import FloatArray, Noise

__all__ = ["Figures", "settle_noise"]

_LOOKED_AT = 50_000  # rows whose digits are looked at
_PROCESS_UNIT = {"cv": "m/s^1.5", "ca": "m/s^2.5"}


class Figures(NamedTuple):
    """Noise figures of a log under one motion model.

    Parameters
    ----------
    model
        ``cv`` or ``ca``.
    position, velocity
        (sensors, 3) standard deviations; NaN where a sensor has no such observation.
    density
        (axes,) spectral density of the process noise.
    noise
        The same for people.
    cost
        Negative log-likelihood.
    """

    model: str
    position: FloatArray
    velocity: FloatArray
    density: FloatArray
    noise: tuple[Noise, ...]
    cost: float


def settle_noise(
    rows: Rows,
    position: FloatArray,
    velocity: FloatArray,
    axes: tuple[int, ...],
    sensors: list[str],
    options: CleanOptions,
) -> Figures:
    """Give the noise of every sensor, under the likeliest of the motion models to choose from.

    Parameters
    ----------
    rows
        The head of a log.
    position, velocity
        (n, 3) in the local frame; NaN where not to be used.
    axes
        Which of x, y, z are observed.
    sensors, options
        Names of the sensors; figures given by the user.
    """
    tried = [
        _under(model, rows, position, velocity, axes, sensors, options) for model in options.models
    ]
    return min(tried, key=lambda figures: figures.cost)


def _under(
    model: str,
    rows: Rows,
    position: FloatArray,
    velocity: FloatArray,
    axes: tuple[int, ...],
    sensors: list[str],
    options: CleanOptions,
) -> Figures:
    sigma_position = np.full((len(sensors), 3), np.nan)
    sigma_velocity = np.full((len(sensors), 3), np.nan)
    density, cost = np.zeros(len(axes)), 0.0
    noise: list[Noise] = []
    for vertical in (False, True):
        block = [i for i in axes if (i == 2) == vertical]
        if not block:
            continue
        declared = np.hstack(
            [rows.fixes.sigma_position[:, block], rows.fixes.sigma_velocity[:, block]]
        )
        z = np.hstack([position[:, block], velocity[:, block]])
        known = np.isfinite(rows.tau) & np.isfinite(z).any(axis=1)
        observations = Observations(
            rows.tau[known], z[known], rows.fixes.sensor[known], declared[known]
        )
        given = _given(options, sensors, rows, vertical)
        found = estimate_noise(
            observations,
            given,
            order=MODELS[model],
            quantum=_quantum(rows, block),
            velocity_quantum=_velocity_quantum(velocity, block),
        )
        sigma_position[:, block] = found.position[:, None]
        sigma_velocity[:, block] = found.velocity[:, None]
        density[[axes.index(i) for i in block]] = found.process**2
        cost += found.cost
        noise += _named(found, given, sensors, vertical, model, observations)
    return Figures(model, sigma_position, sigma_velocity, density, tuple(noise), cost)


def _given(options: CleanOptions, sensors: list[str], rows: Rows, vertical: bool) -> NoiseFigures:
    """The user's figures per sensor; NaN where there is none."""
    general = (options.sigma_height if vertical else options.sigma_position) or np.nan
    position = np.full(len(sensors), np.nan)
    velocity = np.full(len(sensors), options.sigma_velocity or np.nan)
    for i, name in enumerate(sensors):
        mine = rows.fixes.sensor == i
        if not rows.auxiliary[mine].any():
            position[i] = general
        own = options.sensor_sigma.get(name)
        if own is not None and np.isfinite(rows.fixes.position[mine]).any():
            position[i] = own
        elif own is not None:
            velocity[i] = own
    return NoiseFigures(position, velocity, options.process or np.nan)


def _quantum(rows: Rows, block: list[int]) -> float:
    """Resolution of the recorded positions along the axes of a block, m; the coarsest counts."""
    recorded = rows.fixes.position[~rows.auxiliary]
    steps = [grain(recorded[:_LOOKED_AT, axis]) for axis in block]
    if rows.fixes.geographic and block[0] != 2:
        latitude = np.nanmedian(recorded[:, 0]) if np.isfinite(recorded[:, 0]).any() else 0.0
        per_degree = (METRES_PER_DEGREE, METRES_PER_DEGREE * np.cos(np.radians(latitude)))
        steps = [step * scale for step, scale in zip(steps, per_degree, strict=False)]
    return float(max(steps))


def _velocity_quantum(velocity: FloatArray, block: list[int]) -> float:
    """Resolution of the velocities along a block, m/s; horizontal ones may be speed and course."""
    if len(block) < 2:
        return grain(velocity[:_LOOKED_AT, block[0]])
    east, north = velocity[:_LOOKED_AT, 0], velocity[:_LOOKED_AT, 1]
    speed, course = np.hypot(east, north), np.arctan2(east, north)
    moving = speed[speed > 0.0]
    usual = float(np.median(moving)) if len(moving) else 0.0
    return max(
        grain(np.round(speed, 6).astype(np.float64)),
        usual * grain(np.round(course[speed > 0.0], 6).astype(np.float64)),
    )


def _named(
    found: NoiseFigures,
    given: NoiseFigures,
    sensors: list[str],
    vertical: bool,
    model: str,
    observations: Observations,
) -> list[Noise]:
    axes = observations.z.shape[1] // 2
    words = ("height", "vertical velocity") if vertical else ("position", "velocity")
    out = []
    for sensor, name in enumerate(sensors):
        rows = observations.sensor == sensor
        for word, value, fixed, part in (
            (words[0], found.position[sensor], given.position[sensor], slice(0, axes)),
            (words[1], found.velocity[sensor], given.velocity[sensor], slice(axes, None)),
        ):
            if not np.isfinite(value) or not np.isfinite(observations.z[rows, part]).any():
                continue
            declared = observations.declared[rows, part]
            source = "given" if np.isfinite(fixed) else "estimated"
            unit = "m" if part.start == 0 else "m/s"
            if np.isfinite(declared).any():
                out.append(Noise(name, word, float(np.nanmedian(declared)), unit, "declared"))
            else:
                out.append(Noise(name, word, float(value), unit, source))
    word = "vertical acceleration" if vertical else "acceleration"
    word = word.replace("acceleration", "jerk") if model == "ca" else word
    source = "given" if np.isfinite(given.process) else "estimated"
    return [*out, Noise("motion", word, found.process, _PROCESS_UNIT[model], source)]
