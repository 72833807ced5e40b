"""The small kernels against NumPy, at random and at the edges."""

import numpy as np
import pytest

from surefix.linalg import (
    absorb,
    cholesky,
    multiply,
    multiply_transpose,
    solve_lower,
    triangularize,
)

SIZES = [1, 2, 3, 6, 9]


def spd(rng, n, decades=0.0):
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return (Q * 10.0 ** rng.uniform(-decades, 0.0, n)) @ Q.T


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("extra", [0, 1, 6])
def test_triangularize_keeps_the_product(n, extra):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        A = rng.normal(size=(n, n + extra)) * 10.0 ** rng.uniform(-8, 8, (n, 1))
        L = A.copy()
        triangularize(L, n, n + extra)
        assert (np.triu(L, 1) == 0.0).all()
        scale = np.linalg.norm(A, axis=1)
        close = np.abs(L @ L.T - A @ A.T) / np.outer(scale, scale)
        assert close.max() < 1e-14 * (n + extra)


def test_triangularize_leaves_the_rest_alone_and_bears_noughts():
    A = np.arange(30.0).reshape(5, 6)
    before = A.copy()
    triangularize(A, 3, 4)
    np.testing.assert_array_equal(A[3:], before[3:])
    np.testing.assert_array_equal(A[:, 4:], before[:, 4:])
    zero = np.zeros((3, 6))
    triangularize(zero, 3, 6)
    assert (zero == 0.0).all()
    rank_one = np.outer([1.0, 2.0, 3.0], [1.0, 1.0, 0.0, 0.0])
    product = rank_one @ rank_one.T
    triangularize(rank_one, 3, 4)
    np.testing.assert_allclose(rank_one @ rank_one.T, product, atol=1e-13)


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("variance", [1e-12, 0.3, 1e12])
def test_absorb_is_the_update_of_the_textbook(n, variance):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        S, x, h = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
        P, residual = S @ S.T, 1.7
        total = h @ P @ h + variance
        gain = P @ h / total
        mean, spread = x + gain * residual, P - np.outer(gain, gain) * total
        absorb(x, S, S.T @ h, np.empty(n), residual, variance)
        np.testing.assert_allclose(x, mean, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(S @ S.T, spread, rtol=1e-6, atol=1e-9 * np.trace(P))


def test_absorb_knows_what_is_certain():
    x, S = np.array([1.0, 2.0]), np.diag([3.0, 1.0])
    absorb(x, S, S[0].copy(), np.empty(2), 4.0, 0.0)
    np.testing.assert_allclose(x, [5.0, 2.0])
    np.testing.assert_allclose(S @ S.T, np.diag([0.0, 1.0]), atol=1e-15)
    absorb(x, S, S[0].copy(), np.empty(2), 9.0, 0.0)  # nought over nought: nothing to learn
    np.testing.assert_allclose(x, [5.0, 2.0])


def test_absorb_is_exact_to_half_the_digits_at_a_ratio_of_1e16():
    x, S = np.zeros(1), np.array([[1e8]])
    absorb(x, S, S[0].copy(), np.empty(1), 1.0, 1.0)
    assert S[0, 0] ** 2 == pytest.approx(1.0, rel=1e-7)
    assert x[0] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("n", SIZES)
def test_cholesky_and_solve_lower(n):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        A = spd(rng, n, 6.0)
        L, b = A.copy(), rng.normal(size=n)
        assert cholesky(L, n)
        np.testing.assert_allclose(np.tril(L), np.linalg.cholesky(A), rtol=1e-6, atol=1e-12)
        x = b.copy()
        solve_lower(L, x, n)
        np.testing.assert_allclose(np.tril(L) @ x, b, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "A", [[[0.0]], [[-1.0]], [[np.nan]], [[1.0, 2.0], [2.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]]
)
def test_cholesky_says_what_is_not_positive(A):
    assert not cholesky(np.array(A), len(A))


def test_cholesky_works_on_a_part():
    A = np.diag([4.0, 9.0, -1.0])
    assert cholesky(A, 2)
    assert (A[0, 0], A[1, 1], A[2, 2]) == (2.0, 3.0, -1.0)


def test_solve_lower_gives_nought_for_a_nought_pivot():
    b = np.array([3.0, 5.0])
    solve_lower(np.array([[0.0, 0.0], [1.0, 2.0]]), b, 2)
    assert b.tolist() == [0.0, 2.5]


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 4), (4, 6), (6, 6)])
def test_multiply_transpose(rows, columns):
    S = np.random.default_rng(0).normal(size=(6, 6))
    P = np.zeros((6, 6))
    multiply_transpose(S, P, rows, columns)
    part = S[:rows, :columns]
    np.testing.assert_allclose(P[:rows, :rows], part @ part.T, rtol=1e-13, atol=1e-15)
    assert (P[rows:] == 0.0).all()
    assert (P == P.T).all()


@pytest.mark.parametrize(("m", "k", "n"), [(1, 1, 1), (2, 6, 3), (6, 6, 6), (3, 0, 2)])
def test_a_product_of_matrices(m, k, n):
    rng = np.random.default_rng(m + n)
    A, B, C = rng.normal(size=(m, k)), rng.normal(size=(k, n)), np.full((m, n), np.nan)
    multiply(A, B, C)
    np.testing.assert_allclose(C, A @ B, atol=1e-14)
