"""Sources that are late against a velocity: what is said of them, and how it is taken out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.latency import Latency, latency
from surefix.pipelines.rows import Rows, take_rows
from surefix.types import BoolArray, Event, FloatArray

__all__ = ["Late", "find_late", "in_time", "late_events"]

_SURE = 3.0  # standard errors of a delay that is reported
_SMALL = 0.1  # of the interval between fixes: a smaller delay is not


class Late(NamedTuple):
    """A sensor whose positions come at another time than the velocities of a reference.

    Parameters
    ----------
    sensor, reference
        Names; they may be the same.
    found
        The delay and what else was found.
    """

    sensor: str
    reference: str
    found: Latency


def find_late(
    rows: Rows, usable: BoolArray, position: FloatArray, velocity: FloatArray, sensors: list[str]
) -> tuple[Late, ...]:
    """Hold the positions of every sensor against the velocity; give those that are not in time.

    The velocity is that of a velocity log; without one, that of the sensor whose own positions
    agree with it most sharply.

    Parameters
    ----------
    rows
        n rows; ``usable`` (n,) those that may be learnt from.
    position, velocity
        (n, 3) m and m/s in the local axes.
    sensors
        Names of the sensors.
    """
    usable = usable & np.isfinite(rows.tau)
    fixed = usable & ~rows.auxiliary & np.isfinite(position).any(axis=1)
    moving = usable & np.isfinite(velocity).any(axis=1)
    if not (fixed.any() and moving.any()):
        return ()
    moving &= rows.auxiliary if (moving & rows.auxiliary).any() else True
    references = np.unique(rows.fixes.sensor[moving]).tolist()

    def against(reference: int, sensor: int) -> Latency:
        mine, theirs = (
            fixed & (rows.fixes.sensor == sensor),
            moving & (rows.fixes.sensor == reference),
        )
        return latency(rows.tau[mine], position[mine], rows.tau[theirs], velocity[theirs])

    own = {}
    if len(references) > 1:
        own = {reference: against(reference, reference) for reference in references}
    reference = min(references, key=lambda each: own[each].sigma if own else 0.0)
    out = []
    for sensor in np.unique(rows.fixes.sensor[fixed]).tolist():
        found = own[sensor] if own and sensor == reference else against(reference, sensor)
        if abs(found.delay) > max(_SURE * found.sigma, _SMALL * found.interval):
            out.append(Late(sensors[sensor], sensors[reference], found))
    return tuple(out)


def late_events(late: tuple[Late, ...], *, removed: bool) -> list[Event]:
    """Say what was found, and what to do about it."""
    return [Event("latency", np.nan, _said(*each, removed=removed)) for each in late]


def _said(sensor: str, reference: str, found: Latency, *, removed: bool) -> str:
    digits = max(0, -int(np.floor(np.log10(found.sigma))))
    size, sigma = (f"{value:.{digits}f}" for value in (abs(found.delay), found.sigma))
    whose = "its own velocity" if sensor == reference else f"the velocity of {reference}"
    text = f"fixes of {sensor} are {size} ± {sigma} s {_way(found.delay)} against {whose}"
    alike = abs(found.delay) * found.speed
    if not found.arm_sigma < alike / _SURE:
        side = "behind" if found.delay > 0.0 else "ahead"
        text += f", or lie {alike:.2g} m {side} along the course, which looks alike"
    remedy = f"remove with --sensor-delay {sensor}={found.delay:.{digits}f}"
    return text + ("; removed" if removed else f"; {remedy}")


def _way(delay: float) -> str:
    return "late" if delay > 0.0 else "early"


def in_time(rows: Rows, late: tuple[Late, ...], sensors: list[str]) -> Rows:
    """Take delays off the times of the sensors, and put the rows in the new order."""
    delay = np.zeros(len(sensors))
    for each in late:
        delay[sensors.index(each.sensor)] = each.found.delay
    shift = delay[rows.fixes.sensor]
    moved = rows._replace(
        fixes=rows.fixes._replace(time=rows.fixes.time - shift),
        tau=rows.tau - shift,
        time=rows.time - shift,
    )
    known = np.isfinite(moved.tau)
    key = np.where(known, moved.tau, -np.inf)
    last = np.maximum.accumulate(np.where(known, np.arange(len(key)), -1))
    key = np.where(last >= 0, key[last], -np.inf)
    return take_rows(moved, np.argsort(key, kind="stable"))
