"""One place for the compiler flags of the numerical kernels.

Kernels are ordinary typed Python at module level; `kernel` compiles them with Numba and keeps the
machine code on disk. With ``NUMBA_DISABLE_JIT=1`` the same source runs uncompiled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, ParamSpec, TypeVar, cast

import numba
from numba.extending import register_jitable

__all__ = ["helper", "inner", "kernel", "lean_helper", "lean_kernel"]

P = ParamSpec("P")
T = TypeVar("T")

_LEAN: Final[Mapping[str, Any]] = {
    "_nrt": False,
    "no_cfunc_wrapper": True,
    "fastmath": {"contract"},
}


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

    Counting them, an atomic operation for each slice, costs a small kernel more than its work. A
    product and a sum may become one instruction.
    """
    lean = numba.njit(cache=True, error_model="numpy", **_LEAN)
    return cast(Callable[P, T], lean(function))


def lean_helper(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function that allocates nothing and that only kernels call.

    No way in from Python is made, where it stays as it is written.
    """
    return register_jitable(error_model="numpy", **_LEAN)(function)


def inner(function: Callable[P, T]) -> Callable[P, T]:
    """Make such a function part of the machine code of the kernels that call it.

    That is for what is called often or from one place: it is compiled at every place anew.
    """
    return register_jitable(error_model="numpy", forceinline=True, **_LEAN)(function)
