"""Strings of acoustic systems live: what is told is what `clean` says of the recorded bytes."""

import asyncio
import math

import numpy as np
import pandas as pd
import pytest

from acoustic_logs import (
    HOME,
    angle,
    clock,
    dvl,
    evologics,
    gga,
    hdt,
    line,
    mission,
    on_earth,
    received,
    ship,
    vehicle,
)
from service.test_station import pieces, table
from surefix.errors import OptionsError
from surefix.geo.time import parse_time
from surefix.io.journal import Received
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.service.addresses import Address
from surefix.service.live import begin_live, run_live
from surefix.service.options import InputOptions, LiveOptions, read_live
from surefix.service.station import begin_station, latest, receive, resumed, stored

DAY, START = parse_time("2024-05-14"), 40_000.0
CLEAN = CleanOptions(mode="realtime", settle_rows=40, reorder_s=2.0)


def noisy(k):
    """Where the vehicle is said to be at second k: one in thirty is 50 m off."""
    chance = np.random.default_rng(k)
    east, north, depth = vehicle(k)
    off = 50.0 if k % 30 == 17 else 0.0
    return east + chance.normal(0, 0.5) + off, north + chance.normal(0, 0.5), depth


def ptsag(k):
    lat, lon = on_earth(*noisy(k)[:2])
    place = f"{angle(lat, 2, 'NS')},{angle(lon, 3, 'EW')}"
    head = f"PTSAG,#{k},{clock(START + k)},14,05,2024,1,{place}"
    return line(f"{head},F,{noisy(k)[2]:.2f},1,9999.00")


def psonlld(k):
    lat, lon = on_earth(*noisy(k)[:2])
    head = f"PSONLLD,{clock(START + k)},ROV 1,A,{lat:.8f},{lon:.8f},{noisy(k)[2]:.3f}"
    return line(f"{head},0.50,0.50,0.00,0.50,,,,")


def psonall(k):
    east, north, depth = noisy(k)
    head = (
        f"PSONALL,2401,Transducer,{clock(START + k)},{650_000 + east:.2f},{5_688_000 + north:.2f}"
    )
    return line(f"{head},{depth:.2f},,,G,,,,0.500,0.500")


def usbllong(k):
    (x, y, _), (east, north, depth) = ship(k), noisy(k)
    return evologics(DAY + START + k + 0.3, DAY + START + k, east - x, north - y, -depth)


