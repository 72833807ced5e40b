"""White noise that stands for rounding, against what rounding does to a track."""

import numpy as np
import pytest
from scipy.signal import lfilter

from surefix.filters.rounding import rounding_noise

N = 400_000


@pytest.mark.parametrize("change", [0.02, 0.1, 0.6])
@pytest.mark.parametrize("noise", [0.0, 0.15, 0.5])
@pytest.mark.parametrize("weight", [2.0, 30.0])
def test_it_does_to_a_track_what_rounding_does(change, noise, weight):
    """Errors summed up and forgotten over the time for which a track follows velocities."""
    digit, interval = 0.05, 0.5
    rng = np.random.default_rng(3)
    truth = np.cumsum(change * digit * rng.standard_normal(N))
    told = digit * np.round((truth + noise * digit * rng.standard_normal(N)) / digit)
    sigma = rounding_noise(digit, change * digit, interval, weight * digit, noise * digit)
    span = weight * digit / (sigma * interval**1.5)
    keep = np.exp(-1.0 / span)
    error = lfilter([1.0], [1.0, -keep], told - truth)
    assert np.sqrt(error.var() * (1.0 - keep**2)) == pytest.approx(sigma, rel=0.08)


def test_what_hardly_changes_is_off_for_as_long_as_it_is_followed():
    """So σ grows with the third root of that time, as follows from its definition."""
    one, eight = (rounding_noise(0.05, 0.0, 1.0, weight) for weight in (5.0, 40.0))
    assert eight / one == pytest.approx(2.0, rel=0.02)


def test_without_digits_it_is_the_noise():
    assert rounding_noise(0.0, 1.0, 1.0, 1.0, 0.3) == 0.3
    assert rounding_noise(1e-6, 0.01, 1.0, 1.0, 0.3) == pytest.approx(0.3)
