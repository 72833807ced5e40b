"""Kernels on one axis against matrices, the diffuse limit, and densities that integrate to one."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from surefix.filters.hypothesis_axis import commit, forget, open_run, predict_axis, update_axis
from surefix.filters.hypothesis_density import log_normal, log_wild, wrapped
from surefix.models.motion import noise_factor, transition

ORDERS = [2, 3]
NAMES = {2: "cv", 3: "ca"}


def drawn(seed, order):
    """Mean and covariance of [p, v, (a), b]."""
    rng = np.random.default_rng(seed)
    n = order + 1
    A = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-1, 1, n)[:, None]
    return rng.normal(size=n) * 5.0, A @ A.T


def row(n, c, shifted):
    h = np.zeros(n)
    h[c] = 1.0
    h[-1] = 1.0 if shifted else h[-1]
    return h


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("dt", [1e-3, 0.7, 60.0])
def test_prediction(order, dt):
    for seed in range(5):
        m, P = drawn(seed, order)
        F, Q = np.eye(order + 1), np.zeros((order + 1, order + 1))
        F[:order, :order] = transition(NAMES[order], 1, dt)
        G = noise_factor(NAMES[order], 1, dt, 0.3)
        Q[:order, :order] = G @ G.T
        mean, covariance = F @ m, F @ P @ F.T + Q
        predict_axis(m, P, order, dt, 0.3)
        np.testing.assert_allclose(m, mean, rtol=1e-12)
        np.testing.assert_allclose(P, covariance, rtol=1e-12, atol=1e-12 * P.max())
        np.testing.assert_array_equal(P, P.T)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("c", "shifted"), [(0, False), (0, True), (1, False)])
def test_update(order, c, shifted):
    for seed in range(5):
        m, P = drawn(seed, order)
        h, r, nu = row(order + 1, c, shifted), 0.4, 3.0
        S = h @ P @ h + r
        K = P @ h / S
        rest = np.eye(order + 1) - np.outer(K, h)
        mean, covariance = m + K * nu, rest @ P @ rest.T + r * np.outer(K, K)
        update_axis(m, P, order + 1, c, shifted, nu, r)
        np.testing.assert_allclose(m, mean, rtol=1e-10)
        np.testing.assert_allclose(P, covariance, rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(P, P.T)


@pytest.mark.parametrize("order", ORDERS)
def test_nothing_follows_from_an_observation_without_variance(order):
    """Of a component that is known exactly: no division by nought."""
    m, P = np.ones(order + 1), np.zeros((order + 1, order + 1))
    update_axis(m, P, order + 1, 0, False, 5.0, 0.0)
    assert (m == 1.0).all()
    assert not P.any()


@pytest.mark.parametrize("order", ORDERS)
def test_a_run_begins_as_in_the_diffuse_limit(order):
    """The update of an offset of variance B, as B grows: within 1/B of the limit."""
    for seed in range(5):
        m, P = drawn(seed, order)
        forget(m, P, order + 1)
        far = 1e9
        wide = P.copy()
        wide[-1, -1] = far
        h, r, nu = row(order + 1, 0, True), 0.4, 30.0
        K = wide @ h / (h @ wide @ h + r)
        rest = np.eye(order + 1) - np.outer(K, h)
        mean, covariance = m + K * nu, rest @ wide @ rest.T + r * np.outer(K, K)
        open_run(m, P, order + 1, nu, r)
        np.testing.assert_allclose(m, mean, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(P, covariance, rtol=1e-4, atol=1e-4)
        assert np.linalg.eigvalsh(P).min() > -1e-9


@pytest.mark.parametrize("order", ORDERS)
def test_a_run_that_ends_leaves_the_track_as_it_is(order):
    m, P = drawn(1, order)
    before = m[:order].copy(), P[:order, :order].copy()
    forget(m, P, order + 1)
    np.testing.assert_array_equal(m[:order], before[0])
    np.testing.assert_array_equal(P[:order, :order], before[1])
    assert m[-1] == 0.0
    assert not P[-1].any()
    assert not P[:, -1].any()


@pytest.mark.parametrize("order", ORDERS)
def test_a_jump_adds_the_offset(order):
    for seed in range(5):
        m, P = drawn(seed, order)
        T = np.eye(order + 1)
        T[0, -1], T[-1, -1] = 1.0, 0.0
        mean, covariance = T @ m, T @ P @ T.T
        commit(m, P, order + 1)
        np.testing.assert_allclose(m, mean, rtol=1e-13)
        np.testing.assert_allclose(P, covariance, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_a_run_that_was_a_jump_is_a_track_that_began_with_it(order):
    """Open, go on, commit: the position knows the fixes of the run alone, the rates know all."""
    rng = np.random.default_rng(4)
    m, P = drawn(2, order)
    forget(m, P, order + 1)
    known, rates = m.copy(), P.copy()
    rates[0], rates[:, 0] = 0.0, 0.0
    rates[0, 0] = 1e10
    fixes = 500.0 + rng.normal(size=4)
    open_run(m, P, order + 1, fixes[0] - m[0], 1.0)
    update_axis(known, rates, order + 1, 0, False, fixes[0] - known[0], 1.0)
    for z in fixes[1:]:
        predict_axis(m, P, order, 0.5, 0.2)
        predict_axis(known, rates, order, 0.5, 0.2)
        update_axis(m, P, order + 1, 0, True, z - m[0] - m[-1], 1.0)
        update_axis(known, rates, order + 1, 0, False, z - known[0], 1.0)
    commit(m, P, order + 1)
    np.testing.assert_allclose(m[:order], known[:order], rtol=1e-5)
    np.testing.assert_allclose(P[:order, :order], rates[:order, :order], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_density_of_gross_errors_integrates_to_one(count):
    """In spherical shells of the standardised error."""
    shell = {1: lambda r: 2.0, 2: lambda r: 2.0 * np.pi * r, 3: lambda r: 4.0 * np.pi * r * r}
    scales = np.array([0.5, 3.0, 20.0])[:count]

    def mass(r):
        return shell[count](r) * np.prod(scales) * math.exp(log_wild(r * r, logs, count))

    logs = float(np.log(scales).sum())
    total = integrate.quad(mass, 0.0, np.inf)[0]
    assert total == pytest.approx(1.0, rel=1e-6)


def test_the_density_of_gross_errors_is_students():
    rng = np.random.default_rng(0)
    for count in (1, 2, 3):
        scales = rng.uniform(0.1, 10.0, count)
        law = stats.multivariate_t(shape=np.diag(scales**2), df=1)
        for _ in range(5):
            x = rng.standard_cauchy(count) * scales
            found = log_wild(float(((x / scales) ** 2).sum()), float(np.log(scales).sum()), count)
            assert found == pytest.approx(law.logpdf(x), rel=1e-10)
    assert np.isfinite(log_wild(1e18, 0.0, 3))


def test_log_normal():
    for nu, S in [(0.0, 1.0), (3.0, 0.2), (-1e6, 1e4)]:
        assert log_normal(nu, S) == pytest.approx(stats.norm.logpdf(nu, scale=math.sqrt(S)))


def test_angles_differ_by_half_a_turn_at_most():
    assert wrapped(350.0, 360.0) == -10.0
    assert wrapped(-725.0, 360.0) == -5.0
    assert wrapped(350.0, 0.0) == 350.0