def strings(kind, seconds=150):
    """A mission with the strings of one system, a DVL beside it, and lines that are damaged."""
    if kind == "psimssb":
        lines = list(mission(DAY, START, seconds))
    else:
        made = {"ptsag": ptsag, "psonlld": psonlld, "psonall": psonall, "usbllong": usbllong}
        lines = []
        for k in range(seconds):
            at = DAY + START + k
            lines.append(received(gga(k, START), at))
            lines += [received(hdt(k + tick / 5), at + tick / 5) for tick in range(5)]
            lines.append(received(made[kind](k), at + 0.4))
            lines.append(received(dvl(at + 0.9, at + 0.7, vx=0.5 + 0.001 * (k % 7)), at + 0.9))
    for k in range(40, len(lines), 61):
        lines[k] = lines[k][: len(lines[k]) // 2] + b"\r\n"
    return b"".join(lines)


def options(target):
    one = InputOptions(name="dive", address=Address("file"), target=target)
    return LiveOptions(clean=CLEAN, inputs=(one,))


KINDS = {"psimssb": "B01", "ptsag": "1", "psonlld": "ROV 1", "psonall": "2401", "usbllong": "3"}


@pytest.mark.parametrize(("kind", "target"), KINDS.items())
def test_in_any_pieces_and_restarted_it_is_what_clean_says(tmp_path, kind, target):
    data = strings(kind)
    log = tmp_path / "dive.log"
    log.write_bytes(data)
    whole = clean_sources(open_inputs([log], target=target), CLEAN)
    assert whole.sensors == (f"dive {target}",)
    assert len(whole.track.time) > 60
    for number, (wanted, size) in enumerate([("first", 900), (target, 60)]):
        station, given = begin_station(options(wanted)), []
        parts = [*pieces(data, size, np.random.default_rng(number)), b""]
        for k, part in enumerate(parts, 1):
            if k % 37 == 0:  # stopped here, and begun again from what was stored
                content = stored(station)
                station = resumed(options(wanted), content)
                assert stored(station) == content
            station, batches = receive(station, [Received(k, 0, math.nan, part)])
            given += batches
        live = join(given)
        pd.testing.assert_frame_equal(table(live), table(whole), check_exact=True)
        series = [{(c.sensor, c.name): c.value for c in one.channels} for one in (live, whole)]
        assert series[0].keys() == series[1].keys()
        assert (kind == "psimssb") or ("dive DVL", "forward_mps") in series[0]
        for key, value in series[0].items():
            np.testing.assert_array_equal(value, series[1][key])


def test_a_stream_begun_again_while_the_target_is_not_known_yet():
    data, station, other = strings("psimssb", 60), *(begin_station(options("first")),) * 2
    for k, part in enumerate(pieces(data, 2_000, np.random.default_rng(2)), 1):
        piece = [Received(k, 0, math.nan, part)]
        station, _ = receive(station, piece)
        other, _ = receive(resumed(options("first"), stored(other)), piece)
        assert stored(other) == stored(station)


def test_the_position_of_the_target_is_told():
    """Below its ship, with its depth, and with the heading of the ship it is seen from."""
    station, off = begin_station(options("first")), []
    for k, part in enumerate(strings("psonlld").splitlines(keepends=True), 1):
        station, _ = receive(station, [Received(k, 0, math.nan, part)])
        if k % 50 == 0 and (now := latest(station)) is not None:
            x, y, _ = HOME.to_local(*now.geodetic[:2])
            east, north, depth = vehicle(now.time - DAY - START)
            off.append((float(x[0]) - east, float(y[0]) - north, now.depth - depth))
            assert now.heading == pytest.approx(ship(now.time - DAY - START)[2], abs=1.0)
    assert len(off) > 10
    assert np.abs(off[3:]).max() < 2.0  # σ of one sighting is 0.5 m
    assert np.sqrt(np.mean(np.square(off[3:]))) < 0.5


def test_only_relative_sightings_are_told_in_axes_of_the_ship(tmp_path):
    """Without a ship's position none on Earth can be told; the same as from the file."""
    lines = [text for text in mission(DAY, START, 300) if b"GGA" not in text]
    log = tmp_path / "dive.log"
    log.write_bytes(b"".join(lines))
    whole = clean_sources(open_inputs([log], target="B01"), CLEAN)
    station, given = begin_station(options("B01")), []
    for k, part in enumerate([*lines, b""], 1):
        station, batches = receive(station, [Received(k, 0, math.nan, part)])
        given += batches
    assert whole.track.geodetic is None
    pd.testing.assert_frame_equal(table(join(given)), table(whole), check_exact=True)


def test_the_journal_of_a_dive_is_cleaned_like_its_log(tmp_path):
    log, place = tmp_path / "dive.log", tmp_path / "live.toml"
    log.write_bytes(strings("psimssb"))
    place.write_text(
        "[clean]\nsettle_rows = 40\nreorder_s = 2.0\n[journal]\nurl = 'sqlite:///dive.db'\n"
        "[[input]]\nname = 'dive'\nfrom = 'file:dive.log?speed=0'\ntarget = 'B02'\n"
    )
    live = begin_live(read_live(place))
    asyncio.run(run_live(live, asyncio.Event()))
    whole = clean_sources(open_inputs([log], target="B02"), CLEAN)
    again = clean_sources(open_inputs([tmp_path / "dive.db"]), CLEAN)
    assert again.sensors == ("dive B02",)
    pd.testing.assert_frame_equal(table(again), table(whole), check_exact=True)
    assert live.now.depth == pytest.approx(115.0, abs=2.0)
    place.write_text(place.read_text().replace("B02", "B01"))
    with pytest.raises(OptionsError, match="fixes of B02"):
        begin_live(read_live(place))


@pytest.mark.parametrize(
    ("said", "why"), [("target = 3", "transponder"), ("role = 'depth'\ntarget = 'a'", "role fixes")]
)
def test_a_target_that_is_none_is_told(tmp_path, said, why):
    place = tmp_path / "live.toml"
    place.write_text(
        f"[clean]\nsettle_rows = 40\n[[input]]\nname = 'a'\nfrom = 'udp://0.0.0.0:1'\n{said}\n"
    )
    with pytest.raises(OptionsError, match=why):
        read_live(place)


def test_a_ship_alone_is_the_ship():
    station = begin_station(options("ship"))
    station, _ = receive(station, [Received(1, 0, math.nan, strings("psimssb"))])
    now = latest(station)
    x, y, _ = HOME.to_local(*now.geodetic[:2])
    there = ship(now.time - DAY - START)
    assert (float(x[0]), float(y[0])) == pytest.approx(there[:2], abs=1.0)
