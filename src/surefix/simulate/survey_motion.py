"""Motion of a survey vehicle: parallel lines joined by smooth turns, over an uneven bottom."""

from __future__ import annotations

import numpy as np

from surefix.types import FloatArray

__all__ = ["survey_motion"]

_TURN = 40.0  # s for half a turn
_SMOOTH = 8.0  # s, length of the raised-cosine window that rounds every change
_CRAWL = 0.6  # share of the line speed that is kept in a turn


def survey_motion(
    rng: np.random.Generator, time: FloatArray, *, speed: float, line: float, depth: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Drive up and down parallel lines.

    Course and speed are piecewise constant, rounded by a raised-cosine window and disturbed by slow
    random sway; the position is the trapezoidal integral of the velocity, so that one is the
    derivative of the other.

    Parameters
    ----------
    rng
        Source of the line direction, the sway and the bottom.
    time
        (n,) s, evenly spaced, from 0.
    speed
        m/s along the lines.
    line
        Length of a line, m.
    depth
        Mean depth, m.

    Returns
    -------
    position
        (n, 3) m, from (0, 0, −depth).
    velocity
        (n, 3) m/s east, north, up.
    heading
        (n,) deg, 0 … 360: the course and a slow crab angle.
    """
    step = float(time[1] - time[0])
    course, pace = _pattern(time, float(rng.uniform(0.0, 2.0 * np.pi)), speed, line)
    course, pace = _rounded(course, step), _rounded(pace, step)
    sway = np.column_stack([_slow(rng, time, sigma) for sigma in (0.04, 0.04)])
    climb = _slow(rng, time, 0.03)
    velocity = np.column_stack(
        (pace * np.sin(course) + sway[:, 0], pace * np.cos(course) + sway[:, 1], climb)
    )
    position = np.zeros_like(velocity)
    position[1:] = np.cumsum(0.5 * step * (velocity[1:] + velocity[:-1]), axis=0)
    position[:, 2] -= depth
    crab = _slow(rng, time, 4.0)
    return position, velocity, np.mod(np.degrees(course) + crab, 360.0)


def _pattern(
    time: FloatArray, direction: float, speed: float, line: float
) -> tuple[FloatArray, FloatArray]:
    """Course in rad, continued across full turns, and speed: lines, turns to alternating sides."""
    leg = line / speed + _TURN
    index = np.floor(time / leg)
    turned = np.clip((time - index * leg - line / speed) / _TURN, 0.0, 1.0)
    side = np.where(index % 2 == 0, 1.0, -1.0)
    before = np.where(index % 2 == 0, 0.0, np.pi)
    return direction + before + side * np.pi * turned, speed * np.where(turned > 0.0, _CRAWL, 1.0)


def _rounded(values: FloatArray, step: float) -> FloatArray:
    half = max(1, round(0.5 * _SMOOTH / step))
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.pad(values, half, mode="edge")
    return np.asarray(np.convolve(padded, window / window.sum(), mode="valid"))


def _slow(rng: np.random.Generator, time: FloatArray, sigma: float) -> FloatArray:
    """Sum of eight sines of 20 … 300 s period with a total standard deviation of ``sigma``."""
    period = np.geomspace(20.0, 300.0, 8)
    phase = rng.uniform(0.0, 2.0 * np.pi, 8)
    waves = np.sin(2.0 * np.pi * time[:, None] / period + phase)
    return np.asarray(sigma * np.sqrt(2.0 / 8.0) * waves.sum(axis=1))
