"""Series of sizes the compiler knows, and beyond: the textbook's numbers; streams and stacks."""

import numpy as np
import pytest

from reference import kalman as textbook
from reference import robust_weights
from surefix.errors import OptionsError
from surefix.filters import kalman
from surefix.filters.kalman import gaussian
from surefix.filters.linear import advance, filter_linear, stacked, stream_model
from surefix.robust.loss import loss_named

SAME = {"rtol": 1e-9, "atol": 1e-9}
SIZES = [(1, 1), (2, 1), (3, 2), (4, 2), (6, 6), (9, 3), (10, 2)]
WEIGHTS = {
    "kalman": lambda v, loss: np.ones_like(v),
    "huber": lambda v, loss: robust_weights.huber(v, loss.k0),
    "igg3": lambda v, loss: robust_weights.igg3_printed(v, loss.k0, loss.k1),
}


def problem(seed, n, m, count=25):
    """A stable model that changes with every step, correlated noise, gaps and wild values."""
    rng = np.random.default_rng([seed, n, m])
    F = np.eye(n) + 0.3 * rng.standard_normal((count, n, n)) / np.sqrt(n)
    F /= np.maximum(1.0, np.abs(np.linalg.eigvals(F)).max(axis=1))[:, None, None]
    A, B = rng.standard_normal((count, n, n)), rng.standard_normal((count, m, m + 1))
    H = rng.standard_normal((count, m, n))
    R = 0.3 * B @ np.swapaxes(B, 1, 2) + 0.2 * np.eye(m)
    z = 2.0 * rng.standard_normal((count, m)) * rng.choice([1.0, 8.0], (count, m))
    z[rng.random(z.shape) < 0.2] = np.nan
    z[7] = np.nan
    return (
        gaussian(rng.standard_normal(n), np.eye(n)),
        z,
        F,
        0.1 * A @ np.swapaxes(A, 1, 2),
        H,
        R,
    )


@pytest.mark.parametrize(("n", "m"), SIZES)
def test_every_size_is_the_textbook(n, m):
    for seed, (method, weigh) in enumerate(WEIGHTS.items()):
        x, z, F, Q, H, R = problem(seed, n, m)
        loss = loss_named(method)
        found = filter_linear(x, z, F, Q, H, R, loss)
        mean, P = x.mean, x.covariance
        for k in range(len(z)):
            mean, P = textbook.predict(mean, P, F[k], Q[k])
            e, S = z[k] - H[k] @ mean, H[k] @ P @ H[k].T + R[k]
            v = e / np.sqrt(np.diag(S))
            w = np.where(np.isnan(e), np.nan, weigh(np.nan_to_num(v), loss))
            used = np.where(w > 0.0, z[k], np.nan)
            inflated = robust_weights.bifactor(R[k], np.where(w > 0.0, w, 1.0))
            mean, P = textbook.update(mean, P, used, H[k], inflated)[:2]
            np.testing.assert_allclose(found.mean[k], mean, **SAME)
            np.testing.assert_allclose(found.covariance[k], P, **SAME)
            np.testing.assert_allclose(found.residual[k], e, **SAME)
            np.testing.assert_allclose(found.nis[k], v * v, **SAME)
            np.testing.assert_allclose(found.weight[k], w, **SAME)


@pytest.mark.parametrize("method", ["kalman", "igg3"])
@pytest.mark.parametrize("m", [1, 2])
def test_a_stream_is_the_series_to_the_last_bit(m, method):
    x, z, F, Q, H, R = problem(3, 4, m)
    model, loss = (F[0], Q[0], H[0], R[0]), loss_named(method)
    found = filter_linear(x, z, *model, loss)
    packed, state = stream_model(*model, loss), stacked(x)
    for k, row in enumerate(z):
        before = state.copy()
        after, seen = advance(packed, state, row)
        np.testing.assert_array_equal(state, before)
        np.testing.assert_array_equal(after[0], found.mean[k])
        np.testing.assert_array_equal(after[1:], found.covariance[k])
        np.testing.assert_array_equal(seen, [found.residual[k], found.nis[k], found.weight[k]])
        state = after


