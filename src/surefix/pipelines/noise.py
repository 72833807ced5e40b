"""Noise figures and the motion model of a log: what the user gave, else what the data say."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.cleaning.duplicates import constant_axes
from surefix.filters.hypotheses import MOST_SENSORS, Prior
from surefix.filters.learning import learn, likelihood
from surefix.filters.noise import NoiseFigures, Observations, estimate_noise, grain
from surefix.io.nmea_sentence import KMH, KNOT
from surefix.models.motion import MODELS
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import METRES_PER_DEGREE, Rows
from surefix.types import BoolArray, FloatArray, Noise

__all__ = ["PROCESS_UNIT", "Figures", "settle_noise"]

_MEMORY = 300.0  # observations by which noise is adapted in real time
_LOOKED_AT = 50_000  # rows whose digits are looked at
_SPEEDS = tuple(unit * digit for unit in (1.0, KNOT, KMH) for digit in (0.1, 0.01, 0.001))
_COURSES = tuple(float(np.radians(digit)) for digit in (1.0, 0.1, 0.01))
_FITS = 1e-6  # of a step, within which a value is a multiple of it
PROCESS_UNIT = {"cv": "m/s^1.5", "ca": "m/s^2.5"}
"""Of the process noise of each motion model."""


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
    prior
        What a multi-hypothesis filter supposes; None for another method.
    """

    model: str
    position: FloatArray
    velocity: FloatArray
    density: FloatArray
    noise: tuple[Noise, ...]
    prior: Prior | None


class _Block(NamedTuple):
    """Axes that share their figures: the horizontal ones, or the vertical one."""

    axes: list[int]
    observations: Observations
    given: NoiseFigures
    floor: tuple[float, float]
    found: NoiseFigures
    prior: Prior | None = None


