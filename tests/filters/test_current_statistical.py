"""The current statistical filter: its twin, the steps of the Kalman filter, and its manners."""

import numpy as np
import pytest

from reference import singer as textbook
from surefix.errors import OptionsError
from surefix.filters import kalman
from surefix.filters.current_statistical import CurrentState, filter_current, start_current
from surefix.models.singer import rayleigh_variance, singer

DT, ALPHA, HIGHEST, SIGMA = 0.5, 0.05, 15.0, 10.0


def flight(seed, n=400):
    """A straight leg, then 2 m/s²; positions and measurements of one axis."""
    t = DT * np.arange(n)
    truth = 100.0 * t + np.maximum(t - 100.0, 0.0) ** 2
    return truth, truth + SIGMA * np.random.default_rng(seed).standard_normal(n)


def begin():
    mean = np.array([[0.0, 100.0, 0.0]])
    return CurrentState(mean, np.diag([10.0, 10.0, 5.0])[None])


@pytest.mark.parametrize("alpha", [1e-4, 0.05, 3.0])
def test_kernel_is_its_twin(alpha):
    _, z = flight(1)
    z[50:60] = np.nan
    _, mean, covariance = filter_current(singer(alpha, DT), HIGHEST, z[:, None], 100.0, begin())
    m, P = textbook.current_statistical(
        z, 100.0, alpha, DT, HIGHEST, [0.0, 100.0, 0.0], np.diag([100.0, 100.0, 25.0])
    )
    np.testing.assert_allclose(mean[:, 0], m, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(covariance[:, 0], P, rtol=1e-7, atol=1e-9)


def test_it_is_the_steps_of_the_kalman_filter():
    _, z = flight(2, 60)
    model = singer(ALPHA, DT)
    _, mean, covariance = filter_current(model, HIGHEST, z[:, None], 100.0, begin())
    x = kalman.gaussian([0.0, 100.0, 0.0], np.diag([100.0, 100.0, 25.0]))
    for k, observed in enumerate(z):
        a = x.mean[2]
        Q = 2.0 * ALPHA * rayleigh_variance(a, HIGHEST) * model.noise
        x = kalman.predict(x, model.transition, Q)
        x = x._replace(mean=x.mean + model.mean_input * a)
        x, _ = kalman.update(x, [observed], [[1.0, 0.0, 0.0]], [[100.0]])
        np.testing.assert_allclose(mean[k, 0], x.mean, rtol=1e-9)
        np.testing.assert_allclose(covariance[k, 0], x.covariance, rtol=1e-7)


def test_parts_of_a_series_give_the_same_bits_and_axes_are_independent():
    z = np.column_stack([flight(3)[1], -flight(4)[1]])
    before = z.copy()
    model = singer(ALPHA, DT)
    _, mean, _ = filter_current(model, HIGHEST, z, 100.0)
    state, one, _ = filter_current(model, HIGHEST, z[:150], 100.0)
    _, two, _ = filter_current(model, HIGHEST, z[150:], 100.0, state)
    np.testing.assert_array_equal(np.concatenate([one, two]), mean)
    np.testing.assert_array_equal(
        filter_current(model, HIGHEST, z[:, 1:], 100.0)[1][:, 0], mean[:, 1]
    )
    np.testing.assert_array_equal(z, before)


def test_it_follows_a_manoeuvre_and_a_burst_alike():
    for seed in range(5):
        truth, z = flight(seed)
        model = singer(ALPHA, DT)
        off = filter_current(model, HIGHEST, z[:, None], 100.0)[1][:, 0, 0] - truth
        assert np.sqrt(np.mean(off[230:] ** 2)) < SIGMA
        z[150:165] += 300.0
        off = filter_current(model, HIGHEST, z[:, None], 100.0)[1][:, 0, 0] - truth
        assert np.abs(off[150:165]).max() > 250.0


def test_its_covariance_is_cautious_on_a_straight_leg():
    squares = []
    for seed in range(30):
        truth, z = flight(seed, 150)
        _, mean, covariance = filter_current(singer(ALPHA, DT), HIGHEST, z[:, None], SIGMA**2)
        squares.append((mean[100:, 0, 0] - truth[100:]) ** 2 / covariance[100:, 0, 0, 0])
    assert 0.4 < np.mean(squares) < 1.0


def test_nothing_observed_leaves_the_start():
    state, mean, covariance = filter_current(
        singer(ALPHA, DT), HIGHEST, np.full((5, 1), np.nan), 1.0, start_current(1, HIGHEST)
    )
    assert (mean == 0.0).all()
    assert np.diff(covariance[:, 0, 0, 0]).min() > 0.0
    assert state.factor.shape == (1, 3, 3)


@pytest.mark.parametrize("highest", [0.0, -1.0, np.nan, np.inf])
def test_an_acceleration_that_cannot_be_is_refused(highest):
    with pytest.raises(OptionsError, match="positive"):
        filter_current(singer(ALPHA, DT), highest, np.zeros((3, 1)), 1.0)
