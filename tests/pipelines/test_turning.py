"""Lever arms: what a heading says of antennas, and what is said without one."""

import numpy as np
import pytest

from surefix.pipelines.turning import Angles, Turning, arms_at, reached, turned
from surefix.types import Channel

ARM = np.array([30.0, -5.0, 12.0])  # forward, starboard, up
SIGMA, TILT = np.radians(1.0), np.radians(0.5)


def course(time):
    """A turn through north, rad."""
    return 6.1 + 0.05 * time + 0.2 * np.sin(time / 7.0)


def headings(time, value):
    return Channel("heading_deg", "gyro", time, np.degrees(value) % 360.0, 360.0)


def place(time):
    """East and north of the antenna from the reference point, by a rotation matrix."""
    bow = course(time)
    turn = np.array([[np.sin(bow), np.cos(bow)], [np.cos(bow), -np.sin(bow)]])
    return turn @ ARM[:2]


@pytest.mark.parametrize("step", [0.1, 1.0])
def test_the_offset_is_that_of_the_heading_at_the_time_of_the_fix(step):
    time = np.arange(0.0, 60.0, step)
    turning = turned(Turning(), [headings(time, course(time))], 0.0)
    at = np.linspace(3.0, 50.0, 40)
    lever = arms_at([turning], at, np.tile(ARM, (40, 1)), SIGMA, TILT)
    np.testing.assert_allclose(lever[:, :2], [place(t) for t in at], atol=0.02)
    np.testing.assert_allclose(lever[:, 2], 12.0)
    swing = [(place(t + 1e-3) - place(t - 1e-3)) / 2e-3 for t in at]
    np.testing.assert_allclose(lever[:, 3:5], swing, atol=0.03)
    np.testing.assert_allclose(lever[:, 5], 0.0)
    # The offset is uncertain across the arm: by the heading's σ times its length
    sigma = np.hypot(lever[:, 6], lever[:, 7])
    length = np.hypot(30.0, 5.0)
    assert np.all(sigma >= 0.999 * length * SIGMA)
    assert np.all(sigma <= length * np.hypot(SIGMA, np.radians(1.0) * step) * 1.001)


def test_the_uncertainty_is_what_headings_of_that_noise_do():
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 6000.0, 0.2)
    still = np.full(len(time), 0.7)
    sigma = np.radians(1.5)
    # What a compass is wrong by lasts: one error over each minute
    wrong = np.repeat(rng.normal(0.0, sigma, 100), 300)
    turning = Turning(Angles(time, still + wrong))
    at = np.arange(30.0, 6000.0, 60.0)
    lever = arms_at([turning], at, np.tile(ARM, (100, 1)), sigma, TILT)
    right = arms_at([Turning(Angles(time, still))], at, np.tile(ARM, (100, 1)), sigma, TILT)
    z = (lever[:, :2] - right[:, :2]) / lever[:, 6:8]
    assert np.mean(z**2) == pytest.approx(1.0, abs=0.3)


def test_a_single_spike_of_the_compass_does_nothing():
    time = np.arange(0.0, 30.0, 0.5)
    value = course(time)
    value[20] += 2.0
    value[41] = np.nan
    turning = turned(Turning(), [headings(time, value)], 0.0)
    lever = arms_at([turning], np.array([10.0, 10.2]), np.tile(ARM, (2, 1)), SIGMA, TILT)
    np.testing.assert_allclose(lever[:, :2], [place(10.0), place(10.2)], atol=1.0)
    assert len(turning.heading.time) == len(time) - 1


@pytest.mark.parametrize("known", [0, 1, 40])
def test_without_a_heading_the_length_of_the_arm_is_its_uncertainty(known):
    time = np.arange(float(known))
    turning = turned(Turning(), [headings(time, course(time))], 0.0)
    lever = arms_at([turning], np.array([55.0, np.nan]), np.tile(ARM, (2, 1)), SIGMA, TILT)
    np.testing.assert_array_equal(lever[:, :2], 0.0)
    np.testing.assert_array_equal(lever[:, 3:5], 0.0)
    np.testing.assert_allclose(lever[:, 6:8], np.hypot(30.0, 5.0))
    np.testing.assert_allclose(lever[:, 2], 12.0)


def test_in_a_gap_of_headings_nothing_is_made_up():
    time = np.concatenate([np.arange(0.0, 20.0), np.arange(40.0, 60.0)])
    turning = turned(Turning(), [headings(time, course(time))], 0.0)
    at = np.array([19.0, 20.5, 30.0, 39.5, 40.0])
    lever = arms_at([turning], at, np.tile(ARM, (5, 1)), SIGMA, TILT)
    np.testing.assert_allclose(lever[[0, 1, 4], :2], [place(t) for t in at[[0, 1, 4]]], atol=0.5)
    np.testing.assert_array_equal(lever[2:4, :2], 0.0)
    # … and it does not matter whether it has ended
    before = Turning(Angles(*(column[:20] for column in turning.heading)))
    np.testing.assert_array_equal(
        arms_at([before], at[:3], np.tile(ARM, (3, 1)), SIGMA, TILT), lever[:3]
    )


def test_headings_may_come_in_any_parts_and_old_ones_are_forgotten():
    time = np.arange(0.0, 1000.0, 0.5)
    whole = turned(Turning(), [headings(time, course(time))], 900.0)
    parts = Turning()
    for part in np.array_split(np.arange(len(time)), 90):
        parts = turned(parts, [headings(time[part], course(time[part]))], 900.0)
    assert whole.heading.time[0] == 780.0
    assert len(parts.heading.time) <= len(whole.heading.time) + 240
    at = np.linspace(905.0, 995.0, 50)
    arms = np.tile(ARM, (50, 1))
    np.testing.assert_array_equal(
        arms_at([parts], at, arms, SIGMA, TILT), arms_at([whole], at, arms, SIGMA, TILT)
    )


def test_what_is_let_go_is_not_changed_by_what_comes():
    time = np.arange(0.0, 60.0, 0.7)
    some = turned(Turning(), [headings(time[:50], course(time[:50]))], 0.0)
    more = turned(some, [headings(time[50:], course(time[50:]) + 1.0)], 0.0)
    at = np.arange(1.0, reached(some), 0.1)
    arms = np.tile(ARM, (len(at), 1))
    np.testing.assert_allclose(
        arms_at([some], at, arms, SIGMA, TILT), arms_at([more], at, arms, SIGMA, TILT)
    )
    assert reached(Turning()) == -np.inf
