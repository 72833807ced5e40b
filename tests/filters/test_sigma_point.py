"""The sigma-point filter: linear models, its twin, filterpy, Monte Carlo, honesty, extremes."""

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from reference import kalman, robust_weights
from reference import sigma_point as textbook
from surefix.errors import OptionsError
from surefix.filters.sigma_point import Gaussian, Spread, predict, transform, update
from surefix.metrics import mean_bounds, normalised_squares
from surefix.models.ranging import range_to
from surefix.robust.loss import loss_named

SPREADS = [Spread(), Spread(0.5, 2.0, 1.0), Spread(1e-3, 2.0, 0.0), Spread(1.0, 1.0, 0.5)]
BEACONS = np.array([[0.0, 0.0], [80.0, 10.0], [20.0, 90.0]])


def covariance(rng, n, scale=1.0):
    A = rng.normal(size=(n, n + 2))
    return scale * A @ A.T / n


def turn(x):
    """A state (x, y, heading, speed) one second on."""
    px, py, heading, speed = np.moveaxis(x, -1, 0)
    return np.stack(
        [px + speed * np.cos(heading), py + speed * np.sin(heading), heading + 0.1, speed], axis=-1
    )


def ranges(x):
    return range_to(
        np.concatenate((x[..., None, :2], np.zeros_like(x[..., None, :1])), axis=-1),
        np.column_stack((BEACONS, np.zeros(3))),
    )


@pytest.mark.parametrize("spread", SPREADS)
@pytest.mark.parametrize("seed", range(6))
def test_linear_models_give_the_kalman_filter(seed, spread):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 6)), int(rng.integers(1, 5))
    F, H = np.eye(n) + 0.2 * rng.normal(size=(n, n)), rng.normal(size=(m, n))
    Q, R, P = covariance(rng, n), covariance(rng, m), covariance(rng, n)
    mean = rng.normal(size=n)
    x = Gaussian(mean, np.linalg.cholesky(P))
    tolerance = 1e-9 if spread.alpha > 0.01 else 1e-7
    for _ in range(15):
        z = rng.normal(size=m)
        z[rng.random(m) < 0.3] = np.nan
        mean, P = kalman.predict(mean, P, F, Q)
        mean, P = kalman.update(mean, P, z, H, R)[:2]
        x = predict(x, lambda p, F=F: p @ F.T, Q, spread)
        x, _ = update(x, z, lambda p, H=H: p @ H.T, R, spread=spread)
        assert x.mean == pytest.approx(mean, rel=tolerance, abs=tolerance)
        assert x.covariance == pytest.approx(P, rel=tolerance, abs=tolerance)


@pytest.mark.parametrize("spread", SPREADS[:2])
def test_textbook_form_finds_the_same(spread):
    rng = np.random.default_rng(4)
    names = {"alpha": spread.alpha, "beta": spread.beta, "kappa": spread.kappa}
    Q, R = np.diag([0.1, 0.1, 0.01, 0.02]), covariance(rng, 3, 4.0)
    m, P = np.array([30.0, 30.0, 0.5, 1.0]), np.diag([25.0, 25.0, 0.2, 0.1])
    x = Gaussian(m, np.linalg.cholesky(P))
    for _ in range(30):
        z = ranges(m + np.array([3.0, -2.0, 0.0, 0.0])) + rng.normal(size=3)
        z[rng.random(3) < 0.2] = np.nan
        m, P = textbook.predict(m, P, turn, Q, **names)
        m, P = textbook.update(m, P, z, ranges, R, **names)
        x = predict(x, turn, Q, spread)
        x, _ = update(x, z, ranges, R, spread=spread)
        assert x.mean == pytest.approx(m, rel=1e-9, abs=1e-9)
        assert x.covariance == pytest.approx(P, rel=1e-9, abs=1e-9)


