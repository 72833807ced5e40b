"""The heading that turns a velocity: between those beside it, whatever single ones say."""

import numpy as np
import pytest

from surefix.pipelines.azimuth import azimuth_at, settled
from surefix.pipelines.turning import Angles


def course(time):
    """A turn to and fro through north, rad."""
    return np.radians(40.0) * np.sin(np.asarray(time) / 6.0)


def known(time, wild=()):
    heading = course(time) % (2.0 * np.pi)
    heading[list(wild)] = (heading[list(wild)] + 1.5) % (2.0 * np.pi)
    return Angles(np.asarray(time, dtype=float), heading)


def off(turning, time):
    return np.abs(np.angle(np.exp(1j * (azimuth_at(turning, np.asarray(time)) - course(time)))))


@pytest.mark.parametrize("interval", [0.05, 0.2, 0.5])
def test_the_heading_of_a_velocity_is_that_at_its_time(interval):
    time = np.arange(0.0, 60.0, interval)
    times = np.random.default_rng(1).uniform(0.0, time[-1], 500)
    assert off(known(time), times).max() < np.radians(0.6)


@pytest.mark.parametrize("interval", [0.05, 0.2])
def test_wrong_headings_for_less_than_a_second_do_nothing(interval):
    time = np.arange(0.0, 60.0, interval)
    wild = np.flatnonzero((time > 30.0) & (time < 30.85))
    times = np.arange(20.0, 40.0, 0.1)
    assert off(known(time, wild), times).max() < np.radians(7.0)  # it turns by 7°/s at most


def test_a_gap_is_bridged_for_two_seconds_or_where_both_ends_are_near():
    time = np.concatenate([np.arange(0.0, 20.0, 0.2), np.arange(35.0, 50.0, 0.2)])
    turning = known(time)
    lost = np.isnan(azimuth_at(turning, np.array([-0.1, 19.9, 21.7, 21.9, 34.9, 35.1, 51.7, 51.9])))
    assert lost.tolist() == [True, False, False, True, True, False, False, True]
    near = known(np.concatenate([np.arange(0.0, 20.0, 0.2), np.arange(29.7, 50.0, 0.2)]))
    assert np.isfinite(azimuth_at(near, np.arange(20.0, 29.0))).all()
    assert np.isnan(azimuth_at(Angles(), np.array([1.0]))).all()


@pytest.mark.parametrize("seed", range(3))
def test_what_is_settled_stays(seed):
    """Up to there the headings that follow change nothing."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.choice([0.1, 0.3, 1.0, 12.0], 200, p=[0.5, 0.3, 0.15, 0.05]))
    whole = known(time)
    for n in (17, 60, 150):
        part = Angles(time[:n], whole.angle[:n])
        times = np.linspace(time[0], settled(part), 50)
        np.testing.assert_array_equal(azimuth_at(part, times), azimuth_at(whole, times))
