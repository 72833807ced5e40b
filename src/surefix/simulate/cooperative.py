"""Master vehicles of known position observe one slave: the two cases of paper 001, section 4.

Axes: x east, y north, z as in the paper's plots, in m; iteration k is at ``t = k − 1`` s.

- *Case 1*: three masters leave the origin at 1 kn towards east, north and north-east; the slave is
  on ``x = y = t``, ``z = 0.2 (x − 50)²``.
- *Case 2*: four masters in formation along x. Numbers 2, 3 and 4 keep a steady course, number 1
  and the slave accelerate; the slave is the centroid of 1, 2 and 3. The paper gives no figures of
  this formation: these are ours.

What the variance R of the paper means is not printed. Three readings can be drawn:

``position``
    The offset of the slave in the master's body axes, each component with the noise of a range
    whose square has variance R (`surefix.models.ranging.range_variance`).
``components``
    The squares of the three offsets in earth axes, each with variance R.
``range``
    The squared range alone, with variance R.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from surefix.errors import OptionsError
from surefix.geo.rotation import attitude_along
from surefix.models.ranging import range_to, range_variance, relative_position, squared_range
from surefix.types import BoolArray, FloatArray

__all__ = [
    "READINGS",
    "START_SIGMA",
    "Cooperation",
    "Formation",
    "Reading",
    "path",
    "simulate",
    "stack",
]

Reading = Literal["position", "components", "range"]
READINGS: tuple[Reading, ...] = ("position", "components", "range")

_KNOT = 1852.0 / 3600.0
_GROSS_M = (100.0, 400.0)
_MOTION_NOISE = 0.05  # m²/s per axis of the masters of case 2
_PERIOD = 99.0  # s in which the leader of case 2 climbs and dives once
START_SIGMA = 10.0  # m per axis: how well the slave knows where it starts


@dataclass(frozen=True, kw_only=True)
class Formation:
    """What is sailed and how well it is observed.

    Parameters
    ----------
    case
        1 or 2, see the module.
    squared_variance
        R, m⁴.
    process
        Variance per second, m²/s per axis, with which the slave leaves its path; 0 keeps it there.
    reading
        What a master observes.
    quality
        One row per master: factors on its noise along, across and up in its own axes; empty for
        none. Reading ``position`` only.
    gross_share
        Share of observations with a gross error of 100 … 400 m. Reading ``position`` only.
    period_s
        Interval between the observations of each master.
    step_s, count
        The grid of epochs that exist beside the observations: ``count`` of them.
    """

    case: int = 1
    squared_variance: float = 2.5e7
    process: float = 0.0
    reading: Reading = "position"
    quality: tuple[tuple[float, float, float], ...] = ()
    gross_share: float = 0.0
    period_s: tuple[float, ...] = ()
    step_s: float = 1.0
    count: int = 100

    def __post_init__(self) -> None:
        if self.case not in (1, 2):
            raise OptionsError(f"case {self.case}", "1 or 2")
        if self.reading not in READINGS:
            raise OptionsError(f"reading {self.reading!r}", "one of " + ", ".join(READINGS))
        if not (self.squared_variance > 0.0 and self.process >= 0.0 and self.step_s > 0.0):
            raise OptionsError("a variance or step that is negative or 0", "positive figures")
        if self.count < 2:
            raise OptionsError(f"{self.count} epochs", "at least 2")
        if not 0.0 <= self.gross_share < 1.0:
            raise OptionsError(f"gross share {self.gross_share}", "a share from 0 and below 1")
        for name, given in (("quality", self.quality), ("period_s", self.period_s)):
            if given and len(given) != self.masters:
                raise OptionsError(f"{name} for {len(given)} masters", f"{self.masters} of them")

    @property
    def masters(self) -> int:
        """Number of masters: three in case 1, four in case 2."""
        return 2 + self.case

    @property
    def epochs(self) -> tuple[FloatArray, BoolArray]:
        """Times (K,) of the grid and of all observations, and who observes when, (masters, K)."""
        grid = self.step_s * np.arange(self.count, dtype=np.float64)
        if not self.period_s:
            return grid, np.ones((self.masters, self.count), dtype=np.bool_)
        own = [np.arange(0.0, grid[-1] + 1e-9, period) for period in self.period_s]
        time = np.unique(np.round(np.concatenate((grid, *own)), 6))
        return time, np.stack([np.isin(time, np.round(one, 6)) for one in own])


class Cooperation(NamedTuple):
    """One drawn run; `stack` puts several of one formation together, with a leading axis.

    Parameters
    ----------
    time
        (K,) s.
    truth, path
        (K, 3) m: where the slave is, and where it was to be.
    master, attitude
        (masters, K, 3) m, and roll, pitch, yaw in rad; known to all.
    observed
        (masters, K, m) in the unit of the reading; NaN where nothing was observed.
    gross
        (masters, K) which observations have a gross error.
    guess
        (3,) m: where the slave believes it starts, in error by ``START_SIGMA`` per axis.
    """

    time: FloatArray
    truth: FloatArray
    path: FloatArray
    master: FloatArray
    attitude: FloatArray
    observed: FloatArray
    gross: BoolArray
    guess: FloatArray


def simulate(formation: Formation, seed: int | Sequence[int]) -> Cooperation:
    """Draw one run; the same formation and seed give the same bits.

    Parameters
    ----------
    formation
        What is sailed.
    seed
        Of ``numpy.random.default_rng``.
    """
    drift, sway, noise, faults, begin = np.random.default_rng(seed).spawn(5)
    time, observing = formation.epochs
    planned = path(formation.case, time)
    step = np.sqrt(np.diff(time, prepend=time[0]))[:, None]
    away = np.cumsum(step * drift.standard_normal(planned.shape), axis=0)
    truth = planned + np.sqrt(formation.process) * away
    master, attitude = _masters(formation.case, time)
    if formation.case == 2:
        shaken = np.cumsum(step * sway.standard_normal(master.shape), axis=1)
        master = master + np.sqrt(_MOTION_NOISE) * shaken
    exact, sigma = _observation(formation, truth, master, attitude)
    observed = exact + sigma * noise.standard_normal(exact.shape)
    gross = (faults.uniform(size=observing.shape) < formation.gross_share) & observing
    direction = faults.standard_normal(exact.shape)
    direction /= np.sqrt(np.square(direction).sum(axis=-1, keepdims=True))
    error = faults.uniform(*_GROSS_M, gross.shape)[..., None] * direction
    observed = np.where(gross[..., None], observed + error, observed)
    return Cooperation(
        time=time,
        truth=truth,
        path=planned,
        master=master,
        attitude=attitude,
        observed=np.where(observing[..., None], observed, np.nan),
        gross=gross,
        guess=truth[0] + START_SIGMA * begin.standard_normal(3),
    )


def stack(runs: Sequence[Cooperation]) -> Cooperation:
    """Put runs of one formation together: every array but ``time`` gets a leading axis."""
    together = Cooperation(*(np.stack(column) for column in zip(*runs, strict=True)))
    return together._replace(time=runs[0].time)


def path(case: int, time: FloatArray) -> FloatArray:
    """Where the slave is to be at the given times, (n, 3) m."""
    if case == 1:
        return np.stack([time, time, 0.2 * np.square(time - 50.0)], axis=-1)
    return np.asarray(_formation_2(time)[:3].mean(axis=0))


def _formation_2(time: FloatArray) -> FloatArray:
    """The four masters of case 2, (4, n, 3) m: two abeam, one that climbs and dives, one above."""
    ahead, still = _KNOT * time, np.zeros_like(time)
    turn = 2.0 * np.pi / _PERIOD * time
    leader = (ahead + 6.0 * np.sin(turn), still + 30.0, 150.0 - 90.0 * np.cos(turn))
    abeam = [(ahead, still + side, still) for side in (-90.0, 90.0)]
    above = (1.2 * ahead - 40.0, still + 20.0, still - 80.0)
    return np.stack([np.stack(one, axis=-1) for one in (leader, *abeam, above)])


def _masters(case: int, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions and attitudes of the masters, (masters, n, 3) each: bow along the course."""
    if case == 1:
        course = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [np.sqrt(0.5), np.sqrt(0.5), 0.0]])
        place = _KNOT * time[:, None] * course[:, None, :]
        return place, np.broadcast_to(attitude_along(course)[:, None, :], place.shape).copy()
    place = _formation_2(time)
    return place, attitude_along(np.gradient(place, time, axis=1))


def _observation(
    formation: Formation, truth: FloatArray, master: FloatArray, attitude: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What would be observed without noise, (masters, K, m), and its standard deviation."""
    R = formation.squared_variance
    if formation.reading == "range":
        exact = squared_range(truth, master)[..., None]
        return exact, np.full_like(exact, np.sqrt(R))
    if formation.reading == "components":
        exact = np.square(truth - master)
        return exact, np.full_like(exact, np.sqrt(R))
    exact = relative_position(truth, master, attitude)
    sigma = np.sqrt(range_variance(R, range_to(truth, master)))[..., None]
    factors = np.array(formation.quality or [[1.0, 1.0, 1.0]] * formation.masters)
    return exact, sigma * factors[:, None, :]
