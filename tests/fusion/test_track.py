"""Track fusion: generalised least squares as judge, cross-covariances from first principles."""

import numpy as np
import pytest

from reference import track_fusion as textbook
from surefix.fusion.track import (
    bar_shalom_campo,
    inverse_covariance,
    joint_predict,
    joint_update,
)
from surefix.metrics import mean_bounds, normalised_squares


def random_joint(seed, N, n):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(N * n, N * n + 3))
    joint = (A @ A.T).reshape(N, n, N, n).swapaxes(1, 2)
    return rng.normal(size=(N, n)), np.array([joint[i, i] for i in range(N)]), joint


@pytest.mark.parametrize(("N", "n"), [(1, 2), (2, 1), (2, 3), (3, 3), (5, 2)])
@pytest.mark.parametrize("seed", range(4))
def test_best_linear_combination(seed, N, n):
    means, P, joint = random_joint(seed, N, n)
    fused = bar_shalom_campo(means, P, joint)
    mean, covariance = textbook.best_linear(means, joint)
    assert fused.mean == pytest.approx(mean, rel=1e-9, abs=1e-9)
    assert fused.covariance == pytest.approx(covariance, rel=1e-9, abs=1e-9)


def test_two_sources_are_the_formula_of_bar_shalom_and_campo():
    means, P, joint = random_joint(9, 2, 3)
    fused = bar_shalom_campo(means, P, joint)
    mean, covariance = textbook.two_sources(*means, *P, joint[0, 1])
    assert fused.mean == pytest.approx(mean)
    assert fused.covariance == pytest.approx(covariance)


def test_independent_sources_are_weighed_by_their_information():
    means, P, joint = random_joint(2, 4, 2)
    joint = joint * np.eye(4)[:, :, None, None]
    one, other = bar_shalom_campo(means, P, joint), inverse_covariance(means, P)
    assert one.mean == pytest.approx(other.mean)
    assert one.covariance == pytest.approx(other.covariance)
    inverse = np.linalg.inv(P)
    assert other.covariance == pytest.approx(np.linalg.inv(inverse.sum(axis=0)))


def test_order_of_the_sources_does_not_matter():
    means, P, joint = random_joint(3, 4, 3)
    turned = [2, 0, 3, 1]
    one = bar_shalom_campo(means, P, joint)
    other = bar_shalom_campo(means[turned], P[turned], joint[np.ix_(turned, turned)])
    assert one.mean == pytest.approx(other.mean)
    assert one.covariance == pytest.approx(other.covariance)


def test_equal_sources_give_what_each_is():
    """All errors are the same at a common start: the joint covariance is singular."""
    P = np.array([[2.0, 0.3], [0.3, 1.0]])
    joint, means = np.broadcast_to(P, (3, 3, 2, 2)), np.broadcast_to([4.0, 5.0], (3, 2))
    fused = bar_shalom_campo(means, np.broadcast_to(P, (3, 2, 2)), joint)
    assert fused.mean == pytest.approx([4.0, 5.0])
    assert fused.covariance == pytest.approx(P)


@pytest.mark.parametrize("gone", [0, 1, 2])
def test_missing_source_is_left_out(gone):
    means, P, joint = random_joint(5, 3, 2)
    rest = [i for i in range(3) if i != gone]
    part = joint[np.ix_(rest, rest)]
    holed, covariance, blocks = means.copy(), P.copy(), joint.copy()
    holed[gone], covariance[gone] = np.nan, np.nan
    blocks[gone], blocks[:, gone] = np.nan, np.nan
    for fused, expected in (
        (bar_shalom_campo(holed, covariance, blocks), bar_shalom_campo(means[rest], P[rest], part)),
        (inverse_covariance(holed, covariance), inverse_covariance(means[rest], P[rest])),
    ):
        assert fused.mean == pytest.approx(expected.mean)
        assert fused.covariance == pytest.approx(expected.covariance)
    for none in (
        bar_shalom_campo(np.full((3, 2), np.nan), P, joint),
        inverse_covariance(np.full((3, 2), np.nan), P),
    ):
        assert np.isnan(none.mean).all()
        assert np.isnan(none.covariance).all()


def test_stack_is_fused_like_each_alone():
    made = [random_joint(seed, 3, 2) for seed in range(4)]
    stacked = [
        np.stack(column).reshape(2, 2, *column[0].shape) for column in zip(*made, strict=True)
    ]
    together = bar_shalom_campo(*stacked)
    for k, one in enumerate(made):
        alone = bar_shalom_campo(*one)
        assert together.mean[k // 2, k % 2] == pytest.approx(alone.mean)
        assert together.covariance[k // 2, k % 2] == pytest.approx(alone.covariance)


def local_filters(P0, Q, H, R, steps):
    """The joint covariance by the recursion."""
    N = len(H)
    P = np.broadcast_to(P0, (N, *P0.shape))
    joint = np.broadcast_to(P0, (N, N, *P0.shape))
    for _ in range(steps):
        joint, prior = joint_predict(joint, Q), P + Q
        K = [p @ h.T @ np.linalg.inv(h @ p @ h.T + r) for p, h, r in zip(prior, H, R, strict=True)]
        P = np.array([p - k @ h @ p for p, k, h in zip(prior, K, H, strict=True)])
        joint = joint_update(joint, prior, P)
    return joint, P


@pytest.mark.parametrize("steps", [1, 2, 12])
def test_cross_covariances_are_those_of_all_the_noises_written_out(steps):
    rng = np.random.default_rng(steps)
    P0, Q = np.diag([9.0, 4.0]), np.array([[0.5, 0.1], [0.1, 0.2]])
    H = [np.eye(2), rng.normal(size=(2, 2)), rng.normal(size=(1, 2))]
    R = [np.eye(2), np.diag([0.3, 2.0]), np.eye(1)]
    joint, P = local_filters(P0, Q, H, R, steps)
    expected, marginal = textbook.joint_of_filters(P0, Q, H, R, steps)
    assert pytest.approx(marginal, rel=1e-10) == P
    assert joint == pytest.approx(expected, rel=1e-9, abs=1e-10)


def test_transition_moves_all_blocks():
    _, _, joint = random_joint(1, 2, 2)
    F, Q = np.array([[1.0, 0.5], [0.0, 1.0]]), 0.1 * np.eye(2)
    moved = joint_predict(joint, Q, F)
    for i in range(2):
        for j in range(2):
            assert moved[i, j] == pytest.approx(F @ joint[i, j] @ F.T + Q)


@pytest.mark.parametrize("seed", range(3))
def test_nees_of_the_fused_estimate_is_within_its_bounds(seed):
    rng, runs = np.random.default_rng(seed), 400
    _, P, joint = random_joint(seed, 3, 2)
    root = np.linalg.cholesky(textbook.stacked(joint))
    errors = (rng.standard_normal((runs, 6)) @ root.T).reshape(runs, 3, 2)
    stack = np.broadcast_to(P, (runs, 3, 2, 2)), np.broadcast_to(joint, (runs, 3, 3, 2, 2))
    fused = bar_shalom_campo(errors, *stack)
    low, high = mean_bounds(2, runs, 0.999)
    assert low < normalised_squares(fused.mean, fused.covariance).mean() < high
