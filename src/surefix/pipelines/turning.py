"""Where antennas are on a vehicle that turns: lever arms, carried by its heading.

An antenna that is mounted away from the reference point describes a circle when the vehicle turns.
With the heading at the time of a fix its offset is known, to the uncertainty of the heading times
its distance; without one it is not, and the distance itself is the uncertainty. The vehicle is
taken to be level: its roll and pitch are noise to a fix, and are estimated as such.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.geo.angle import wrap
from surefix.types import BoolArray, Channel, FloatArray

__all__ = ["Arm", "Turning", "arms_at", "reached", "turned"]

Arm = tuple[float, ...]
"""Forward, starboard and up, m, from the reference point to the antenna; empty: there is none."""

_KEPT: Final = 120.0  # s of headings that are kept
_AWAY: Final = 2.0  # s between a heading and a fix that are too many
_DRIFT: Final = math.radians(1.0)  # rad/s that a heading may change unseen
_SPAN: Final = 0.5  # s before and after, over which the rate of turn is taken


class Turning(NamedTuple):
    """Headings of the last two minutes.

    Parameters
    ----------
    time
        (n,) s, rising.
    heading
        (n,) rad, clockwise from north, as they were recorded.
    """

    time: FloatArray = np.empty(0)
    heading: FloatArray = np.empty(0)


def turned(turning: Turning, channels: Sequence[Channel], needed: float) -> Turning:
    """Add headings; what is older than two minutes and before ``needed`` (s) is forgotten."""
    series = [channel for channel in channels if channel.name == "heading_deg"]
    if not series:
        return turning
    time = np.concatenate([turning.time, *(each.time for each in series)])
    heading = np.concatenate([turning.heading, *(np.radians(each.value) for each in series)])
    known = np.isfinite(time) & np.isfinite(heading)
    time, first = np.unique(time[known], return_index=True)
    keep = time >= min(needed, float(time[-1]) if len(time) else 0.0) - _KEPT
    return Turning(time[keep], heading[known][first][keep])


def reached(turning: Turning) -> float:
    """Time up to which another heading changes nothing, s."""
    return float(turning.time[-2]) - _SPAN if len(turning.time) > 1 else -math.inf


def arms_at(
    turning: Turning, time: FloatArray, arms: FloatArray, sigma_heading: float
) -> FloatArray:
    """Offsets of antennas at the times of their fixes.

    Parameters
    ----------
    turning
        The headings there are.
    time
        (n,) s.
    arms
        (n, 3) forward, starboard, up, m.
    sigma_heading
        Standard deviation of the heading, rad.

    Returns
    -------
    lever
        (n, 9) east, north, up: offset of the antenna from the reference point, m, its velocity due
        to the rate of turn, m/s, and standard deviation of the offset, m.
    """
    heading, rate, away = _heading_at(turning, time)
    forward, starboard, up = arms.T
    sine, cosine = np.sin(heading), np.cos(heading)
    east, north = forward * sine + starboard * cosine, forward * cosine - starboard * sine
    lever = np.zeros((len(time), 9))
    lever[:, 0], lever[:, 1], lever[:, 2] = east, north, up
    lever[:, 3], lever[:, 4] = rate * north, -rate * east  # clockwise: from north to east
    sigma = np.hypot(sigma_heading, _DRIFT * np.minimum(away, _AWAY))
    lever[:, 6], lever[:, 7] = np.abs(north) * sigma, np.abs(east) * sigma
    unknown = ~(away <= _AWAY)
    lever[unknown, :2] = lever[unknown, 3:5] = 0.0
    lever[unknown, 6:8] = np.hypot(forward, starboard)[unknown, None]
    return lever


def _heading_at(turning: Turning, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Heading, rad, rate of turn, rad/s, and time to the farther of the headings beside it, s.

    Only headings near by are looked at, and none behind a gap: the numbers depend neither on where
    the headings begin nor on whether they go on after it. A turn goes on into a gap.
    """
    n, known = len(time), turning.time
    if len(known) < 2:
        return np.zeros(n), np.zeros(n), np.full(n, np.inf)
    together = np.diff(known) <= _AWAY
    heading = _without_spikes(turning.heading, together)
    place = np.arange(len(known))
    begins = np.maximum.accumulate(np.where(np.append(False, together), 0, place))
    ends = np.minimum.accumulate(np.where(np.append(together, False), len(known), place)[::-1])
    at = np.clip(np.searchsorted(known, time, side="right") - 1, 0, None)
    start, stop = known[begins[at]], known[ends[::-1][at]]
    beyond = np.maximum(time - stop, 0.0)
    middle = time - np.where(beyond > 0.0, beyond + _SPAN, 0.0)
    first, last = (np.clip(middle + side, start, stop) for side in (-_SPAN, _SPAN))
    swept = _wrapped(_between(known, heading, last) - _between(known, heading, first))
    rate = np.where(last > first, swept / np.where(last > first, last - first, 1.0), 0.0)
    left = time - known[at]
    right = np.where(beyond > 0.0, 0.0, known[np.minimum(at + 1, len(known) - 1)] - time)
    away = np.where(left == 0.0, 0.0, np.maximum(left, right))
    heading = _between(known, heading, np.minimum(time, stop)) + rate * beyond
    return heading, rate, np.where(time >= known[0], away, np.inf)


def _between(known: FloatArray, heading: FloatArray, time: FloatArray) -> FloatArray:
    """Heading at a time between two that are known, the short way round."""
    left = np.clip(np.searchsorted(known, time, side="right") - 1, 0, len(known) - 2)
    share = np.clip((time - known[left]) / (known[left + 1] - known[left]), 0.0, 1.0)
    return heading[left] + share * _wrapped(heading[left + 1] - heading[left])


def _without_spikes(heading: FloatArray, together: BoolArray) -> FloatArray:
    """Median of each heading and its neighbours: a turn stays as it is, a single spike goes."""
    inner = heading[1:-1]
    beside = [_wrapped(heading[:-2] - inner), np.zeros_like(inner), _wrapped(heading[2:] - inner)]
    middle = np.where(together[:-1] & together[1:], np.median(beside, axis=0), 0.0)
    return np.concatenate([heading[:1], inner + middle, heading[-1:]])


def _wrapped(angle: FloatArray) -> FloatArray:
    """The angle in −π … π, rad."""
    return wrap(angle, 2.0 * np.pi)
