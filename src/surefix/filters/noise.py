"""Noise figures from the data: nobody has to know them, and a user's figure always wins.

The measurement noise of every sensor and the density of the process noise maximise the likelihood
of the innovations of a gated filter, each innovation being normal with probability 1 − ε and
anywhere within a wide window otherwise: gross errors cost a constant, whatever their size.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.simplex import descend
from surefix.filters.track import filter_track, start
from surefix.robust.loss import loss_named
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = [
    "NoiseFigures",
    "Observations",
    "difference_scale",
    "estimate_noise",
    "grain",
    "initial_scales",
    "sample_of",
    "speed_scale",
    "typical_step",
    "variances",
]

_OUTLIERS = 0.05  # prior share of gross errors
_WINDOW = 100.0  # width of the window gross errors fall in, in initial standard deviations
_SAMPLE = 2000  # epochs the likelihood is evaluated on
_FEW = 30  # rows that a sensor needs for a figure of its own, where there are others
_SHRINKS = (0.0, -1.4, -2.8)  # logarithms by which the initial figures are tried smaller
_BLOCKS = 6  # stretches of the log they come from


class Observations(NamedTuple):
    """Observations of a set of axes that share their noise figures.

    Parameters
    ----------
    time
        (n,) s, not decreasing.
    z
        (n, 2a) position, then velocity of a axes; NaN is missing.
    sensor
        (n,) which sensor each row came from.
    declared
        (n, 2a) standard deviations that came with the records; NaN where none did.
    """

    time: FloatArray
    z: FloatArray
    sensor: IntArray
    declared: FloatArray


class NoiseFigures(NamedTuple):
    """Standard deviations by sensor, and the root of the process noise density.

    ``position`` and ``velocity`` are (sensors,), m and m/s, NaN where the sensor has no such
    observation; ``process`` is √q, m/s^1.5 for constant velocity. ``cost`` is the negative
    log-likelihood they reach, 0 where none was evaluated.
    """

    position: FloatArray
    velocity: FloatArray
    process: float
    cost: float = 0.0


def difference_scale(
    time: FloatArray, z: FloatArray, period: float = 0.0, share: float = 0.25
) -> float:
    """Standard deviation of the noise of a series, from each value and its two neighbours.

    ``z_k`` minus the straight line between its neighbours has variance ``σ²(1 + a² + b²)``; the
    lower quartile of the normalised differences survives two thirds of bad triples. Motion adds to
    it, so it is an upper bound. NaN if there are fewer than three distinct times.

    Parameters
    ----------
    time, z
        (n,) series without NaN; ``period`` > 0 for angles.
    share
        The quantile. Less survives more bad triples, but knows the scale less well.

    >>> difference_scale(np.arange(5.0), np.array([0.0, 1.0, 2.0, 3.0, 4.0]))
    0.0
    """
    keep = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    t, y = time[keep], z[keep]
    if period > 0.0:
        y = np.unwrap(y, period=period)
    if len(t) < 3:
        return float("nan")
    a = (t[2:] - t[1:-1]) / (t[2:] - t[:-2])
    residual = y[1:-1] - (a * y[:-2] + (1.0 - a) * y[2:])
    normalised: FloatArray = np.abs(residual) / np.sqrt(1.0 + a**2 + (1.0 - a) ** 2)
    small = float(np.quantile(normalised, share))
    if small == 0.0 and (normalised > 0.0).any():  # coarse digits: most differences are nought
        small = float(np.quantile(normalised[normalised > 0.0], share))
    return small / NormalDist().inv_cdf(0.5 + 0.5 * share)


def grain(values: FloatArray) -> float:
    """Resolution of a series: the smallest step between the values that occur.

    >>> grain(np.array([0.3, 0.1, 0.2, 0.4]))
    0.1
    """
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    steps = steps[steps > 1e-9]
    return round(float(steps.min()), 9) if len(steps) > 2 else 0.0


def speed_scale(time: FloatArray, z: FloatArray, span: int = 10) -> float:
    """Twice the 90 % quantile of the speed over ``span`` observations along one axis, m/s."""
    span = min(span, len(time) - 1)
    if span < 1:
        return 1.0
    dt = time[span:] - time[:-span]
    step = np.abs(z[span:] - z[:-span])[dt > 0.0]
    return 2.0 * float(np.quantile(step / dt[dt > 0.0], 0.9)) if len(step) else 1.0


def estimate_noise(
    observations: Observations,
    given: NoiseFigures,
    *,
    order: int = 2,
    period: float = 0.0,
    quantum: float = 0.0,
    velocity_quantum: float = 0.0,
) -> NoiseFigures:
    """Estimate the noise figures that ``given`` leaves NaN.

    Parameters
    ----------
    observations
        The log; a few thousand rows in blocks spread over it are used.
    given
        Figures that are known; their length tells how many sensors there are.
    order, period
        Of the motion model.
    quantum, velocity_quantum
        Resolution of positions and velocities: no estimate falls below ``quantum/√12``.
    """
    sample = sample_of(observations)
    axes = sample.z.shape[1] // 2
    start_position = initial_scales(sample, given.position, slice(0, axes), period)
    start_velocity = initial_scales(sample, given.velocity, slice(axes, 2 * axes), 0.0)
    floor = max(quantum / np.sqrt(12.0), 1e-9)
    floor_velocity = max(velocity_quantum / np.sqrt(12.0), 1e-9)
    position, velocity = np.fmax(start_position, floor), np.fmax(start_velocity, floor_velocity)
    free_position = np.isnan(given.position) & np.isfinite(start_position)
    free_velocity = np.isnan(given.velocity) & np.isfinite(start_velocity)
    free_process = np.isnan(given.process)
    position[~np.isfinite(start_position)] = np.nan
    velocity[~np.isfinite(start_velocity)] = np.nan
    reference = _reference_process(sample, position, order)
    scale = NoiseFigures(position.copy(), velocity.copy(), reference)

    def figures(theta: FloatArray) -> NoiseFigures:
        p, v, i = position.copy(), velocity.copy(), int(free_position.sum())
        j = i + int(free_velocity.sum())
        p[free_position] = np.maximum(scale.position[free_position] * _bounded(theta[:i]), floor)
        v[free_velocity] = np.maximum(
            scale.velocity[free_velocity] * _bounded(theta[i:j]), floor_velocity
        )
        process = reference * np.exp(theta[j]) if free_process else given.process
        return NoiseFigures(p, v, float(process))

    def cost(theta: FloatArray) -> float:
        return _cost(sample, figures(theta), scale, order, period)

    size = int(free_position.sum()) + int(free_velocity.sum()) + int(free_process)
    if len(sample.time) < 3:
        return figures(np.zeros(size))
    if size == 0:
        return figures(np.zeros(0))._replace(cost=cost(np.zeros(0)))
    best = np.zeros(size)
    if free_process:
        measured = size - 1
        trials = [
            np.array([*np.full(measured, shrink), level])
            for shrink in _SHRINKS[: 1 if measured == 0 else None]
            for level in np.arange(-9.0, 3.1, 1.5 if shrink == 0.0 else 3.0)
        ]
        best = trials[int(np.argmin([cost(trial) for trial in trials]))]
    simplex = np.vstack([best, best - 0.7 * np.eye(size)])
    found = descend(cost, simplex, near=0.04, level=0.3, most=60 * size)
    return figures(found.x)._replace(cost=found.value)


def _bounded(theta: FloatArray) -> FloatArray:
    """Factor on an initial standard deviation, within a factor of 30 of it."""
    return np.asarray(np.exp(np.clip(theta, -3.4, 3.4)))


def sample_of(observations: Observations) -> Observations:
    """Keep a few thousand rows: blocks of neighbours, evenly spread over the log.

    The blocks are as long as the slowest sensor needs; faster sensors are thinned within them.
    """
    present = np.asarray(np.any(np.isfinite(observations.z), axis=1))
    sensors, counts = np.unique(observations.sensor[present], return_counts=True)
    keep = np.zeros(len(present), dtype=np.bool_)
    if len(sensors):
        each = _SAMPLE // len(sensors)
        slow = sensors[_base(observations.time, present, observations.sensor, sensors, counts)]
        slowest = np.flatnonzero(present & (observations.sensor == slow))
        spans = _blocks(slowest, each)
        for sensor in sensors:
            rows = np.flatnonzero(present & (observations.sensor == sensor))
            rows = np.concatenate([rows[(rows >= a) & (rows <= b)] for a, b in spans])
            keep[rows[:: max(1, len(rows) // each)]] = True
    return Observations(
        observations.time[keep],
        observations.z[keep],
        observations.sensor[keep],
        observations.declared[keep],
    )


def _base(
    time: FloatArray, present: BoolArray, sensor: IntArray, sensors: IntArray, counts: IntArray
) -> int:
    """Which of the sensors that last for most of the log is the slowest."""
    lasts = [np.ptp(time[present & (sensor == s)]) for s in sensors]
    steady = np.asarray(lasts) >= 0.5 * max(lasts)
    return int(np.argmin(np.where(steady, counts, np.inf)))


def _blocks(rows: IntArray, size: int) -> list[tuple[int, int]]:
    """First and last row of the blocks that hold about ``size`` of the given rows."""
    if len(rows) <= size:
        return [(int(rows[0]), int(rows[-1]))]
    length = size // _BLOCKS
    starts = np.linspace(0, len(rows) - length, _BLOCKS).astype(int)
    return [(int(rows[s]), int(rows[s + length - 1])) for s in starts]


def initial_scales(
    sample: Observations,
    given: FloatArray,
    columns: slice,
    period: float,
    share: float = 0.25,
) -> FloatArray:
    """Per sensor: the given figure, or the difference scale over the axes; NaN if unobserved."""
    out = given.copy()
    for sensor in range(len(given)):
        rows = sample.sensor == sensor
        scales = []
        for c in range(*columns.indices(sample.z.shape[1])):
            seen = rows & np.isfinite(sample.z[:, c])
            scales.append(difference_scale(sample.time[seen], sample.z[seen, c], period, share))
            if not np.isfinite(scales[-1]) and seen.any():
                scales[-1] = 1.0
        usable = [s for s in scales if np.isfinite(s)]
        if rows.sum() < _FEW and rows.sum() < len(rows) // 2:
            usable = []
        if np.isnan(out[sensor]) and usable:
            positive = [s for s in usable if s > 0.0]
            out[sensor] = max(positive) if positive else 1e-3
        elif not usable:
            out[sensor] = np.nan
    return out


def _reference_process(sample: Observations, position: FloatArray, order: int) -> float:
    """√q at which a step's process noise equals the measurement noise."""
    step = typical_step(sample.time)
    seen = position[np.isfinite(position)]
    sigma = float(seen.min()) if len(seen) else 1.0
    return float(sigma / step ** (order - 0.5))


