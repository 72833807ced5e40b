"""Checks before any cleaning, and the thresholds that follow from what a ship can do."""

import numpy as np
import pytest

from surefix.cleaning.plausibility import Bounds, Check, plausibility
from surefix.cleaning.thresholds import position_thresholds, rate_threshold, spacing
from surefix.errors import OptionsError
from surefix.geo.local_frame import LocalFrame

SECONDS = np.arange(12.0)


def test_each_check_has_its_code():
    x = np.array([1.0, np.nan, 2.0, 3.0, 99.0, 4.0, 5.0, 12.0, 6.0, 6.0, 6.0, 6.0])
    valid = np.ones(12, np.bool_)
    valid[3] = False
    bounds = Bounds(lower=0.0, upper=50.0, rate=3.0, frozen=2)
    found = plausibility(x, SECONDS, bounds, valid=valid)
    wanted = [0, Check.MISSING, 0, Check.INVALID, Check.RANGE, 0, 0, Check.RATE, 0, 0]
    assert found.tolist() == [*wanted, Check.FROZEN, Check.FROZEN]


def test_without_bounds_everything_passes():
    x = np.random.default_rng(0).normal(0.0, 1e9, 12)
    assert not plausibility(x, SECONDS, Bounds()).any()


@pytest.mark.parametrize("rate", [0.5, 2.0, 7.0])
def test_a_sensor_that_stays_where_it_jumped_to_is_believed_when_it_can_be_there(rate):
    x = np.zeros(200)
    x[50:] = 30.0
    found = plausibility(x, np.arange(200.0), Bounds(rate=rate, slack=1.0))
    first = 50 + int(np.ceil((30.0 - 1.0) / rate)) - 1
    np.testing.assert_array_equal(
        found == Check.RATE, (np.arange(200) >= 50) & (np.arange(200) < first)
    )


def test_bursts_of_any_length_are_refused_as_long_as_the_rate_forbids_them():
    for length in (1, 2, 3, 5, 10):
        x = np.zeros(60)
        x[30 : 30 + length] = 50.0
        found = plausibility(x, np.arange(60.0), Bounds(rate=4.0))
        np.testing.assert_array_equal(found == Check.RATE, x == 50.0)


def test_headings_turn_through_north():
    x = np.mod(np.arange(350.0, 374.0, 2.0), 360.0)
    assert not plausibility(x, SECONDS, Bounds(rate=3.0), period=360.0).any()
    assert plausibility(x, SECONDS, Bounds(rate=3.0)).any()


def test_unknown_times_are_not_tested_for_the_rate():
    t = SECONDS.copy()
    t[5], t[8] = np.nan, t[7]
    x = np.zeros(12)
    x[[5, 8]] = 40.0
    found = plausibility(x, t, Bounds(rate=1.0))
    assert found[5] == found[8] == Check.PASSED


def test_bounds_that_contradict_themselves_are_refused():
    for wrong in ({"lower": 2.0, "upper": 1.0}, {"rate": -1.0}, {"slack": np.nan}, {"frozen": -1}):
        with pytest.raises(OptionsError):
            Bounds(**wrong)


def test_spacing_is_that_to_the_farther_neighbour():
    assert spacing([0.0, 1.0, 3.0, np.nan, 9.0]).tolist() == [1.0, 2.0, 2.0, 1.5, 1.5]
    assert spacing([4.0, 4.0, 5.0]).tolist() == [1.0, 1.0, 1.0]
    assert np.isnan(spacing([1.0])).all()
    assert np.isnan(spacing([np.nan, np.nan])).all()
    np.testing.assert_allclose(rate_threshold([0.0, 2.0, 4.0], 3.0), 6.0)


@pytest.mark.parametrize("latitude", [0.0, 38.4, -60.0, 80.0])
def test_a_second_at_full_speed_is_as_far_as_the_ellipsoid_says(latitude):
    speed = 15.0
    phi = np.radians([latitude, latitude])
    north, east = position_thresholds([0.0, 1.0], phi, speed)
    x, y, _ = LocalFrame(latitude, 5.0).to_local(
        [latitude + np.degrees(north[0]), latitude], [5.0, 5.0 + np.degrees(east[0])]
    )
    assert y[0] == pytest.approx(speed, rel=1e-5)
    assert x[1] == pytest.approx(speed, rel=1e-5)


def test_thresholds_at_a_pole_and_without_latitude():
    north, east = position_thresholds([0.0, 1.0], np.radians([90.0, np.nan]), 15.0)
    assert np.isfinite(north).all()
    assert (east <= np.pi).all()
    north, _ = position_thresholds([0.0, 1.0], [np.nan, np.nan], 15.0)
    assert np.isnan(north).all()