def test_filterpy_finds_the_same():
    points = MerweScaledSigmaPoints(4, alpha=0.7, beta=2.0, kappa=0.5)
    other = UnscentedKalmanFilter(4, 3, 1.0, ranges, lambda x, dt: turn(x), points)
    other.x, other.P = np.array([30.0, 30.0, 0.5, 1.0]), np.diag([25.0, 25.0, 0.2, 0.1])
    other.Q, other.R = np.diag([0.1, 0.1, 0.01, 0.02]), 4.0 * np.eye(3)
    x = Gaussian(other.x.copy(), np.linalg.cholesky(other.P))
    rng, spread = np.random.default_rng(5), Spread(0.7, 2.0, 0.5)
    for _ in range(3):
        z = ranges(other.x) + rng.normal(size=3)
        other.predict()
        # filterpy measures the propagated points of the prediction; draw them anew, as here
        other.sigmas_f = points.sigma_points(other.x, other.P)
        other.update(z)
        x, _ = update(predict(x, turn, other.Q, spread), z, ranges, other.R, spread=spread)
        assert x.mean == pytest.approx(other.x, rel=1e-9, abs=1e-9)
        assert x.covariance == pytest.approx(other.P, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("sigma", [2.0, 6.0, 15.0])
def test_transform_of_a_range_is_that_of_monte_carlo(sigma):
    x = Gaussian(np.array([60.0, 40.0, 0.0]), sigma * np.eye(3))
    platform = np.array([0.0, 0.0, 20.0])
    drawn = range_to(
        x.mean + sigma * np.random.default_rng(6).standard_normal((400_000, 3)), platform
    )
    image = transform(x, lambda p: range_to(p, platform)[..., None])
    assert image.mean[0] == pytest.approx(drawn.mean(), rel=0.002)
    assert image.factor[0, 0] ** 2 == pytest.approx(drawn.var(), rel=0.07)
    linear = range_to(x.mean, platform)
    if sigma > 5.0:
        assert abs(image.mean[0] - drawn.mean()) < 0.1 * abs(linear - drawn.mean())


def test_transform_of_a_square_is_exact():
    for spread in (Spread(), Spread(0.1, 2.0, 0.0)):
        image = transform(Gaussian(np.array([3.0]), np.array([[2.0]])), np.square, spread)
        assert image.mean[0] == pytest.approx(9.0 + 4.0)
        assert image.covariance[0, 0] == pytest.approx(4.0 * 9.0 * 4.0 + 2.0 * 16.0)


def test_stack_is_filtered_like_each_alone():
    rng = np.random.default_rng(7)
    means = rng.normal(30.0, 3.0, (5, 2, 4))
    factors = np.linalg.cholesky(np.stack([covariance(rng, 4) for _ in range(10)])).reshape(
        5, 2, 4, 4
    )
    z = rng.normal(50.0, 5.0, (5, 2, 3))
    z[2, 1, 0], z[3, 0] = np.nan, np.nan
    together, seen = update(
        predict(Gaussian(means, factors), turn, np.eye(4)), z, ranges, np.eye(3)
    )
    for at in np.ndindex(5, 2):
        one, alone = update(
            predict(Gaussian(means[at], factors[at]), turn, np.eye(4)), z[at], ranges, np.eye(3)
        )
        assert together.mean[at] == pytest.approx(one.mean, rel=1e-12)
        assert together.factor[at] == pytest.approx(one.factor, rel=1e-9, abs=1e-12)
        assert seen.residual[at] == pytest.approx(alone.residual, nan_ok=True)


def test_nothing_observed_changes_nothing():
    x = Gaussian(np.array([1.0, 2.0]), np.array([[2.0, 0.0], [1.0, 3.0]]))
    after, seen = update(x, [np.nan, np.nan], lambda p: p, np.eye(2))
    assert after.mean.tolist() == x.mean.tolist()
    assert after.covariance == pytest.approx(x.covariance)
    assert np.isnan(seen.weight).all()
    assert np.isnan(seen.nis).all()


def test_inputs_are_left_as_they_were():
    x = Gaussian(np.array([30.0, 40.0]), np.diag([3.0, 3.0]))
    kept = x.mean.copy(), x.factor.copy()
    update(predict(x, lambda p: p, np.eye(2)), [50.0, np.nan], lambda p: p, np.eye(2))
    assert (x.mean == kept[0]).all()
    assert (x.factor == kept[1]).all()


@pytest.mark.parametrize("ratio", [1e-12, 1e-6, 1e6, 1e12])
def test_covariance_survives_extreme_ratios(ratio):
    """A range of variance ``ratio`` from a state that is known along one line only."""
    x = Gaussian(np.array([30.0, 40.0]), np.diag([1e6, 1e-6]))
    for k in range(200):
        z = np.array([50.0 + 0.001 * k])
        x, _ = update(
            predict(x, lambda p: p, 1e-12 * np.eye(2)),
            z,
            lambda p: np.hypot(p[..., :1], p[..., 1:]),
            [[ratio]],
        )
        values = np.linalg.eigvalsh(x.covariance)
        assert np.isfinite(x.mean).all()
        assert values[0] >= -1e-15 * values[1]


def test_angles_are_compared_across_the_seam():
    def bearing(p):
        return np.arctan2(p[..., 1:2], p[..., :1])

    def wrapped(a, b):
        return np.angle(np.exp(1j * (a - b)))

    x = Gaussian(np.array([-50.0, 0.5]), np.eye(2))
    after, seen = update(x, [-np.pi + 0.05], bearing, [[1e-4]], difference=wrapped)
    assert abs(seen.residual[0]) < 0.1
    assert after.mean[1] == pytest.approx(
        0.5 - 0.8 * 3.0,
        abs=0.05,  # variance 1 against (50 · 0.01)²
    )
    wrong, _ = update(x, [-np.pi + 0.05], bearing, [[1e-4]])
    assert abs(wrong.mean[1] + 1.9) > 1.0


@pytest.mark.parametrize("sigma", [0.3, 1.0, 3.0])
def test_nees_lies_within_its_bounds(sigma):
    """Eighty runs at once; at one epoch they are independent."""
    rng, runs = np.random.default_rng(8), 80
    P, Q = np.diag([9.0, 9.0, 0.01, 0.04]), np.diag([0.05, 0.05, 1e-4, 1e-3])
    truth = np.array([40.0, 20.0, 0.5, 1.0]) + rng.standard_normal((runs, 4)) @ np.sqrt(P)
    x = Gaussian(
        np.broadcast_to([40.0, 20.0, 0.5, 1.0], (runs, 4)),
        np.broadcast_to(np.sqrt(P), (runs, 4, 4)),
    )
    for k in range(1, 61):
        truth = turn(truth) + rng.standard_normal((runs, 4)) @ np.sqrt(Q)
        z = ranges(truth) + sigma * rng.standard_normal((runs, 3))
        z[rng.random(z.shape) < 0.2] = np.nan
        x, _ = update(predict(x, turn, Q), z, ranges, sigma**2 * np.eye(3))
        if k in (10, 35, 60):
            nees = normalised_squares(x.mean - truth, x.factor @ x.factor.mT)
            low, high = mean_bounds(4, runs, 0.999)
            assert low < nees.mean() < high


def test_thresholds_are_the_loss_igg1():
    """Full weight, ``T₁/d``, prediction only: by hand, on one component."""
    loss, x = loss_named("igg1", k0=1.5, k1=4.5), Gaussian(np.zeros(1), np.eye(1))
    for d in (1.0, 2.0, 4.4, 4.6, 50.0):
        z = np.array([d * np.sqrt(5.0)])
        after, seen = update(x, z, lambda p: p, [[4.0]], loss=loss)
        weight = robust_weights.igg1(np.array([d]), 1.5, 4.5)[0]
        assert seen.sigma[0] == pytest.approx(d)
        assert seen.weight[0] == pytest.approx(weight)
        expected = z[0] / (1.0 + 4.0 / weight) if weight > 0.0 else 0.0
        assert after.mean[0] == pytest.approx(expected)
        assert after.covariance[0, 0] == pytest.approx(
            1.0 - (weight > 0) / (1.0 + 4.0 / max(weight, 1e-9))
        )


def test_weights_keep_the_correlation_of_the_noise():
    rng = np.random.default_rng(9)
    R, P = covariance(rng, 3), covariance(rng, 3)
    z, loss = np.array([0.1, 6.0, -0.2]), loss_named("huber", k0=1.5)
    after, seen = update(Gaussian(np.zeros(3), np.linalg.cholesky(P)), z, lambda p: p, R, loss=loss)
    inflated = robust_weights.bifactor(R, seen.weight)
    mean, covariance_after = kalman.update(np.zeros(3), P, z, np.eye(3), inflated)[:2]
    assert seen.weight.min() < 1.0
    assert after.mean == pytest.approx(mean)
    assert after.covariance == pytest.approx(covariance_after)


@pytest.mark.parametrize(
    "call",
    [
        lambda x: predict(x, lambda p: p, -np.eye(2)),
        lambda x: predict(x, lambda p: p, np.eye(2), Spread(2.0, 2.0, 0.0)),
        lambda x: predict(x, lambda p: p, np.eye(2), Spread(1.0, 2.0, -2.0)),
        lambda x: update(x, [0.0, 0.0], lambda p: p, np.diag([1.0, 0.0])),
        lambda x: update(x, [0.0, 0.0], lambda p: p, [[np.nan, 0.0], [0.0, 1.0]]),
        lambda x: update(x, [0.0, 0.0], lambda p: p, np.eye(2), loss=loss_named("student-t")),
    ],
)
def test_bad_options_are_refused(call):
    with pytest.raises(OptionsError):
        call(Gaussian(np.zeros(2), np.eye(2)))


def test_process_noise_may_be_singular():
    x = predict(Gaussian(np.zeros(2), np.eye(2)), lambda p: p, np.diag([4.0, 0.0]))
    assert x.covariance == pytest.approx(np.diag([5.0, 1.0]))
