"""Errors that begin without any step: fixes wander off, and come back."""

from __future__ import annotations

from typing import Literal

import numpy as np

from surefix.types import FloatArray

__all__ = ["Drag", "pull_of"]

Drag = Literal["even", "slow", "vertical"]

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
