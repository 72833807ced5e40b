"""Rows do the same whether the compiler knows their size or not, and as NumPy has it."""

import numpy as np
import pytest

from surefix import rows
from surefix.jit import kernel
from surefix.linalg import triangularize_rows
from surefix.rows import (
    ONE,
    add_product,
    add_row,
    angle_row,
    clear_row,
    copy_row,
    dot_rows,
    part,
    root_row,
    scratch,
    size_of,
    turn_row,
    width,
)


@kernel
def everything(A, B, out, size):
    """Each function once; row by row into ``out`` (8, n)."""
    n = width(size)
    work = scratch(size, size)
    for i in range(n):
        copy_row(work, i, A, i, size)
    add_row(out, 0, 2.5, work, n - 1, size)
    copy_row(out, 1, work, 0, size)
    clear_row(out, 2, size)
    add_product(out, 3, A, 0, B, 0, size)
    add_product(out, 4, A, 0, A, 0, size)
    root_row(out, 4, size)
    angle_row(out, 5, A, 0, B, 0, size)
    copy_row(out, 6, A, 0, size)
    turn_row(out, 6, 0.5, size)
    inner = part(A, n, ONE, size)
    for j in range(n):
        out[7, j] = inner[0, j] + dot_rows(A, 0, B, 0, size)


@kernel
def reduced(A, size):
    v = scratch(ONE, size)
    triangularize_rows(A, v, size)


def plain(A, B):
    n = len(A)
    away = A[0] - 0.5 * np.rint(A[0] / 0.5)
    return np.stack(
        [
            1.0 + 2.5 * A[n - 1],
            A[0],
            np.zeros(n),
            1.0 + A[0] * B[0],
            np.sqrt(1.0 + A[0] ** 2),
            np.arctan2(A[0], B[0]),
            away,
            A[1 % n] + A[0] @ B[0],
        ]
    )


@pytest.mark.parametrize("size", [size_of(1), size_of(5), size_of(6), 5, 20])
def test_every_function_is_numpys(size):
    n = width(size)
    rng = np.random.default_rng(n)
    A, B = rng.standard_normal((n + 1, n)), rng.standard_normal((n + 1, n))
    out, by_hand = np.ones((8, n)), np.ones((8, n))
    everything(A, B, out, size)
    expected = plain(A[:n], B)
    expected[7] = A[1] + A[0] @ B[0]
    np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-14)
    getattr(everything, "py_func", everything)(A, B, by_hand, size)
    np.testing.assert_allclose(by_hand, expected, rtol=1e-14, atol=1e-14)


def test_angles_all_round_and_at_all_scales():
    rng = np.random.default_rng(3)
    edge = [0.0, -0.0, 1.0, -1.0, 1e-300, -1e300]
    x, y = (np.array(each).ravel() for each in np.meshgrid(edge, edge))
    scale = 10.0 ** rng.integers(-12, 12, 20_000)
    X = np.concatenate((x, rng.standard_normal(20_000) * scale)).reshape(-1, 1)
    Y = np.concatenate((y, rng.standard_normal(20_000))).reshape(-1, 1)
    found = np.empty_like(X)
    angles(Y, X, found, size_of(1))
    both = (X != 0.0) | (Y != 0.0)
    np.testing.assert_allclose(found[both], np.arctan2(Y, X)[both], rtol=5e-15)
    assert (found[~both] == 0.0).any()


@kernel
def angles(Y, X, out, size):
    for i in range(Y.shape[0]):
        angle_row(out, i, Y, i, X, i, size)


@pytest.mark.parametrize("size", [size_of(4), size_of(12), 7])
def test_triangularised_by_rows_is_a_factor_of_the_same(size):
    n = width(size)
    A = np.random.default_rng(n).standard_normal((n, n))
    A[1] = 0.0
    A[2] = A[0] * [1.0] * n
    L = A.copy()
    reduced(L, size)
    assert (np.triu(L, 1) == 0.0).all()
    np.testing.assert_allclose(L @ L.T, A @ A.T, atol=1e-13)


def test_large_sizes_are_plain_numbers():
    assert size_of(0) == 0
    assert size_of(rows.width(size_of(18)) + 1) == 19
