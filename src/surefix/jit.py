"""One place for the compiler flags of the numerical kernels.

Kernels are ordinary typed Python at module level; `kernel` compiles them with Numba and keeps the
machine code on disk. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba
from numba.extending import register_jitable

__all__ = ["helper", "inner", "kernel", "lean_kernel"]

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


def lean_kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that allocates nothing: references to arrays are not counted in it.

    Counting them, an atomic operation for each slice, costs a small kernel more than its work.
    """
    flags = {"_nrt": False, "fastmath": {"contract"}}
    return cast(Callable[P, T], numba.njit(cache=True, error_model="numpy", **flags)(function))


def inner(function: Callable[P, T]) -> Callable[P, T]:
    """Make a function that allocates nothing part of the machine code of the kernels that call it.

    It is compiled with them alone, for no way in from Python is made, where it stays as it is
    written. A product and a sum may become one instruction.
    """
    flags = {"_nrt": False, "no_cfunc_wrapper": True, "fastmath": {"contract"}}
    part = register_jitable(error_model="numpy", forceinline=True, **flags)
    return cast(Callable[P, T], part(function))
