"""Square-root linear algebra on small matrices, for kernels.

A covariance ``P`` is carried as a factor ``S`` with ``P = S Sᵀ``, so it cannot lose its positive
semi-definiteness whatever the ratio of its eigenvalues. All functions work in place on arrays that
the caller owns.
"""

from __future__ import annotations

import math

from surefix.jit import helper, inlined
from surefix.rows import Size, add_row, copy_row, dot_rows, width
from surefix.types import FloatArray

__all__ = [
    "absorb",
    "cholesky",
    "multiply",
    "multiply_transpose",
    "solve_lower",
    "triangularize",
    "triangularize_rows",
]


@helper
def triangularize(A: FloatArray, rows: int, columns: int) -> None:
    """Turn ``A`` into ``[L 0]`` with ``L Lᵀ = A Aᵀ`` by Householder reflections from the right.

    Parameters
    ----------
    A
        (≥ rows, ≥ columns), columns ≥ rows; overwritten: L, (rows, rows) lower triangular, then 0.
    rows, columns
        The part of ``A`` that counts.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., 5.2.2, transposed.
    """
    for i in range(rows):
        norm2 = 0.0
        for k in range(i + 1, columns):
            norm2 += A[i, k] * A[i, k]
        if norm2 == 0.0:
            continue
        head = A[i, i]
        norm = math.sqrt(head * head + norm2)
        pivot = head + norm if head > 0.0 else head - norm
        beta = 2.0 / (pivot * pivot + norm2)
        for j in range(i + 1, rows):
            dot = A[j, i] * pivot
            for k in range(i + 1, columns):
                dot += A[j, k] * A[i, k]
            dot *= beta
            A[j, i] -= dot * pivot
            for k in range(i + 1, columns):
                A[j, k] -= dot * A[i, k]
        A[i, i] = -norm if head > 0.0 else norm
        for k in range(i + 1, columns):
            A[i, k] = 0.0


@inlined
def triangularize_rows(A: FloatArray, v: FloatArray, size: Size) -> None:
    """Do the same to a square matrix of a size that the compiler may know, row by row.

    Parameters
    ----------
    A
        (n, n), C-contiguous; overwritten.
    v
        (1, n) scratch.
    size
        Size n, see `surefix.rows`.
    """
    n = width(size)
    for i in range(n - 1):
        head = A[i, i]
        copy_row(v, 0, A, i, size)
        for k in range(i + 1):
            v[0, k] = 0.0
        norm2 = dot_rows(v, 0, v, 0, size)
        if norm2 == 0.0:
            continue
        norm = math.sqrt(head * head + norm2)
        pivot = head + norm if head > 0.0 else head - norm
        v[0, i] = pivot
        beta = 2.0 / (pivot * pivot + norm2)
        for j in range(i + 1, n):
            add_row(A, j, -beta * dot_rows(A, j, v, 0, size), v, 0, size)
        A[i, i] = -norm if head > 0.0 else norm
        for k in range(i + 1, n):
            A[i, k] = 0.0


@helper
def absorb(
    x: FloatArray,
    S: FloatArray,
    phi: FloatArray,
    gain: FloatArray,
    residual: float,
    variance: float,
) -> None:
    """Update mean and factor with one scalar observation (Potter's algorithm).

    ``K = S φ / (φᵀφ + r)``, ``x += K ν``, ``S -= K φᵀ / (1 + √(r / (φᵀφ + r)))`` with ``φ = Sᵀ h``.

    Parameters
    ----------
    x, S
        (n,) mean and (n, n) factor; overwritten.
    phi
        (n,) ``Sᵀ h``, the observation row seen through the factor.
    gain
        (n,) scratch.
    residual, variance
        Innovation ν and observation variance r ≥ 0 of the scalar.

    Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, II.4.
    """
    n = x.shape[0]
    total = variance
    for i in range(n):
        total += phi[i] * phi[i]
    if total <= 0.0:
        return
    shrink = 1.0 / (1.0 + math.sqrt(variance / total))
    for i in range(n):
        k = 0.0
        for j in range(n):
            k += S[i, j] * phi[j]
        gain[i] = k / total
        x[i] += gain[i] * residual
    for i in range(n):
        for j in range(n):
            S[i, j] -= shrink * gain[i] * phi[j]


@helper
def multiply(A: FloatArray, B: FloatArray, C: FloatArray) -> None:
    """Write ``C = A B``; of small matrices that is sooner done than a BLAS is called."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            total = 0.0
            for k in range(B.shape[0]):
                total += A[i, k] * B[k, j]
            C[i, j] = total


@helper
def multiply_transpose(S: FloatArray, P: FloatArray, rows: int, columns: int) -> None:
    """Write ``P = S Sᵀ`` for the first ``rows`` rows of S, over its first ``columns`` columns."""
    for i in range(rows):
        for j in range(i + 1):
            total = 0.0
            for k in range(columns):
                total += S[i, k] * S[j, k]
            P[i, j] = total
            P[j, i] = total


@helper
def cholesky(A: FloatArray, n: int) -> bool:
    """Overwrite the lower triangle of ``A`` with its Cholesky factor; False if not positive."""
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                A[i, i] = math.sqrt(total)
            else:
                A[i, j] = total / A[j, j]
    return True


@helper
def solve_lower(L: FloatArray, b: FloatArray, n: int) -> None:
    """Overwrite ``b`` with ``L⁻¹ b``; a zero pivot gives a zero component."""
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * b[k]
        b[i] = total / L[i, i] if L[i, i] != 0.0 else 0.0
