"""What is to be written in the journal: kept until it is, and never waited for in vain.

A step is written before anything of it is put out, as long as the journal answers. If it does not,
or cannot write, what is to be written waits here, up to a limit, and nothing waits for the journal;
it is tried again by and by, and takes what waited in the order it came.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from surefix.errors import OutputError
from surefix.io.journal import Journal, Received, Told

__all__ = ["Gap", "Keeper"]

_KEPT: Final = 64 << 20  # bytes that are kept for a journal that cannot be written
_PATIENCE: Final = 1.0  # s that a step waits for the journal; a step after that, hardly any
_HARDLY: Final = 0.02
_AGAIN: Final = 1.0  # s between attempts while it is away
_BATCH: Final = 4 << 20  # bytes written in one transaction, about
_LAST: Final = 4.0  # s that the end waits for


class Gap(NamedTuple):
    """What the journal will never have.

    Parameters
    ----------
    pieces, size
        How many records, and their bytes.
    first, last
        s, Unix: times of arrival or validity; NaN if they have none.
    """

    pieces: int = 0
    size: int = 0
    first: float = math.nan
    last: float = math.nan


class Keeper:
    """What waits for the journal.

    Parameters
    ----------
    journal
        That takes it.
    """

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._waiting: deque[Received | Told] = deque()
        self._writing: asyncio.Task[None] | None = None
        self._flying: list[Received | Told] = []
        self._tried = -math.inf
        self.size = 0
        """Bytes that wait."""
        self.trouble = ""
        """Why the journal has not got everything, in words; empty when it has."""
        self.gap = Gap()
        """What it will never get, since this was last read and reset."""

    @property
    def waiting(self) -> list[Received | Told]:
        """What the journal has not got yet, the oldest first."""
        return [*self._flying, *self._waiting]

    async def keep(
        self,
        records: Iterable[Received | Told] = (),
        snapshot: Callable[[], tuple[int, bytes]] | None = None,
        *,
        last: bool = False,
    ) -> bool:
        """Write records and all that waits; without success, keep them.

        Parameters
        ----------
        records
            In the order of their numbers.
        snapshot
            Gives the snapshot that is written with the last of them.
        last
            There is no other time: try at once, and wait longer.

        Returns
        -------
        bool
            Whether the journal has got all, the snapshot included.
        """
        for each in records:
            self._waiting.append(each)
            self.size += _size(each)
        patience = _LAST if last else _HARDLY if self.trouble else _PATIENCE
        end = time.monotonic() + patience
        while self._writing is not None or self._waiting or snapshot is not None:
            if self._writing is None:
                if self.trouble and not last and time.monotonic() - self._tried < _AGAIN:
                    break
                if self._begin(snapshot):
                    snapshot = None
            assert self._writing is not None
            left = max(end - time.monotonic(), 0.0)
            done, _ = await asyncio.wait({self._writing}, timeout=left)
            if not done:
                self.trouble = self.trouble or "the journal does not answer"
                break
            if not self._ended(self._writing):
                break
        else:
            self.trouble = ""
            return True
        self._spare()
        return False

    def _begin(self, snapshot: Callable[[], tuple[int, bytes]] | None) -> bool:
        """Begin to write the next batch; True if the snapshot is in it."""
        size = 0
        while self._waiting and size < _BATCH:
            self._flying.append(self._waiting.popleft())
            size += _size(self._flying[-1])
        received = [each for each in self._flying if isinstance(each, Received)]
        told = [each for each in self._flying if isinstance(each, Told)]
        stored = snapshot() if snapshot is not None and not self._waiting else None
        self._tried = time.monotonic()
        writing = asyncio.to_thread(self._journal.write, received, told, stored)
        self._writing = asyncio.create_task(writing)
        return stored is not None

    def _ended(self, writing: asyncio.Task[None]) -> bool:
        """Take note of how a batch went."""
        self._writing = None
        try:
            writing.result()
        except OutputError as error:
            self.trouble = str(error)
            self._waiting.extendleft(reversed(self._flying))
            self._flying = []
            return False
        self.size -= sum(map(_size, self._flying))
        self._flying = []
        return True

    def _spare(self) -> None:
        """Keep no more than there is room for: the oldest goes, and is counted."""
        while self.size > _KEPT and self._waiting:
            gone = self._waiting.popleft()
            size = _size(gone)
            self.size -= size
            known = self.gap
            first = gone.time if math.isnan(known.first) else known.first
            last = known.last if math.isnan(gone.time) else gone.time
            self.gap = Gap(known.pieces + 1, known.size + size, first, last)


def _size(each: Received | Told) -> int:
    return len(each.data) if isinstance(each, Received) else len(each.text)
