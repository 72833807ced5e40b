"""One place for the compiler flags of the numerical kernels.

Kernels are ordinary typed Python at module level; `kernel` compiles them with Numba and keeps the
machine code on disk. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar, cast

import numba
from numba.core import event
from numba.extending import register_jitable

__all__ = ["compilations", "helper", "kernel"]

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def compilations(tell: Callable[[str], None]) -> Iterator[None]:
    """Tell the name of each kernel before it is compiled; what comes from disk is not told."""
    watch = _Watch(tell)
    event.register("numba:compile", watch)
    try:
        yield
    finally:
        event.unregister("numba:compile", watch)


class _Watch(event.Listener):  # type: ignore[misc]  # numba has no types
    """Hears of compilations; those of the parts of a kernel belong to it."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._depth = tell, 0

    def on_start(self, event: event.Event) -> None:
        self._depth += 1
        if self._depth == 1:
            self._tell(str(event.data["dispatcher"].py_func.__name__))

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that Python calls; its machine code is cached on disk."""
    return cast(Callable[P, T], numba.njit(cache=True, error_model="numpy")(function))


def helper(function: Callable[P, T]) -> Callable[P, T]:
    """Let kernels call a small function; it is compiled as a part of them.

    Called from Python it runs as Python. It has no machine code of its own, no wrapper and no place
    on disk, and one version serves all constants it is called with: that saves a tenth to a half of
    the compilation.
    """
    compiled = register_jitable(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
    return cast(Callable[P, T], compiled(function))
