"""Being told to stop: Ctrl-C and SIGTERM end a command wherever they meet it."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

__all__ = ["TERMINATED", "obeyed"]

TERMINATED: Final = 143
"""What a command that was terminated ends with."""

_SOON: Final = 0.01  # s


@contextmanager
def obeyed() -> Iterator[None]:
    """Let SIGTERM unwind like Ctrl-C, so that unfinished files are removed, and lose neither.

    Both are exceptions, and an exception that comes up while an object is finalised is dropped by
    the interpreter: then the signal is sent again.
    """
    usual = sys.unraisablehook

    def again(dropped: sys.UnraisableHookArgs) -> None:
        if issubclass(dropped.exc_type, KeyboardInterrupt):
            number = signal.SIGINT
        elif issubclass(dropped.exc_type, SystemExit):
            number = signal.SIGTERM
        else:
            usual(dropped)
            return
        threading.Timer(_SOON, _thread.interrupt_main, [number]).start()

    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = usual
        signal.signal(signal.SIGTERM, before)
