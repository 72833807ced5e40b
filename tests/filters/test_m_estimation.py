"""The M-estimation update against dense eqs 19, the plain filter, and a general minimiser."""

import numpy as np
import pytest
from scipy.optimize import minimize

from reference import kalman as textbook
from reference import towed as dense
from surefix.errors import OptionsError
from surefix.filters.kalman import gaussian, update
from surefix.filters.m_estimation import m_update
from surefix.robust.loss import loss_named

HUBER = loss_named("huber")
SAME = {"rel": 1e-9, "abs": 1e-9}


def problem(seed, *, diagonal=False):
    """Prediction, H, R and an observation, some of it wild, as a random linear problem."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 6))
    A, B = rng.normal(size=(n, n + 2)), rng.normal(size=(m, m + 2))
    P, R = A @ A.T * 10.0 ** rng.uniform(-2, 2), B @ B.T
    if diagonal:
        R = np.diag(np.diag(R))
    H, mean = rng.normal(size=(m, n)), rng.normal(size=n)
    noise = np.linalg.cholesky(R) @ rng.normal(size=m) * rng.choice([1.0, 20.0], m)
    z = H @ (mean + np.linalg.cholesky(P) @ rng.normal(size=n)) + noise
    return mean, P, z, H, R


@pytest.mark.parametrize("seed", range(20))
def test_as_printed_it_is_eqs_19_by_dense_matrices(seed):
    """With a diagonal R all square roots of it are one; that of P does not matter as W₁ = I."""
    mean, P, z, H, R = problem(seed, diagonal=True)
    if seed % 3 == 0:
        z[0] = np.nan
    after, seen = m_update(gaussian(mean, P), z, H, R, HUBER, state_loss=HUBER)
    m, C, w = dense.eqs_19(mean, P, z - H @ mean, H, R, HUBER.k0)
    assert after.mean == pytest.approx(m, **SAME)
    assert after.covariance == pytest.approx(C, **SAME)
    assert seen.weight == pytest.approx(w, nan_ok=True)
    assert (seen.state_weight == 1.0).all()
    assert (w[~np.isnan(w)] < 1.0).any() or seed not in range(3)


@pytest.mark.parametrize("seed", range(10))
def test_as_printed_it_is_a_kalman_update_with_r_over_w(seed):
    mean, P, z, H, R = problem(seed, diagonal=True)
    after, seen = m_update(gaussian(mean, P), z, H, R, HUBER)
    v = np.abs(z - H @ mean) / np.sqrt(np.diag(R))
    assert seen.weight == pytest.approx(np.minimum(1.0, HUBER.k0 / v))
    m, C = textbook.update(mean, P, z, H, R / seen.weight)[:2]
    assert after.mean == pytest.approx(m, **SAME)
    assert after.covariance == pytest.approx(C, **SAME)


@pytest.mark.parametrize("method", ["huber", "igg1", "igg3", "igg3-yang", "gate"])
@pytest.mark.parametrize("seed", range(4))
def test_standardised_by_the_innovation_it_is_the_robust_kalman_update(method, seed):
    mean, P, z, H, R = problem(seed, diagonal=True)
    x, loss = gaussian(mean, P), loss_named(method)
    ours, seen = m_update(x, z, H, R, loss, standardise="innovation")
    other, info = update(x, z, H, R, loss)
    assert ours.mean == pytest.approx(other.mean, **SAME)
    assert ours.covariance == pytest.approx(other.covariance, **SAME)
    assert seen.weight == pytest.approx(info.weight)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("state_side", [True, False])
def test_iterated_it_minimises_eq_15(seed, state_side):
    mean, P, z, H, R = problem(seed)
    k_state = 1.0 if state_side else 1e9
    state = loss_named("huber", k0=k_state)
    after, seen = m_update(
        gaussian(mean, P), z, H, R, HUBER, state_loss=state, sweeps=3000, tolerance=1e-12
    )
    given = (P, z - H @ mean, H, R, k_state, HUBER.k0)
    root = np.linalg.cholesky(P)

    def whitened(e):
        value, slope = dense.objective(root @ e, *given)
        return value, root.T @ slope

    best = minimize(
        whitened,
        np.zeros(len(P)),
        jac=True,
        method="BFGS",
        options={"gtol": 1e-9, "maxiter": 5000},
    )
    value, slope = dense.objective(after.mean - mean, *given)
    assert value <= best.fun + 1e-9 * (1.0 + best.fun)
    assert seen.change <= 1e-12 or seen.sweeps == 3000
    assert root.T @ slope == pytest.approx(np.zeros(len(P)), abs=1e-5)
    again = dense.iteration(P, z - H @ mean, H, R, seen.state_weight, seen.weight)
    assert after.mean - mean == pytest.approx(again, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_covariance_of_the_iterated_form_is_eq_19e_with_the_last_weights(seed):
    mean, P, z, H, R = problem(seed)
    after, seen = m_update(gaussian(mean, P), z, H, R, HUBER, state_loss=HUBER, sweeps=40)
    a, b = np.linalg.cholesky(P), np.linalg.cholesky(R)
    wide = a @ np.diag(1.0 / seen.state_weight) @ a.T
    noisy = b @ np.diag(1.0 / seen.weight) @ b.T
    m, C = textbook.update(mean, wide, z, H, noisy)[:2]
    assert after.mean == pytest.approx(m, rel=1e-7, abs=1e-7)
    assert after.covariance == pytest.approx(C, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("seed", range(12))
def test_the_objective_never_rises(seed):
    mean, P, z, H, R = problem(seed)
    values = []
    for sweeps in range(1, 25):
        after, _ = m_update(
            gaussian(mean, P), z, H, R, HUBER, state_loss=HUBER, sweeps=sweeps, tolerance=0.0
        )
        given = (P, z - H @ mean, H, R, HUBER.k0, HUBER.k0)
        values.append(dense.objective(after.mean - mean, *given)[0])
    assert (np.diff(values) <= 1e-9 * (1.0 + values[0])).all()


def test_without_a_loss_any_number_of_sweeps_is_the_kalman_filter():
    mean, P, z, H, R = problem(3)
    m, C = textbook.update(mean, P, z, H, R)[:2]
    after, seen = m_update(gaussian(mean, P), z, H, R, loss_named("kalman"), sweeps=50)
    assert after.mean == pytest.approx(m, **SAME)
    assert after.covariance == pytest.approx(C, **SAME)
    assert seen.sweeps == 2


def test_student_t_iterated_is_a_stationary_point_of_its_likelihood():
    x, loss = gaussian([0.0], [[4.0]]), loss_named("student-t")
    after, _ = m_update(x, [9.0], [[1.0]], [[1.0]], loss, sweeps=500, tolerance=1e-13)
    r = 9.0 - after.mean[0]
    assert after.mean[0] / 4.0 == pytest.approx((loss.k0 + 1.0) * r / (loss.k0 + r * r))


def test_the_vaguer_side_is_blamed():
    """A surprise is a gross error where the fix is the vaguer, a true move where the state is."""
    for variance, moves in ((0.01, False), (100.0, True)):
        after, seen = m_update(
            gaussian([0.0], [[variance]]),
            [60.0],
            [[1.0]],
            [[1.0]],
            HUBER,
            state_loss=HUBER,
            sweeps=200,
        )
        assert (after.mean[0] > 50.0) == moves
        assert (seen.state_weight[0] < 1.0) == moves
        assert (seen.weight[0] < 1.0) != moves


def test_units_do_not_matter():
    mean, P, z, H, R = problem(7)
    rng = np.random.default_rng(1)
    s, t = 10.0 ** rng.uniform(-5, 5, len(mean)), 10.0 ** rng.uniform(-5, 5, len(z))
    options = {"state_loss": HUBER, "sweeps": 60}
    one, seen = m_update(gaussian(mean, P), z, H, R, HUBER, **options)
    other, scaled = m_update(
        gaussian(mean * s, P * np.outer(s, s)),
        z * t,
        H * t[:, None] / s,
        R * np.outer(t, t),
        HUBER,
        **options,
    )
    assert other.mean / s == pytest.approx(one.mean, rel=1e-7)
    assert scaled.weight == pytest.approx(seen.weight, rel=1e-7)
    assert scaled.state_weight == pytest.approx(seen.state_weight, rel=1e-7)


@pytest.mark.parametrize("lost", [np.nan, np.inf])
def test_missing_components_are_left_out(lost):
    mean, P, _, _, _ = problem(5)
    H, R = np.eye(len(mean))[:1].repeat(2, axis=0), np.array([[1.0, 0.6], [0.6, 2.0]])
    x = gaussian(mean, P)
    after, seen = m_update(x, [lost, 1.0], H, R, HUBER, state_loss=HUBER, sweeps=20)
    alone, _ = m_update(x, [1.0], H[1:], R[1:, 1:], HUBER, state_loss=HUBER, sweeps=20)
    assert after.mean == pytest.approx(alone.mean)
    assert np.isnan(seen.weight).tolist() == [True, False]
    nothing, seen = m_update(x, [lost, lost], H, R, HUBER)
    assert (nothing.mean == x.mean).all()
    assert nothing.covariance == pytest.approx(P)
    assert seen.sweeps == 0


def test_covariance_stays_symmetric_and_positive_at_any_scale():
    x = gaussian([0.0, 0.0], [[1e12, 0.0], [0.0, 1e-12]])
    for z in (0.0, 1e9):
        after, _ = m_update(x, [z], [[1.0, 1.0]], [[1e-6]], HUBER, state_loss=HUBER, sweeps=100)
        assert (after.covariance == after.covariance.T).all()
        assert (np.linalg.eigvalsh(after.covariance) >= 0.0).all()


def test_inputs_are_untouched():
    mean, P, z, H, R = problem(2)
    x = gaussian(mean, P)
    kept = [np.array(each) for each in (*x, z, H, R)]
    m_update(x, z, H, R, HUBER, state_loss=HUBER, sweeps=30)
    for now, before in zip((*x, z, H, R), kept, strict=True):
        assert (now == before).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"H": np.eye(3)},
        {"R": -np.eye(2)},
        {"R": np.zeros((2, 2))},
        {"R": np.full((2, 2), np.nan)},
        {"state_loss": loss_named("igg3")},
        {"standardise": "range"},
        {"sweeps": 0},
        {"sweeps": 2, "standardise": "innovation"},
        {"tolerance": -1.0},
    ],
)
def test_options_that_do_not_fit_are_refused(wrong):
    given = {"z": [1.0, 2.0], "H": np.eye(2), "R": np.eye(2), "loss": HUBER} | wrong
    with pytest.raises(OptionsError):
        m_update(gaussian([0.0, 0.0], np.eye(2)), **given)
