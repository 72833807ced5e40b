"""What inputs bring by their role, and velocities that are turned by a heading."""

import numpy as np
import pytest

from surefix.pipelines.rows import Rows
from surefix.pipelines.supporting import BODY, steered, support
from surefix.pipelines.turning import Angles
from surefix.types import Channel, Fixes, Log

TIME = np.arange(5.0)


def series(name, value, sensor="dvl DVL"):
    return Channel(name, sensor, TIME, np.full(5, float(value)), 0.0)


def fixes(position, velocity):
    empty, zero = np.full((5, 3), np.nan), np.zeros(5, np.int64)
    return Fixes(TIME, position, velocity, empty, empty, zero, zero, zero == 0, zero, False)


def test_a_doppler_log_brings_velocities_along_its_axes():
    channels = (
        series("forward_mps", 1.0), series("starboard_mps", 0.2), series("down_mps", -0.1),
        series("velocity_sigma_mps", 0.01), series("heading_deg", 5.0, "dvl HDT"),
    )  # fmt: skip
    there = fixes(np.zeros((5, 3)), np.ones((5, 3)))  # of the ship, on the same line
    brought = support(Log(source="", channels=channels, fixes=there, sensors=("GP",)), "velocity")
    assert brought.axes == BODY
    assert brought.sensors == ("dvl DVL",)
    np.testing.assert_array_equal(brought.fixes.velocity, np.tile([0.2, 1.0, 0.1], (5, 1)))
    assert (brought.fixes.sigma_velocity == 0.01).all()
    assert np.isnan(brought.fixes.position).all()


@pytest.mark.parametrize(("own", "rows"), [(np.nan, 5), (0.0, 0)])
def test_positions_are_not_taken_from_a_log_of_velocities(own, rows):
    log = Log(source="", sensors=("a",), fixes=fixes(np.full((5, 3), own), np.ones((5, 3))))
    brought = support(log, "velocity")
    assert (0 if brought.fixes is None else len(brought.fixes.time)) == rows
    assert brought.sensors == (("a",) if rows else ())


@pytest.mark.parametrize("degrees", [0.0, 37.0, 90.0, 359.5])
def test_turned_by_the_heading_with_its_uncertainty(degrees):
    """Ahead at 2 m/s: one degree is 35 mm/s across, and nothing along."""
    time = np.arange(0.0, 10.0, 0.5)
    turning = Angles(time, np.full(len(time), np.radians(degrees)))
    ahead = fixes(np.full((5, 3), np.nan), np.tile([0.0, 2.0, 0.1], (5, 1)))
    ahead = ahead._replace(sigma_velocity=np.full((5, 3), 0.01), time=TIME + 2.0)
    no = np.zeros(5, np.bool_)
    rows = Rows(ahead, TIME, TIME, no, no, np.empty((5, 0)))
    done, problems = steered(rows, turning, np.radians(1.0), "dvl")
    bow = np.radians(degrees)
    expected = [2.0 * np.sin(bow), 2.0 * np.cos(bow), 0.1]
    np.testing.assert_allclose(done.fixes.velocity, np.tile(expected, (5, 1)), atol=1e-12)
    across = 2.0 * np.radians(1.0) * np.abs([np.cos(bow), np.sin(bow)])
    wide = np.append(np.hypot(0.01, across), 0.01)
    np.testing.assert_allclose(done.fixes.sigma_velocity, np.tile(wide, (5, 1)), atol=1e-12)
    assert problems == ()
    lost, problems = steered(rows, Angles(), 0.01, "dvl")
    assert np.isnan(lost.fixes.velocity[:, :2]).all()
    assert [(each.kind, each.total) for each in problems] == [("no-heading", 5)]