def typical_step(time: FloatArray, alone: float = 1.0) -> float:
    """Median of the positive steps of ``time`` (n,), s; ``alone`` where there is none.

    >>> typical_step(np.array([0.0, 1.0, 1.0, 3.0, 4.0]))
    1.0
    """
    steps = np.diff(time)
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else alone


def variances(observations: Observations, figures: NoiseFigures) -> FloatArray:
    """(n, 2a) variance of every observation: declared by its record, else its sensor's figure."""
    axes = observations.z.shape[1] // 2
    sigma = np.empty_like(observations.z)
    sigma[:, :axes] = figures.position[observations.sensor, None]
    sigma[:, axes:] = figures.velocity[observations.sensor, None]
    known = np.isfinite(observations.declared)
    sigma[known] = observations.declared[known]
    for part, pool in ((sigma[:, :axes], figures.position), (sigma[:, axes:], figures.velocity)):
        known = pool[np.isfinite(pool)]
        part[~np.isfinite(part)] = np.median(known) if len(known) else 1.0
    return sigma**2


def _cost(
    sample: Observations, figures: NoiseFigures, scale: NoiseFigures, order: int, period: float
) -> float:
    """Negative log-likelihood of the innovations under the mixture."""
    axes = sample.z.shape[1] // 2
    n = len(sample.time)
    group = np.repeat([0, 1], axes)
    motion = Motion(order, axes, np.full(axes, figures.process**2), group, 2, period)
    typical = typical_step(sample.time)
    speed = max(speed_scale(sample.time, np.nan_to_num(sample.z[:, 0])), 1e-6)
    recovery = Recovery(30.0 * typical, speed)
    epochs = Epochs(
        sample.time,
        sample.z,
        variances(sample, figures),
        np.full((n, 2), np.nan),
        np.zeros(n, np.int64),
    )
    gate = loss_named("gate", false_alarm=1e-4)
    _, out, _ = filter_track(motion, gate, recovery, epochs, start(motion, recovery))
    total = 0.0
    for g, reference in ((0, scale.position), (1, scale.velocity)):
        seen = np.isfinite(out.nis[:, g])
        if not seen.any():
            continue
        observed = np.isfinite(sample.z[seen, g * axes : (g + 1) * axes]).sum(axis=1)
        log_normal = -0.5 * (out.nis[seen, g] + out.logdet[seen, g]) - observed * 0.5 * np.log(
            2 * np.pi
        )
        window = _WINDOW * np.nan_to_num(reference[sample.sensor[seen]], nan=1.0)
        log_uniform = -observed * np.log(window)
        total -= np.logaddexp(np.log1p(-_OUTLIERS) + log_normal, np.log(_OUTLIERS) + log_uniform)[
            min(3, len(log_normal)) :
        ].sum()
    return float(total)
