"""What the sentence of an acoustic instrument says: a transponder's position, or a velocity.

Units: s, degrees, metres, m/s. NaN is missing. ``talker`` is empty: proprietary sentences have
none; ``type`` is the whole address.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

__all__ = ["NOT_MEASURED", "Attitude", "BodyVelocity", "Place", "Sighting"]

Place = Literal["ship", "north", "grid", "globe"]
"""What a position is in: the ship's axes (x starboard, y forward), axes through the ship (x east,
y north), a map grid whose zone is not told (x easting, y northing), or latitude and longitude."""


NOT_MEASURED = (" filtered", " predicted")
"""Ends of the names of targets whose positions are no measurements of their own."""


class Sighting(NamedTuple):
    """A position of a transponder.

    Parameters
    ----------
    target
        Whose position: the transponder's name, with one of `NOT_MEASURED` where the system says so.
    second
        s since midnight, when it was measured; NaN where ``measured`` says it.
    place
        What ``x`` and ``y`` are.
    x, y
        m east (or starboard) and north (or forward); for ``globe`` degrees latitude, longitude.
    depth
        m, positive down.
    sigma_x, sigma_y, sigma_depth
        m, standard deviations that the system declares; east and north, equal for ``ship``.
    valid
        False where the system marks the position as bad.
    day
        Days since 1970-01-01, where the sentence has a date.
    measured, told
        s on the instrument's own clock: when it was measured, and when the sentence was written.
    """

    talker: str
    type: str
    target: str
    second: float
    place: Place
    x: float
    y: float
    depth: float
    sigma_x: float
    sigma_y: float
    sigma_depth: float
    valid: bool
    day: int | None = None
    measured: float = float("nan")
    told: float = float("nan")


class Attitude(NamedTuple):
    """How a vehicle lies, degrees; ``second`` since midnight, NaN if the sentence has no time.

    Heading is true, roll is positive with starboard down, pitch with the bow up. What the sentence
    does not tell at all is None, what it leaves empty is NaN.
    """

    talker: str
    type: str
    second: float
    heading: float | None
    roll: float | None = None
    pitch: float | None = None


class BodyVelocity(NamedTuple):
    """Velocity over ground along the vehicle's own axes, m/s, all NaN where it is not valid.

    ``sigma`` is the standard deviation of one component; ``measured`` and ``told`` as in
    `Sighting`.
    """

    talker: str
    type: str
    forward: float
    starboard: float
    down: float
    sigma: float
    measured: float
    told: float
