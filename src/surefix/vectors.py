"""Vectors in the intermediate code of the compiler, from which `surefix.rows` is made.

Every function takes the builder of a block of code and values in it, and gives a value.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils

from surefix.types import FloatArray

__all__ = [
    "CONTRACT",
    "arctangent",
    "as_vector",
    "call_vector",
    "constant",
    "load",
    "spread_out",
    "store",
    "vector_of",
]

CONTRACT = ("contract",)
"""Leave to make one instruction of a product and a sum."""


def _by_chebyshev(degree: int) -> tuple[float, ...]:
    """Powers of z = t² that make ``atan(t)/t`` for t up to tan(π/8)."""
    reach = math.tan(math.pi / 8.0) ** 2

    def ratio(z: FloatArray) -> FloatArray:
        return np.arctan(np.sqrt(z)) / np.sqrt(z)

    found = np.polynomial.Chebyshev.interpolate(ratio, degree, domain=[0.0, reach])
    return tuple(found.convert(kind=np.polynomial.Polynomial).coef.tolist())


_ARCTANGENT = _by_chebyshev(11)


def arctangent(builder: Any, y: Any, x: Any) -> Any:
    """Angle of (x, y): atan of at most tan(π/8) by a polynomial, and what symmetry adds to it.

    ``atan(a) = π/4 + atan((a − 1)/(a + 1))`` brings a ratio of up to 1 to within ± tan(π/8).
    """
    kind = x.type
    zero, eighth = constant(kind, 0.0), constant(kind, math.tan(math.pi / 8.0))
    across, along = call_vector(builder, "fabs", x), call_vector(builder, "fabs", y)
    steep = builder.fcmp_ordered(">", along, across)
    low, high = builder.select(steep, across, along), builder.select(steep, along, across)
    wide = builder.fcmp_ordered(">", low, builder.fmul(eighth, high))
    above = builder.select(wide, builder.fsub(low, high), low)
    under = builder.select(wide, builder.fadd(low, high), high)
    nothing = builder.fcmp_ordered("==", under, zero)
    t = builder.fdiv(above, builder.select(nothing, constant(kind, 1.0), under))
    z = builder.fmul(t, t)
    angle = builder.fmul(t, _polynomial(builder, z, _ARCTANGENT))
    angle = builder.fadd(angle, builder.select(wide, constant(kind, 0.25 * math.pi), zero))
    angle = builder.select(steep, builder.fsub(constant(kind, 0.5 * math.pi), angle), angle)
    behind = builder.fcmp_ordered("<", x, zero)
    angle = builder.select(behind, builder.fsub(constant(kind, math.pi), angle), angle)
    return call_vector(builder, "copysign", angle, y)


def _polynomial(builder: Any, z: Any, coefficients: tuple[float, ...]) -> Any:
    """Sum of c_i zⁱ: in pairs, then pairs of pairs (Estrin), none of which waits for another."""
    terms = [constant(z.type, each) for each in coefficients]
    while len(terms) > 1:
        odd = [builder.fmul(each, z, flags=CONTRACT) for each in terms[1::2]]
        pairs = [
            builder.fadd(low, high, flags=CONTRACT)
            for low, high in zip(terms[::2], odd, strict=False)
        ]
        terms = pairs + terms[2 * len(odd) :]
        z = builder.fmul(z, z)
    return terms[0]


def call_vector(builder: Any, name: str, *args: Any) -> Any:
    """Call a function of vectors that the compiler knows."""
    kind = args[0].type
    whole = ir.FunctionType(kind, [kind] * len(args))
    known = cgutils.get_or_insert_function(builder.module, whole, f"llvm.{name}.v{kind.count}f64")
    return builder.call(known, args)


def constant(kind: Any, value: float) -> Any:
    """Vector of one known number everywhere."""
    return ir.Constant(kind, [value] * kind.count)


def spread_out(builder: Any, number: Any, kind: Any) -> Any:
    """Vector of one number everywhere."""
    undefined = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(undefined, number, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
    return builder.shuffle_vector(first, undefined, everywhere)


def vector_of(n: int) -> Any:
    """Type of a vector of n numbers."""
    return ir.VectorType(ir.DoubleType(), n)


def as_vector(builder: Any, row: Any, n: int) -> Any:
    """Take the place of a number for that of a vector that begins with it."""
    return builder.bitcast(row, vector_of(n).as_pointer())


def load(builder: Any, place: Any) -> Any:
    """Read a number or a vector, wherever it lies."""
    value = builder.load(place)
    value.align = 8
    return value


def store(builder: Any, value: Any, place: Any) -> None:
    """Write a number or a vector, wherever it goes."""
    builder.store(value, place).align = 8
