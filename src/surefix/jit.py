"""One place for the compiler flags of the numerical kernels.

Kernels are ordinary typed Python at module level; `kernel` compiles them with Numba and keeps the
machine code on disk. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

__all__ = ["helper", "kernel"]

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
