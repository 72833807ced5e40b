"""The two pure steps against filterpy, the twin, and the limits of double precision."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from reference import kalman as textbook
from reference import robust_weights
from surefix.errors import OptionsError
from surefix.filters.kalman import Gaussian, gaussian, predict, update
from surefix.robust.loss import loss_named

SAME = {"rtol": 1e-9, "atol": 1e-9}
SCALES = [None, 1.0, *(loss_named("igg3")[3:])]


def covariance(rng, n, scale=1.0):
    A = rng.normal(size=(n, n + 2))
    return scale * A @ A.T / n


def problem(seed):
    """A random linear problem: mean, P, F, Q, H, R and 25 observations with gaps."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 5))
    F = np.eye(n) + 0.2 * rng.normal(size=(n, n))
    F /= max(1.0, np.abs(np.linalg.eigvals(F)).max())
    H = rng.normal(size=(m, n))
    R = covariance(rng, m, 10.0 ** rng.uniform(-3, 1))
    if seed % 2:
        R = np.diag(np.diag(R))
    Q = covariance(rng, n, 10.0 ** rng.uniform(-3, 0))
    z = 3.0 * rng.normal(size=(25, m))
    z[rng.random(z.shape) < 0.3] = np.nan
    z[5] = np.nan
    return rng.normal(size=n), covariance(rng, n), F, Q, H, R, z


@pytest.mark.parametrize("seed", range(30))
def test_filterpy_finds_the_same(seed):
    mean, P, F, Q, H, R, z = problem(seed)
    other = KalmanFilter(dim_x=len(mean), dim_z=len(R))
    other.x, other.P, other.F, other.Q = mean[:, None].copy(), P.copy(), F, Q
    x = gaussian(mean, P)
    for row in z:
        x = predict(x, F, Q)
        other.predict()
        assert x.mean == pytest.approx(other.x[:, 0], rel=1e-9, abs=1e-9)
        np.testing.assert_allclose(x.covariance, other.P, **SAME)
        seen = ~np.isnan(row)
        x, info = update(x, row, H, R)
        assert (np.isnan(info.weight) == ~seen).all()
        if not seen.any():
            continue
        other.dim_z = int(seen.sum())
        other.update(row[seen, None], R=R[np.ix_(seen, seen)], H=H[seen])
        np.testing.assert_allclose(x.mean, other.x[:, 0], **SAME)
        np.testing.assert_allclose(x.covariance, other.P, **SAME)
        np.testing.assert_allclose(info.residual[seen], other.y[:, 0], **SAME)


@pytest.mark.parametrize("method", ["huber", "igg1", "igg3", "igg3-yang", "gate"])
@pytest.mark.parametrize("seed", range(6))
def test_robust_update_is_the_textbook_update_with_equivalent_covariance(method, seed):
    mean, P, _, _, H, R, z = problem(seed)
    loss = loss_named(method)
    rng = np.random.default_rng(seed)
    weighed = set()
    for row in z * rng.choice([1.0, 2.0, 8.0], z.shape):
        after, info = update(gaussian(mean, P), row, H, R, loss)
        nu, S = row - H @ mean, H @ P @ H.T + R
        v = np.abs(nu) / np.sqrt(np.diag(S))
        w = expected_weight(method, v, loss)
        np.testing.assert_allclose(info.weight, np.where(np.isnan(row), np.nan, w), atol=1e-12)
        np.testing.assert_allclose(info.sigma, v, **SAME)
        kept = np.where(w > 0.0, row, np.nan)
        inflated = robust_weights.bifactor(R, np.where(w > 0.0, w, 1.0))
        m, C = textbook.update(mean, P, kept, H, inflated)[:2]
        np.testing.assert_allclose(after.mean, m, **SAME)
        np.testing.assert_allclose(after.covariance, C, **SAME)
        weighed |= set(np.sign(w[~np.isnan(w)] - 1.0))
    assert weighed == {0.0, -1.0}


def expected_weight(method, v, loss):
    if method == "gate":
        return np.where(np.isnan(v), np.nan, (v <= loss.k1) * 1.0)
    if method == "huber":
        return robust_weights.huber(v, loss.k0)
    name = {"igg1": "igg1", "igg3": "igg3_printed", "igg3-yang": "igg3_yang"}[method]
    return getattr(robust_weights, name)(np.nan_to_num(v), loss.k0, loss.k1)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_a_group_shares_the_weight_of_its_mahalanobis_distance(axes):
    rng = np.random.default_rng(axes)
    loss = loss_named("huber")
    P, R = covariance(rng, axes), covariance(rng, axes)
    z = 4.0 * rng.normal(size=axes)
    after, info = update(gaussian(np.zeros(axes), P), z, np.eye(axes), R, loss, [0] * axes)
    nis = z @ np.linalg.solve(P + R, z)
    w = robust_weights.huber(np.sqrt(nis) / SCALES[axes], loss.k0)
    assert info.nis == pytest.approx([nis], rel=1e-12)
    assert info.weight == pytest.approx([w], rel=1e-12)
    m, C = textbook.update(np.zeros(axes), P, z, np.eye(axes), R / w)[:2]
    np.testing.assert_allclose(after.mean, m, **SAME)
    np.testing.assert_allclose(after.covariance, C, **SAME)


