"""What the multi-hypothesis filter learns from a log: noise figures, and how often fixes are wrong.

In turns: decide which observations belong to the track under the present figures; take the figures
that make these likeliest; count what was left out. A gross error then no longer counts in the
noise, and what is supposed of gross errors is what the log shows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.filters.hypotheses import Prior
from surefix.filters.hypothesis_evidence import BEGIN, BRIEFLY, evidence
from surefix.filters.hypothesis_review import deleted_residuals
from surefix.filters.hypothesis_trail import Decisions
from surefix.filters.learning_shares import counted
from surefix.filters.multi_hypothesis_modes import decide_offline
from surefix.filters.noise import (
    NoiseFigures,
    Observations,
    initial_scales,
    sample_of,
    typical_step,
    variances,
)
from surefix.filters.records import Epochs, Motion
from surefix.filters.rounding import rounding_noise
from surefix.filters.simplex import descend
from surefix.filters.track import by_axis
from surefix.types import FloatArray

__all__ = ["Learnt", "learn", "likelihood", "supposed"]

_ROUNDS = 3
_ENOUGH = 0.02  # relative change of the figures, and change of the shares, that ends the rounds
_WILD = 30.0  # scale of gross errors to begin with, in standard deviations
_DRAG = 1e-5  # probability that a drag begins in a stretch of eight fixes, if any do
_BIAS = 2.0  # standard deviations that velocities may be wrong by for good
_SHRINKS = (1.0, 0.3, 0.1, 0.03)  # of the noise of the positions, tried at first
_FEWEST = 0.1  # share of good triples of neighbours that tell the scale of differences …
_DIFFER = 0.25  # … and share of the scale of differences that no figure to begin with falls below
_MANY = 0.2  # share of gross errors supposed meanwhile, in rows or not
_WIDEST = 3.4  # logarithm of the factor that a round may change a figure by
_LEAST = 0.3  # share of the figures begun with that none falls below
_NO_DIGIT = 1e-8  # m/s, below which velocities are not rounded
_MATTERS = 1.05  # … and how much more than white noise rounding must cost to count


class Learnt(NamedTuple):
    """Noise figures of one block of axes, and what to suppose of its gross errors.

    Parameters
    ----------
    figures
        As `surefix.filters.noise.estimate_noise` gives them.
    prior
        Of a filter on these axes.
    """

    figures: NoiseFigures
    prior: Prior


def supposed(
    axes: int,
    sigma_position: float,
    sigma_velocity: float,
    speed: float,
    longest: float,
    *,
    drags: bool = False,
) -> Prior:
    """What is supposed of a log that nothing is known of.

    Parameters
    ----------
    axes
        How many there are.
    sigma_position, sigma_velocity
        Usual noise, m and m/s.
    speed
        Standard deviation of a velocity nothing is known about, m/s.
    longest
        Longest run, s.
    drags
        Whether fixes may wander off slowly.
    """
    return Prior(
        isolated=0.05,
        partial=0.005,
        poor=0.02,
        burst=0.001,
        ending=1.0 / 15.0,
        longest=longest,
        manoeuvre=2e-5,
        velocity=0.02,
        again=0.9,
        spread=np.repeat([_WILD * sigma_position, _WILD * sigma_velocity], axes),
        sigma_velocity=speed,
        drag=_DRAG if drags else 0.0,
        steady=_BIAS * sigma_velocity,
    )


def learn(
    observations: Observations,
    given: NoiseFigures,
    first: NoiseFigures,
    *,
    order: int,
    period: float,
    speed: float,
    longest: float,
    floor: tuple[float, float],
    drags: bool = False,
) -> Learnt:
    """Learn the figures that ``given`` leaves NaN, and the prior.

    Parameters
    ----------
    observations
        The log; a few thousand rows in blocks spread over it are used.
    given, first
        Figures that are known, and others to begin with.
    order, period
        Of the motion model.
    speed, longest, drags
        As for `supposed`.
    floor
        Least standard deviations of positions and velocities: their resolution over √12.
    """
    sample = sample_of(observations)
    axes = sample.z.shape[1] // 2
    prior = supposed(axes, *_usual(first), speed, longest, drags=drags)
    if len(sample.time) < 3 or not np.isfinite(first.position).any():
        return Learnt(first, prior)
    motion = _motion(first, axes, order, period)
    figures = _begun(sample, given, first, prior, floor, motion)
    least = figures._replace(
        position=np.maximum(figures.position * _LEAST, floor[0]),
        velocity=np.maximum(figures.velocity * _LEAST, floor[1]),
    )
    noisy = None
    for _ in range(_ROUNDS):
        motion, epochs = _motion(figures, axes, order, period), _epochs(sample, figures)
        said, weight, smoothed = decide_offline(motion, prior, epochs)
        residual, variance = deleted_residuals(motion, epochs, weight, smoothed)
        supposed_before, before = prior, figures
        prior = counted(prior, said, residual, variance, epochs.variance, sample.sensor)
        figures = _likeliest(sample, said, prior, given, before, least, motion)
        if noisy is None:
            noisy = np.sqrt(np.maximum(figures.velocity**2 - floor[1] ** 2, 0.0))
        rounded = _rounded(observations, figures, noisy, floor[1], order)
        least = least._replace(velocity=np.fmax(least.velocity, rounded))
        higher = np.where(np.isnan(given.velocity), least.velocity, 0.0)
        figures = figures._replace(velocity=np.maximum(figures.velocity, higher))
        if _change(before, figures) < _ENOUGH and _moved(supposed_before, prior) < _ENOUGH:
            break
    return Learnt(figures, prior)


def likelihood(
    observations: Observations,
    figures: NoiseFigures,
    *,
    order: int,
    period: float,
    speed: float,
    longest: float,
) -> float:
    """Log-likelihood of a log before anything is learnt, by which motion models are told apart.

    A run of wrong velocities is explained by a livelier model, unless it may be a run.

    Parameters
    ----------
    observations, order, period, speed, longest
        As for `learn`.
    figures
        Those to begin with.
    """
    sample = sample_of(observations)
    axes = sample.z.shape[1] // 2
    if len(sample.time) < 3 or not np.isfinite(figures.position).any():
        return -figures.cost
    prior = supposed(axes, *_usual(figures), speed, longest)._replace(isolated=_MANY, row=_MANY)
    motion, epochs = _motion(figures, axes, order, period), _epochs(sample, figures)
    return _evidence(motion, figures, prior, epochs, BRIEFLY)


def _rounded(
    observations: Observations, figures: NoiseFigures, noisy: FloatArray, floor: float, order: int
) -> FloatArray:
    """(sensors,) what velocities are worth at best for their digits; 0 where they do not matter.

    Parameters
    ----------
    observations, figures, order
        The log, its figures so far, and the motion model.
    noisy
        (sensors,) noise of the velocities before they were rounded.
    floor
        What rounding costs if it is white.
    """
    axes = observations.z.shape[1] // 2
    least = np.zeros_like(noisy)
    every, between = (
        _interval(observations.time, observations.z[:, part])
        for part in (slice(axes, None), slice(axes))
    )
    if not (every > 0.0 and between > 0.0 and floor > _NO_DIGIT):
        return least
    change = figures.process * math.sqrt(every)
    if order > 2:
        steps = np.diff(
            observations.z[np.isfinite(observations.z[:, axes:]).all(axis=1), axes:], axis=0
        )
        change = float(np.sqrt(np.mean(steps**2))) if steps.size else 0.0
    weight = _usual(figures)[0] * math.sqrt(between)
    for s in np.flatnonzero(np.isfinite(noisy)):
        white = math.hypot(floor, noisy[s])
        worth = rounding_noise(floor * math.sqrt(12.0), change, every, weight, float(noisy[s]))
        least[s] = worth if worth > _MATTERS * white else 0.0
    return least


def _interval(time: FloatArray, z: FloatArray) -> float:
    """Median time between what is observed, s; 0 where there is too little."""
    return typical_step(time[np.isfinite(z).any(axis=1)], alone=0.0)


def _motion(figures: NoiseFigures, axes: int, order: int, period: float) -> Motion:
    return Motion(order, axes, np.full(axes, figures.process**2), by_axis(axes), 2 * axes, period)


def _epochs(sample: Observations, figures: NoiseFigures) -> Epochs:
    n, m = sample.z.shape
    return Epochs(
        sample.time,
        sample.z,
        variances(sample, figures),
        np.full((n, m), np.nan),
        np.zeros(n, np.int64),
        sample.sensor,
    )


def _usual(figures: NoiseFigures) -> tuple[float, float]:
    """Median noise of positions and of velocities over the sensors, 1 where there is none."""
    known = [part[np.isfinite(part)] for part in (figures.position, figures.velocity)]
    position, velocity = (float(np.median(part)) if len(part) else 1.0 for part in known)
    return position, velocity


def _likeliest(
    sample: Observations,
    said: Decisions,
    prior: Prior,
    given: NoiseFigures,
    first: NoiseFigures,
    least: NoiseFigures,
    motion: Motion,
) -> NoiseFigures:
    """Figures that maximise the likelihood of what was decided to belong to the track."""
    free_position = np.isnan(given.position) & np.isfinite(first.position)
    free_velocity = np.isnan(given.velocity) & np.isfinite(first.velocity)
    i = int(free_position.sum())
    j = i + int(free_velocity.sum())
    size = j + int(math.isnan(given.process))
    if size == 0:
        return first

    weight = np.where(said.fixed > 0.0, said.fixed, 1.0)
    used = sample._replace(z=np.where(said.fixed > 0.0, sample.z, np.nan))

    def figures(theta: FloatArray) -> NoiseFigures:
        factor: FloatArray = np.exp(np.clip(theta, -_WIDEST, _WIDEST))
        p, v = first.position.copy(), first.velocity.copy()
        p[free_position] = np.maximum(p[free_position] * factor[:i], least.position[free_position])
        v[free_velocity] = np.maximum(v[free_velocity] * factor[i:j], least.velocity[free_velocity])
        return NoiseFigures(p, v, float(first.process * factor[j]) if size > j else first.process)

    def cost(theta: FloatArray) -> float:
        trial = figures(theta)
        epochs = _epochs(used, trial)
        epochs = epochs._replace(
            variance=epochs.variance / weight, fixed=said.fixed, jump=said.jump
        )
        return -_evidence(motion, trial, prior, epochs, 1)

    simplex = np.vstack([np.zeros(size), 0.25 * np.eye(size)])
    found = descend(cost, simplex, near=0.01, level=0.1, most=40 * size)
    return figures(found.x)._replace(cost=found.value)


def _evidence(
    motion: Motion, figures: NoiseFigures, prior: Prior, epochs: Epochs, most: int
) -> float:
    """Log-likelihood of the observations under some figures."""
    moving = motion._replace(density=np.full(motion.axes, figures.process**2))
    return evidence(moving, prior, epochs, most, begin=BEGIN)


def _begun(
    sample: Observations,
    given: NoiseFigures,
    first: NoiseFigures,
    prior: Prior,
    floor: tuple[float, float],
    motion: Motion,
) -> NoiseFigures:
    """The likeliest of a few figures to begin with, if many gross errors made ``first`` too large.

    None is far below what neighbouring fixes differ by: smooth errors would look like none at all.
    """
    free = np.isnan(given.position)
    unknown = np.full_like(first.position, np.nan)
    positions = slice(0, motion.axes)
    differ = initial_scales(sample, unknown, positions, motion.period, _FEWEST)
    least = np.fmin(first.position, np.fmax(_DIFFER * differ, floor[0]))
    trials = []
    for shrink in _SHRINKS:
        smaller = np.fmax(first.position * shrink, least)
        position = np.where(free, smaller, first.position)
        trials.append(first._replace(position=position))
    reached = []
    for trial in trials:
        spread = prior.spread.copy()
        spread[: motion.axes] = _WILD * _usual(trial)[0]
        ready = prior._replace(isolated=_MANY, row=_MANY, spread=spread)
        reached.append(_evidence(motion, trial, ready, _epochs(sample, trial), BRIEFLY))
    return trials[int(np.argmax(reached))]


def _change(before: NoiseFigures, after: NoiseFigures) -> float:
    """Largest relative change of a figure."""
    pairs = [*zip(before.position, after.position, strict=True)]
    pairs += [*zip(before.velocity, after.velocity, strict=True), (before.process, after.process)]
    return max(abs(math.log(b / a)) for a, b in pairs if a > 0.0 and b > 0.0)


def _moved(before: Prior, after: Prior) -> float:
    """Largest change of the shares of fixes that are wrong, on all axes or on some."""
    return max(abs(after.isolated - before.isolated), abs(after.partial - before.partial))
