"""What a live stream tells is what `surefix clean --mode realtime` says of the recorded one."""

import math
from functools import reduce
from itertools import pairwise
from operator import xor

import numpy as np
import pandas as pd
import pytest

from surefix.api import to_table
from surefix.io.journal import Received
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.service.addresses import Address
from surefix.service.options import InputOptions, LiveOptions
from surefix.service.station import begin_station, latest, receive, resumed, stored

CLEAN = CleanOptions(mode="realtime", settle_rows=40, reorder_s=2.0)


def sentence(body):
    return f"${body}*{reduce(xor, body.encode()):02X}\r\n".encode()


def minutes(degrees, width):
    return f"{int(degrees):0{width}d}{(degrees % 1.0) * 60.0:08.5f}"


def recorded(n=150, seed=1):
    """Sentences of a boat at 1 Hz, some of them wild, late, broken or doubled."""
    rng = np.random.default_rng(seed)
    lines = []
    for k in range(n):
        clock = f"{12 + k // 3600:02d}{k // 60 % 60:02d}{k % 60:02d}.00"
        north, east = rng.normal(0.0, 1e-5, 2) + (4e-4 if rng.random() < 0.08 else 0.0)
        lat, lon = minutes(54.0 + 2e-5 * k + north, 2), minutes(10.0 + 1e-5 * k + east, 3)
        place = f"{lat},N,{lon},E"
        lines.append(sentence(f"GPGGA,{clock},{place},1,08,1.0,2.0,M,40.0,M,,"))
        speed, course = 4.49 + 0.1 * rng.normal(), 16.4 + rng.normal()
        lines.append(sentence(f"GPRMC,{clock},A,{place},{speed:.2f},{course:.1f},010826,,,A"))
        lines.append(sentence(f"HEHDT,{(350.0 + 0.2 * k + rng.normal()) % 360.0:.2f},T"))
    for k in rng.choice(np.arange(130, len(lines) - 4), 12, replace=False):
        lines[k], lines[k + 3] = lines[k + 3], lines[k]
    middle = len(lines) * 2 // 3
    lines[middle] = lines[middle][:20] + b"\r\n"
    lines.insert(middle + 30, lines[middle + 29])
    return b"".join(lines)


