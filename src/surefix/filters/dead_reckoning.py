"""Displacement from measured velocity: its wild values left out, the rest integrated.

Between two samples the velocity is taken as changing evenly, so that the displacement is a
parabola there and its derivative exactly the interpolated velocity.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.cleaning.hampel import MAD_TO_SIGMA
from surefix.filters.random_walk import RESTART, SKIP, outliers
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["DeadReckoning", "dead_reckoning", "displacement", "velocity_at", "velocity_known"]

_LEAST = 30  # samples that can be judged
_REJECT = 3.5  # standard deviations of one axis
_ENDS = 5  # samples that tell where the velocity stands before and after a jump
_LONGEST_RUN = 60  # samples in a run of wrong velocities


class DeadReckoning(NamedTuple):
    """A velocity series ready to be integrated.

    Parameters
    ----------
    time
        (m,) s, increasing.
    velocity
        (m, d) m/s, finite.
    path
        (m, d) m, its integral, from 0.
    interval
        Median step, s.
    noise
        (d,) m/s, robust standard deviation of the velocity about the mean of its neighbours, as
        white noise would have it; what the vehicle itself does in a step is part of it.
    """

    time: FloatArray
    velocity: FloatArray
    path: FloatArray
    interval: float
    noise: FloatArray


def dead_reckoning(time: FloatArray, velocity: FloatArray) -> DeadReckoning:
    """Integrate velocities without those that are missing or wild.

    Parameters
    ----------
    time
        (m,) s, not decreasing.
    velocity
        (m, d) m/s; NaN is missing. A sample that is wrong on one axis is left out on all.
    """
    ordered = np.concatenate([[True], np.diff(time) > 0.0])
    known = np.isfinite(velocity).all(axis=1) & np.isfinite(time) & ordered
    time, velocity = time[known], velocity[known]
    if len(time) >= _LEAST:
        good = _credible(time, velocity)
        time, velocity = time[good], velocity[good]
    step = np.diff(time)
    mean = 0.5 * (velocity[1:] + velocity[:-1])
    path = np.zeros_like(velocity)
    np.cumsum(mean * step[:, None], axis=0, out=path[1:])
    noise = np.array([_spread(axis) for axis in velocity.T])
    return DeadReckoning(
        time, velocity, path, float(np.median(step)) if len(step) else np.inf, noise
    )


def _credible(time: FloatArray, velocity: FloatArray) -> BoolArray:
    """(m,) velocities that are neither wild by themselves nor in a run of wrong ones.

    A run begins and ends with a jump, and the velocity after it goes on where it was before.
    """
    step = np.diff(time, prepend=time[0])
    state = outliers(velocity, step, np.zeros(len(time), np.bool_), _REJECT)
    kept = np.flatnonzero(state != SKIP)
    first = np.flatnonzero(state[kept] == RESTART)
    last = np.append(first[1:], len(kept)) - 1
    begin, end = [], []
    for a, b in zip(first, last + 1, strict=True):
        begin.append(np.median(velocity[kept[a : min(a + _ENDS, b)]], axis=0))
        end.append(np.median(velocity[kept[max(b - _ENDS, a) : b]], axis=0))
    good: BoolArray = state != SKIP
    for i in range(1, len(first) - 1):
        inward, outward = begin[i] - end[i - 1], begin[i + 1] - end[i]
        across = begin[i + 1] - end[i - 1]
        least = min(np.linalg.norm(inward), np.linalg.norm(outward))
        if last[i] - first[i] < _LONGEST_RUN and np.linalg.norm(across) < 0.5 * least:
            good[kept[first[i]] : kept[last[i]] + 1] = False
    return good


def displacement(way: DeadReckoning, at: FloatArray) -> FloatArray:
    """(n, d) m travelled since the first sample, at the times ``at`` (n,) s."""
    index, ahead, step = _place(way, at)
    rise = (way.velocity[index + 1] - way.velocity[index]) * (ahead / step)[:, None]
    return np.asarray(way.path[index] + (way.velocity[index] + 0.5 * rise) * ahead[:, None])


def velocity_at(way: DeadReckoning, at: FloatArray, half: float) -> FloatArray:
    """(n, d) m/s: the mean velocity from ``half`` seconds before ``at`` to as long after it."""
    return np.asarray((displacement(way, at + half) - displacement(way, at - half)) / (2.0 * half))


def velocity_known(way: DeadReckoning, at: FloatArray, longest: float) -> BoolArray:
    """(n,) whether a time lies between two samples that are no more than ``longest`` s apart."""
    _, ahead, step = _place(way, at)
    inside: BoolArray = (ahead >= 0.0) & (ahead <= step) & (step <= longest)
    return inside


def _place(way: DeadReckoning, at: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    index = np.clip(np.searchsorted(way.time, at, side="right") - 1, 0, len(way.time) - 2)
    return index, at - way.time[index], way.time[index + 1] - way.time[index]


def _spread(values: FloatArray) -> float:
    """Robust standard deviation of white noise, from each value and its two neighbours."""
    if len(values) < 3:
        return 0.0
    second = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    return MAD_TO_SIGMA * float(np.median(np.abs(second))) / math.sqrt(1.5)
