"""Work on one thing while the next of its kind is made, on a second core."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

__all__ = ["while_next_is_made"]

T = TypeVar("T")


def while_next_is_made(work: Callable[[T], None], items: Iterable[T]) -> None:
    """Do ``work`` on each item, one after the other, in a thread of its own.

    The caller's thread makes the next item meanwhile; no item is made before the work on the one
    but last is done, so that two are in memory at most. It gains what lets go of the interpreter:
    the kernels of the filters on this side, the packing of files on the other.

    Parameters
    ----------
    work
        Called once for each item, in their order, never twice at a time.
    items
        Made by the caller's thread, where Ctrl-C arrives.

    Raises
    ------
    Exception
        What ``work`` or ``items`` raise, as it is. There is no more work then, and the thread has
        ended.
    """
    with ThreadPoolExecutor(1, "beside") as thread:
        last: Future[None] | None = None
        for item in items:
            if last is not None:
                last.result()
            last = thread.submit(work, item)
        if last is not None:
            last.result()
