"""The filter over a series against its own steps and the textbook, and both kinds of residual."""

import numpy as np
import pytest

from reference import kalman as textbook
from reference import robust_weights
from surefix.errors import OptionsError
from surefix.filters.kalman import gaussian, predict, update
from surefix.filters.linear import filter_linear
from surefix.robust.loss import loss_named

SAME = {"rtol": 1e-9, "atol": 1e-9}
WEIGHTS = {
    "huber": lambda v, loss: robust_weights.huber(v, loss.k0),
    "igg1": lambda v, loss: robust_weights.igg1(v, loss.k0, loss.k1),
    "igg3": lambda v, loss: robust_weights.igg3_printed(v, loss.k0, loss.k1),
    "igg3-yang": lambda v, loss: robust_weights.igg3_yang(v, loss.k0, loss.k1),
    "kalman": lambda v, loss: np.ones_like(v),
}


def problem(seed, count=40):
    """A stable random model; correlated noise that differs at every epoch, gaps, gross errors."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 7)), int(rng.integers(1, 5))
    F = np.eye(n) + 0.2 * rng.normal(size=(n, n))
    F /= max(1.0, np.abs(np.linalg.eigvals(F)).max())
    H, A, B = rng.normal(size=(m, n)), rng.normal(size=(n, n)), rng.normal(size=(count, m, m + 1))
    z = 2.0 * rng.normal(size=(count, m)) * rng.choice([1.0, 8.0], (count, m))
    z[rng.random(z.shape) < 0.2] = np.nan
    R = 0.3 * B @ np.swapaxes(B, 1, 2) + 0.2 * np.eye(m)
    return gaussian(rng.normal(size=n), np.eye(n)), z, F, 0.1 * A @ A.T, H, R


@pytest.mark.parametrize("spread", ["innovation", "noise"])
@pytest.mark.parametrize("method", WEIGHTS)
@pytest.mark.parametrize("seed", range(4))
def test_series_is_the_textbook_with_equivalent_covariances(seed, method, spread):
    x, z, F, Q, H, R = problem(seed)
    loss = loss_named(method)
    found = filter_linear(x, z, F, Q, H, R, loss, spread)
    m, P = x.mean, x.covariance
    for k in range(len(z)):
        m, P = textbook.predict(m, P, F, Q)
        S = H @ P @ H.T + R[k]
        sigma = np.sqrt(np.diag(S if spread == "innovation" else R[k]))
        v = (z[k] - H @ m) / sigma
        w = np.where(np.isnan(z[k]), np.nan, WEIGHTS[method](np.nan_to_num(v), loss))
        np.testing.assert_allclose(found.weight[k], w, **SAME)
        np.testing.assert_allclose(found.residual[k], z[k] - H @ m, **SAME)
        np.testing.assert_allclose(found.nis[k], (z[k] - H @ m) ** 2 / np.diag(S), **SAME)
        used = np.where(w > 0.0, z[k], np.nan)
        inflated = robust_weights.bifactor(R[k], np.where(w > 0.0, w, 1.0))
        m, P = textbook.update(m, P, used, H, inflated)[:2]
        np.testing.assert_allclose(found.mean[k], m, **SAME)
        np.testing.assert_allclose(found.covariance[k], P, **SAME)


@pytest.mark.parametrize("spread", ["innovation", "noise"])
def test_series_is_its_steps(spread):
    x, z, F, Q, H, R = problem(11)
    loss, fixed = loss_named("igg3"), R[0]
    found = filter_linear(x, z, F, Q, H, fixed, loss, spread)
    for k, row in enumerate(z):
        x, seen = update(predict(x, F, Q), row, H, fixed, loss, spread=spread)
        np.testing.assert_allclose(found.mean[k], x.mean, **SAME)
        np.testing.assert_allclose(found.covariance[k], x.covariance, **SAME)
        np.testing.assert_allclose(found.weight[k], seen.weight, **SAME)
        np.testing.assert_allclose(found.nis[k], seen.nis, **SAME)


def test_a_residual_over_its_noise_alone_blames_the_observation():
    """Far prediction, P ≫ R: the innovation is within its own σ, and far beyond that of R."""
    x = gaussian([0.0], [[100.0]])
    fair = update(x, [10.0], [[1.0]], [[1.0]], loss_named("igg3"))[1]
    harsh = update(x, [10.0], [[1.0]], [[1.0]], loss_named("igg3"), spread="noise")[1]
    assert fair.weight == [1.0]
    assert harsh.weight == [0.0]
    assert harsh.sigma == pytest.approx([10.0])
    assert harsh.nis == pytest.approx(fair.nis)


def test_a_group_is_measured_by_its_noise_as_a_whole():
    R = np.array([[2.0, 0.6], [0.6, 1.0]])
    z, loss = np.array([2.5, -2.0]), loss_named("huber")
    after, seen = update(
        gaussian([0.0, 0.0], np.eye(2)), z, np.eye(2), R, loss, [0, 0], spread="noise"
    )
    distance = np.sqrt(z @ np.linalg.solve(R, z)) / loss.scale2
    assert seen.sigma == pytest.approx([distance])
    weight = robust_weights.huber(distance, loss.k0)
    m = textbook.update(np.zeros(2), np.eye(2), z, np.eye(2), R / weight)[0]
    np.testing.assert_allclose(after.mean, m, **SAME)


def test_arguments_are_left_alone():
    x, z, F, Q, H, R = problem(2)
    given = (x.mean, x.factor, z, F, Q, H, R)
    before = [each.copy() for each in given]
    filter_linear(x, z, F, Q, H, R, loss_named("igg1"))
    for each, kept in zip(given, before, strict=True):
        np.testing.assert_array_equal(each, kept)


def test_no_epochs_are_no_error():
    x, z, F, Q, H, R = problem(2)
    found = filter_linear(x, z[:0], F, Q, H, R[:0])
    assert found.mean.shape == (0, len(x.mean))


@pytest.mark.parametrize("wrong", ["z", "R shape", "R", "R asymmetric", "H", "Q", "loss", "spread"])
def test_what_does_not_fit_is_refused(wrong):
    x, z, F, Q, H, R = problem(3)
    loss, spread = None, "innovation"
    if wrong == "z":
        z = z[0]
    elif wrong == "R shape":
        R = R[:-1]
    elif wrong == "R":
        R = -R
    elif wrong == "R asymmetric":
        R = R.copy()
        R[0] += np.triu(np.ones_like(R[0]), 1) + (R.shape[1] == 1) * np.nan
    elif wrong == "H":
        H = H.T if H.shape[0] != H.shape[1] else H[:-1]
    elif wrong == "Q":
        Q = -Q
    elif wrong == "loss":
        loss = loss_named("student-t")
    else:
        spread = "both"
    with pytest.raises(OptionsError):
        filter_linear(x, z, F, Q, H, R, loss, spread)
