"""Delays in recorded logs: an AUV's legs with a DVL, and the receivers of a ship."""

import numpy as np
import pandas as pd
import pytest

from surefix.filters.latency import latency
from surefix.geo.local_frame import LocalFrame


def leg(data, number):
    """Time, place of the INS, its velocity, and the DVL's turned by the INS heading."""
    pose = pd.read_csv(data / "auv_dvl" / f"GT_trajectory{number}.csv").to_numpy()
    dvl = pd.read_csv(data / "auv_dvl" / f"DVL_trajectory{number}.csv").to_numpy()
    latitude, longitude = np.degrees(pose[:, 2]), np.degrees(pose[:, 1])
    x, y, _ = LocalFrame(latitude[0], longitude[0]).to_local(latitude, longitude)
    yaw = np.interp(dvl[:, 0], pose[:, 0], np.unwrap(pose[:, 9]))
    forward, starboard = dvl[:, 1], dvl[:, 2]
    east = forward * np.sin(yaw) + starboard * np.cos(yaw)
    north = forward * np.cos(yaw) - starboard * np.sin(yaw)
    place, own = np.column_stack([x, y]), pose[:, [5, 4]]
    return pose[:, 0], place, own, dvl[:, 0], np.column_stack([east, north])


@pytest.mark.parametrize("number", range(1, 9))
def test_an_ins_is_in_time_with_itself(data, number):
    time, place, own, *_ = leg(data, number)
    noise = np.random.default_rng(number).normal(0.0, 0.3, place.shape)
    found = latency(time, place + noise, time, own)
    assert abs(found.delay) < 4.0 * found.sigma < 0.5


@pytest.mark.parametrize("number", [1, 8])
def test_the_dvl_is_early_and_aft_of_the_ins(data, number):
    """Both at once; matching the velocities of the two gives 1.2 s on these legs."""
    time, place, _, dvl_time, dvl = leg(data, number)
    noise = np.random.default_rng(number).normal(0.0, 0.3, place.shape)
    found = latency(time, place + noise, dvl_time, dvl)
    assert abs(found.delay - 1.2) < 2.5 * found.sigma
    assert 1.0 < found.arm < 3.0


@pytest.mark.parametrize("number", range(1, 9))
def test_a_delay_that_is_put_in_is_found(data, number):
    """Noise of a USBL and a delay of 3 s, with every fifth fix 20 m off."""
    time, place, own, *_ = leg(data, number)
    rng = np.random.default_rng(number)
    noisy = place + rng.normal(0.0, 0.5, place.shape)
    noisy[rng.uniform(size=len(time)) < 0.2] += rng.choice([-20.0, 20.0], 2)
    found = latency(time + 3.0, noisy, time, own)
    assert abs(found.delay - 3.0) < 3.5 * found.sigma + 0.1
    assert found.sigma < 0.5
