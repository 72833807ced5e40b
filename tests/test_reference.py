"""The textbook twins agree with each other, so that they may judge the kernels."""

import numpy as np
import pytest

from reference import kalman, robust_weights, rts

STEPS = 40
F = np.tile([[1.0, 0.5], [0.0, 1.0]], (STEPS, 1, 1))
Q = np.tile([[0.04, 0.05], [0.05, 0.1]], (STEPS, 1, 1))
H = np.asarray([[1.0, 0.0], [1.0, 0.3]])
R = np.tile(np.diag([1.0, 2.0]), (STEPS, 1, 1))


def test_filter_and_smoother_agree_with_weighted_least_squares():
    z = np.random.default_rng(0).normal(size=(STEPS, 2))
    z[5], z[7, 1] = np.nan, np.nan
    start = np.zeros(2), np.eye(2)
    means, covariances = kalman.run(*start, z, H, R, F, Q)[:2]
    smoothed = rts.smooth(means, covariances, F, Q)
    best = kalman.batch(*start, z, H, R, F, Q)
    assert smoothed[0] == pytest.approx(best[0], abs=1e-12)
    assert smoothed[1] == pytest.approx(best[1], abs=1e-12)
    assert means[-1] == pytest.approx(best[0][-1], abs=1e-12)


def test_weights_are_continuous_and_fall_from_one():
    v = np.linspace(-8.0, 8.0, 16001)
    for weight, end in (
        (robust_weights.huber(v, 1.5), 1.5 / 8.0),
        (robust_weights.igg3_printed(v, 1.5, 4.5), 0.0),
        (robust_weights.igg3_yang(v, 1.5, 4.5), 0.0),
        (robust_weights.student_t(v**2, 4.0, 1), 5.0 / 68.0),
    ):
        assert weight[-1] == pytest.approx(end)
        assert np.abs(np.diff(weight)).max() < 2e-3
        assert (np.diff(weight[8000:]) <= 0.0).all()
    igg1 = robust_weights.igg1(np.asarray([1.0, 3.0, 4.499, 4.5]), 1.5, 4.5)
    assert igg1 == pytest.approx([1.0, 0.5, 1.5 / 4.499, 0.0])


def test_bifactor_keeps_the_correlation():
    covariance = np.asarray([[4.0, 1.0], [1.0, 1.0]])
    inflated = robust_weights.bifactor(covariance, np.asarray([0.25, 1.0]))
    assert inflated == pytest.approx(np.asarray([[16.0, 2.0], [2.0, 1.0]]))
