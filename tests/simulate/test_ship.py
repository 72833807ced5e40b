"""The simulated voyage: its sensors err as they should, its faults are where it says."""

from itertools import pairwise

import numpy as np
import pytest

from surefix.errors import OptionsError
from surefix.simulate.ship import QUANTITIES, simulate
from surefix.simulate.ship_faults import BURSTS

TURN = 2.0 * np.pi


@pytest.fixture(scope="module", params=[1, 2, 3])
def voyage(request):
    return simulate(request.param, hours=3.0)


def test_same_seed_same_bits():
    one, two = simulate([4, 1], hours=0.5), simulate([4, 1], hours=0.5)
    for a, b in zip(one.sensors, two.sensors, strict=True):
        assert a.value.tobytes() == b.value.tobytes()
    other = simulate([4, 2], hours=0.5)
    assert other.sensors[0].intact.tobytes() != one.sensors[0].intact.tobytes()


def test_every_sensor_logs_every_second(voyage):
    assert len(voyage.time) == 3 * 3600
    assert (np.diff(voyage.time) == 1.0).all()
    measured = {}
    for sensor in voyage.sensors:
        measured.setdefault(sensor.sensor, []).append(sensor.quantity)
        assert len(sensor.value) == len(voyage.time)
    assert {name: tuple(found) for name, found in measured.items()} == QUANTITIES


def test_faults_are_where_they_are_said_to_be(voyage):
    for sensor in voyage.sensors:
        faults = sensor.faults
        good = faults.good
        np.testing.assert_array_equal(sensor.value[good], sensor.intact[good])
        wrong = sensor.value[faults.burst > 0] != sensor.intact[faults.burst > 0]
        assert wrong.all()
        assert np.isnan(sensor.value[faults.lost]).all()
        np.testing.assert_array_equal(sensor.valid, ~faults.invalid)
        stuck = np.flatnonzero(faults.stuck)
        assert (sensor.value[stuck] == sensor.value[stuck[0] - 1]).all()


def test_bursts_have_their_lengths_and_one_offset(voyage):
    sensor = voyage.sensor("INS", "v_east")
    burst = sensor.faults.burst
    edges = np.flatnonzero(np.diff(burst, prepend=0, append=0))
    runs = list(zip(edges[::2], edges[1::2], strict=True))
    assert {int(burst[a]) for a, _ in runs} == set(BURSTS)
    for a, b in runs:
        assert b - a == burst[a]
        np.testing.assert_allclose(np.ptp(sensor.value[a:b] - sensor.intact[a:b]), 0.0, atol=1e-9)
    assert min(a2 - b1 for (_, b1), (a2, _) in pairwise(runs)) >= 40


def test_share_of_gross_errors_is_that_asked_for():
    found = [
        (sensor.faults.burst > 0).mean()
        for seed in range(3)
        for sensor in simulate(seed, gross_share=0.02).sensors
        if sensor.sensor == "INS"
    ]
    assert np.mean(found) == pytest.approx(0.02, rel=0.15)
    clean = simulate(1, hours=0.5, gross_share=0.0)
    assert all(sensor.faults.good.all() for sensor in clean.sensors if sensor.sensor != "GNSS")


def test_isolated_errors_alone_leave_the_rest_of_the_voyage():
    both, alone = simulate(5, hours=1.0), simulate(5, hours=1.0, bursts=(1,))
    for a, b in zip(both.sensors, alone.sensors, strict=True):
        np.testing.assert_array_equal(a.intact, b.intact)
        assert set(np.unique(b.faults.burst)) <= {0, 1}


def test_sensors_err_as_their_kind_does(voyage):
    frame = voyage.frame
    errors = {}
    for name in ("INS", "GNSS"):
        at = [np.degrees(voyage.sensor(name, q).intact) for q in ("latitude", "longitude")]
        errors[name] = np.column_stack(frame.to_local(*at)[:2]) - voyage.position
    assert np.abs(errors["GNSS"]).max() < 9.0
    assert np.hypot(*errors["INS"][-1]) > 20.0  # drifts
    assert np.diff(errors["INS"], axis=0).std() < 0.3 < np.diff(errors["GNSS"], axis=0).std()


def test_velocity_is_the_derivative_of_the_position(voyage):
    east = voyage.sensor("INS", "v_east").truth
    moved = np.diff(voyage.position[:, 0])
    assert np.abs(moved - 0.5 * (east[1:] + east[:-1])).max() < 0.02


def test_the_ship_turns_through_north(voyage):
    heading = voyage.sensor("INS", "heading").truth
    assert ((heading >= 0.0) & (heading < TURN)).all()
    assert (np.abs(np.diff(heading)) > np.pi).sum() >= 2


def test_gnss_is_gone_for_a_while(voyage):
    value = voyage.sensor("GNSS", "latitude").value
    inside = (voyage.time >= voyage.outage[0]) & (voyage.time < voyage.outage[1])
    assert inside.sum() >= 500
    assert np.isnan(value[inside]).all()


def test_wrong_options():
    for wrong in ({"hours": 0.1}, {"hours": np.nan}, {"gross_share": 0.2}, {"bursts": (4,)}):
        with pytest.raises(OptionsError):
            simulate(1, **wrong)
