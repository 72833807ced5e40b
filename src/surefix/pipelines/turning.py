"""Where antennas are on a vehicle that turns, rolls and pitches: its attitude carries lever arms.

An antenna that is mounted away from the reference point swings around it. With heading, roll and
pitch at the time of a fix its offset is known, to the uncertainty of the angles times its distance.
Without a heading it is not, and the distance itself is the uncertainty. A vehicle that has never
told roll and pitch is taken to be level: they are noise to a fix, and are estimated as such.

Rotations as in `surefix.geo.rotation`, with z down: x forward, y to starboard.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.geo.angle import wrap
from surefix.types import BoolArray, Channel, FloatArray

__all__ = ["ANGLES", "Angles", "Arm", "Turning", "arms_at", "reached", "turned"]

Arm = tuple[float, ...]
"""Forward, starboard and up, m, from the reference point to the antenna; empty: there is none."""

ANGLES: Final = ("heading", "roll", "pitch")
"""What carries an arm, in the order of `Turning`."""

_KEPT: Final = 120.0  # s of angles that are kept
_NEAR: Final = 10.0  # s before a fix and after it, more than anything that is looked at for it
_AWAY: Final = 2.0  # s between an angle and a fix that are too many
_DRIFT: Final = math.radians(1.0)  # rad/s that a heading may change unseen
_SPAN: Final = 0.5  # s before and after, over which the rate of turn is taken …
_TILT_SPAN: Final = 0.25  # … and those of roll and pitch, which turn round sooner
# A ship in a seaway: what roll and pitch do unseen. An amplitude of 10° in 8 s is an RMS of
_TILT: Final = math.radians(7.0)
_OMEGA: Final = 2.0 * math.pi / 8.0  # rad/s: so its rate has an RMS of _TILT · _OMEGA, and so on
_CARRIED: Final = 1.2  # s after the last roll or pitch when no guess is better than level
_STEEPEST: Final = math.radians(90.0)  # of roll and pitch
# A spike is what no ship does between two values: 25° in 7 s have 20°/s² at the most
_SLACK, _JERKS = math.radians(1.0), math.radians(20.0)


class Angles(NamedTuple):
    """One angle over the last two minutes, as it was recorded.

    Parameters
    ----------
    time
        (n,) s, rising.
    angle
        (n,) rad.
    """

    time: FloatArray = np.empty(0)
    angle: FloatArray = np.empty(0)


class Turning(NamedTuple):
    """Heading, clockwise from north; roll, starboard down; pitch, bow up."""

    heading: Angles = Angles()
    roll: Angles = Angles()
    pitch: Angles = Angles()


class _Told(NamedTuple):
    """An angle at n instants: rad and rad/s, their uncertainty from the time to what was recorded.

    ``known``: something is near enough; ``began``: something was recorded before.
    """

    angle: FloatArray
    rate: FloatArray
    sigma: FloatArray
    sigma_rate: FloatArray
    known: BoolArray
    began: BoolArray


def turned(
    turning: Turning, channels: Iterable[Channel], needed: float, names: Sequence[str] = ANGLES
) -> Turning:
    """Add angles of the given names; what is older than two minutes and before ``needed`` (s) goes.

    Roll and pitch beyond 90° are left out: no arm can be carried by them.
    """
    found: dict[str, list[Channel]] = {}
    for channel in channels:
        name = channel.name.removesuffix("_deg")
        if name in names:
            found.setdefault(name, []).append(channel)
    return turning._replace(
        **{
            name: _longer(getattr(turning, name), series, needed, name != "heading")
            for name, series in found.items()
        }
    )


def _longer(angles: Angles, series: list[Channel], needed: float, tilt: bool) -> Angles:
    time = np.concatenate([each.time for each in series])
    angle = np.radians(np.concatenate([each.value for each in series]))
    known = np.isfinite(time) & np.isfinite(angle)
    if tilt:
        angle = _wrapped(angle)
        known &= np.abs(angle) <= _STEEPEST
    edge = angles.time[-1:]
    time, angle = np.append(angles.time, time[known]), np.append(angles.angle, angle[known])
    if np.any(np.diff(time[len(angles.time) - len(edge) :]) <= 0.0):
        time, first = np.unique(time, return_index=True)
        angle = angle[first]
    keep = time >= min(needed, float(time[-1]) if len(time) else 0.0) - _KEPT
    return Angles(time[keep], angle[keep])


def reached(turning: Turning, names: Sequence[str] = ANGLES) -> float:
    """Time up to which another angle changes nothing, s; angles that were never told do not count.

    >>> reached(Turning())
    -inf
    """
    told = [angles.time for name in names if len((angles := getattr(turning, name)).time) > 1]
    return min((float(time[-2]) - _SPAN for time in told), default=-math.inf)


def arms_at(
    turnings: Sequence[Turning],
    time: FloatArray,
    arms: FloatArray,
    sigma_heading: float,
    sigma_tilt: float,
) -> FloatArray:
    """Offsets of antennas at the times of their fixes.

    Parameters
    ----------
    turnings
        The angles there are; each angle is the first that is known at the time.
    time
        (n,) s.
    arms
        (n, 3) forward, starboard, up, m.
    sigma_heading, sigma_tilt
        Standard deviation of the heading, and of roll and pitch, rad.

    Returns
    -------
    lever
        (n, 12) east, north, up: offset of the antenna from the reference point, m, its velocity due
        to the rates of the angles, m/s, and the standard deviations of both.
    """
    heading, roll, pitch = (
        _first([_at(getattr(each, name), time, name != "heading") for each in turnings])
        for name in ANGLES
    )
    roll, pitch = _level_if_lost(roll, sigma_tilt), _level_if_lost(pitch, sigma_tilt)
    # In the vehicle's axes after roll (v, w) and pitch (p, d); their derivatives by roll and pitch
    forward, starboard, down = arms[:, 0], arms[:, 1], -arms[:, 2]
    sr, cr, sp, cp = *_sine_cosine(roll.angle), *_sine_cosine(pitch.angle)
    v, w = starboard * cr - down * sr, starboard * sr + down * cr
    p, d = forward * cp + w * sp, w * cp - forward * sp
    zero = np.zeros_like(p)
    by_roll, by_pitch = (v * sp, -w, v * cp), (d, zero, -p)
    s, c = _sine_cosine(heading.angle)
    place = _to_earth(s, c, (p, v, d))
    by = [(place[1], -place[0], zero), _to_earth(s, c, by_roll), _to_earth(s, c, by_pitch)]
    away = np.hypot(sigma_heading, heading.sigma)
    sigmas = [np.where(heading.known, away, 0.0), roll.sigma, pitch.sigma]
    rates = [heading.rate, roll.rate, pitch.rate]
    known = heading.known
    # Without a heading nothing horizontal is known but how long it is
    length = (
        np.hypot(p, v),
        np.hypot(*(_dot(each, rates[1:]) for each in ((by_roll[0], d), (-w, zero)))),
    )
    lever = np.zeros((len(time), 12))
    for k in range(3):
        parts = [each[k] for each in by]
        seen = known | (k == 2)
        lever[:, k] = np.where(seen, place[k], 0.0)
        lever[:, 3 + k] = np.where(seen, _dot(parts, rates), 0.0)
        lever[:, 6 + k] = np.where(seen, _root(parts, sigmas), length[0])
        unseen = [zero, roll.sigma_rate, pitch.sigma_rate]
        lever[:, 9 + k] = np.where(seen, _root(parts, unseen), length[1])
    return lever


def _sine_cosine(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.sin(angle), np.cos(angle)


def _to_earth(
    sine: FloatArray, cosine: FloatArray, along: tuple[FloatArray, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """East, north and up of what is forward, to starboard and down on a level vehicle."""
    p, v, d = along
    return p * sine + v * cosine, p * cosine - v * sine, -d


def _dot(parts: Sequence[FloatArray], factors: Sequence[FloatArray]) -> FloatArray:
    total = parts[0] * factors[0]
    for part, factor in zip(parts[1:], factors[1:], strict=True):
        total = total + part * factor
    return total


def _root(parts: Sequence[FloatArray], sigmas: Sequence[FloatArray]) -> FloatArray:
    """Root of the sum of squares of partial derivatives times standard deviations."""
    total = np.abs(parts[0]) * sigmas[0]
    for part, sigma in zip(parts[1:], sigmas[1:], strict=True):
        total = np.hypot(total, part * sigma)
    return total


def _first(told: Sequence[_Told]) -> _Told:
    """The first that is known."""
    best = told[0]
    for other in told[1:]:
        pairs = zip(best, other, strict=True)
        chosen = _Told._make(np.where(best.known, one, two) for one, two in pairs)
        best = chosen._replace(began=best.began | other.began)
    return best


def _level_if_lost(told: _Told, sigma: float) -> _Told:
    """Roll or pitch: level as long as none was told, and again, but uncertain, when it is lost."""
    lost = told.began & ~told.known
    return told._replace(
        sigma=np.where(told.known, np.hypot(sigma, told.sigma), np.where(lost, _TILT, 0.0)),
        sigma_rate=np.where(lost, _TILT * _OMEGA, told.sigma_rate),
    )


def _at(angles: Angles, time: FloatArray, tilt: bool) -> _Told:
    """An angle at the times of fixes.

    Only values near by are looked at, and none behind a gap: the numbers depend neither on where
    the series begins nor on whether it goes on after it. A turn goes on into a gap.
    """
    n = len(time)
    blank = np.zeros(n)
    began = time >= angles.time[0] if len(angles.time) else np.zeros(n, np.bool_)
    angles = _around(angles, time)
    known = angles.time
    if len(known) < 2:
        return _Told(blank, blank, blank, blank, np.zeros(n, np.bool_), began)
    span, longest = (_TILT_SPAN, _CARRIED) if tilt else (_SPAN, _AWAY)
    steps = np.diff(known)
    together = steps <= _AWAY
    angle = _without_spikes(angles.angle, steps, together, tilt)
    place = np.arange(len(known))
    begins = np.maximum.accumulate(np.where(np.append(False, together), 0, place))
    ends = np.minimum.accumulate(np.where(np.append(together, False), len(known), place)[::-1])
    at = np.clip(np.searchsorted(known, time, side="right") - 1, 0, None)
    start, stop = known[begins[at]], known[ends[::-1][at]]
    beyond = np.maximum(time - stop, 0.0)
    middle = time - np.where(beyond > 0.0, beyond + span, 0.0)
    first, last = (np.clip(middle + side, start, stop) for side in (-span, span))
    swept = _wrapped(_between(known, angle, last) - _between(known, angle, first))
    rate = np.where(last > first, swept / np.where(last > first, last - first, 1.0), 0.0)
    left = time - known[at]
    right = np.where(beyond > 0.0, 0.0, known[np.minimum(at + 1, len(known) - 1)] - time)
    away = np.where(left == 0.0, 0.0, np.maximum(left, right))
    angle = _between(known, angle, np.minimum(time, stop)) + rate * beyond
    near = began & (away <= _AWAY) & (beyond <= longest)
    if tilt:
        sigma, sigma_rate = _unseen(left, right, beyond)
    else:
        sigma, sigma_rate = _DRIFT * np.minimum(away, _AWAY), blank
    angle, rate, sigma, sigma_rate = (
        np.where(near, each, 0.0) for each in (angle, rate, sigma, sigma_rate)
    )
    return _Told(angle, rate, sigma, sigma_rate, near, began)


def _around(angles: Angles, time: FloatArray) -> Angles:
    """The values that matter to these times, and a few more."""
    seen = time[np.isfinite(time)]
    if not len(seen):
        return Angles()
    begin = np.searchsorted(angles.time, seen.min() - _NEAR) - 3
    end = np.searchsorted(angles.time, seen.max() + _NEAR) + 3
    some = slice(max(int(begin), 0), int(end))
    return Angles(angles.time[some], angles.angle[some])


def _unseen(
    left: FloatArray, right: FloatArray, beyond: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What roll or pitch and its rate may have done unseen since the values beside a fix.

    On a line between two values it is off by half its second derivative times the times to both;
    on a line that goes on for a time t, with a slope taken over up to a second, by half of that
    times t (t + 1 s). The slope of a line is that of the middle between its ends, and off by the
    second derivative times the time to it; there, over ±h, by the third derivative times h²/6.
    """
    swing, change = _TILT * _OMEGA**2, _TILT * _OMEGA**3
    ends = beyond > 0.0
    sigma = 0.5 * swing * np.where(ends, beyond * (beyond + 1.0), left * right)
    half = np.maximum(np.maximum(left, right), _TILT_SPAN)
    aside = np.minimum(np.minimum(left, right), 0.5 * np.abs(left - right))
    inside = np.hypot(swing * aside, change * half**2 / 6.0)
    return sigma, np.where(ends, swing * (beyond + 0.5), inside)