def pieces(data, size, rng):
    cuts = np.unique(rng.integers(0, len(data), len(data) // size))
    bounds = [0, *cuts.tolist(), len(data)]
    return [data[a:b] for a, b in pairwise(bounds)]


def station_of(*names, clean=CLEAN, **roles):
    inputs = tuple(
        InputOptions(name=name, address=Address("file"), role=roles.get(name, "fixes"))
        for name in names
    )
    return begin_station(LiveOptions(clean=clean, inputs=inputs))


def table(cleaned):
    return to_table(cleaned).to_pandas()


def series_equal(one, other):
    assert len(one.channels) == len(other.channels) > 0
    for a, b in zip(one.channels, other.channels, strict=True):
        for x, y in zip(a[2:7], b[2:7], strict=True):
            np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("size", [7, 200, 5000])
def test_in_any_pieces_it_is_what_clean_says(tmp_path, size):
    log = tmp_path / "boat.nmea"
    log.write_bytes(recorded())
    whole = clean_sources(open_inputs([log]), CLEAN)
    station, given = station_of("boat"), []
    parts = [*pieces(log.read_bytes(), size, np.random.default_rng(size)), b""]
    for number, data in enumerate(parts, 1):
        before = station
        station, batches = receive(station, [Received(number, 0, math.nan, data)])
        if number % 50 == 0:  # the state before is still what it was
            again = receive(before, [Received(number, 0, math.nan, data)])[1]
            assert [table(b).equals(table(a)) for a, b in zip(batches, again, strict=True)] == [
                True
            ] * len(batches)
        given += batches
    assert station.after == len(parts)
    live = join(given)
    pd.testing.assert_frame_equal(table(live), table(whole), check_exact=True)
    series_equal(live, whole)


def test_the_latest_is_what_clean_says_of_a_log_that_ends_there(tmp_path):
    data = recorded()
    lines = data.splitlines(keepends=True)
    station = station_of("boat")
    told = 0
    for number, line in enumerate(lines, 1):
        station, _ = receive(station, [Received(number, 0, math.nan, line)])
        now = latest(station)
        if now is None or number % 40:
            continue
        told += 1
        log = tmp_path / "boat.nmea"
        log.write_bytes(b"".join(lines[:number]))
        track = clean_sources(open_inputs([log]), CLEAN).track
        assert now.time == track.time[-1]
        np.testing.assert_array_equal(now.geodetic, track.geodetic[-1])
        np.testing.assert_array_equal(now.sigma_position, track.sigma_position[-1])
    assert told > 5


def test_without_fixes_it_is_carried_on_with_less_and_less_certainty():
    station = station_of("boat")
    station, _ = receive(station, [Received(1, 0, math.nan, recorded())])
    now = latest(station)
    assert now is not None
    assert 0.0 <= now.time - now.observed < 5.0
    then = [latest(station, now.time + seconds) for seconds in (1.0, 10.0, 60.0)]
    for seconds, there in zip((1.0, 10.0, 60.0), then, strict=True):
        assert there.time == now.time + seconds
        assert there.observed == now.observed
        # m north and east, at the speed of the last fix
        moved = (there.geodetic - now.geodetic)[:2] * [111_000.0, 111_000.0 * np.cos(0.9425)]
        np.testing.assert_allclose(moved, now.velocity[1::-1] * seconds, rtol=0.02, atol=0.2)
    sigmas = [now.sigma_position[0], *(there.sigma_position[0] for there in then)]
    assert np.all(np.diff(sigmas) > 0.0)
    assert latest(station, now.time - 5.0).time == now.time


@pytest.mark.parametrize("role", ["depth", "heading"])
def test_it_is_carried_on_whichever_input_is_named_first(role):
    station = station_of("other", "boat", other=role)
    station, _ = receive(station, [Received(1, 1, math.nan, recorded())])
    station, _ = receive(station, [Received(2, 0, math.nan, b"")])
    now = latest(station)
    assert latest(station, now.time + 10.0).time == now.time + 10.0


def test_two_receivers_are_two_inputs(tmp_path):
    logs = []
    for i in (1, 2):
        logs.append(tmp_path / f"gps{i}.nmea")
        logs[-1].write_bytes(recorded(seed=i))
    whole = clean_sources(open_inputs(logs), CLEAN)
    station, given, number = station_of("gps1", "gps2"), [], 0
    lines = [log.read_bytes().splitlines(keepends=True) for log in logs]
    for pair in zip(*lines, strict=False):
        for source, line in enumerate(pair):
            number += 1
            station, batches = receive(station, [Received(number, source, math.nan, line)])
            given += batches
    rest = [
        Received(0, s, math.nan, b"".join(lines[s][len(min(lines, key=len)) :])) for s in (0, 1)
    ]
    ends = [Received(0, s, math.nan, b"") for s in (0, 1)]
    station, batches = receive(station, [piece for piece in rest if piece.data] + ends)
    given += batches
    pd.testing.assert_frame_equal(table(join(given)), table(whole), check_exact=True)


def test_arrival_dates_what_has_no_date():
    """GGA alone has no date: it is that of its arrival, and a day is added at midnight."""
    station, given = station_of("boat"), []
    noon = 1_785_585_600.0  # 2026-08-01T12:00:00Z
    lines = [line for line in recorded().splitlines(keepends=True) if b"GGA" in line]
    for number, line in enumerate(lines, 1):
        arrived = noon + number + 0.3
        station, batches = receive(station, [Received(number, 0, arrived, line)])
        given += batches
    time = join(given).track.time
    assert time[0] == pytest.approx(noon, abs=5.0)


def test_stored_between_any_two_pieces_it_goes_on_as_if_nothing_had_happened():
    inputs = (InputOptions(name="boat", address=Address("file")),)
    options = LiveOptions(clean=CLEAN, inputs=inputs)
    station, other = begin_station(options), begin_station(options)
    given, again = [], []
    parts = [*pieces(recorded(), 300, np.random.default_rng(9)), b""]
    for number, data in enumerate(parts, 1):
        piece = [Received(number, 0, math.nan, data)]
        station, batches = receive(station, piece)
        given += batches
        other, batches = receive(resumed(options, stored(other)), piece)
        again += batches
        assert stored(other) == stored(station)
    pd.testing.assert_frame_equal(table(join(given)), table(join(again)), check_exact=True)
    series_equal(join(given), join(again))
