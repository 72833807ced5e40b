"""The multi-hypothesis filter on what the masters of paper 001 observe.

The masters are the sensors of one filter. The slave's known displacement is subtracted, so that
what is left walks at random with Q; `surefix.filters.records.Motion` knows constant velocities, and
one that is observed as nought at every epoch makes a random walk of that: between two such epochs
the position gains the variance q Δt³/12. The noise is given as to the other filters, at the ranges
that the filter with thresholds believes; how often and how far observations are wrong is learnt.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.hypotheses import Prior, no_hypotheses
from surefix.filters.learning import learn
from surefix.filters.multi_hypothesis_modes import offline_hypotheses, realtime_hypotheses
from surefix.filters.noise import NoiseFigures, Observations
from surefix.filters.records import Epochs, Motion
from surefix.filters.track import by_axis
from surefix.fusion.track import Estimate
from surefix.models.ranging import range_to, range_variance
from surefix.papers.cooperative_tracks import observed_positions
from surefix.simulate.cooperative import START_SIGMA, Cooperation, Formation
from surefix.types import FloatArray

__all__ = ["Several", "several"]

_REST = 1e-3  # σ of the velocity nought, of what the process adds in a step
_LONGEST = 39.5  # steps


class Several(NamedTuple):
    """What several hypotheses make of some runs.

    Parameters
    ----------
    realtime, offline
        (runs, K, …) the filter, and the smoother.
    weight
        (runs, masters, K) of each observation, decided offline.
    """

    realtime: Estimate
    offline: Estimate
    weight: FloatArray


def several(
    formation: Formation, world: Cooperation, process: float, believed: FloatArray
) -> Several:
    """Filter the observations of all masters with several hypotheses; reading ``position``.

    Parameters
    ----------
    formation, world, process
        As for `surefix.papers.cooperative_tracks.central_track`; all masters observe at all epochs.
    believed
        (runs, K, 3) m, where the slave is believed to be, for the noise of the ranges.
    """
    there = observed_positions(world) - world.path[:, :, None]
    ranges = range_to(believed[:, :, None], world.master.swapaxes(1, 2))
    noise = range_variance(formation.squared_variance, ranges)
    parts = [_one(world, run, there[run], noise[run], process) for run in range(len(world.truth))]
    stacked = [np.stack(column) for column in zip(*parts, strict=True)]
    diagonal = [each[..., None] * np.eye(3) for each in (stacked[1], stacked[3])]
    return Several(Estimate(stacked[0], diagonal[0]), Estimate(stacked[2], diagonal[1]), stacked[4])


def _one(
    world: Cooperation, run: int, there: FloatArray, noise: FloatArray, process: float
) -> tuple[FloatArray, ...]:
    """Means and variances (K, 3) in real time and offline, and weights (masters, K)."""
    K, N = noise.shape
    step = float(world.time[1] - world.time[0])
    q = 12.0 * process / step**2
    rest = np.full((1 + K * N, 3), _REST * np.sqrt(q * step))
    begin = (world.guess[run] - world.path[run, 0])[None]
    z = np.hstack([np.vstack([begin, there.reshape(-1, 3)]), np.zeros_like(rest)])
    spread = np.append(START_SIGMA, np.sqrt(noise.ravel()))
    sigma = np.hstack([np.repeat(spread[:, None], 3, axis=1), rest])
    time = np.append(world.time[0], np.repeat(world.time, N))
    sensor = np.append(0, np.tile(np.arange(N), K))
    prior = _learnt(Observations(time[1:], z[1:], sensor[1:], sigma[1:]), N, q, step)
    fixed = np.full_like(z, np.nan)
    fixed[:, 3:] = fixed[0] = 1.0
    motion = Motion(2, 3, np.full(3, q), by_axis(3), 6, 0.0)
    epochs = Epochs(time, z, sigma**2, fixed, np.zeros(len(time), np.int64), sensor)
    _, now = realtime_hypotheses(motion, prior, epochs, no_hypotheses(motion))
    whole = offline_hypotheses(motion, prior, epochs)
    out: list[FloatArray] = []
    for found in (now, whole):
        out += [found.mean[N::N, :3] + world.path[run], found.sigma[N::N, :3] ** 2]
    return *out, whole.weight[1:, :3].min(axis=1).reshape(K, N).T


def _learnt(observations: Observations, sensors: int, q: float, step: float) -> Prior:
    """What is supposed of gross errors; the noise and the process are given."""
    speed = float(np.sqrt(q * step))
    usual = float(np.median(observations.declared[:, 0]))
    given = NoiseFigures(np.full(sensors, usual), np.full(sensors, speed), float(np.sqrt(q)))
    return learn(
        observations,
        given,
        given,
        order=2,
        period=0.0,
        speed=speed,
        longest=_LONGEST * step,
        floor=(1e-9, 1e-9),
    ).prior