def _between(known: FloatArray, angle: FloatArray, time: FloatArray) -> FloatArray:
    """Angle at a time between two that are known, the short way round."""
    left = np.clip(np.searchsorted(known, time, side="right") - 1, 0, len(known) - 2)
    share = np.clip((time - known[left]) / (known[left + 1] - known[left]), 0.0, 1.0)
    return angle[left] + share * _wrapped(angle[left + 1] - angle[left])


def _without_spikes(
    angle: FloatArray, steps: FloatArray, together: BoolArray, tilt: bool
) -> FloatArray:
    """Median of each angle and its neighbours: a turn stays as it is, a single spike goes.

    Roll and pitch turn round within a few values, and are replaced only if they are too far off.
    """
    inner = angle[1:-1]
    beside = [_wrapped(angle[:-2] - inner), np.zeros_like(inner), _wrapped(angle[2:] - inner)]
    middle = np.where(together[:-1] & together[1:], np.median(beside, axis=0), 0.0)
    if tilt:
        most = _SLACK + 0.5 * _JERKS * steps[:-1] * steps[1:]
        middle = np.where(np.abs(middle) > most, middle, 0.0)
    return np.concatenate([angle[:1], inner + middle, angle[-1:]])


def _wrapped(angle: FloatArray) -> FloatArray:
    """The angle in −π … π, rad."""
    return wrap(angle, 2.0 * np.pi)
