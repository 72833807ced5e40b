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
from surefix.types import Channel, FloatArray

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

    Only headings near by are looked at, so that the numbers do not depend on where they begin.
    """
    n, known = len(time), turning.time
    if len(known) < 2:
        return np.zeros(n), np.zeros(n), np.full(n, np.inf)
    heading = _without_spikes(turning.heading)
    beyond = np.maximum(time - known[-1], 0.0)  # after the last one the turn goes on
    middle = time - np.where(beyond > 0.0, beyond + _SPAN, 0.0)
    first, last = (np.clip(middle + side, known[0], known[-1]) for side in (-_SPAN, _SPAN))
    swept = _wrapped(_between(known, heading, last) - _between(known, heading, first))
    rate = np.where(last > first, swept / np.where(last > first, last - first, 1.0), 0.0)
    place = np.searchsorted(known, time, side="right")
    left = time - known[np.maximum(place - 1, 0)]
    right = known[np.minimum(place, len(known) - 1)] - time
    away = np.where(place == 0, right, np.where(beyond > 0.0, left, np.maximum(left, right)))
    away = np.where(left == 0.0, 0.0, away)
    heading = _between(known, heading, time) + rate * beyond
    return heading, rate, np.where(np.isfinite(time), away, np.inf)


def _between(known: FloatArray, heading: FloatArray, time: FloatArray) -> FloatArray:
    """Heading at a time between two that are known, the short way round."""
    left = np.clip(np.searchsorted(known, time, side="right") - 1, 0, len(known) - 2)
    share = np.clip((time - known[left]) / (known[left + 1] - known[left]), 0.0, 1.0)
    return heading[left] + share * _wrapped(heading[left + 1] - heading[left])


def _without_spikes(heading: FloatArray) -> FloatArray:
    """Median of each heading and its neighbours: a turn stays as it is, a single spike goes."""
    inner = heading[1:-1]
    beside = [_wrapped(heading[:-2] - inner), np.zeros_like(inner), _wrapped(heading[2:] - inner)]
    return np.concatenate([heading[:1], inner + np.median(beside, axis=0), heading[-1:]])


def _wrapped(angle: FloatArray) -> FloatArray:
    """The angle in −π … π, rad."""
    return wrap(angle, 2.0 * np.pi)
