"""What an input brings for the track, by its role: fixes, depths, velocities.

A depth is an observation of the height alone; a velocity one of the velocity alone. Velocities
along the vehicle's own axes are turned to east and north when they are let go, by its heading at
their time; it is taken to be level.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from surefix.errors import OptionsError
from surefix.geo.local_frame import rotate
from surefix.pipelines.azimuth import azimuth_at
from surefix.pipelines.rows import Rows, take_fixes
from surefix.pipelines.turning import Angles
from surefix.types import Channel, Fixes, FloatArray, IntArray, Log, Problem

__all__ = ["BODY", "NOT_CLEANED", "Support", "no_heading", "steered", "support"]

BODY: Final = "body"
"""Axes of velocities along the vehicle's own axes: to starboard, ahead and up until turned."""

NOT_CLEANED: Final = "velocity_sigma_mps"
"""Series of the standard deviations that a sensor declares for its velocities."""

_ALONG: Final = ("starboard_mps", "forward_mps", "down_mps")
_REMEDY: Final = "the heading of the vehicle is missing at that time"


class Support(NamedTuple):
    """What one part of an input brings for the track.

    Parameters
    ----------
    fixes
        The observations; None if there are none.
    sensors
        Names, which ``Fixes.sensor`` indexes.
    axes
        What they are in until they are let go: as ``Log.axes``, or `BODY`.
    """

    fixes: Fixes | None
    sensors: tuple[str, ...]
    axes: str = ""


def support(log: Log, role: str) -> Support:
    """What a part of an input of a role brings for the track."""
    if role == "fixes":
        return Support(log.fixes, log.sensors, log.axes if log.fixes is not None else "")
    if role == "depth":
        return _depths(log)
    return _velocities(log) if role == "velocity" else Support(None, ())


def _depths(log: Log) -> Support:
    series = [channel for channel in log.channels if channel.name == "depth_m"]
    if not series:
        return Support(None, ())
    names = tuple(dict.fromkeys(channel.sensor for channel in series))
    time = np.concatenate([c.time for c in series])
    sensor = np.concatenate([np.full(len(c.time), names.index(c.sensor)) for c in series])
    position = np.full((len(time), 3), np.nan)
    position[:, 2] = -np.concatenate([c.value for c in series])
    empty = np.full((len(time), 3), np.nan)
    return Support(_observed(time, sensor, position, empty, empty), names)


def _velocities(log: Log) -> Support:
    """Velocities; positions, of another body perhaps, are not taken from such a log."""
    series: dict[str, dict[str, Channel]] = {}
    for channel in log.channels:
        if channel.name in (*_ALONG, NOT_CLEANED):
            series.setdefault(channel.sensor, {})[channel.name] = channel
    if series:
        return _along(series)
    fixes = log.fixes
    if fixes is not None and np.isfinite(fixes.position).any():
        bare = np.isnan(fixes.position).all(axis=1) & np.isfinite(fixes.velocity).any(axis=1)
        own = np.flatnonzero(bare)
        fixes = take_fixes(fixes, own) if len(own) else None
    return Support(fixes, log.sensors if fixes is not None else ())


def _along(series: Mapping[str, Mapping[str, Channel]]) -> Support:
    """Velocities along the vehicle's own axes, by sensor."""
    times, numbers, velocities, sigmas = [], [], [], []
    for number, own in enumerate(series.values()):
        time = next(iter(own.values())).time
        empty = np.full(len(time), np.nan)
        starboard, ahead, down, sigma = (
            own[name].value if name in own else empty for name in (*_ALONG, NOT_CLEANED)
        )
        times.append(time)
        numbers.append(np.full(len(time), number))
        velocities.append(np.column_stack([starboard, ahead, -down]))
        sigmas.append(np.column_stack([sigma] * 3))
    time = np.concatenate(times)
    found = _observed(
        time,
        np.concatenate(numbers),
        np.full((len(time), 3), np.nan),
        np.concatenate(velocities),
        np.concatenate(sigmas),
    )
    return Support(found, tuple(series), BODY)


def _observed(
    time: FloatArray,
    sensor: IntArray,
    position: FloatArray,
    velocity: FloatArray,
    sigma_velocity: FloatArray,
) -> Fixes:
    n = len(time)
    unknown, zero = np.full((n, 3), np.nan), np.zeros(n, np.int64)
    there = np.ones(n, np.bool_), np.arange(n)
    return Fixes(
        time, position, velocity, unknown, sigma_velocity, sensor, zero, *there, geographic=False
    )


def steered(
    rows: Rows, headings: Angles, sigma_heading: float, sensor: str
) -> tuple[Rows, tuple[Problem, ...]]:
    """Velocities along the vehicle's axes turned to east, north, up; without heading left out.

    Parameters
    ----------
    rows
        Velocities to starboard, ahead and up, m/s.
    headings
        Those of the vehicle.
    sigma_heading
        Their standard deviation, rad, which is added to what the sensor declares.
    sensor
        What measured them.
    """
    fixes = rows.fixes
    azimuth = azimuth_at(headings, fixes.time)
    velocity = fixes.velocity.copy()
    velocity[:, 0], velocity[:, 1] = rotate(velocity[:, 0], velocity[:, 1], -azimuth)
    sigma = fixes.sigma_velocity.copy()
    across = np.nan_to_num(np.abs(velocity[:, 1::-1])) * sigma_heading
    sigma[:, :2] = np.hypot(sigma[:, :2], across)
    lost = np.isnan(azimuth) & np.isfinite(fixes.velocity[:, :2]).all(axis=1)
    problems: tuple[Problem, ...] = ()
    if lost.any():
        example = f"{sensor} at {fixes.time[lost][0]:.1f} s"
        problems = (Problem("no-heading", int(lost.sum()), example, _REMEDY),)
    turned = fixes._replace(velocity=velocity, sigma_velocity=sigma)
    return rows._replace(fixes=turned), problems


def no_heading(source: str) -> OptionsError:
    """Say that velocities cannot be turned."""
    return OptionsError(
        f"{source} has velocities along the vehicle's own axes",
        "a heading to turn them to east and north",
        "add --heading FILE",
    )
