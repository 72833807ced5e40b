"""An ROV survey dive: truth, USBL fixes with gross errors, DVL, pressure depth and heading.

What is wrong with the log, and known to be:

- isolated gross errors of 3 … 40 m, and one burst of fixes that share one wrong offset;
- dropouts, lost single fixes and irregular steps;
- one *true jump*: from an instant on, the USBL is referenced anew (another transponder, a corrected
  lever arm) and every good fix lies ``jump_m`` further. Nothing says which datum is right, but the
  fixes after it agree with each other: the track after it is true, and truth carries the step. The
  vehicle did not move by it, so the velocity does not;
- a DVL whose clock runs at its own rate, with lost bottom tracks;
- spikes in the pressure depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surefix.geo.local_frame import LocalFrame
from surefix.simulate.faults import irregular_times, outside
from surefix.simulate.rov_sensors import (
    Dvl,
    Truth,
    depth_log,
    dvl_log,
    fixes_log,
    gaps,
    heading_log,
    usbl_errors,
)
from surefix.simulate.survey_motion import survey_motion
from surefix.types import BoolArray, Channel, Fixes, FloatArray, Log

__all__ = [
    "RovDive",
    "columns",
    "depth_columns",
    "log",
    "simulate",
    "velocity_columns",
]

_START = 1_715_673_600.0  # 2024-05-14 08:00:00 UTC
_ORIGIN = LocalFrame(59.8215, 4.3087)  # open water of the northern North Sea
_STEP = 0.1  # s between the epochs of the truth
_SENSORS = ("USBL",)


@dataclass(frozen=True, kw_only=True)
class RovDive:
    """A simulated dive; every array is exact truth unless it is called a measurement.

    Parameters
    ----------
    seed
        What it was drawn from.
    frame
        Origin of the local axes.
    time
        (n,) s Unix, every 0.1 s.
    position, velocity
        (n, 3) m in the local axes, the jump included, and m/s.
    heading_deg
        (n,) 0 … 360.
    fixes
        The USBL measurements, m of them.
    fix_position
        (m, 3) m, where the vehicle was at each fix.
    gross, burst
        (m,) which fixes are gross errors, and which of those belong to the burst.
    jump_time, jump_m
        s, and (3,) m: the true jump; NaN and 0 where there is none.
    dvl
        Measured velocity.
    depth, heading
        Measured series ``depth_m`` and ``heading_deg``.
    depth_gross
        Which values of ``depth`` are spikes.
    """

    seed: int
    frame: LocalFrame
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    heading_deg: FloatArray
    fixes: Fixes
    fix_position: FloatArray
    gross: BoolArray
    burst: BoolArray
    jump_time: float
    jump_m: FloatArray
    dvl: Dvl
    depth: Channel
    depth_gross: BoolArray
    heading: Channel


def simulate(
    seed: int,
    *,
    minutes: float = 40.0,
    fix_interval_s: float = 2.0,
    sigma_position_m: float = 0.5,
    sigma_vertical_m: float = 0.4,
    gross_share: float = 0.08,
    gross_m: tuple[float, float] = (3.0, 40.0),
    burst_fixes: int = 12,
    jump_m: tuple[float, float, float] = (20.0, -12.0, 0.0),
    dropouts: int = 3,
    lost_share: float = 0.03,
    jitter: float = 0.15,
    dvl_interval_s: float = 0.5,
    sigma_dvl_mps: float = 0.01,
    dvl_clock_ppm: float = 60.0,
    sigma_depth_m: float = 0.02,
    depth_spike_share: float = 0.001,
    speed_mps: float = 0.5,
    line_m: float = 110.0,
    depth_m: float = 85.0,
    geographic: bool = False,
) -> RovDive:
    """Draw one dive; the same seed and options give the same bits.

    Parameters
    ----------
    seed
        Of ``numpy.random.default_rng``.
    minutes
        Duration, at least 2.
    fix_interval_s, jitter, lost_share, dropouts
        Nominal step of the USBL, its scatter as a share of the step (below 0.5), share of single
        fixes lost, and number of dropouts of 15 … 40 s.
    sigma_position_m, sigma_vertical_m
        USBL noise per horizontal axis and vertical, white.
    gross_share, gross_m
        Share of isolated gross errors, and their least and greatest length.
    burst_fixes
        Number of consecutive fixes with one common error of 8 … 25 m; 0 for none.
    jump_m
        The true jump at about 70 % of the dive; zeros for none.
    dvl_interval_s, sigma_dvl_mps, dvl_clock_ppm
        Step and noise of the DVL, and how much its clock runs fast.
    sigma_depth_m, depth_spike_share
        Noise of the 5 Hz pressure depth, and share of spikes of 1 … 20 m.
    speed_mps, line_m, depth_m
        Survey speed, length of a line, mean depth.
    geographic
        Give the fixes as latitude, longitude, height instead of x, y, z.
    """
    motion, clock, faults, noise, dvl, depth, gyro = np.random.default_rng(seed).spawn(7)
    end = _START + 60.0 * minutes
    truth = _truth(motion, end, speed_mps, line_m, depth_m, np.asarray(jump_m, dtype=np.float64))
    usbl = irregular_times(clock, _START, end, fix_interval_s, jitter)
    usbl = usbl[outside(usbl, gaps(clock, truth.time, dropouts, (15.0, 40.0)))]
    usbl = usbl[clock.uniform(size=usbl.size) >= lost_share]
    gross, burst, error = usbl_errors(
        faults, usbl, truth.jump_time, gross_share, gross_m, burst_fixes
    )
    sigma = np.array([sigma_position_m, sigma_position_m, sigma_vertical_m])
    at_fixes = truth.observed(usbl)
    measured = at_fixes + sigma * noise.standard_normal(at_fixes.shape) + error
    depths, spikes = depth_log(depth, truth, sigma_depth_m, depth_spike_share)
    return RovDive(
        seed=seed,
        frame=_ORIGIN,
        time=truth.time,
        position=truth.observed(truth.time),
        velocity=truth.velocity,
        heading_deg=truth.heading,
        fixes=fixes_log(usbl, measured, _ORIGIN if geographic else None),
        fix_position=at_fixes,
        gross=gross,
        burst=burst,
        jump_time=truth.jump_time,
        jump_m=truth.jump,
        dvl=dvl_log(dvl, truth, dvl_interval_s, sigma_dvl_mps, dvl_clock_ppm),
        depth=depths,
        depth_gross=spikes,
        heading=heading_log(gyro, truth),
    )


def log(dive: RovDive) -> Log:
    """Give the dive as a reader would: fixes, depth and heading."""
    return Log(
        source=f"simulated dive {dive.seed}",
        sensors=_SENSORS,
        fixes=dive.fixes,
        channels=(dive.depth, dive.heading),
    )


def columns(dive: RovDive) -> dict[str, FloatArray]:
    """Columns of the raw log of the dive, one row a fix: what a navigation package would write.

    ``time``, then ``lat, lon, depth`` or ``x, y, z``, the measured ``heading``.
    """
    position = dive.fixes.position
    table = {"time": dive.fixes.time}
    if dive.fixes.geographic:
        table |= {"lat": position[:, 0], "lon": position[:, 1], "depth": -position[:, 2]}
    else:
        table |= {"x": position[:, 0], "y": position[:, 1], "z": position[:, 2]}
    nearest = np.searchsorted(dive.heading.time, dive.fixes.time).clip(
        max=dive.heading.time.size - 1
    )
    return table | {"heading": dive.heading.value[nearest]}


def depth_columns(dive: RovDive) -> dict[str, FloatArray]:
    """Columns of the pressure-depth log: ``time`` and ``depth``, m positive down."""
    return {"time": dive.depth.time, "depth": dive.depth.value}


def velocity_columns(dive: RovDive) -> dict[str, FloatArray]:
    """Columns of the DVL log on its own clock: ``time, ve, vn, vu``; NaN without bottom."""
    east, north, up = dive.dvl.velocity.T
    return {"time": dive.dvl.time, "ve": east, "vn": north, "vu": up}


def _truth(
    rng: np.random.Generator, end: float, speed: float, line: float, depth: float, jump: FloatArray
) -> Truth:
    elapsed = np.arange(0.0, end - _START + 0.5 * _STEP, _STEP)
    position, velocity, heading = survey_motion(rng, elapsed, speed=speed, line=line, depth=depth)
    when = _START + float(rng.uniform(0.67, 0.73)) * (end - _START)
    jump_time = when if jump.any() else float("nan")
    return Truth(_START + elapsed, position, velocity, heading, jump_time, jump)