def settle_noise(
    rows: Rows,
    position: FloatArray,
    velocity: FloatArray,
    axes: tuple[int, ...],
    sensors: list[str],
    options: CleanOptions,
    speed: float,
    longest: float,
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
    speed
        Standard deviation of a velocity nothing is known about, m/s.
    longest
        Longest run of wrong fixes to be survived, s.
    """
    tried = {
        model: _blocks(model, rows, position, velocity, axes, sensors, options)
        for model in options.models
    }
    model = min(tried, key=lambda name: sum(block.found.cost for block in tried[name]))
    blocks = tried[model]
    if options.several:
        model, blocks = _learnt_best(tried, model, speed, longest, drags=options.drags)
    sigma_position = np.full((len(sensors), 3), np.nan)
    sigma_velocity = np.full((len(sensors), 3), np.nan)
    density = np.zeros(len(axes))
    noise: list[Noise] = []
    for block in blocks:
        sigma_position[:, block.axes] = block.found.position[:, None]
        sigma_velocity[:, block.axes] = block.found.velocity[:, None]
        density[[axes.index(i) for i in block.axes]] = block.found.process**2
        noise += _named(block, sensors, model)
    prior = _joined(blocks, axes)
    if prior is not None and options.mode == "realtime" and blocks[0].axes != [2]:
        prior = prior._replace(adapt=_adapting(blocks[0]))
    return Figures(model, sigma_position, sigma_velocity, density, tuple(noise), prior)


def _blocks(
    model: str,
    rows: Rows,
    position: FloatArray,
    velocity: FloatArray,
    axes: tuple[int, ...],
    sensors: list[str],
    options: CleanOptions,
) -> list[_Block]:
    """Figures of the horizontal and of the vertical axes under one motion model."""
    out = []
    recorded = np.where(np.isfinite(velocity), rows.fixes.velocity, np.nan)  # in its own axes
    for vertical in (False, True):
        block = [i for i in axes if (i == 2) == vertical]
        if not block:
            continue
        stated = rows.fixes.sigma_position, rows.fixes.sigma_velocity
        declared = np.hstack([part.take(block, axis=1) for part in stated])
        placed = np.where(_still(rows, block, len(sensors)), np.nan, position.take(block, axis=1))
        z = np.hstack([placed, velocity.take(block, axis=1)])  # C-contiguous
        known = np.isfinite(rows.tau) & np.isfinite(z).any(axis=1)
        observations = Observations(
            rows.tau[known], z[known], rows.fixes.sensor[known], declared[known]
        )
        given = _given(options, sensors, rows, vertical)
        quantum = _quantum(rows, block), _velocity_quantum(recorded, block)
        found = estimate_noise(
            observations,
            given,
            order=MODELS[model],
            quantum=quantum[0],
            velocity_quantum=quantum[1],
        )
        floor = (max(quantum[0] / 12.0**0.5, 1e-9), max(quantum[1] / 12.0**0.5, 1e-9))
        out.append(_Block(block, observations, given, floor, found))
    return out


def _learnt_best(
    tried: dict[str, list[_Block]], plain: str, speed: float, longest: float, *, drags: bool
) -> tuple[str, list[_Block]]:
    """Learn under the likelier motion model; under both, where what is wrong may last or not.

    A run of wrong velocities looks like a livelier motion to the ``plain`` choice, which judges
    each by itself; the other one depends on figures that are not learnt yet.
    """

    def fit(name: str, blocks: list[_Block]) -> float:
        return sum(
            likelihood(
                block.observations,
                block.found,
                order=MODELS[name],
                period=0.0,
                speed=speed,
                longest=longest,
            )
            for block in blocks
        )

    likely = plain if len(tried) == 1 else max(tried, key=lambda name: fit(name, tried[name]))
    learnt = {
        name: [_learnt(block, name, speed, longest, drags=drags) for block in tried[name]]
        for name in sorted({plain, likely})
    }
    if len(learnt) > 1:
        likely = max(learnt, key=lambda name: fit(name, learnt[name]))
    return likely, learnt[likely]


def _learnt(block: _Block, model: str, speed: float, longest: float, *, drags: bool) -> _Block:
    """Let the figures of a block follow from what belongs to the track."""
    learnt = learn(
        block.observations,
        block.given,
        block.found,
        order=MODELS[model],
        period=0.0,
        speed=speed,
        longest=longest,
        floor=block.floor,
        drags=drags,
    )
    return block._replace(found=learnt.figures, prior=learnt.prior)


def _joined(blocks: list[_Block], axes: tuple[int, ...]) -> Prior | None:
    """One prior for all axes: that of the first block, with the scales of each."""
    priors = [block.prior for block in blocks if block.prior is not None]
    if not priors:
        return None
    d, first, last = len(axes), priors[0], priors[-1]
    spread = np.ones(2 * d)
    for block in blocks:
        assert block.prior is not None
        own = len(block.axes)
        for j, i in enumerate(block.axes):
            at = axes.index(i)
            spread[at], spread[d + at] = block.prior.spread[j], block.prior.spread[own + j]
    alone = last.isolated - first.isolated if last is not first else 0.0
    return first._replace(partial=max(first.partial, alone), spread=spread)


def _adapting(block: _Block) -> FloatArray:
    """How fast noise follows a stream: that of fixes which nobody gave or declared.

    Sensors of depths and velocities stay as settled: they come so often that what a model misses
    of the motion would be taken for their noise.
    """
    adapt = np.zeros(MOST_SENSORS)
    d = len(block.axes)
    for sensor in range(min(len(block.given.position), MOST_SENSORS)):
        mine = block.observations.sensor == sensor
        placed = np.isfinite(block.observations.z[mine, :d]).any()
        declared = np.isfinite(block.observations.declared[mine, :d]).any()
        if placed and not declared and np.isnan(block.given.position[sensor]):
            adapt[sensor] = 1.0 / _MEMORY
    return adapt


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


def _still(rows: Rows, block: list[int], sensors: int) -> BoolArray:
    """Positions of a sensor along an axis whose digits never change, while those beside it do."""
    axes = rows.fixes.position[:, block]
    if rows.fixes.geographic and len(block) == 2:
        axes = axes[:, ::-1]  # latitude comes first there, east here
    return np.asarray(constant_axes(axes, rows.fixes.sensor, sensors)[rows.fixes.sensor])


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
    """Resolution of recorded velocities along a block, m/s; horizontal ones may be speed, course.

    They may also never change: then it is what their digits tell.
    """
    seen = velocity[:_LOOKED_AT, block]
    steps = [_step(column, _SPEEDS) for column in seen.T]
    if len(block) == 2:
        speed, course = np.hypot(*seen.T), np.arctan2(*seen.T)
        moving = speed > 0.0
        usual = float(np.median(speed[moving])) if moving.any() else 0.0
        steps += [_step(speed, _SPEEDS), usual * _step(course[moving], _COURSES)]
    return max(steps)


def _step(values: FloatArray, usual: tuple[float, ...]) -> float:
    """Resolution of a series; if only a few values occur the coarsest usual one that they fit."""
    found = grain(np.round(values, 6).astype(np.float64))
    known = np.unique(values[np.isfinite(values)])
    if found > 0.0 or not len(known):
        return found
    fit = (step for step in usual if (np.abs(known / step - np.rint(known / step)) < _FITS).all())
    return max(fit, default=0.0)


def _named(block: _Block, sensors: list[str], model: str) -> list[Noise]:
    """The figures of a block for people."""
    observations, found, given = block.observations, block.found, block.given
    vertical = block.axes == [2]
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
    return [*out, Noise("motion", word, found.process, PROCESS_UNIT[model], source)]
