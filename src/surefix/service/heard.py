"""What was heard of each sensor: when, how late, and whether it stands by it itself.

Only times are kept, of the last minute; what the observations are worth the session says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.types import Channel, FloatArray, Log

__all__ = ["ATTITUDE", "QUANTITIES", "Begun", "Heard", "hear"]

ATTITUDE: Final = "attitude"
QUANTITIES: Final = {
    "roll_deg": ATTITUDE,
    "pitch_deg": ATTITUDE,
    "heading_deg": "heading",
    "depth_m": "depth",
    "forward_mps": "velocity",
}
"""What a series is an observation of, by its name; other series come from a sensor of positions."""

Begun = tuple[str, int, float, bool]
"""A fix that may still grow: sensor, number, time of validity, whether it has a position."""

_WINDOW: Final = 60.0  # s that are remembered …
_LEAST: Final = 6  # … but at least so many observations …
_MOST: Final = 600  # … and at most


class Heard(NamedTuple):
    """What was heard of one sensor.

    Parameters
    ----------
    name, source, quantity
        Of the sensor, the number of its input, and what it measures.
    time, delay
        (n,) s, Unix: validity of its last observations, in the order of arrival, and how much later
        they arrived, s; NaN where the time of arrival is not known.
    arrived
        s, Unix: when the last one arrived.
    marked
        s, Unix: validity of the last one that it called invalid itself; NaN if none.
    row
        Number of the last fix.
    """

    name: str
    source: int
    quantity: str
    time: FloatArray = np.empty(0)
    delay: FloatArray = np.empty(0)
    arrived: float = math.nan
    marked: float = math.nan
    row: int = -1

    @property
    def interval(self) -> float:
        """Usual time between two observations, s; NaN where there are too few."""
        steps = np.diff(np.sort(self.time))
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if len(steps) else math.nan

    @property
    def latest(self) -> float:
        """Validity of the last observation, s; −∞ where there is none."""
        return float(self.time[-1]) if len(self.time) else -math.inf

    @property
    def rate(self) -> float:
        """Observations a second; NaN where there are too few."""
        span = float(np.ptp(self.time)) if len(self.time) > 1 else 0.0
        return (len(self.time) - 1) / span if span > 0.0 else math.nan

    @property
    def latency(self) -> float:
        """Median of the delays, s; NaN without times of arrival."""
        known = self.delay[np.isfinite(self.delay)]
        return float(np.median(known)) if len(known) else math.nan

    @property
    def slowest(self) -> float:
        """Delay that 95 of 100 observations do not exceed, s; NaN without times of arrival."""
        known = self.delay[np.isfinite(self.delay)]
        return float(np.quantile(known, 0.95, method="higher")) if len(known) else math.nan


def hear(
    heard: tuple[Heard, ...], source: int, log: Log, begun: Sequence[Begun], arrival: float
) -> tuple[Heard, ...]:
    """Take note of what came with one piece of an input.

    Parameters
    ----------
    heard
        What was known before.
    source, log, begun
        Number of the input, what was read of it, and the fixes that are not complete yet.
    arrival
        s, Unix, of the piece; NaN if it is not known.
    """
    known = {(each.source, each.name): each for each in heard}
    rows: list[Begun] = []
    if log.fixes is not None:
        fixes = log.fixes
        there = fixes.valid & np.isfinite(fixes.position[:, :2]).all(axis=1)
        columns = (fixes.sensor.tolist(), fixes.row.tolist(), fixes.time.tolist(), there.tolist())
        rows = [(log.sensors[s], *rest) for s, *rest in zip(*columns, strict=True)]
    for name, number, time, good in [*rows, *begun]:
        before = known.get((source, name), Heard(name, source, "position"))
        if number > before.row and math.isfinite(time):
            news = _with(before, [time], arrival) if good else before._replace(marked=time)
            known[source, name] = news._replace(row=number)
    series = [each for each in log.channels if each.name in QUANTITIES]
    for sensor in dict.fromkeys(each.sensor for each in series):
        own = [each for each in series if each.sensor == sensor]
        told = {QUANTITIES[each.name] for each in own}
        quantity = ATTITUDE if ATTITUDE in told else QUANTITIES[own[0].name]
        before = known.get((source, sensor), Heard(sensor, source, quantity))
        known[source, sensor] = _with(before, _instants(own), arrival)
    return tuple(known.values())


def _instants(series: Sequence[Channel]) -> list[float]:
    """When a sensor said something, in the order of arrival; angles of one time count once."""
    found = [each.time[np.isfinite(each.time) & np.isfinite(each.value)] for each in series]
    longest = max(found, key=len)
    more = [each[~np.isin(each, longest)] for each in found]
    return [*longest.tolist(), *np.concatenate(more).tolist()]


def _with(heard: Heard, times: list[float], arrival: float) -> Heard:
    """Add observations; what is older than a minute is forgotten, but for the last few."""
    if not times:
        return heard
    time = np.concatenate([heard.time, times])[-_MOST:]
    delay = np.concatenate([heard.delay, arrival - np.array(times)])[-_MOST:]
    keep = np.abs(time - time[-1]) <= _WINDOW
    keep[-_LEAST:] = True
    return heard._replace(time=time[keep], delay=delay[keep], arrived=arrival)
