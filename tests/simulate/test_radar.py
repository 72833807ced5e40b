"""The simulated radars: what is said to be true of them is."""

import numpy as np
import pytest

from surefix.errors import OptionsError
from surefix.models.radar import polar_difference, to_cartesian, to_polar
from surefix.simulate.radar import simulate


@pytest.fixture(scope="module")
def flight():
    return simulate(1)


def test_the_same_seed_gives_the_same_bits(flight):
    again, other = simulate(1), simulate(2)
    for one, two in zip(flight.radars, again.radars, strict=True):
        np.testing.assert_array_equal(one.polar, two.polar)
    assert not np.array_equal(flight.position, other.position)


def test_velocity_is_the_change_of_position_and_the_swerve_ends_parallel(flight):
    moved = np.diff(flight.position, axis=0) / flight.dt
    between = 0.5 * (flight.velocity[1:] + flight.velocity[:-1])
    np.testing.assert_allclose(moved, between, atol=1e-4)
    np.testing.assert_allclose(flight.velocity[7000], flight.velocity[0], atol=1e-9)
    acceleration = np.diff(flight.velocity, axis=0) / flight.dt
    assert (np.abs(acceleration[~flight.manoeuvre[1:] & ~flight.manoeuvre[:-1]]) < 1e-9).all()
    np.testing.assert_allclose(np.abs(acceleration).max(axis=0), [0.0, 1.5, 1.0], atol=1e-3)


@pytest.mark.parametrize("which", [0, 1])
def test_noise_and_systematic_errors_are_as_stated(flight, which):
    log = flight.radars[which]
    off = polar_difference(log.polar, to_polar(flight.position, log.at)) - log.bias
    usual = off[~log.wild & (log.noise == 1.0)] / log.sigma
    np.testing.assert_allclose(usual.std(axis=0), 1.0, atol=0.03)
    np.testing.assert_allclose(usual.mean(axis=0), 0.0, atol=0.05)
    assert (log.polar[:, 1] >= 0.0).all()
    assert (log.polar[:, 1] < 2 * np.pi).all()


def test_noise_of_a_grows_where_said(flight):
    log = flight.radars[0]
    off = polar_difference(log.polar, to_polar(flight.position, log.at)) - log.bias
    loud = off[~log.wild & (log.noise > 1.0)] / log.sigma
    np.testing.assert_allclose(loud.std(axis=0), 3.0, atol=0.2)
    assert np.flatnonzero(log.noise > 1.0)[[0, -1]].tolist() == [8000, 8999]


def test_the_burst_is_a_false_target_at_a_constant_distance(flight):
    log = flight.radars[0]
    assert np.flatnonzero(log.burst).tolist() == list(range(2500, 2515))
    off = to_cartesian(log.polar - log.bias, log.at) - flight.position
    assert (np.abs(off[log.burst]).min(axis=0) > 100.0).all()
    assert (np.ptp(off[log.burst], axis=0) < 250.0).all()
    assert not flight.radars[1].wild.any()


def test_isolated_wild_measurements_stand_alone():
    log = simulate(3, wild_share=0.3).radars[0]
    lonely = log.wild & ~log.burst
    assert 0.1 < lonely.mean() < 0.3
    assert not (lonely[1:] & lonely[:-1]).any()


def test_bursts_and_lengths_can_be_chosen():
    flight = simulate(
        4, samples=500, bursts=((50, 3), (300, 40)), manoeuvre=(200, 250), noisy=(0, 0, 1.0)
    )
    log = flight.radars[0]
    assert log.burst.sum() == 43
    assert len(flight.position) == 500
    assert flight.manoeuvre.sum() == 50
    np.testing.assert_array_equal(log.noise, 1.0)


def test_reference_is_close_to_the_truth(flight):
    off = flight.reference - flight.position
    np.testing.assert_allclose(off.std(axis=0), 0.5, atol=0.03)


@pytest.mark.parametrize(
    "wrong",
    [
        {"samples": 0},
        {"dt": 0.0},
        {"sigma_a": (0.0, 1.0, 1.0)},
        {"sigma_reference_m": -1.0},
        {"wild_share": 1.0},
        {"wild_sigma": (5.0, 2.0)},
    ],
)
def test_scenes_that_cannot_be_are_refused(wrong):
    with pytest.raises(OptionsError, match="expected"):
        simulate(1, **wrong)
