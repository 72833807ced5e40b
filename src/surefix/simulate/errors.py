"""What the errors of simulated logs are made of, in units of σ."""

from __future__ import annotations

from typing import Literal

import numpy as np

from surefix.types import FloatArray

__all__ = ["GROSS", "Drag", "directions", "pull_of", "scatter", "velocity_errors"]

Drag = Literal["even", "slow", "vertical"]

GROSS = (10.0, 130.0)
"""Least and greatest length of a gross error: 3 … 40 m where σ is 0.3 m."""

_RUN = (5, 40)  # epochs a run of wrong velocities lasts
_EARLIEST = 25  # epoch at which one begins
_EVEN = 60  # fixes over which it grows by 1 σ each, and as many over which it goes back
_SLOW = (0.1, 1.0)  # σ from one fix to the next in one that is slower, …
_GROWS, _STAYS = (30, 120), (10, 60)  # … fixes over which it grows, and for which it stays


def pull_of(rng: np.random.Generator, drag: Drag | None) -> FloatArray:
    """Length of the error of each of its fixes, in σ.

    Parameters
    ----------
    rng
        Source of what is drawn.
    drag
        ``even`` and ``vertical``: for 60 intervals by 1 σ from each fix to the next, and back as
        slowly. ``slow``: for 30 … 120 intervals by 0.1 … 1 σ each; it stays for 10 … 60, and goes
        back as it came or at once. None has no fixes.
    """
    if drag is None:
        return np.zeros(0)
    if drag != "slow":
        return np.asarray(_EVEN - np.abs(np.arange(1.0 - _EVEN, _EVEN)))
    low, high = _SLOW
    step = low * (high / low) ** rng.uniform()
    out = step * np.arange(1, int(rng.integers(*_GROWS, endpoint=True)) + 1)
    stays = np.full(int(rng.integers(*_STAYS, endpoint=True)), out[-1])
    return np.concatenate([out, stays, out[::-1] if rng.uniform() < 0.5 else out[:0]])


def directions(rng: np.random.Generator, count: int, d: int) -> FloatArray:
    """(count, d) unit vectors, all directions alike."""
    arrows = rng.standard_normal((count, d))
    return np.asarray(arrows / np.linalg.norm(arrows, axis=1, keepdims=True))


def scatter(rng: np.random.Generator, freedom: float, shape: tuple[int, int]) -> FloatArray:
    """White noise of variance 1: normal, or Student's with so many degrees of freedom."""
    if np.isinf(freedom):
        return rng.standard_normal(shape)
    return np.asarray(rng.standard_t(freedom, shape) * np.sqrt((freedom - 2.0) / freedom))


def velocity_errors(rng: np.random.Generator, runs: int, n: int, d: int) -> FloatArray:
    """(n, d) errors of the velocities in σ: one common error a run."""
    error = np.zeros((n, d))
    for _ in range(runs):
        first = int(rng.integers(_EARLIEST, n - _RUN[1]))
        count = int(rng.integers(*_RUN, endpoint=True))
        error[first : first + count] = rng.uniform(*GROSS) * directions(rng, 1, d)
    return error
