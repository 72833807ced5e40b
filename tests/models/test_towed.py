"""The towed body's matrices against matrix exponentials, its geography against geodesics."""

import numpy as np
import pytest
from pyproj import Geod

from reference import towed as textbook
from surefix.errors import OptionsError
from surefix.models.towed import (
    OBSERVED,
    control_input,
    dynamics,
    moved,
    noise_factor,
    offset,
    printed_transition,
    radii,
    towed_model,
    transition,
)

EARTH = Geod(ellps="WGS84")
PLACES = [
    (0.0, 10.0),
    (0.0, 179.9999),
    (45.0, -179.9999),
    (-45.0, 90.0),
    (80.0, 179.999),
    (-80.0, -60.0),
]


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
@pytest.mark.parametrize("distance", [0.5, 60.0, 1000.0])
def test_metres_are_those_of_the_geodesic(latitude, longitude, distance):
    bearing = np.radians(np.arange(0.0, 360.0, 15.0))
    north, east = distance * np.cos(bearing), distance * np.sin(bearing)
    there = moved(
        np.full(24, np.radians(latitude)), np.full(24, np.radians(longitude)), north, east
    )
    assert (np.abs(there[1]) <= np.pi).all()
    ends = np.degrees(there[1]), np.degrees(there[0])
    azimuth, back, length = EARTH.inv(np.full(24, longitude), np.full(24, latitude), *ends)
    assert length == pytest.approx(np.full(24, distance), abs=2e-7 * distance + 1e-8)
    halfway = textbook.short_way(np.radians(0.5 * textbook_unwrapped(back + 180.0, azimuth)))
    across = distance * textbook.short_way(halfway - bearing)
    assert across == pytest.approx(np.zeros(24), abs=2e-7 * distance + 1e-8)


def textbook_unwrapped(back, azimuth):
    """Twice the mean of two azimuths in degrees."""
    return 2.0 * azimuth + np.degrees(textbook.short_way(np.radians(back - azimuth)))


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_offset_undoes_moved(latitude, longitude):
    rng = np.random.default_rng(0)
    start = np.full(50, np.radians(latitude)), np.full(50, np.radians(longitude))
    north, east = rng.uniform(-1000.0, 1000.0, (2, 50))
    back = offset(*start, *moved(*start, north, east))
    assert back[0] == pytest.approx(north, abs=1e-4)
    assert back[1] == pytest.approx(east, abs=1e-4)


@pytest.mark.parametrize("latitude", [0.0, 60.0, 80.0])
def test_a_heading_of_90_degrees_follows_the_parallel_across_the_date_line(latitude):
    phi, lam = np.radians(latitude), np.radians(179.99)
    for _ in range(1000):
        phi, lam = moved(phi, lam, 0.0, 2.5)
    assert np.degrees(phi) == pytest.approx(latitude, abs=1e-12)
    turn = np.degrees(lam) + 360.0 - 179.99
    assert 0.0 < turn < 10.0
    points = np.linspace(179.99, 179.99 + turn, 2001)
    along = EARTH.line_length(points, np.full(2001, latitude))
    assert along == pytest.approx(2500.0, abs=1e-3)


def test_radii_are_those_of_the_ellipsoid():
    assert radii(0.0)[1] == pytest.approx(EARTH.a)
    assert radii(np.pi / 2)[0] == pytest.approx(radii(np.pi / 2)[1])
    for latitude in (0.0, 36.0, -80.0):
        here = np.radians(latitude)
        assert radii(here)[0] * np.radians(1e-3) == pytest.approx(
            EARTH.inv(0.0, latitude - 5e-4, 0.0, latitude + 5e-4)[2], rel=1e-8
        )


@pytest.mark.parametrize("dt", [0.1, 1.0, 7.0, 11.9, 12.1, 60.0, 900.0])
@pytest.mark.parametrize("heading", [0.0, 2.0, -3.0])
def test_transition_and_noise_are_those_of_the_continuous_model(dt, heading):
    model = towed_model(position=0.02)
    A = textbook.dynamics(heading, 2.5, model.beta)
    assert dynamics(heading, 2.5, model.beta) == pytest.approx(A)
    F, Q = textbook.discretise(A, textbook.densities(600.0, 0.15, 0.02, 0.1, 0.01), dt)
    assert transition(heading, 2.5, model.beta, dt) == pytest.approx(F, rel=1e-12, abs=1e-12)
    G = noise_factor(heading, 2.5, dt, model)
    size = np.sqrt(np.diag(Q))
    assert G @ G.T / np.outer(size, size) == pytest.approx(Q / np.outer(size, size), abs=1e-9)


def test_noise_of_no_time_and_of_no_current_is_nothing():
    model = towed_model(current_mps=0.0)
    assert not noise_factor(1.0, 2.0, 0.0, towed_model()).any()
    Q = noise_factor(1.0, 2.0, 5.0, model) @ noise_factor(1.0, 2.0, 5.0, model).T
    assert not Q[2:4].any()
    assert np.isfinite(Q).all()


def test_printed_transition_is_eq_6_and_right_to_second_order():
    heading, speed, beta, T = 0.7, 2.5, 0.01, 2.0
    F = printed_transition(heading, speed, beta, T)
    s, c = np.sin(heading), np.cos(heading)
    assert F[0] == pytest.approx([1, 0, T - beta * T**2 / 2, 0, -speed * T * s, T * c])
    assert F[1] == pytest.approx([0, 1, 0, T - beta * T**2 / 2, speed * T * c, T * s])
    assert F[2] == pytest.approx([0, 0, 1 - beta * T + beta**2 * T**2 / 2, 0, 0, 0])
    assert F[4:] == pytest.approx(np.eye(6)[4:])
    wrong = [
        np.abs(printed_transition(heading, speed, beta, dt) - transition(heading, speed, beta, dt))
        for dt in (10.0, 20.0)
    ]
    assert wrong[1].max() / wrong[0].max() == pytest.approx(8.0, rel=0.05)


def test_control_input_makes_the_linear_form_the_motion():
    x = np.array([3.0, -4.0, 0.2, -0.1, 2.2, 2.5])
    F = transition(x[4], x[5], 0.002, 4.0)
    after = F @ x + control_input(x[4], x[5], 4.0)
    assert after[0] == pytest.approx(3.0 + F[0, 2] * 0.2 + 10.0 * np.cos(2.2))
    assert after[1] == pytest.approx(-4.0 - F[1, 3] * 0.1 + 10.0 * np.sin(2.2))


def test_observed_are_position_heading_and_speed():
    assert OBSERVED @ np.arange(6.0) == pytest.approx([0.0, 1.0, 4.0, 5.0])


@pytest.mark.parametrize(
    "wrong", [{"correlation_s": 0.0}, {"speed_mps": -1.0}, {"position": np.nan}]
)
def test_impossible_figures_are_refused(wrong):
    with pytest.raises(OptionsError):
        towed_model(**wrong)