def test_steps_leave_their_arguments_alone():
    mean, P, F, Q, H, R, z = problem(2)
    x = gaussian(mean, P)
    kept = [a.copy() for a in (x.mean, x.factor, F, Q, H, R, z)]
    update(predict(x, F, Q), z[0], H, R, loss_named("igg3"))
    assert all(
        np.array_equal(a, b, equal_nan=True)
        for a, b in zip(kept, (x.mean, x.factor, F, Q, H, R, z), strict=True)
    )


@pytest.mark.parametrize("decades", [0, 4, 8, 12, 16])
def test_covariance_stays_positive_whatever_the_ratio(decades):
    """Fault 18: prior over measurement variance 10^decades, 200 seeds, 40 steps each."""
    for seed in range(200 if decades == 16 else 40):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 7))
        x = gaussian(np.zeros(n), covariance(rng, n, 10.0**decades) + np.eye(n))
        truth = x.factor @ rng.normal(size=n)
        for step in range(40):
            h = rng.normal(size=(1, n))
            x, _ = update(x, h @ truth + rng.normal(), h, np.eye(1))
            x = predict(x, np.eye(n), np.zeros((n, n))) if step % 5 == 0 else x
            assert np.isfinite(x.mean).all()
            P = x.covariance
            assert (P == P.T).all()
            values = np.linalg.eigvalsh(P)
            assert values[0] >= -1e-15 * values[-1]
        error = x.mean - truth
        # what was measured 40 times over is known to about one sigma, not lost to rounding
        assert np.abs(h @ error).max() < 6.0


def test_two_directions_measured_to_1e_8_of_their_prior():
    x = gaussian([0.0, 0.0], np.diag([1e16, 1e16]))
    H = np.array([[1.0, 1.0], [1.0, -1.0]])
    x, _ = update(x, [3.0, 1.0], H, np.eye(2))
    assert x.mean == pytest.approx([2.0, 1.0], abs=1e-6)
    np.testing.assert_allclose(x.covariance, 0.5 * np.eye(2), atol=1e-6)


def test_singular_noise_and_perfect_knowledge():
    x = predict(gaussian([1.0, 2.0], np.zeros((2, 2))), np.eye(2), [[0.0, 0.0], [0.0, 0.0]])
    assert (x.covariance == 0.0).all()
    x, info = update(x, [9.0], [[1.0, 0.0]], [[1.0]])
    assert x.mean == pytest.approx([1.0, 2.0])
    assert info.nis == pytest.approx([64.0])
    rank_one = np.array([[1.0, 2.0], [2.0, 4.0]])
    np.testing.assert_allclose(gaussian([0, 0], rank_one).covariance, rank_one, atol=1e-12)


@pytest.mark.parametrize(
    "R",
    [
        [[0.0]],
        [[-1.0]],
        [[np.inf]],
        [[np.nan]],
        [[1.0, 0.5], [0.2, 1.0]],
        [[1.0, 2.0], [2.0, 1.0]],
        [[1.0, 1.0], [1.0, 1.0]],
        [1.0, 2.0],
    ],
)
def test_impossible_noise_is_refused(R):
    """Fault 17."""
    m = len(np.atleast_2d(R)[0])
    with pytest.raises(OptionsError, match="R = "):
        update(gaussian(np.zeros(m), np.eye(m)), np.zeros(m), np.eye(m), R)


def test_impossible_states_shapes_and_losses_are_refused():
    with pytest.raises(OptionsError, match="covariance"):
        gaussian([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]])
    with pytest.raises(OptionsError, match="covariance"):
        gaussian([0.0], [[np.nan]])
    x = gaussian([0.0, 0.0], np.eye(2))
    with pytest.raises(OptionsError, match="Q = "):
        predict(x, np.eye(2), -np.eye(2))
    with pytest.raises(OptionsError, match="H of shape"):
        update(x, [0.0], [[1.0]], [[1.0]])
    with pytest.raises(OptionsError, match="student-t"):
        update(x, [0.0], [[1.0, 0.0]], [[1.0]], loss_named("student-t"))


def test_nothing_observed_changes_nothing():
    x = Gaussian(np.array([1.0, 2.0]), np.array([[1.0, 0.0], [0.5, 1.0]]))
    after, info = update(x, [np.nan, np.nan], np.eye(2), np.eye(2), loss_named("igg3"))
    assert np.array_equal(after.mean, x.mean)
    assert np.array_equal(after.factor, x.factor)
    assert np.isnan(info.weight).all()
    assert np.isnan(info.nis).all()


def test_covariances_of_a_stack():
    rng = np.random.default_rng(1)
    factor = rng.standard_normal((4, 2, 3, 3))
    stack = Gaussian(np.zeros((4, 2, 3)), factor).covariance
    for i in np.ndindex(4, 2):
        np.testing.assert_allclose(stack[i], factor[i] @ factor[i].T, rtol=1e-12, atol=1e-12)
