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
    "PLACE",
    "BoolArray",
    "ByteArray",
    "Channel",
    "Cleaned",
    "CleanedChannel",
    "Edit",
    "Event",
    "Fixes",
    "FloatArray",
    "IntArray",
    "Log",
    "Noise",
    "Problem",
    "Reason",
    "Track",
    "Verdict",
    "Verdicts",
]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ByteArray = NDArray[np.uint8]

AXES = ("x", "y", "z")
PLACE = ("latitude_deg", "longitude_deg")
"""Series that tell where a ship was from which something is seen."""


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
    """A scalar series beside the position: depth, heading, speed and the like.

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
    total
        How often it was met.
    example
        The first one, with its line: ``line 12: $GPGGA,…``.
    remedy
        What the user can do about it; may be empty.
    """

    kind: str
    total: int
    example: str
    remedy: str = ""


class Event(NamedTuple):
    """Something about the log as a whole that the user should know.

    Parameters
    ----------
    kind
        ``gap``, ``clock-step``, ``misdated``, ``week-rollover``, ``jump``, ``run``, ``drag``,
        ``sensor-suspect``, ``sensor-trusted``, ``noise-changed``, ``held``, ``idle-axis``,
        ``height-offset``, ``latency`` or ``note``.
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
    depth_positive_down: bool = False
    """True where the third axis was given as a depth (height = −depth)."""
    axes: str = ""
    """Of positions that are yet to be placed by where the ship was: ``ship`` (x to starboard, y
    ahead), ``north`` (x east, y north of it). ``?``: not known yet; ``wait``: nor is it known of
    positions that wait for that."""


class Reason(IntEnum):
    """Why a verdict was given; `surefix.reasons.texts` turns it into a sentence."""

    AGREES = 0
    OFF = 1
    AXIS_OFF = 2
    JUMP = 3
    NO_POSITION = 4
    NO_VALUE = 5
    NO_TIME = 6
    INVALID = 7
    REPEATED = 8
    HELD = 9
    LATE = 10
    ACCEPTED_BY_USER = 11
    REJECTED_BY_USER = 12
    RUN = 13
    ISOLATED = 14
    DRAG = 15


class Verdicts(NamedTuple):
    """The core record: what was done with each observation, and why.

    Parameters
    ----------
    verdict
        (n,) codes of `Verdict`.
    weight
        (n,) 0 … 1, the share of its information that was used.
    innovation_sigma
        (n,) how far the observation lay from its prediction, in standard deviations of the
        innovation, as a one-axis equivalent (Mahalanobis distance over the axes that share a
        weight); NaN where nothing was predicted.
    standardised
        (n, 3) innovation per axis over its standard deviation, signed; NaN where not observed.
    reason
        (n,) codes of `Reason`.
    detail
        (n,) the figure that goes with the reason: a time in s (JUMP, HELD, LATE: the time it refers
        to), an axis mask (AXIS_OFF: bits 0, 1, 2 for x, y, z) or a number of fixes (RUN, DRAG).
    offset
        (n, 3) m, the common offset of the run that the observation belongs to, or its own in a
        drag; NaN outside of both.
    """

    verdict: IntArray
    weight: FloatArray
    innovation_sigma: FloatArray
    standardised: FloatArray
    reason: IntArray
    detail: FloatArray
    offset: FloatArray


class Track(NamedTuple):
    """A track with its uncertainty, one row an epoch, in the order of time.

    Parameters
    ----------
    time
        (n,) s.
    position, velocity
        (n, 3) local x east, y north, z up in m, and m/s.
    sigma_position, sigma_velocity
        (n, 3) standard deviations, m and m/s.
    geodetic
        (n, 3) latitude deg, longitude deg, height m, or None for metric input.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    sigma_position: FloatArray
    sigma_velocity: FloatArray
    geodetic: FloatArray | None


class Noise(NamedTuple):
    """One noise figure the filter used.

    Parameters
    ----------
    sensor
        Whose noise it is; ``motion`` for the process noise.
    quantity
        ``position``, ``height``, ``velocity``, ``vertical velocity``, ``acceleration`` …
    value, unit
        The figure: a standard deviation, or the root of a spectral density for the motion.
    source
        ``estimated``, ``given`` or ``declared`` (per record, by the sensor).
    """

    sensor: str
    quantity: str
    value: float
    unit: str
    source: str


class CleanedChannel(NamedTuple):
    """A cleaned scalar series; arrays of length n in the order of time.

    ``value`` is the clean series, ``rate`` its change per second, ``sigma`` its standard deviation,
    ``raw`` the input. ``verdicts.standardised`` has shape (n, 1).
    """

    name: str
    sensor: str
    time: FloatArray
    raw: FloatArray
    value: FloatArray
    rate: FloatArray
    sigma: FloatArray
    period: float
    verdicts: Verdicts
    noise: tuple[Noise, ...]


@dataclass(frozen=True, kw_only=True)
class Cleaned:
    """The result of cleaning a log: every view (files, report, dashboard) is made from it.

    Rows of ``track``, ``verdicts`` and ``raw_position`` correspond: one per input fix.

    Parameters
    ----------
    sources
        Names of the inputs.
    sensors
        Names of the position sensors; ``sensor`` indexes them.
    track, verdicts
        The clean track and what was done with each fix.
    raw_position
        (n, 3) the input fixes in local m; NaN where missing.
    raw_coordinates
        (n, 3) the input fixes as they were given (latitude, longitude, height, or x, y, z).
    sensor, row
        (n,) sensor index and record number in the input.
    has_depth
        True where the input gave depth (positive down) rather than height.
    resampled
        The track at regular times, if that was asked for.
    channels
        Scalar series cleaned beside it.
    noise, events, problems
        Noise figures used; what to know about the log; bad input counted.
    settings
        Every option as used, by name, and versions; for the report and the JSON summary.
    """

    sources: tuple[str, ...]
    sensors: tuple[str, ...]
    track: Track
    verdicts: Verdicts
    raw_position: FloatArray
    raw_coordinates: FloatArray
    sensor: IntArray
    row: IntArray
    has_depth: bool
    resampled: Track | None
    channels: tuple[CleanedChannel, ...]
    noise: tuple[Noise, ...]
    events: tuple[Event, ...]
    problems: tuple[Problem, ...]
    settings: Mapping[str, str]
