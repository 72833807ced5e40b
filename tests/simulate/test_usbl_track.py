"""The simulated track of paper 000 keeps what it says of itself."""

import numpy as np
import pytest

from surefix.errors import OptionsError
from surefix.metrics import normalised_squares
from surefix.models.usbl import fix
from surefix.simulate.usbl_track import simulate

SEEDS = range(6)


@pytest.mark.parametrize("run", ["common", "independent"])
@pytest.mark.parametrize("seed", SEEDS)
def test_there_are_121_gross_errors_and_30_on_end(seed, run):
    track = simulate(seed, run=run)
    rows = np.flatnonzero(track.burst)
    assert track.gross.sum() == 121
    assert rows.size == 30
    assert np.ptp(rows) == 29
    assert track.gross[rows].all()
    assert not track.gross[[rows[0] - 1, rows[-1] + 1]].any()
    assert not track.gross[:10].any()
    np.testing.assert_array_equal(track.error.any(axis=1), track.gross)


@pytest.mark.parametrize("seed", SEEDS)
def test_sizes_are_as_promised(seed):
    common, independent = simulate(seed), simulate(seed, run="independent")
    size = np.abs(common.error)
    assert (size[common.burst] == [22.0, 22.0, 11.0]).all()
    assert (np.ptp(common.error[common.burst], axis=0) == 0.0).all()
    for each in (size[common.gross & ~common.burst], np.abs(independent.error[common.gross])):
        assert each.min() >= 5.0
        assert each.max() <= 42.0
    assert (independent.error[common.burst].std(axis=0) > 10.0).all()


def test_the_two_kinds_differ_within_the_run_only():
    one, two = simulate(3), simulate(3, run="independent")
    np.testing.assert_array_equal(one.gross, two.gross)
    np.testing.assert_array_equal(one.position, two.position)
    np.testing.assert_array_equal(one.measured_velocity, two.measured_velocity)
    differ = (one.fixes != two.fixes).any(axis=1)
    np.testing.assert_array_equal(differ, one.burst)


def test_a_seed_gives_the_same_bits_and_another_does_not():
    one, again, other = simulate([1, 4]), simulate([1, 4]), simulate([1, 5])
    np.testing.assert_array_equal(one.fixes, again.fixes)
    assert (one.fixes != other.fixes).all()


@pytest.mark.parametrize("sigmas", [(0.007, 3e-4), (0.003, 1e-4), (0.015, 1e-3)])
@pytest.mark.parametrize("seed", SEEDS)
def test_fixes_scatter_as_the_geometry_says(seed, sigmas):
    track = simulate(
        seed, gross=0, burst=0, epochs=2000, sigma_phase=sigmas[0], sigma_time=sigmas[1]
    )
    squares = normalised_squares(track.fixes - track.position, track.fix_covariance)
    assert squares.mean() == pytest.approx(3.0, abs=0.25)
    speeds = (track.measured_velocity - track.velocity).std(axis=0)
    assert speeds == pytest.approx([0.03] * 3, rel=0.08)


def test_fixes_come_through_the_geometry():
    track = simulate(2)
    np.testing.assert_array_equal(track.fixes, fix(track.array, track.phase, track.travel_time))
    off = np.abs(track.fixes - track.position - track.error)
    assert off[track.gross].max() < 2.0


def test_velocity_is_the_derivative_of_the_position():
    track = simulate(5, interval_s=0.25)
    mean = 0.5 * (track.velocity[1:] + track.velocity[:-1])
    np.testing.assert_allclose(np.diff(track.position, axis=0) / 0.25, mean, atol=1e-9)


@pytest.mark.parametrize(
    "wrong",
    [
        {"run": "none"},
        {"gross": 20, "burst": 30},
        {"epochs": 120},
        {"depth_m": 50.0},
        {"gross_m": (5.0, 150.0)},
    ],
)
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(OptionsError):
        simulate(1, **wrong)
