"""The records that pass between the parts of surefix. Plain data: arrays, no behaviour.

Conventions: SI units and radians inside; local axes are x east, y north, z up; time in
seconds (Unix UTC wherever the source has a date); NaN is missing; arrays of three columns
always carry all three axes, an axis that was never observed being NaN throughout.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "AXES",
    "BoolArray",
    "Channel",
    "Edit",
    "Event",
    "Fixes",
    "FloatArray",
    "IntArray",
    "Log",
    "Problem",
    "Verdict",
]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

AXES = ("x", "y", "z")


class Verdict(IntEnum):
    """What was done with an observation."""

    USED = 0
    DOWNWEIGHTED = 1
    REJECTED = 2
    MISSING = 3
    DUPLICATE = 4
    EDITED = 5


class Edit(IntEnum):
    """What the user decided about a fix; it overrides every method."""

    NONE = 0
    ACCEPT = 1
    REJECT = 2


class Fixes(NamedTuple):
    """Position fixes of one or several sensors, in the order of the input.

    Parameters
    ----------
    time
        (n,) s; NaN where the record has no time.
    position
        (n, 3). Metric: x, y, z in m. Geographic: latitude deg, longitude deg, height m (up).
    velocity
        (n, 3) m/s east, north, up.
    sigma_position, sigma_velocity
        (n, 3) standard deviations declared by the sensor, m and m/s; NaN where it declares none.
    sensor
        (n,) index into ``Log.sensors``.
    edit
        (n,) codes of `Edit`.
    valid
        (n,) False where the sensor itself marks the fix as invalid.
    row
        (n,) number of the record in its input, from 0.
    geographic
        True where ``position`` holds latitude, longitude, height.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    sigma_position: FloatArray
    sigma_velocity: FloatArray
    sensor: IntArray
    edit: IntArray
    valid: BoolArray
    row: IntArray
    geographic: bool


class Channel(NamedTuple):
    """A scalar series beside the position: depth, heading, speed …

    Parameters
    ----------
    name
        ``depth_m`` (positive down), ``heading_deg``, ``speed_mps``, ``course_deg`` …: the unit is
        part of the name. Angles that wrap carry degrees.
    sensor
        The sensor it came from.
    time
        (n,) s.
    value
        (n,) in the unit the name says; NaN is missing.
    period
        360 for an angle in degrees that wraps, else 0.
    """

    name: str
    sensor: str
    time: FloatArray
    value: FloatArray
    period: float


class Problem(NamedTuple):
    """A kind of bad input that was counted instead of raised.

    Parameters
    ----------
    kind
        Short stable name, such as ``checksum`` or ``no-checksum``.
    count
        How often it was met.
    example
        The first one, with its line: ``line 12: $GPGGA,…``.
    remedy
        What the user can do about it; may be empty.
    """

    kind: str
    count: int
    example: str
    remedy: str = ""


class Event(NamedTuple):
    """Something about the log as a whole that the user should know.

    Parameters
    ----------
    kind
        ``gap``, ``clock-step``, ``week-rollover``, ``jump``, ``recovery``, ``held``, ``note`` …
    time
        s on the output's clock; NaN where it concerns the whole log.
    text
        One sentence.
    """

    kind: str
    time: float
    text: str


@dataclass(frozen=True, kw_only=True)
class Log:
    """What was read: a whole log, or one chunk of it.

    ``fixes`` is None where the input holds no positions. A chunked reader repeats ``sensors``
    (which may only grow) and gives ``problems`` and ``events`` of that chunk alone.
    """

    source: str
    sensors: tuple[str, ...] = ()
    fixes: Fixes | None = None
    channels: tuple[Channel, ...] = ()
    problems: tuple[Problem, ...] = ()
    events: tuple[Event, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)
    """Records met by kind (sentence type, row); for `surefix info`."""
