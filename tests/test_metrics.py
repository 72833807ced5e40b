import numpy as np
import pytest

from surefix.metrics import (
    mean_bounds,
    normalised_squares,
    rejection_rates,
    rmse,
)


def sample(runs, seed=7):
    rng = np.random.default_rng(seed)
    covariance = np.asarray([[4.0, 1.2, 0.0], [1.2, 1.0, -0.2], [0.0, -0.2, 0.5]])
    return rng.multivariate_normal(np.zeros(3), covariance, runs), covariance


def test_rmse_is_per_axis_and_leaves_out_what_is_missing():
    error = np.asarray([[1.0, np.nan, np.nan], [-1.0, 2.0, np.nan], [1.0, -2.0, np.nan]])
    assert rmse(error) == pytest.approx([1.0, 2.0, np.nan], nan_ok=True)
    assert np.isnan(rmse(np.empty((0, 2)))).all()


def test_honest_covariance_has_its_mean_squares_within_bounds():
    error, covariance = sample(2000)
    low, high = mean_bounds(3, 2000, 0.999)
    squares = normalised_squares(error, np.broadcast_to(covariance, (2000, 3, 3)))
    assert low < squares.mean() < high
    assert squares[0] == pytest.approx(error[0] @ np.linalg.inv(covariance) @ error[0])
    assert normalised_squares(error[0], covariance) == pytest.approx(squares[0])


def test_a_boastful_covariance_falls_out_of_the_bounds():
    error, covariance = sample(2000)
    assert normalised_squares(error, 0.7 * covariance).mean() > mean_bounds(3, 2000, 0.999)[1]
    assert normalised_squares(error, 1.3 * covariance).mean() < mean_bounds(3, 2000, 0.999)[0]


def test_bounds_close_in_with_the_number_of_runs():
    one, many = mean_bounds(2, 1), mean_bounds(2, 1000)
    assert one[0] < many[0] < 2.0 < many[1] < one[1]
    # 50 runs of four states: tables give 162.7 … 241.1 for χ² with 200 degrees of freedom
    assert mean_bounds(4, 50) == pytest.approx((3.25, 4.82), abs=0.01)


def test_rejection_rates():
    rejected = np.asarray([True, False, True, False, False, False])
    gross = np.asarray([True, True, False, False, False, False])
    assert rejection_rates(rejected, gross) == (0.5, 0.25)
    assert np.isnan(rejection_rates(rejected, np.zeros(6, dtype=bool)).detected)
    assert np.isnan(rejection_rates(rejected, np.ones(6, dtype=bool)).false_alarms)
