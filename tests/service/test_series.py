"""Heading and depth that go out: clean, at the instant of the position, and only while known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.test_station import CLEAN, recorded, sentence, station_of
from surefix.geo.angle import wrap
from surefix.io.journal import Received
from surefix.io.write_nmea import LONGEST, TYPES, sentences
from surefix.service.station import Latest, latest, receive
from surefix.service.telling import epoch_of

NOON = 1_785_585_600.0  # 2026-08-01T12:00:00Z, when the boat of `recorded` sets out


def heading(k):
    """Steady turn through north."""
    return (355.0 + 0.5 * k) % 360.0


def at(k, source, data, number=0):
    return Received(number, source, NOON + k, data)


def fed(station, seconds, source=0, **series):
    """A boat's fixes at 1 Hz, each with what its other sensors say; a value in twelve is wild."""
    fixes = [line for line in recorded(seconds).splitlines(keepends=True) if b"RMC" in line]
    times, chance = {}, np.random.default_rng(4)
    for line in fixes:
        clock = line.split(b",")[1]
        if len(clock) < 9 or b"*" not in line:
            continue
        k = float(clock[:2]) * 3600 + float(clock[2:4]) * 60 + float(clock[4:]) - 43_200
        station, _ = receive(station, [at(k + 0.1, source, line)])
        if k in times:
            continue
        times[k] = True
        off = 40.0 if chance.random() < 0.08 else 0.0
        for where, say in series.items():
            text = say(k, off + chance.normal(0.0, 0.3))
            station, _ = receive(station, [at(k + 0.1, int(where[1:]), sentence(text))])
    return station


def hdt(k, off):
    return f"HEHDT,{(heading(k) + off) % 360.0:.2f},T"


def dpt(k, off):
    return f"SDDPT,{30.0 + 0.05 * k + 0.1 * off:.2f},0.0"


def test_the_heading_of_the_log_itself():
    station = fed(station_of("boat"), 150, s0=hdt)
    now = latest(station)
    assert abs(wrap(now.heading - heading(now.time - NOON))) < 1.0
    assert math.isnan(now.depth)


def test_an_input_of_headings_comes_before_others():
    def askew(k, off):
        return hdt(k + 40.0, off)  # 20° to starboard

    station = fed(station_of("boat", "gyro", gyro="heading"), 150, s0=askew, s1=hdt)
    now = latest(station)
    assert abs(wrap(now.heading - heading(now.time - NOON))) < 1.0


@pytest.mark.parametrize("role", ["fixes", "depth"])
def test_depth_of_the_water_or_of_a_depth_sensor(role):
    names = ("boat",) if role == "fixes" else ("boat", "pressure")
    say = {"s0": dpt} if role == "fixes" else {"s1": dpt}
    station = fed(station_of(*names, pressure=role), 150, **say)
    now = latest(station)
    assert now.depth == pytest.approx(30.0 + 0.05 * (now.time - NOON), abs=0.5)
    if role == "depth":
        assert now.depth == pytest.approx(-now.geodetic[2])


def test_what_falls_silent_is_carried_on_for_three_seconds_and_no_longer():
    station = fed(station_of("boat"), 150, s0=hdt)
    now = latest(station)
    for ahead, known in ((1.0, True), (2.5, True), (4.0, False)):
        then = latest(station, now.time + ahead)
        assert then.time == now.time + ahead
        assert math.isfinite(then.heading) == known
        if known:
            assert abs(wrap(then.heading - heading(then.time - NOON))) < 1.0


def test_no_heading_before_its_series_is_settled():
    station = station_of("boat")
    for line in recorded(60).splitlines(keepends=True):
        if b"HDT" not in line:
            station, _ = receive(station, [Received(0, 0, math.nan, line)])
    now = latest(station)
    assert math.isnan(now.heading)
    text = sentences(epoch_of(now)).decode()
    assert "HDT" not in text
    assert "GGA" in text
    assert CLEAN.settle_rows == 40


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
THREE = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)


@settings(deadline=None)
@given(NUMBERS, THREE, THREE, THREE, st.one_of(st.none(), THREE), NUMBERS, NUMBERS, NUMBERS)
def test_whatever_is_known_no_sentence_is_too_long(
    time, position, velocity, sigma, geodetic, observed, turned, depth
):
    now = Latest(time, position, velocity, sigma, sigma, geodetic, observed, turned, depth)
    for text in sentences(epoch_of(now), types=(*TYPES, "GBS"), talker="IN").splitlines(True):
        assert text.endswith(b"\r\n")
        assert len(text) <= LONGEST
