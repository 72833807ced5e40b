"""USBL geometry: both ways, what cannot be, and how far a fix can be trusted."""

import numpy as np
import pytest

from reference import usbl as twin
from surefix.errors import OptionsError
from surefix.models.usbl import UsblArray, fix, fix_covariance, observe

ARRAYS = [
    UsblArray(),
    UsblArray(baseline_m=0.1, wavelength_m=0.05, sound_speed_mps=1463.0),
    UsblArray(baseline_m=0.02, wavelength_m=0.06, sound_speed_mps=1540.0),
]


def figures(array):
    return array.baseline_m, array.wavelength_m, array.sound_speed_mps


def places(seed, count=40):
    """Positions below the array, some far to the side."""
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.normal(scale=150.0, size=(count, 2)), rng.uniform(1.0, 900.0, count)]
    )


@pytest.mark.parametrize("array", ARRAYS)
@pytest.mark.parametrize("seed", range(3))
def test_a_position_comes_back_from_its_phases_and_time(array, seed):
    position = places(seed)
    np.testing.assert_allclose(fix(array, *observe(array, position)), position, rtol=1e-9)


@pytest.mark.parametrize("array", ARRAYS)
@pytest.mark.parametrize("seed", range(3))
def test_angles_and_delays_say_the_same(array, seed):
    position = places(seed)
    phase, time = observe(array, position)
    for k, place in enumerate(position):
        expected, travel = twin.observe(*figures(array), place)
        np.testing.assert_allclose(phase[k], expected, rtol=1e-12)
        assert time[k] == pytest.approx(travel, rel=1e-12)
        found = twin.fix(*figures(array), *phase[k], time[k])
        np.testing.assert_allclose(fix(array, phase[k], time[k]), found, rtol=1e-9, atol=1e-6)


def test_the_printed_formulae_by_hand():
    """λ = 2d: a phase of half its limit is a ray at 60° to the baseline."""
    place = fix(UsblArray(), [np.pi / 2, 0.0], 0.2)
    np.testing.assert_allclose(place, [75.0, 0.0, 150.0 * np.sqrt(0.75)], rtol=1e-12)


def test_phases_no_ray_can_have_give_no_position():
    array = UsblArray()
    limit = array.phase_limit
    phase = limit * np.array([[0.8, 0.61], [0.8, 0.59], [1.01, 0.0], [0.0, 0.0]])
    place = fix(array, phase, 0.1)
    assert np.isnan(place).all(axis=1).tolist() == [True, False, True, False]
    assert twin.fix(*figures(array), *phase[0], 0.1) is None
    assert np.isnan(fix_covariance(array, phase, np.full(4, 0.1), 0.01, 1e-4)[0]).all()


def test_what_is_missing_stays_missing():
    array = UsblArray()
    phase = np.array([[np.nan, 0.1], [0.1, np.nan], [0.1, 0.1], [0.1, 0.1]])
    time = np.array([0.1, 0.1, np.nan, -0.1])
    assert np.isnan(fix(array, phase, time)).all()
    assert np.isnan(fix_covariance(array, phase, time, 0.01, 1e-4)).all()
    measured, travel = observe(array, np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]]))
    assert np.isnan(measured).any(axis=1).all()
    assert travel[0] == 0.0
    assert np.isnan(travel[1])


def test_whole_turns_are_lost_where_the_baseline_exceeds_half_a_wave():
    half, long = UsblArray(baseline_m=0.03), UsblArray(baseline_m=0.031)
    assert not half.ambiguous
    assert half.phase_limit == pytest.approx(np.pi)
    assert long.ambiguous
    assert long.phase_limit > np.pi
    steep = [150.0, 0.0, 1.0]
    assert observe(half, steep)[0][0] <= np.pi < observe(long, steep)[0][0]


@pytest.mark.parametrize("array", ARRAYS)
def test_covariance_is_that_of_the_derivatives(array):
    position = places(7, 12)
    phase, time = observe(array, position)
    found = fix_covariance(array, phase, time, 0.02, 3e-4)
    for k in range(len(position)):
        expected = twin.covariance(*figures(array), phase[k], time[k], 0.02, 3e-4)
        np.testing.assert_allclose(found[k], expected, rtol=1e-4, atol=1e-6 * np.trace(expected))


@pytest.mark.parametrize("place", [(0.0, 0.0, 100.0), (60.0, -30.0, 120.0), (200.0, 150.0, 90.0)])
@pytest.mark.parametrize("sigmas", [(0.007, 3e-4), (0.002, 1e-4), (0.0005, 3e-4)])
def test_covariance_is_that_of_many_noisy_fixes(place, sigmas):
    array, rng = UsblArray(), np.random.default_rng(3)
    phase, time = observe(array, place)
    phases = phase + sigmas[0] * rng.standard_normal((40_000, 2))
    times = time + sigmas[1] * rng.standard_normal(40_000)
    seen = np.cov(fix(array, phases, times).T)
    said = fix_covariance(array, phase, time, *sigmas)
    scale = np.sqrt(np.outer(np.diag(seen), np.diag(seen)))
    np.testing.assert_allclose(said / scale, seen / scale, atol=0.03)


def test_near_the_plane_of_the_array_the_depth_is_not_told():
    array = UsblArray()
    shallow = fix_covariance(array, *observe(array, [100.0, 0.0, 1.0]), 0.007, 3e-4)
    deep = fix_covariance(array, *observe(array, [100.0, 0.0, 100.0]), 0.007, 3e-4)
    assert shallow[2, 2] > 1000.0 * deep[2, 2]
    flat = fix_covariance(array, [array.phase_limit, 0.0], 0.1, 0.007, 3e-4)
    assert np.isnan(flat).all()


def test_arguments_are_left_alone_and_any_shape_goes():
    array, position = UsblArray(), places(1, 6).reshape(2, 3, 3)
    before = position.copy()
    phase, time = observe(array, position)
    kept = phase.copy(), time.copy()
    assert fix(array, phase, time).shape == (2, 3, 3)
    assert fix_covariance(array, phase, time, 0.01, 1e-4).shape == (2, 3, 3, 3)
    np.testing.assert_array_equal(position, before)
    np.testing.assert_array_equal(phase, kept[0])
    np.testing.assert_array_equal(time, kept[1])


@pytest.mark.parametrize("name", ["baseline_m", "wavelength_m", "sound_speed_mps"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_array_is_refused(name, value):
    with pytest.raises(OptionsError, match=name):
        UsblArray(**{name: value})
