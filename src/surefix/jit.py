"""One place for the compiler flags of the numerical kernels.

Kernels are ordinary typed Python at module level; `kernel` compiles them with Numba and keeps the
machine code on disk. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba
from numba.core import event
from numba.extending import register_jitable

from surefix.compiling import KernelCache, KernelCompiler, PartCompiler

__all__ = [
    "compilations",
    "helper",
    "inlined",
    "inner",
    "kernel",
    "lean_helper",
    "lean_kernel",
    "on_disk",
    "threaded_kernel",
]

P = ParamSpec("P")
T = TypeVar("T")

_KERNEL: Final[Mapping[str, Any]] = {
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "pipeline_class": KernelCompiler,
}
_PART: Final[Mapping[str, Any]] = {
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": PartCompiler,
}
_LEAN: Final[Mapping[str, Any]] = {"_nrt": False, "fastmath": {"contract"}}


@contextmanager
def compilations(tell: Callable[[str], None]) -> Iterator[None]:
    """Tell the name of each kernel before it is compiled; what comes from disk is not told."""
    watch = _Watch(tell)
    event.register("numba:compile", watch)  # type: ignore[no-untyped-call]
    try:
        yield
    finally:
        event.unregister("numba:compile", watch)  # type: ignore[no-untyped-call]


class _Watch(event.Listener):
    """Hears of compilations; those of the parts of a kernel belong to it."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._depth = tell, 0

    def on_start(self, event: event.Event) -> None:
        self._depth += 1
        if self._depth == 1:
            self._tell(str(event.data["dispatcher"].py_func.__name__))

    def on_end(self, _event: event.Event) -> None:
        self._depth -= 1


def on_disk(kernel: Callable[..., object]) -> bool:
    """Tell whether anything of a kernel was compiled before, or need not be."""
    cache = getattr(kernel, "_cache", None)
    return not isinstance(cache, KernelCache) or not cache.empty()


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that Python calls; its machine code is cached on disk."""
    return _kept(function)


def helper(function: Callable[P, T]) -> Callable[P, T]:
    """Let kernels call a small function; it is compiled as a part of them.

    Called from Python it runs as Python. It has no machine code of its own, no wrapper and no place
    on disk, and one version serves all constants it is called with: that saves a tenth to a half of
    the compilation.
    """
    part = register_jitable(**_PART)
    compiled: Callable[P, T] = part(function)
    return compiled


def lean_kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that allocates nothing: references to arrays are not counted in it.

    Counting them, an atomic operation for each slice, costs a small kernel more than its work. A
    product and a sum may become one instruction. It lets go of the interpreter, so that what was
    cleaned is written meanwhile.
    """
    return _kept(function, nogil=True, **_LEAN)


def lean_helper(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function that allocates nothing and that only kernels call.

    No way in from Python is made, where it stays as it is written.
    """
    return register_jitable(**_PART, **_LEAN)(function)


def inner(function: Callable[P, T]) -> Callable[P, T]:
    """Make such a function part of the machine code of the kernels that call it.

    That is for what is called often or from one place: it is compiled at every place anew.
    """
    return register_jitable(forceinline=True, **_PART, **_LEAN)(function)


def inlined(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function that is made part of the machine code of each kernel that calls it.

    Sizes that the caller knows (see `surefix.rows`) are then known inside, and no array is counted
    on the way. A product and a sum may become one instruction.
    """
    part = register_jitable(forceinline=True, fastmath={"contract"}, **_PART)
    inside: Callable[P, T] = part(function)
    return inside


def threaded_kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that lets go of the interpreter, so that threads can run it side by side."""
    return _kept(function, nogil=True)


def _kept(function: Callable[P, T], **options: Any) -> Callable[P, T]:
    """Compile a function and keep it on disk, where there is a folder for it."""
    made = numba.njit(**_KERNEL, **options)(function)
    if hasattr(made, "_cache"):  # not with NUMBA_DISABLE_JIT
        with suppress(RuntimeError):  # there is none that can be written to
            made._cache = KernelCache(function)  # noqa: SLF001
    return cast(Callable[P, T], made)
