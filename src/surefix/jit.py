"""One place for the compiler flags of the numerical kernels.

Kernels are ordinary typed Python at module level; `kernel` compiles them with Numba and keeps the
machine code on disk. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba
from numba.extending import register_jitable

__all__ = ["helper", "inlined", "kernel", "threaded_kernel"]

P = ParamSpec("P")
T = TypeVar("T")


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that Python calls; its machine code is cached on disk."""
    return cast(Callable[P, T], numba.njit(cache=True, error_model="numpy")(function))


def helper(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a small function that only kernels call; it is inlined into them."""
    return cast(
        Callable[P, T],
        numba.njit(cache=True, error_model="numpy", inline="never")(function),
    )


def inlined(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function that is made part of the machine code of each kernel that calls it.

    Sizes that the caller knows (see `surefix.rows`) are then known inside, and no array is counted
    on the way. A product and a sum may become one instruction.
    """
    part = register_jitable(
        error_model="numpy",
        forceinline=True,
        fastmath={"contract"},
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
    )
    inside: Callable[P, T] = part(function)
    return inside


def threaded_kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that lets go of the interpreter, so that threads can run it side by side."""
    return cast(Callable[P, T], numba.njit(cache=True, error_model="numpy", nogil=True)(function))
