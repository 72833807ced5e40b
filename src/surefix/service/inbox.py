"""What has arrived and waits for the next step: bounded, the oldest given up first and counted."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Final, NamedTuple

__all__ = ["Arrived", "Inbox"]

_MOST: Final = 4 << 20  # bytes that may wait


class Arrived(NamedTuple):
    """Bytes of a source, and when they came.

    Parameters
    ----------
    source
        Number of the input.
    time
        s, Unix; NaN for a recorded log, whose lines say so themselves.
    data
        The bytes; empty when the source has come to its end.
    """

    source: int
    time: float
    data: bytes


class Inbox:
    """Where sources leave what they read, and the service takes it away."""

    def __init__(self, most: int = _MOST) -> None:
        self._waiting: deque[Arrived] = deque()
        self._size, self._most = 0, most
        self._filled, self._room = asyncio.Event(), asyncio.Event()
        self._room.set()
        self.shed = 0
        """Bytes given up because they came faster than they could be taken."""

    def put(self, arrived: Arrived) -> None:
        """Leave bytes; if too many wait, the oldest are given up: the newest state counts."""
        self._waiting.append(arrived)
        self._size += len(arrived.data)
        while self._size > self._most and len(self._waiting) > 1:
            lost = self._waiting.popleft()
            self._size -= len(lost.data)
            self.shed += len(lost.data)
        self._filled.set()
        if 2 * self._size > self._most:
            self._room.clear()

    async def put_in_turn(self, arrived: Arrived) -> None:
        """Leave bytes once there is room: for a recorded log, which can wait."""
        await self._room.wait()
        self.put(arrived)

    async def take(self, timeout: float | None = None) -> list[Arrived]:
        """Take all that waits; waits for something, at most ``timeout`` seconds."""
        try:
            await asyncio.wait_for(self._filled.wait(), timeout)
        except TimeoutError:
            return []
        taken = list(self._waiting)
        self._waiting.clear()
        self._size = 0
        self._filled.clear()
        self._room.set()
        return taken
