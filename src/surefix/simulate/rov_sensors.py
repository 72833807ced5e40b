"""The sensors of an ROV, each sampling one truth: USBL, DVL, pressure and gyro."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.geo.local_frame import LocalFrame
from surefix.simulate.faults import error_vectors, isolated, outside
from surefix.types import BoolArray, Channel, Fixes, FloatArray

__all__ = [
    "Dvl",
    "Truth",
    "depth_log",
    "dvl_log",
    "fixes_log",
    "gaps",
    "heading_log",
    "usbl_errors",
]


class Dvl(NamedTuple):
    """Bottom-track velocity.

    Parameters
    ----------
    time
        (n,) s on the DVL's own clock.
    true_time
        (n,) s, when it was measured.
    velocity
        (n, 3) m/s east, north, up; NaN where the bottom was lost.
    sigma
        m/s, standard deviation per axis.
    """

    time: FloatArray
    true_time: FloatArray
    velocity: FloatArray
    sigma: float


class Truth(NamedTuple):
    """Motion of the vehicle, sampled anywhere by linear interpolation.

    Parameters
    ----------
    time
        (n,) s, every 0.1 s.
    position, velocity
        (n, 3) m and m/s, without the jump.
    heading
        (n,) deg.
    jump_time, jump
        s (NaN for never), and (3,) m.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    heading: FloatArray
    jump_time: float
    jump: FloatArray

    def at(self, values: FloatArray, time: FloatArray) -> FloatArray:
        """Sample a series of the truth, (n, 3), at other instants, (m,) s."""
        return np.column_stack([np.interp(time, self.time, axis) for axis in values.T])

    def observed(self, time: FloatArray) -> FloatArray:
        """Sample the position with the jump, (m, 3) m."""
        after = (time >= self.jump_time).astype(np.float64)
        return self.at(self.position, time) + after[:, None] * self.jump


def gaps(
    rng: np.random.Generator, time: FloatArray, count: int, length: tuple[float, float]
) -> FloatArray:
    """Draw silences of a sensor, (count, 2) s, in the later nine tenths of the dive."""
    start, duration = time[0], time[-1] - time[0]
    begin = start + duration * rng.uniform(0.1, 0.95, count)
    return np.column_stack((begin, begin + rng.uniform(*length, count)))


def usbl_errors(
    rng: np.random.Generator,
    time: FloatArray,
    jump_time: float,
    share: float,
    size: tuple[float, float],
    burst_fixes: int,
) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Rows in error, rows of the burst, and (m, 3) errors; the first ten fixes are good."""
    count = time.size
    burst = np.zeros(count, dtype=np.bool_)
    begin = int(rng.uniform(0.35, 0.45) * count)
    burst[begin : begin + burst_fixes] = True
    near = np.convolve(burst, np.ones(5), mode="same") > 0.0
    near |= np.abs(time - jump_time) < 20.0
    near[:10] = True
    chosen = isolated(rng, np.flatnonzero(~near), round(share * count))
    error = np.zeros((count, 3))
    error[burst] = error_vectors(rng, 1, 8.0, 25.0)
    error[chosen] = error_vectors(rng, chosen.size, *size)
    gross = burst.copy()
    gross[chosen] = True
    return gross, burst, error


def fixes_log(time: FloatArray, position: FloatArray, frame: LocalFrame | None) -> Fixes:
    """Put (m, 3) measured positions into a record, geographic if a frame is given."""
    unknown = np.full((time.size, 3), np.nan)
    if frame is not None:
        latitude, longitude, _ = frame.to_geographic(position[:, 0], position[:, 1])
        position = np.column_stack((latitude, longitude, position[:, 2]))
    return Fixes(
        time=time,
        position=position,
        velocity=unknown,
        sigma_position=unknown.copy(),
        sigma_velocity=unknown.copy(),
        sensor=np.zeros(time.size, dtype=np.int64),
        edit=np.zeros(time.size, dtype=np.int64),
        valid=np.ones(time.size, dtype=np.bool_),
        row=np.arange(time.size, dtype=np.int64),
        geographic=frame is not None,
    )


def dvl_log(
    rng: np.random.Generator, truth: Truth, interval: float, sigma: float, ppm: float
) -> Dvl:
    """Sample the velocity on a clock that runs fast, with four silences of the bottom track."""
    time = np.arange(truth.time[0], truth.time[-1], interval)
    velocity = truth.at(truth.velocity, time) + sigma * rng.standard_normal((time.size, 3))
    velocity[~outside(time, gaps(rng, truth.time, 4, (5.0, 30.0)))] = np.nan
    return Dvl(time[0] + (time - time[0]) * (1.0 + 1e-6 * ppm), time, velocity, sigma)


def depth_log(
    rng: np.random.Generator, truth: Truth, sigma: float, share: float
) -> tuple[Channel, BoolArray]:
    """Sample the pressure depth at 5 Hz, and tell which values are spikes."""
    time = np.arange(truth.time[0], truth.time[-1], 0.2)
    depth = -truth.at(truth.position, time)[:, 2] + sigma * rng.standard_normal(time.size)
    spikes = rng.uniform(size=time.size) < share
    sign = rng.choice([-1.0, 1.0], time.size)
    depth += spikes * sign * rng.uniform(1.0, 20.0, time.size)
    return Channel("depth_m", "pressure", time, depth.round(3), 0.0), spikes


def heading_log(rng: np.random.Generator, truth: Truth) -> Channel:
    """Sample the heading at 2 Hz with a noise of 0.5°."""
    time = truth.time[::5]
    heading = truth.heading[::5] + 0.5 * rng.standard_normal(time.size)
    return Channel("heading_deg", "gyro", time, np.mod(heading.round(2), 360.0), 360.0)
