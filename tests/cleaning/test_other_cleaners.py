"""Hampel, least squares and Lagrange against plain NumPy and SciPy."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from reference import ship_cleaning as twin
from surefix.cleaning.hampel import MAD_TO_SIGMA, hampel, rolling_scale
from surefix.cleaning.lagrange import lagrange
from surefix.cleaning.least_squares import five_point_cubic, sliding_least_squares
from surefix.cleaning.replacement import continued, reduced
from surefix.errors import OptionsError


def series(seed, n=150, missing=0.0):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=n).cumsum() + 100.0
    at = rng.random(n) < 0.1
    x[at] += rng.normal(0.0, 40.0, at.sum())
    x[rng.random(n) < missing] = np.nan
    return x


@pytest.mark.parametrize("window", [3, 5, 11, 61])
@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_hampel_is_that_of_sorted_windows(window, causal, missing):
    x = series(window, missing=missing)
    before, after = (window - 1, 0) if causal else (window // 2, window // 2)
    for n_sigma, floor in ((3.0, 0.0), (1.0, 0.0), (2.0, 1.5)):
        found = hampel(x, window=window, n_sigma=n_sigma, floor=floor, causal=causal)
        wanted = twin.hampel(x, before, after, n_sigma, floor)
        np.testing.assert_allclose(found.value, wanted, atol=1e-12)


def test_hampel_on_equal_values_and_angles():
    flat = np.zeros(40)
    flat[20] = 1.0
    assert hampel(flat, floor=0.0).replaced.sum() == 1
    assert not hampel(flat, floor=1.0).replaced.any()
    north = np.tile([359.0, 0.5, 1.0], 20)
    north[30] = 120.0
    found = hampel(north, n_sigma=5.0, period=360.0)
    np.testing.assert_array_equal(np.flatnonzero(found.replaced), [30])


def test_false_alarms_of_hampel_on_white_noise_are_few():
    for seed in range(3):
        x = np.random.default_rng(seed).normal(size=20_000)
        assert 0.001 < hampel(x, window=61).replaced.mean() < 0.006  # 0.27 % for a known σ


def test_rolling_scale_of_normal_noise_is_its_standard_deviation():
    for seed, sigma in ((0, 0.3), (1, 5.0)):
        x = np.random.default_rng(seed).normal(0.0, sigma, 20_000)
        assert rolling_scale(x, 501, centred=True).mean() == pytest.approx(sigma, rel=0.03)
    assert pytest.approx(1.0 / 0.6744897501960817, rel=1e-12) == MAD_TO_SIGMA


@pytest.mark.parametrize("window", [5, 11, 21])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_equal_weights_are_the_filter_of_savitzky_and_golay(window, degree):
    x = series(degree)
    found = sliding_least_squares(x, window=window, degree=degree, weighted=False).value
    np.testing.assert_allclose(found, savgol_filter(x, window, degree, mode="interp"), atol=1e-9)


@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_weighted_fit_is_that_of_numpy(missing):
    x = series(4, missing=missing)
    u = np.arange(-5, 6) / 6.0
    for degree in range(4):
        found = sliding_least_squares(x, degree=degree).value
        wanted = twin.polynomial(x, (1.0 - np.abs(u) ** 3) ** 3, degree)
        np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_five_point_cubic_has_its_coefficients():
    for at, row in (
        (2, [-3, 12, 17, 12, -3]),
        (0, [34.5, 2, -3, 2, -0.5]),
        (1, [2, 27, 12, -8, 2]),
    ):
        for i, coefficient in enumerate(row):
            x = np.zeros(5)
            x[i] = 35.0
            assert five_point_cubic(x).value[at] == pytest.approx(coefficient, abs=1e-9)


def test_smoothers_keep_a_cubic_and_do_not_remove_an_outlier():
    t = np.linspace(-1.0, 1.0, 50)
    cubic = 3.0 - t + 2.0 * t**2 + 4.0 * t**3
    np.testing.assert_allclose(five_point_cubic(cubic).value, cubic, atol=1e-9)
    wild = cubic.copy()
    wild[25] += 100.0
    assert five_point_cubic(wild).value[25] - cubic[25] == pytest.approx(1700.0 / 35.0)
    assert five_point_cubic([1.0, np.nan]).value.tolist()[0] == 1.0
    turning = np.mod(np.linspace(300.0, 420.0, 40), 360.0)
    np.testing.assert_allclose(five_point_cubic(turning, period=360.0).value, turning, atol=1e-9)


@pytest.mark.parametrize("points", [1, 2, 3, 4])
@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_lagrange_is_that_of_exact_fits(points, missing):
    x = series(points, missing=missing)
    t = np.cumsum(np.random.default_rng(9).uniform(0.5, 2.0, len(x)))
    limit = np.full(len(x), 8.0)
    found = lagrange(x, t, limit, points=points, patience=4)
    assert found.replaced.any()
    np.testing.assert_allclose(found.value, twin.lagrange(x, t, limit, points, 4), rtol=1e-9)


def test_lagrange_begins_anew_after_its_patience():
    x = np.zeros(40)
    x[20:] = 100.0
    found = lagrange(x, np.arange(40.0), 5.0, patience=5)
    np.testing.assert_array_equal(np.flatnonzero(found.replaced), np.arange(20, 25))


def test_lagrange_leaves_out_what_has_no_time():
    t = np.arange(20.0)
    t[[6, 9]] = [np.nan, 8.0]
    x = np.arange(20.0)
    x[[6, 9]] = 500.0
    found = lagrange(x, t, 1.0)
    assert not found.replaced.any()
    np.testing.assert_array_equal(found.value, x)


def test_angles_are_continued_after_a_median():
    x = np.array([350.0, 355.0, 180.0, 170.0, 5.0, 10.0, np.nan, 20.0])
    turned, recent = continued(x, 360.0)
    np.testing.assert_array_equal(turned[[0, 4, 5, 7]], [350.0, 365.0, 370.0, 380.0])
    again, _ = continued(np.array([30.0]), 360.0, recent)
    assert again[0] == 390.0
    np.testing.assert_array_equal(reduced(np.array([370.0, -10.0]), 360.0), [10.0, 350.0])


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: hampel([1.0], window=4),
        lambda: hampel([1.0], window=1),
        lambda: hampel([1.0], n_sigma=-1.0),
        lambda: hampel([1.0], floor=np.nan),
        lambda: sliding_least_squares([1.0], window=4),
        lambda: sliding_least_squares([1.0], degree=4),
        lambda: sliding_least_squares([1.0], window=1, degree=1),
        lambda: lagrange([1.0], [0.0], 1.0, points=0),
        lambda: lagrange([1.0], [0.0], 1.0, patience=-1),
    ],
)
def test_wrong_options_are_refused(wrong):
    with pytest.raises(OptionsError):
        wrong()


def test_empty_series():
    nothing = np.empty(0)
    for found in (hampel(nothing), five_point_cubic(nothing), lagrange(nothing, nothing, 1.0)):
        assert found.value.size == 0
