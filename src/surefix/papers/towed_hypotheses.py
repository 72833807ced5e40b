"""The multi-hypothesis filter on the towed sonar of paper 002, offline.

The state of the towed body is no set of positions and velocities, but what is left of its sensors
once the motion of the ship is subtracted is: heading and speed walk at random, a random walk being
a constant velocity that is observed as nought at every epoch (its position gains q Δt³/12 between
two of them); and a fix less the way through the water drifts with the current, which is a slowly
changing velocity. `offline_hypotheses` decides on these three series. The filter and smoother of
the towed body then follow, and each value is judged again by its deleted residual under that exact
model: wrong with a Cauchy density, or right with a normal one. Its probability of being right is
its weight. The noise is given as to the other methods; how often values are wrong and how far is
counted on the way.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from surefix.filters.hypothesis_review import deleted
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis_modes import offline_hypotheses
from surefix.filters.records import Epochs, Motion
from surefix.filters.records import Estimate as Decided
from surefix.filters.towed import TowedTrack, filter_towed, smooth_towed
from surefix.filters.track import by_axis
from surefix.geo.angle import wrap
from surefix.models.towed import offset
from surefix.simulate.towed import TowedSurvey
from surefix.types import FloatArray

__all__ = ["smooth_several"]

_LONGEST_S: Final = 39.5
_REST: Final = 1e-3  # σ of the velocity nought, of what the process adds in a step
_SWEEPS: Final = 2
_LEAST: Final = 1e-10  # weight of what is wrong
_WRONG: Final = (2.0, 50.0)  # prior counts: wrong, and all
_WILD: Final = (30.0, 5.0)  # scale of the wrong ones in σ: where few are known, and at least
_FEW: Final = 5


def smooth_several(survey: TowedSurvey) -> TowedTrack:
    """Smooth a survey by what several hypotheses decide.

    Parameters
    ----------
    survey
        From `surefix.simulate.towed.simulate`; what is bad in it is not looked at.
    """
    weight = _decided(survey)
    for _ in range(_SWEEPS):
        weight = _judged(survey, weight, _smoothed(survey, weight))
    return _smoothed(survey, weight)


def _smoothed(survey: TowedSurvey, weight: FloatArray) -> TowedTrack:
    sigma = survey.sigma / np.sqrt(np.maximum(weight, _LEAST))
    known = survey.model, survey.rates
    track = filter_towed(survey.start, survey.time, survey.z, sigma, known[0], rates=known[1])
    return smooth_towed(track, survey.time, known[0], rates=known[1])


def _decided(survey: TowedSurvey) -> FloatArray:
    """(N, 4) weights of all values by the three series; 1 where there is none."""
    model, time, sigma = survey.model, survey.time, survey.sigma
    dt = np.diff(time, prepend=time[0])
    ship = np.cumsum(survey.rates * dt[:, None], axis=0)
    off = survey.z[:, 2:] - ship
    heading = _walk(time, off[:, 0], sigma[2], model.heading, 2.0 * np.pi)
    speed = _walk(time, off[:, 1], sigma[3], model.speed, 0.0)
    course = heading.mean[:, 0] + ship[:, 0] - 0.5 * survey.rates[:, 0] * dt
    way = (speed.mean[:, 0] + ship[:, 1] - 0.5 * survey.rates[:, 1] * dt) * dt
    reckoned = np.cumsum(way[:, None] * np.column_stack([np.cos(course), np.sin(course)]), axis=0)
    fix = np.column_stack(offset(*survey.start.mean[:2], *survey.z[:, :2].T)) - reckoned
    drift = np.sqrt(2.0 * model.beta) * model.current
    fixes = _series(time, fix, np.full_like(fix, np.nan), sigma[0], drift, model.current, 0.0)
    weight = np.column_stack([fixes.weight[:, :2], heading.weight[:, 0], speed.weight[:, 0]])
    return np.where(np.isfinite(weight), weight, 1.0)


def _walk(time: FloatArray, x: FloatArray, sigma: float, density: float, period: float) -> Decided:
    """Decide on a random walk of the given variance per second."""
    step = float(np.median(np.diff(time)))
    process = np.sqrt(12.0 * density) / step
    speed = float(process * np.sqrt(step))
    return _series(time, x[:, None], np.zeros((len(x), 1)), sigma, process, speed, period)


def _series(
    time: FloatArray,
    x: FloatArray,
    velocity: FloatArray,
    sigma: float,
    process: float,
    speed: float,
    period: float,
) -> Decided:
    n, axes = x.shape
    motion = Motion(2, axes, np.full(axes, process**2), by_axis(axes), 2 * axes, period)
    variance = np.repeat([sigma**2, (_REST * speed) ** 2], axes)
    fixed = np.full((n, 2 * axes), np.nan)
    fixed[:, axes:] = np.where(np.isfinite(velocity), 1.0, np.nan)
    epochs = Epochs(
        time, np.hstack([x, velocity]), np.tile(variance, (n, 1)), fixed, np.zeros(n, np.int64)
    )
    return offline_hypotheses(motion, supposed(axes, sigma, speed, speed, _LONGEST_S), epochs)


def _judged(survey: TowedSurvey, weight: FloatArray, track: TowedTrack) -> FloatArray:
    """Probability of each value that it is right, by its deleted residual."""
    residual = np.column_stack(
        [
            *offset(*track.mean[:, :2].T, *survey.z[:, :2].T),
            wrap(survey.z[:, 2] - track.mean[:, 4], 2.0 * np.pi),
            survey.z[:, 3] - track.mean[:, 5],
        ]
    )
    P = np.einsum("kii->ki", track.covariance)[:, [0, 1, 4, 5]]
    e, S = deleted(residual, P, np.square(survey.sigma), np.maximum(weight, _LEAST))
    seen, wrong = np.isfinite(e), np.isfinite(e) & (weight < 0.5)
    share = (wrong.sum(axis=0) + _WRONG[0]) / (seen.sum(axis=0) + _WRONG[1])
    scale = np.array([_scale(np.abs(e[wrong[:, c], c]), survey.sigma[c]) for c in range(4)])
    wide = np.square(scale) + S
    right = -0.5 * (e * e / S + np.log(2.0 * np.pi * S)) + np.log(1.0 - share)
    wild = -np.log(np.pi) - 0.5 * np.log(wide) - np.log1p(e * e / wide) + np.log(share)
    odds = np.clip(np.where(seen, wild - right, 0.0), -500.0, 500.0)
    return np.where(seen, 1.0 / (1.0 + np.exp(odds)), 1.0)


def _scale(sizes: FloatArray, sigma: float) -> float:
    if len(sizes) < _FEW:
        return _WILD[0] * sigma
    return max(float(np.median(sizes)), _WILD[1] * sigma)
