"""Covariance intersection: the optimum, its bound for any correlation, edges."""

import numpy as np
import pytest
from scipy.optimize import minimize

from surefix.errors import OptionsError
from surefix.fusion.covariance_intersection import covariance_intersection

MEASURES = {
    "trace": lambda P: np.log(np.trace(P)),
    "determinant": lambda P: np.linalg.slogdet(P)[1],
}


def sources(seed, N, n, spread=1.0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(N, n, n + 1)) * np.exp(spread * rng.normal(size=(N, n, 1)))
    return rng.normal(size=(N, n)), A @ A.swapaxes(-1, -2)


def fused_by(omega, P):
    return np.linalg.inv(np.einsum("i,iab->ab", omega, np.linalg.inv(P)))


@pytest.mark.parametrize("criterion", MEASURES)
@pytest.mark.parametrize(("N", "n"), [(2, 1), (2, 3), (3, 2), (4, 3), (6, 4)])
def test_no_other_weights_are_better(criterion, N, n):
    measure = MEASURES[criterion]
    for seed in range(4):
        means, P = sources(seed, N, n)
        fused, omega = covariance_intersection(means, P, criterion)
        assert omega.min() >= 0.0
        assert omega.sum() == pytest.approx(1.0)
        assert fused.covariance == pytest.approx(fused_by(omega, P), rel=1e-9)

        def cost(u, P=P):
            share = np.exp(u - u.max())
            return measure(fused_by(share / share.sum(), P))

        best = minimize(
            cost, np.zeros(N), method="Nelder-Mead", tol=1e-12, options={"maxiter": 4000}
        )
        assert measure(fused.covariance) <= best.fun + 1e-9


@pytest.mark.parametrize("criterion", MEASURES)
def test_two_sources_against_a_grid(criterion):
    means, P = sources(11, 2, 2)
    grid = np.linspace(0.0, 1.0, 20001)
    values = [MEASURES[criterion](fused_by(np.array([w, 1.0 - w]), P)) for w in grid]
    _, omega = covariance_intersection(means, P, criterion)
    assert omega[0] == pytest.approx(grid[np.argmin(values)], abs=2e-4)


def test_mean_is_that_of_the_information_form():
    means, P = sources(1, 3, 3)
    fused, omega = covariance_intersection(means, P)
    vector = sum(
        w * np.linalg.solve(one, mean) for w, one, mean in zip(omega, P, means, strict=True)
    )
    assert fused.mean == pytest.approx(fused.covariance @ vector)


@pytest.mark.parametrize("seed", range(8))
def test_bound_holds_for_any_cross_covariance(seed):
    """The true covariance of the fused error never exceeds what is claimed."""
    rng = np.random.default_rng(seed)
    means, P = sources(seed, 2, 3)
    fused, omega = covariance_intersection(means, P, "determinant")
    gains = [w * fused.covariance @ np.linalg.inv(one) for w, one in zip(omega, P, strict=True)]
    roots = [np.linalg.cholesky(one) for one in P]
    for size in (-1.0, -0.5, 0.0, 0.7, 1.0):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        cross = size * roots[0] @ turn @ roots[1].T
        both = gains[0] @ cross @ gains[1].T
        true = sum(g @ one @ g.T for g, one in zip(gains, P, strict=True)) + both + both.T
        assert np.linalg.eigvalsh(fused.covariance - true).min() > -1e-9 * np.trace(true)


def test_a_source_that_is_better_in_every_direction_is_taken_alone():
    P = np.array([np.eye(3), 1.05 * np.eye(3), 4.0 * np.eye(3)])
    for criterion in MEASURES:
        fused, omega = covariance_intersection(np.arange(9.0).reshape(3, 3), P, criterion)
        assert omega == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
        assert fused.mean == pytest.approx([0.0, 1.0, 2.0], abs=1e-5)


def test_equal_sources_stay_what_they_are():
    means, P = np.ones((4, 2)), np.broadcast_to([[2.0, 0.5], [0.5, 1.0]], (4, 2, 2))
    fused, _ = covariance_intersection(means, P)
    assert fused.mean == pytest.approx([1.0, 1.0])
    assert fused.covariance == pytest.approx(P[0])


@pytest.mark.parametrize("criterion", MEASURES)
def test_unit_and_stack_change_nothing(criterion):
    pairs = [sources(seed, 3, 2) for seed in range(6)]
    means, P = (np.stack(column) for column in zip(*pairs, strict=True))
    together, omega = covariance_intersection(means, P, criterion)
    for k, (mean, one) in enumerate(pairs):
        alone, weight = covariance_intersection(1e4 * mean, 1e8 * one, criterion)
        assert omega[k] == pytest.approx(weight, abs=1e-5)
        assert together.covariance[k] == pytest.approx(1e-8 * alone.covariance, rel=1e-5)


def test_missing_sources_are_left_out():
    means, P = sources(3, 3, 2)
    gone = means.copy()
    gone[0] = np.nan
    fused, omega = covariance_intersection(gone, P)
    expected, rest = covariance_intersection(means[1:], P[1:])
    assert omega[0] == 0.0
    assert omega[1:] == pytest.approx(rest, abs=1e-6)
    assert fused.mean == pytest.approx(expected.mean, abs=1e-5)
    none, weights = covariance_intersection(np.full((3, 2), np.nan), P)
    assert np.isnan(none.mean).all()
    assert np.isnan(none.covariance).all()
    assert np.isnan(weights).all()


def test_unknown_criterion_is_refused():
    with pytest.raises(OptionsError, match="trace or determinant"):
        covariance_intersection(np.zeros((2, 1)), np.ones((2, 1, 1)), "volume")
