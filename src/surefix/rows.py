"""Rows of small matrices as vectors whose size the compiler knows, for kernels.

A *size* is ``(None,) * n`` or the whole number n. The length of a tuple is part of its type, so a
kernel that takes one is compiled for that n, once, when it is first called with it, and cached on
disk like any other: its rows live in vector registers and its scratch on the stack. With a plain
number the same source runs at any size on scratch from the heap, at a third of the speed.

Matrices are C-contiguous and exactly as wide as the size says; rows are ``A[i, :]``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable
from numba.np import arrayobj

from surefix.types import FloatArray
from surefix.vectors import (
    CONTRACT,
    arctangent,
    as_vector,
    call_vector,
    load,
    spread_out,
    store,
    vector_of,
)

__all__ = [
    "ONE",
    "Size",
    "add_product",
    "add_row",
    "angle_row",
    "clear_row",
    "copy_row",
    "dot_rows",
    "part",
    "root_row",
    "scratch",
    "size_of",
    "turn_row",
    "width",
]

Size: TypeAlias = tuple[None, ...] | int
"""A size known to the compiler, or a plain number."""

ONE: Size = (None,)
"""Size of a matrix of one row: a vector."""

_LARGEST = 18  # twice the largest state: a factor beside that of its noise


def size_of(n: int) -> Size:
    """Size to call a kernel with: a tuple for 1 … 18.

    >>> size_of(3), size_of(20)
    ((None, None, None), 20)
    """
    return (None,) * n if 1 <= n <= _LARGEST else n


def width(size: Size) -> int:
    """How many columns a size stands for; callable from kernels and from Python."""
    return size if isinstance(size, int) else len(size)


def scratch(rows: Size, columns: Size) -> FloatArray:
    """Matrix (rows, columns) of undefined content; on the stack where both sizes are tuples.

    To be called outside of loops, and not to be returned.
    """
    return np.empty((width(rows), width(columns)))


def part(A: FloatArray, start: int, rows: Size, columns: Size) -> FloatArray:
    """Matrix (rows, columns) that begins at number ``start`` of a C-contiguous array: a view.

    The array must outlive it, so it is not to be returned.
    """
    n, m = width(rows), width(columns)
    return A.reshape(-1)[start : start + n * m].reshape(n, m)


def add_row(A: FloatArray, i: int, factor: float, B: FloatArray, k: int, size: Size) -> None:
    """``A[i] += factor · B[k]``."""
    A[i] += factor * B[k]


def copy_row(A: FloatArray, i: int, B: FloatArray, k: int, size: Size) -> None:
    """``A[i] = B[k]``."""
    A[i] = B[k]


def clear_row(A: FloatArray, i: int, size: Size) -> None:
    """``A[i] = 0``."""
    A[i] = 0.0


def dot_rows(A: FloatArray, i: int, B: FloatArray, k: int, size: Size) -> float:
    """``A[i] · B[k]``; the order of the sum is the compiler's."""
    return float(A[i] @ B[k])


def add_product(
    A: FloatArray, i: int, B: FloatArray, j: int, C: FloatArray, k: int, size: Size
) -> None:
    """``A[i] += B[j] · C[k]``, number by number."""
    A[i] += B[j] * C[k]


def root_row(A: FloatArray, i: int, size: Size) -> None:
    """``A[i] = √A[i]``."""
    A[i] = np.sqrt(A[i])


def angle_row(
    A: FloatArray, i: int, Y: FloatArray, j: int, X: FloatArray, k: int, size: Size
) -> None:
    """``A[i] = atan2(Y[j], X[k])`` to two units of the last place; 0 where both are 0."""
    A[i] = np.arctan2(Y[j], X[k])


def turn_row(A: FloatArray, i: int, period: float, size: Size) -> None:
    """Bring ``A[i]`` to within half a period of 0."""
    A[i] -= period * np.rint(A[i] / period)


# What follows teaches the compiler these functions. They are built in, not overloaded, since an
# overload is a function of its own to compile for each kind of its arguments.

_MATRIX = types.Array(types.float64, 2, "C")


@type_callable(width)
def _type_width(_: Any) -> Any:
    return lambda size: types.intp


@type_callable(scratch)
def _type_scratch(_: Any) -> Any:
    return lambda rows, columns: _MATRIX


@type_callable(part)
def _type_part(_: Any) -> Any:
    return lambda A, start, rows, columns: _MATRIX


@type_callable(add_row)
def _type_add_row(_: Any) -> Any:
    return lambda A, i, factor, B, k, size: types.void


@type_callable(copy_row)
def _type_copy_row(_: Any) -> Any:
    return lambda A, i, B, k, size: types.void


