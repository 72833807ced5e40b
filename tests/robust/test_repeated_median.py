"""The repeated-median line: the textbook's, and half of the samples may be wild."""

import numpy as np
import pytest

from reference import repeated_median as textbook
from surefix.robust.repeated_median import repeated_median


@pytest.mark.parametrize("n", [1, 2, 3, 6, 7, 20, 39])
@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_it_is_the_textbooks(n, missing):
    rng = np.random.default_rng(n)
    for _ in range(20):
        y = np.round(rng.standard_normal(n), 1)
        y[rng.uniform(size=n) < missing] = np.nan
        np.testing.assert_allclose(repeated_median(y), textbook.repeated_median(y), atol=1e-12)


def test_an_exact_line_is_found_with_nearly_half_of_the_samples_wild():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        y = 7.0 - 2.5 * np.arange(39.0)
        wild = rng.permutation(39)[:18]
        y[wild] += rng.uniform(100.0, 1e6, 18)
        level, slope = repeated_median(y)
        assert slope == pytest.approx(-2.5, abs=1e-9)
        assert level == pytest.approx(7.0 - 2.5 * 38, abs=1e-6)


def test_more_than_half_wild_breaks_it():
    y = np.arange(39.0)
    y[15:] += 1000.0
    assert abs(repeated_median(y)[0] - 38.0) > 100.0


def test_missing_samples_only():
    assert np.isnan(repeated_median([np.nan, np.nan])).all()
    assert np.isnan(repeated_median([])).all()
