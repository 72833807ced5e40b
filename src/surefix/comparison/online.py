"""Filters of the literature that methods are compared with in real time.

Plain forms, epoch by epoch in NumPy, on the same epochs, motion and noise figures as the methods of
`surefix clean`. A state is ``[position, velocity, (acceleration)]`` of all axes; the observations
are its first components. Fixes that the user accepts are judged like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar

import numpy as np

from surefix.filters.records import Epochs, Estimate, Motion, Recovery
from surefix.filters.track import start
from surefix.models.motion import add_noise_factor, propagate_rows
from surefix.robust.loss import block_scale
from surefix.types import BoolArray, FloatArray

__all__ = ["Belief", "Found", "Observation", "predicted", "run_online", "updated", "vague"]

_TAIL: Final = 0.0027  # probability at which distances over one, two and three axes are alike
_VAGUE: Final = 100.0  # variance of a prediction over that of the fix, from which it says nothing

Memory = TypeVar("Memory")


class Belief(NamedTuple):
    """(n,) mean and (n, n) covariance of a state."""

    mean: FloatArray
    covariance: FloatArray


class Observation(NamedTuple):
    """What one epoch brings: (m,) values and variances, NaN where nothing; the components seen."""

    z: FloatArray
    variance: FloatArray
    seen: BoolArray


class Found(NamedTuple):
    """What a filter made of one epoch: its belief, its prediction, and (m,) weights given."""

    belief: Belief
    predicted: Belief
    weight: FloatArray


Step = Callable[[Motion, Memory, float, Observation], tuple[Memory, Found]]
"""Motion, memory, seconds since the epoch before, observation → memory, what was found."""


def run_online(
    motion: Motion,
    recovery: Recovery,
    epochs: Epochs,
    state: object,
    begin: Callable[[Belief, FloatArray], Memory],
    step: Step[Memory],
) -> tuple[object, Estimate]:
    """Run a filter over a series.

    Parameters
    ----------
    motion, recovery, epochs
        As for `surefix.filters.track.filter_track`; of the recovery only the vague velocity counts.
    state
        What an earlier call gave; None at the beginning.
    begin
        Makes the first memory of a vague belief and the (m,) variances of the first epoch.
    step
        Advances it by one epoch.
    """
    n, m = len(epochs.time), 2 * motion.axes
    if state is None:
        first = start(motion, recovery)
        variance = epochs.variance[0] if n else np.ones(m)
        belief = Belief(first.mean, first.factor @ first.factor.T)
        last, memory = np.nan, begin(belief, variance)
    else:
        last, memory = state  # type: ignore[misc]
    found = []
    for time, z, variance in zip(epochs.time.tolist(), epochs.z, epochs.variance, strict=True):
        dt = 0.0 if np.isnan(last) else time - last
        memory, out = step(motion, memory, dt, Observation(z, variance, np.isfinite(z)))
        found.append(out)
        last = time
    return (last, memory), _estimate(motion, epochs, found)


def predicted(motion: Motion, belief: Belief, dt: float) -> Belief:
    """Carry a belief ``dt`` seconds on: ``F m``, ``F P Fᵀ + Q``."""
    n = motion.order * motion.axes
    F, G = np.eye(n), np.zeros((n, n))
    propagate_rows(F, motion.order, motion.axes, dt, n)
    add_noise_factor(G, motion.order, motion.axes, dt, motion.density, 0)
    return Belief(F @ belief.mean, F @ belief.covariance @ F.T + G @ G.T)


def updated(belief: Belief, observation: Observation, variance: FloatArray) -> Belief:
    """Update with the components that were seen, in Joseph's form.

    Parameters
    ----------
    belief
        The prediction.
    observation
        What was seen.
    variance
        (m,) variances in the place of the observation's own.
    """
    i = np.flatnonzero(observation.seen)
    m, P = belief
    R = np.diag(variance[i])
    K = np.linalg.solve(P[np.ix_(i, i)] + R, P[i]).T
    A = np.eye(len(m))
    A[:, i] -= K
    P = A @ P @ A.T + K @ R @ K.T
    return Belief(m + K @ (observation.z[i] - m[i]), 0.5 * (P + P.T))


def vague(belief: Belief, observation: Observation) -> BoolArray:
    """(m,) components whose prediction is so unsure that it cannot judge an observation."""
    own = np.diagonal(belief.covariance)[: len(observation.z)]
    return np.asarray(own > _VAGUE * observation.variance)


def _estimate(motion: Motion, epochs: Epochs, found: list[Found]) -> Estimate:
    """Put what was found at each epoch into the form that is judged and shown."""
    n, m, states = len(epochs.time), 2 * motion.axes, motion.order * motion.axes
    out = Estimate(
        np.empty((n, states)),
        np.empty((n, states)),
        np.full((n, motion.groups), np.nan),
        np.full((n, motion.groups), np.nan),
        np.full((n, m), np.nan),
        np.zeros(n, np.int64),
        np.full((n, motion.groups), np.nan),
        np.zeros(n, np.int64),
        np.full((n, motion.axes), np.nan),
        np.zeros(n, np.bool_),
        np.ones(n),
    )
    scale = [1.0, *(block_scale(axes, _TAIL) for axes in (1, 2, 3))]
    for k, (belief, before, weight) in enumerate(found):
        out.mean[k] = belief.mean
        out.sigma[k] = np.sqrt(np.diagonal(belief.covariance))
        for g in range(motion.groups):
            i = np.flatnonzero((motion.group == g) & np.isfinite(epochs.z[k]))
            if not len(i):
                continue
            off = epochs.z[k, i] - before.mean[i]
            S = before.covariance[np.ix_(i, i)] + np.diag(epochs.variance[k, i])
            out.weight[k, g] = weight[i].min()
            out.standardised[k, i] = off / np.sqrt(np.diagonal(S))
            out.distance[k, g] = np.sqrt(off @ np.linalg.solve(S, off)) / scale[len(i)]
    return out
