"""A clock that nobody can set: the computer's time when it began, and what has passed since."""

from __future__ import annotations

import time

__all__ = ["SteadyClock"]


class SteadyClock:
    """Gives s, Unix, and never steps; a computer's clock that is set shows in `set_by`."""

    def __init__(self) -> None:
        self._start = time.time() - time.monotonic()

    def __call__(self) -> float:
        """Give the time, s."""
        return self._start + time.monotonic()

    @property
    def set_by(self) -> float:
        """By how much the computer's clock was set since this one began, s."""
        return time.time() - self()