def test_many_series_are_each_by_itself_to_the_last_bit():
    x, z, F, Q, H, R = problem(5, 4, 2)
    rng = np.random.default_rng(6)
    several = z + rng.standard_normal((23, *z.shape))
    starts = [gaussian(rng.standard_normal(4), (1.0 + t) * np.eye(4)) for t in range(23)]
    whole = kalman.Gaussian(*(np.stack(part) for part in zip(*starts, strict=True)))
    loss = loss_named("huber")
    together = filter_linear(whole, several, F, Q, H, R, loss)
    alike = filter_linear(x, several, F, Q, H, R, loss)
    for t, start in enumerate(starts):
        for one, all_of_them in ((start, together), (x, alike)):
            alone = filter_linear(one, several[t], F, Q, H, R, loss)
            for field, among in zip(alone, all_of_them, strict=True):
                np.testing.assert_array_equal(among[t], field)


@pytest.mark.parametrize("ratio", [1e4, 1e8, 1e12])
def test_a_vague_prior_costs_no_more_digits_than_it_must(ratio):
    """Variances that differ by a ratio: that much of the last digit, and never a negative one."""
    x, z, F, Q, H, R = problem(8, 4, 2)
    x = gaussian(x.mean, np.diag([ratio, ratio, 1.0, 1.0]) * 1e-2)
    found = filter_linear(x, z, F, Q, H, 0.01 * R)
    for k, row in enumerate(z):
        x, _ = kalman.update(kalman.predict(x, F[k], Q[k]), row, H[k], 0.01 * R[k])
        size = np.sqrt(np.outer(*[np.diag(x.covariance)] * 2))
        lost = np.abs(found.covariance[k] - x.covariance) / size
        assert lost.max() < 1e-9 + 1e-15 * ratio
        assert np.linalg.eigvalsh(found.covariance[k] / size).min() > 0.0


def test_long_series_stay_symmetric_and_positive():
    x, z, F, Q, H, R = problem(9, 4, 2, count=4000)
    found = filter_linear(x, z, F, 1e-9 * Q, H, R)
    P = found.covariance
    size = np.sqrt(np.einsum("kii,kjj->kij", P, P))
    assert np.abs(P - np.swapaxes(P, 1, 2)).max() <= 1e-12 * P.max()
    assert np.linalg.eigvalsh(P / size).min() > 0.0


def test_what_is_not_finite_is_missing():
    x, z, F, Q, H, R = problem(1, 4, 2)
    endless = np.where(np.isnan(z), np.inf, z)
    found, expected = (filter_linear(x, each, F, Q, H, R) for each in (endless, z))
    np.testing.assert_array_equal(found.mean, expected.mean)
    np.testing.assert_array_equal(np.isnan(found.weight), np.isnan(z))


@pytest.mark.parametrize("wrong", ["state", "stack", "F", "4 axes"])
def test_stacks_that_do_not_fit_are_refused(wrong):
    x, z, F, Q, H, R = problem(2, 4, 2)
    z = np.stack([z, z])
    if wrong == "state":
        x = kalman.Gaussian(x.mean, np.eye(3))
    elif wrong == "stack":
        x = kalman.Gaussian(np.zeros((3, 4)), np.broadcast_to(np.eye(4), (3, 4, 4)))
    elif wrong == "F":
        F = F[:-1]
    else:
        z = z[None]
    with pytest.raises(OptionsError):
        filter_linear(x, z, F, Q, H, R)


@pytest.mark.parametrize("wrong", ["R", "H", "loss"])
def test_a_stream_of_no_model_is_refused(wrong):
    _, _, F, Q, H, R = problem(2, 4, 2)
    F, Q, H, R, loss = F[0], Q[0], H[0], R[0], None
    if wrong == "R":
        R = -R
    elif wrong == "H":
        H = H[0]
    else:
        loss = loss_named("student-t")
    with pytest.raises(OptionsError):
        stream_model(F, Q, H, R, loss)
