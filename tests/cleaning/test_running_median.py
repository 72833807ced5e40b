"""The running median is the median of the sorted window, whatever comes and goes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import median_filter

from reference import running_median as textbook
from surefix.cleaning.running_median import middle, push, running_median, sorted_window
from surefix.errors import OptionsError
from surefix.jit import kernel

samples = st.lists(
    st.one_of(st.just(np.nan), st.floats(-1e9, 1e9), st.integers(-3, 3).map(float)), max_size=60
)


@given(samples, st.integers(1, 20), st.booleans())
@settings(max_examples=300, deadline=None)
def test_any_series_and_window(values, window, centred):
    series = np.array(values, dtype=float)
    np.testing.assert_allclose(
        running_median(series, window, centred=centred),
        textbook.running_median(series, window, centred=centred),
        rtol=1e-12,
    )


@pytest.mark.parametrize("window", [1, 2, 3, 8, 39, 40, 400])
@pytest.mark.parametrize("missing", [0.0, 0.3, 0.95])
def test_long_series_with_ties_and_gaps(window, missing):
    rng = np.random.default_rng(window)
    series = np.round(rng.standard_normal(500), 1)
    series[rng.uniform(size=500) < missing] = np.nan
    for centred in (True, False):
        np.testing.assert_array_equal(
            running_median(series, window, centred=centred),
            textbook.running_median(series, window, centred=centred),
        )


@pytest.mark.parametrize("window", [3, 39, 301])
def test_inside_the_series_it_is_scipys(window):
    series = np.random.default_rng(3).standard_normal(1000)
    inside = slice(window, -window)
    expected = median_filter(series, window)[inside]
    np.testing.assert_array_equal(running_median(series, window)[inside], expected)


def test_sorted_and_reversed_series_are_no_worst_case_for_the_order():
    up = np.arange(200.0)
    for series in (up, up[::-1].copy()):
        np.testing.assert_array_equal(running_median(series, 7)[3:-3], series[3:-3])


def test_columns_are_independent_and_the_input_is_untouched():
    series = np.random.default_rng(5).standard_normal((50, 3))
    series[10, 1] = np.nan
    before = series.copy()
    both = running_median(series, 5)
    np.testing.assert_array_equal(series, before)
    for i in range(3):
        np.testing.assert_array_equal(both[:, i], running_median(series[:, i], 5))


def test_all_missing_is_missing_and_nothing_gives_nothing():
    assert np.isnan(running_median([np.nan] * 4, 3)).all()
    assert running_median([], 3).shape == (0,)


def test_infinities_are_values():
    series = [1.0, np.inf, 2.0, -np.inf, 3.0]
    assert running_median(series, 3, centred=False).tolist() == [1.0, np.inf, 2.0, 2.0, 2.0]


def test_less_than_half_wild_samples_do_not_move_it():
    rng = np.random.default_rng(8)
    series = rng.uniform(-1.0, 1.0, 400)
    for start in range(20, 380, 40):
        series[start : start + 19] = 1e6
    assert np.abs(running_median(series, 39)).max() <= 1.0


@kernel
def one_step(window, value):
    push(window, value)
    return middle(window)


def test_sample_by_sample_is_the_series_at_once():
    series = np.random.default_rng(9).standard_normal(80)
    series[30:36] = np.nan
    window = sorted_window(9)
    medians = []
    for value in series[:40]:
        medians.append(one_step(window, value))
    copy = window.copy()
    for value in series[40:]:
        medians.append(one_step(window, value))
    np.testing.assert_array_equal(medians, running_median(series, 9, centred=False))
    again = [one_step(copy, value) for value in series[40:]]
    np.testing.assert_array_equal(again, medians[40:])


@pytest.mark.parametrize("window", [0, -3])
def test_no_window_is_refused(window):
    with pytest.raises(OptionsError, match="from 1"):
        running_median([1.0], window)
    with pytest.raises(OptionsError, match="from 1"):
        sorted_window(window)
