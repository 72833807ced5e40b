"""A vehicle under a USBL array: truth, fixes with gross errors, and velocities, after paper 000.

The paper takes a processed track as the truth and adds 121 gross errors, 30 of them on end; their
sizes are in a figure that is lost. The printed RMSEs tell them nevertheless. Its Huber filter is
bounded against isolated errors and follows the run, the plain filter follows both: so Huber's RMSE
is that of the run alone, ``b √(30/n)``, and gives b ≈ 21 m in X and Y and 11 m in Z. The difference
of the squares of both filters is the isolated errors' share; it is 33.1, 31.9 and 32.7 m² in X,
Y and Z: one size for all axes, and about 25 m (root mean square) by the gain of the filter.

Assumed: 700 epochs 1 s apart; isolated errors uniform over 5 … 42 m with a random sign on each axis
by itself; every gross error strikes all three axes; the first ten epochs are good.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from surefix.errors import OptionsError
from surefix.models.usbl import UsblArray, fix, fix_covariance, observe
from surefix.simulate.survey_motion import survey_motion
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["UsblTrack", "simulate"]

Run = Literal["common", "independent"]

_FREE = 10  # epochs at the beginning without gross errors


@dataclass(frozen=True, kw_only=True)
class UsblTrack:
    """A simulated track; positions are in the axes of the array, z down.

    Parameters
    ----------
    array, sigma_phase, sigma_time, sigma_velocity
        The array and the noise of what it and the velocity sensors measure: rad, s, m/s.
    time
        (n,) s from 0.
    position, velocity
        (n, 3) truth, m and m/s.
    phase, travel_time
        (n, 2) rad and (n,) s as measured.
    fixes
        (n, 3) m, the positions that follow from them; NaN where the phases are impossible.
    measured_velocity
        (n, 3) m/s.
    gross, burst
        (n,) which fixes are gross errors, and which of those belong to the run.
    error
        (n, 3) m, the gross errors; zero elsewhere.
    """

    array: UsblArray
    sigma_phase: float
    sigma_time: float
    sigma_velocity: float
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    phase: FloatArray
    travel_time: FloatArray
    fixes: FloatArray
    measured_velocity: FloatArray
    gross: BoolArray
    burst: BoolArray
    error: FloatArray

    @property
    def fix_covariance(self) -> FloatArray:
        """(n, 3, 3) m², from the noise of phase and time; NaN where there is no fix."""
        return fix_covariance(
            self.array, self.phase, self.travel_time, self.sigma_phase, self.sigma_time
        )


def simulate(
    seed: int | Sequence[int],
    *,
    epochs: int = 700,
    interval_s: float = 1.0,
    gross: int = 121,
    burst: int = 30,
    run: Run = "common",
    gross_m: tuple[float, float] = (5.0, 42.0),
    burst_m: tuple[float, float, float] = (22.0, 22.0, 11.0),
    array: UsblArray | None = None,
    sigma_phase: float = 0.007,
    sigma_time: float = 3e-4,
    sigma_velocity: float = 0.03,
    speed_mps: float = 0.3,
    line_m: float = 60.0,
    depth_m: float = 120.0,
) -> UsblTrack:
    """Draw one track; the same seed and options give the same bits.

    All but the errors within the run is the same for both kinds of run.

    Parameters
    ----------
    seed
        Of ``numpy.random.default_rng``.
    epochs, interval_s
        How many epochs, and s between them.
    gross, burst
        Number of gross errors, and how many of them stand in one run.
    run
        ``common``: one offset of the sizes ``burst_m`` with random signs throughout the run.
        ``independent``: the run is made of errors drawn like the isolated ones.
    gross_m
        Least and greatest size of an isolated error per axis, m; uniform between them.
    burst_m
        Size of the common offset per axis, m.
    array, sigma_phase, sigma_time, sigma_velocity
        The array, and noises in rad, s (two-way) and m/s; 0.007 rad are 0.13° abeam.
    speed_mps, line_m, depth_m
        Speed, length of a survey line, depth below the array.

    Raises
    ------
    OptionsError
        The gross errors do not fit into the epochs, or reach above the array.
    """
    if run not in get_args(Run):
        raise OptionsError(f"run {run!r}", "one of " + ", ".join(get_args(Run)))
    if not 0 <= burst <= gross or epochs < _FREE + 1 + gross + 2 * (burst > 0):
        raise OptionsError(
            f"{gross} gross errors, {burst} in a run, {epochs} epochs",
            f"a run no longer than all, and {_FREE + 3} good epochs",
        )
    if depth_m <= max(*gross_m, *burst_m) + 20.0:
        raise OptionsError(f"depth_m = {depth_m}", "20 m more than the largest gross error")
    array = array or UsblArray()
    motion, place, sizes, runs, noise, dvl = np.random.default_rng(seed).spawn(6)
    time = np.arange(epochs, dtype=np.float64) * interval_s
    position, velocity, _ = survey_motion(motion, time, speed=speed_mps, line=line_m, depth=depth_m)
    down = np.array([1.0, 1.0, -1.0])
    position, velocity = position * down, velocity * down
    isolated, stretch = _where(place, epochs, gross, burst)
    error = np.zeros((epochs, 3))
    error[isolated] = _sizes(sizes, isolated.size, gross_m)
    offset = np.asarray(burst_m) * runs.choice([-1.0, 1.0], 3)
    error[stretch] = offset if run == "common" else _sizes(runs, stretch.size, gross_m)
    phase, travel_time = observe(array, position + error)
    phase = phase + sigma_phase * noise.standard_normal(phase.shape)
    travel_time = travel_time + sigma_time * noise.standard_normal(epochs)
    return UsblTrack(
        array=array,
        sigma_phase=sigma_phase,
        sigma_time=sigma_time,
        sigma_velocity=sigma_velocity,
        time=time,
        position=position,
        velocity=velocity,
        phase=phase,
        travel_time=travel_time,
        fixes=fix(array, phase, travel_time),
        measured_velocity=velocity + sigma_velocity * dvl.standard_normal(velocity.shape),
        gross=np.isin(np.arange(epochs), np.concatenate([isolated, stretch])),
        burst=np.isin(np.arange(epochs), stretch),
        error=error,
    )


def _where(
    rng: np.random.Generator, epochs: int, gross: int, burst: int
) -> tuple[IntArray, IntArray]:
    """Rows of the isolated errors and of the run, which keeps a good fix on either side."""
    first = int(rng.integers(_FREE + 1, epochs - burst)) if burst else _FREE
    stretch = np.arange(first, first + burst)
    others = np.arange(_FREE, epochs)
    others = others[(others < first - 1) | (others > first + burst)] if burst else others
    return np.sort(rng.choice(others, gross - burst, replace=False)), stretch


def _sizes(rng: np.random.Generator, count: int, size: tuple[float, float]) -> FloatArray:
    return np.asarray(rng.uniform(*size, (count, 3)) * rng.choice([-1.0, 1.0], (count, 3)))