@type_callable(clear_row)
def _type_clear_row(_: Any) -> Any:
    return lambda A, i, size: types.void


@type_callable(dot_rows)
def _type_dot_rows(_: Any) -> Any:
    return lambda A, i, B, k, size: types.float64


@type_callable(add_product)
def _type_add_product(_: Any) -> Any:
    return lambda A, i, B, j, C, k, size: types.void


@type_callable(root_row)
def _type_root_row(_: Any) -> Any:
    return lambda A, i, size: types.void


@type_callable(angle_row)
def _type_angle_row(_: Any) -> Any:
    return lambda A, i, Y, j, X, k, size: types.void


@type_callable(turn_row)
def _type_turn_row(_: Any) -> Any:
    return lambda A, i, period, size: types.void


@lower_builtin(width, types.BaseTuple)
@lower_builtin(width, types.Integer)
def _width(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    return _number(context, builder, signature.args[0], args[0])


@lower_builtin(part, *([types.Any] * 4))
def _part(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    a, start, rows, columns = signature.args
    data = arrayobj.make_array(a)(context, builder, args[0]).data
    at = builder.gep(data, [context.cast(builder, args[1], start, types.intp)])
    n, m = (_number(context, builder, *each) for each in ((rows, args[2]), (columns, args[3])))
    return _borrowed(context, builder, at, n, m)


@lower_builtin(scratch, types.BaseTuple, types.BaseTuple)
def _scratch_on_stack(context: Any, builder: Any, signature: Any, _args: Any) -> Any:
    n, m = (len(each) for each in signature.args)
    data = cgutils.alloca_once(builder, ir.DoubleType(), size=n * m)
    data.align = 64
    number = context.get_constant
    return _borrowed(context, builder, data, number(types.intp, n), number(types.intp, m))


def _borrowed(context: Any, builder: Any, data: Any, n: Any, m: Any) -> Any:
    """Array (n, m) of numbers that somebody else owns."""
    array = arrayobj.make_array(_MATRIX)(context, builder)
    item = context.get_constant(types.intp, 8)
    arrayobj.populate_array(
        array,
        data=data,
        shape=cgutils.pack_array(builder, [n, m]),
        strides=cgutils.pack_array(builder, [builder.mul(m, item), item]),
        itemsize=item,
        meminfo=None,
    )
    return array._getvalue()


@lower_builtin(scratch, types.Any, types.Any)
def _scratch_on_heap(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    size = [_number(context, builder, *each) for each in zip(signature.args, args, strict=True)]
    plain = _MATRIX(types.intp, types.intp)
    return context.compile_internal(
        builder, lambda rows, columns: np.empty((rows, columns)), plain, size
    )


@lower_builtin(add_row, *([types.Any] * 6))
def _add_row(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    a, i, factor, b, k, size = signature.args
    target = _start(context, builder, a, args[0], i, args[1], size, args[5])
    source = _start(context, builder, b, args[3], k, args[4], size, args[5])
    number = context.cast(builder, args[2], factor, types.float64)

    def add(at: Any, of: Any, times: Any) -> None:
        product = builder.fmul(times, load(builder, of), flags=CONTRACT)
        store(builder, builder.fadd(load(builder, at), product, flags=CONTRACT), at)

    if isinstance(size, types.BaseTuple):
        n = len(size)
        spread = spread_out(builder, number, vector_of(n))
        add(as_vector(builder, target, n), as_vector(builder, source, n), spread)
    else:
        with _columns(context, builder, size, args[5]) as j:
            add(builder.gep(target, [j]), builder.gep(source, [j]), number)
    return context.get_dummy_value()


@lower_builtin(copy_row, *([types.Any] * 5))
def _copy_row(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    a, i, b, k, size = signature.args
    target = _start(context, builder, a, args[0], i, args[1], size, args[4])
    source = _start(context, builder, b, args[2], k, args[3], size, args[4])
    if isinstance(size, types.BaseTuple):
        n = len(size)
        value = load(builder, as_vector(builder, source, n))
        store(builder, value, as_vector(builder, target, n))
    else:
        with _columns(context, builder, size, args[4]) as j:
            store(builder, load(builder, builder.gep(source, [j])), builder.gep(target, [j]))
    return context.get_dummy_value()


@lower_builtin(clear_row, *([types.Any] * 3))
def _clear_row(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    a, i, size = signature.args
    target = _start(context, builder, a, args[0], i, args[1], size, args[2])
    if isinstance(size, types.BaseTuple):
        n = len(size)
        store(builder, ir.Constant(vector_of(n), [0.0] * n), as_vector(builder, target, n))
    else:
        with _columns(context, builder, size, args[2]) as j:
            store(builder, ir.Constant(ir.DoubleType(), 0.0), builder.gep(target, [j]))
    return context.get_dummy_value()


@lower_builtin(dot_rows, *([types.Any] * 5))
def _dot_rows(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    a, i, b, k, size = signature.args
    one = _start(context, builder, a, args[0], i, args[1], size, args[4])
    other = _start(context, builder, b, args[2], k, args[3], size, args[4])
    zero = ir.Constant(ir.DoubleType(), -0.0)  # adds nothing at all
    if isinstance(size, types.BaseTuple):
        n = len(size)
        x, y = (load(builder, as_vector(builder, each, n)) for each in (one, other))
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType(), vector_of(n)])
        name = f"llvm.vector.reduce.fadd.v{n}f64"
        add = cgutils.get_or_insert_function(builder.module, kind, name)
        return builder.call(add, [zero, builder.fmul(x, y)], fastmath=("reassoc",))
    total = cgutils.alloca_once_value(builder, zero)
    with _columns(context, builder, size, args[4]) as j:
        x, y = (load(builder, builder.gep(each, [j])) for each in (one, other))
        product = builder.fmul(x, y, flags=CONTRACT)
        builder.store(builder.fadd(builder.load(total), product, flags=CONTRACT), total)
    return builder.load(total)


@lower_builtin(add_product, *([types.Any] * 7))
def _add_product(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    def add(a: Any, b: Any, c: Any) -> Any:
        return builder.fadd(a, builder.fmul(b, c, flags=CONTRACT), flags=CONTRACT)

    return _each(context, builder, signature.args, args, add)


@lower_builtin(root_row, *([types.Any] * 3))
def _root_row(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    def root(a: Any) -> Any:
        return call_vector(builder, "sqrt", a)

    return _each(context, builder, signature.args, args, root)


@lower_builtin(turn_row, *([types.Any] * 4))
def _turn_row(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    kinds, given = signature.args, args
    period = context.cast(builder, given[2], kinds[2], types.float64)
    one = ir.Constant(ir.DoubleType(), 1.0)

    def turn(a: Any) -> Any:
        P = spread_out(builder, period, a.type)
        turns = builder.fmul(a, spread_out(builder, builder.fdiv(one, period), a.type))
        return builder.fsub(a, builder.fmul(P, call_vector(builder, "rint", turns)))

    kept = (0, 1, 3)
    return _each(context, builder, [kinds[i] for i in kept], [given[i] for i in kept], turn)


@lower_builtin(angle_row, *([types.Any] * 7))
def _angle_row(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    def angle(_a: Any, y: Any, x: Any) -> Any:
        return arctangent(builder, y, x)

    return _each(context, builder, signature.args, args, angle)


def _each(context: Any, builder: Any, kinds: Any, args: Any, function: Any) -> Any:
    """Put a function of rows, given as (matrix, row) in turn, into the first of them."""
    size, n = kinds[-1], args[-1]
    places = [
        _start(context, builder, kinds[i], args[i], kinds[i + 1], args[i + 1], size, n)
        for i in range(0, len(kinds) - 1, 2)
    ]
    if isinstance(size, types.BaseTuple):
        rows = [as_vector(builder, each, len(size)) for each in places]
        store(builder, function(*(load(builder, each) for each in rows)), rows[0])
    else:
        with _columns(context, builder, size, n) as j:
            rows = [as_vector(builder, builder.gep(each, [j]), 1) for each in places]
            store(builder, function(*(load(builder, each) for each in rows)), rows[0])
    return context.get_dummy_value()


def _number(context: Any, builder: Any, kind: Any, size: Any) -> Any:
    """What `width` gives."""
    if isinstance(kind, types.BaseTuple):
        return context.get_constant(types.intp, len(kind))
    return context.cast(builder, size, kind, types.intp)


def _start(
    context: Any, builder: Any, kind: Any, matrix: Any, index: Any, row: Any, size: Any, n: Any
) -> Any:
    """Pointer to the first number of a row."""
    data = arrayobj.make_array(kind)(context, builder, matrix).data
    columns = _number(context, builder, size, n)
    at = builder.mul(context.cast(builder, row, index, types.intp), columns)
    return builder.gep(data, [at])


@contextmanager
def _columns(context: Any, builder: Any, kind: Any, size: Any) -> Iterator[Any]:
    """Loop over the columns where their number is not known; gives the index."""
    with cgutils.for_range(builder, _number(context, builder, kind, size)) as loop:
        yield loop.index
