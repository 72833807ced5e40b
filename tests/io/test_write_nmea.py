"""NMEA that is written: its form, its honesty, and what our own reader and pynmea2 make of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pynmea2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surefix.errors import OptionsError, OutputError
from surefix.geo.time import parse_time
from surefix.io.nmea import parse
from surefix.io.nmea_log import read_nmea
from surefix.io.nmea_record import Heading, Motion, Position, Sigma
from surefix.io.write_nmea import LONGEST, TYPES, Epoch, sentences
from surefix.io.writers import resampled_writer, track_writer
from surefix.types import Reason, Track, Verdict, Verdicts

NOON = parse_time("2024-05-14T12:00:00")
WHOLE = Epoch(
    NOON, 36.7, -122.3, 12.5, 1.5, -2.0, 0.5, 0.4, 0.9, 0.05, heading=218.53, depth=100.25
)
ALL = (*TYPES, "GBS")
KNOT = 1852 / 3600


def lines(epoch: Epoch, **how: object) -> list[str]:
    return sentences(epoch, **how).decode("ascii").splitlines()  # type: ignore[arg-type]


def one(epoch: Epoch, kind: str) -> list[str]:
    """Fields of one sentence, the address first."""
    (text,) = lines(epoch, types=(kind,))
    return text.rpartition("*")[0].split(",")


def test_the_whole_epoch() -> None:
    assert [text[3:6] for text in lines(WHOLE)] == list(TYPES)
    assert sentences(WHOLE).count(b"\r\n") == len(TYPES)
    assert one(WHOLE, "GGA")[1:7] == ["120000.00", "3642.000000", "N", "12218.000000", "W", "1"]
    assert one(WHOLE, "RMC")[2] == "A"
    assert one(WHOLE, "RMC")[7:] == ["4.86", "143.13", "140524", "", "", "A"]
    assert one(WHOLE, "HDT")[1:] == ["218.53", "T"]
    assert one(WHOLE, "DPT")[1:] == ["100.25", "0.0"]


finite = st.floats(allow_nan=True, allow_infinity=True, width=64)
EPOCHS = st.builds(
    Epoch,
    time=st.floats(-1e12, 1e12),
    latitude=st.one_of(st.floats(-90, 90), st.floats()),
    longitude=st.one_of(st.floats(-540, 540), st.floats()),
    height=finite, east=finite, north=finite, sigma_east=finite, sigma_north=finite,
    sigma_up=finite, covariance=finite, heading=finite, depth=finite, known=st.booleans(),
)  # fmt: skip


@settings(deadline=None)
@given(EPOCHS)
def test_whatever_the_numbers_sentences_are_sound(epoch: Epoch) -> None:
    for text in sentences(epoch, types=ALL).splitlines(keepends=True):
        assert text.endswith(b"\r\n")
        assert len(text) <= LONGEST
        pynmea2.parse(text.decode("ascii").strip(), check=True)
        if text[3:6] != b"GBS":
            assert type(parse(text)) in (Position, Motion, Sigma, Heading) or b"DPT" in text


def test_the_longest_sentences_fit() -> None:
    """Only figures that are there can be too long: the widest of each."""
    wide = Epoch(
        NOON + 0.99, -89.999999, -179.999999, -99999.99, 4e4, 4e4, 99999.999, 99999.999,
        99999.999, 9e9, 359.99, 99999.99,
    )  # fmt: skip
    for text in sentences(wide, types=ALL).splitlines(keepends=True):
        assert len(text) <= LONGEST, text


@settings(deadline=None)
@given(
    latitude=st.floats(-90, 90),
    longitude=st.floats(-180, 180),
    second=st.floats(0, 3.4e9),
    speed=st.floats(0.01, 40),
    course=st.floats(0, 359.99),
)
def test_our_own_reader_reads_it_back(
    latitude: float, longitude: float, second: float, speed: float, course: float
) -> None:
    east, north = speed * math.sin(math.radians(course)), speed * math.cos(math.radians(course))
    epoch = Epoch(second, latitude, longitude, 12.5, east, north, 0.5, 0.4, 0.9)
    gga, rmc, vtg, gst = (parse(text.encode()) for text in lines(epoch))
    assert isinstance(gga, Position)
    assert isinstance(rmc, Position)
    assert isinstance(vtg, Motion)
    assert isinstance(gst, Sigma)
    for record in (gga, rmc):
        assert record.valid
        assert record.latitude == pytest.approx(latitude, abs=1e-8)
        apart = math.remainder(record.longitude - longitude, 360.0)
        assert apart == pytest.approx(0.0, abs=1e-8)
        late = math.remainder(record.second - second, 86400.0)
        assert late == pytest.approx(0.0, abs=0.00501)
    assert (rmc.day is not None) == (second >= parse_time("1980-01-01") - 0.005)
    if rmc.day is not None:
        assert abs(rmc.day * 86400.0 + rmc.second - second) < 0.00501
    assert vtg.speed == pytest.approx(speed, abs=0.0051 * KNOT)
    assert abs(math.remainder(vtg.course - course, 360.0)) < 0.0051
    assert (gst.east, gst.north, gst.up) == (0.5, 0.4, 0.9)


@pytest.mark.parametrize(
    ("degrees", "text"),
    [
        (59.9999999 / 60, "0059.999999999"),
        (1 - 1e-10, "0100.000000"),
        (-(1 - 1e-10), "0100.000000"),
        (12 + 59.9999996 / 60, "1300.000000"),
        (12 + 59.9999994 / 60, "1259.999999"),
        (90.0, "9000.000000"),
        (-0.0, "0000.000000"),
        (-1e-12, "0000.000000"),
    ],
)
def test_minutes_never_reach_sixty(degrees: float, text: str) -> None:
    place = one(Epoch(NOON, degrees, 0.0), "GGA")
    assert place[2] == (text if len(text) == 11 else "0100.000000")
    assert place[3] == ("S" if degrees < 0 and float(place[2]) > 0 else "N")


@pytest.mark.parametrize(
    ("longitude", "text"),
    [(180.0, "18000.000000"), (-180.0, "18000.000000"), (181.0, "17900.000000"),
     (-540.0, "18000.000000"), (179 + 59.9999999 / 60, "18000.000000")],
)  # fmt: skip
def test_longitudes_stay_within_half_a_turn(longitude: float, text: str) -> None:
    assert one(Epoch(NOON, 0.0, longitude), "GGA")[4] == text


def test_time_and_date_turn_together_at_midnight() -> None:
    midnight = parse_time("2024-01-01")
    before, after = Epoch(midnight - 0.0051, 1.0, 1.0), Epoch(midnight - 0.0049, 1.0, 1.0)
    assert [one(before, "RMC")[k] for k in (1, 9)] == ["235959.99", "311223"]
    assert [one(after, "RMC")[k] for k in (1, 9)] == ["000000.00", "010124"]


def test_what_is_missing_is_empty() -> None:
    bare = Epoch(NOON)
    assert [text[3:6] for text in lines(bare)] == ["GGA", "RMC", "VTG"]
    assert one(bare, "GGA")[1:] == ["120000.00", *[""] * 4, "0", "", "", "", "M", "", "M", "", ""]
    assert one(bare, "RMC")[2:] == ["V", *[""] * 6, "140524", "", "", "N"]
    assert one(bare, "VTG")[1:] == ["", "T", "", "M", "", "N", "", "K", "N"]
    assert sentences(Epoch(math.nan, 1.0, 1.0)) == b""
    assert one(Epoch(5.0, 1.0, 1.0), "RMC")[9] == ""  # a log without a date


def test_dead_reckoning_says_so() -> None:
    lost = WHOLE._replace(known=False)
    assert one(lost, "GGA")[6] == "0"
    assert (one(lost, "RMC")[2], one(lost, "RMC")[12]) == ("V", "E")
    assert one(lost, "VTG")[9] == "E"
    for kind in ("GGA", "RMC"):
        record = parse(sentences(lost, types=(kind,)))
        assert isinstance(record, Position)
        assert not record.valid


def test_standing_still_has_no_course() -> None:
    still = WHOLE._replace(east=0.001, north=0.0)
    assert one(still, "VTG")[1:6] == ["", "T", "", "M", "0.00"]


@settings(deadline=None)
@given(st.floats(0.01, 30), st.floats(0.01, 30), st.floats(0, math.pi))
def test_ellipse_is_that_of_the_covariance(major: float, minor: float, turn: float) -> None:
    major, minor = max(major, minor), min(major, minor)
    axis, across = np.array([np.sin(turn), np.cos(turn)]), np.array([np.cos(turn), -np.sin(turn)])
    spread = major**2 * np.outer(axis, axis) + minor**2 * np.outer(across, across)
    east, north = np.sqrt(np.diag(spread))
    epoch = WHOLE._replace(sigma_east=east, sigma_north=north, covariance=spread[0, 1])
    told = one(epoch, "GST")
    assert float(told[3]) == pytest.approx(major, abs=2e-3)
    assert float(told[4]) == pytest.approx(minor, abs=2e-3)
    if major > 1.01 * minor:
        apart = math.remainder(math.radians(float(told[5])) - turn, math.pi)
        assert abs(apart) < 2e-3


@pytest.mark.parametrize("covariance", [math.nan, 0.3, math.inf])
def test_no_ellipse_without_a_possible_covariance(covariance: float) -> None:
    assert one(WHOLE._replace(covariance=covariance), "GST")[3:6] == ["", "", ""]


def test_talker_and_types_are_checked() -> None:
    assert lines(WHOLE, talker="GP", types=("HDT",)) == ["$GPHDT,218.53,T*08"]
    for talker in ("", "G", "gp", "G,", "GPS", "Gé"):
        with pytest.raises(OptionsError, match="talker"):
            sentences(WHOLE, talker=talker)
    with pytest.raises(OptionsError, match="one of GGA"):
        sentences(WHOLE, types=("GLL",))


def test_pynmea2_reads_the_same() -> None:
    gga, rmc, vtg, gst, hdt, dpt = (pynmea2.parse(text, check=True) for text in lines(WHOLE))
    assert (gga.latitude, gga.longitude) == (pytest.approx(36.7), pytest.approx(-122.3))
    assert (gga.altitude, gga.gps_qual) == (12.5, 1)
    assert rmc.datetime.timestamp() == NOON
    assert rmc.status == "A"
    assert float(vtg.spd_over_grnd_kmph) == pytest.approx(9.0)
    assert (float(gst.std_dev_longitude), float(gst.std_dev_latitude)) == (0.5, 0.4)
    assert float(hdt.heading) == 218.53
    assert float(dpt.depth) == 100.25


def track(n: int) -> Track:
    k = np.arange(n)
    geodetic = np.c_[36 + k * 1e-5, -122 + k * 1e-5, -500.0 - k]
    wide = np.ones((n, 3))
    return Track(NOON + k, wide, wide, np.full((n, 3), 0.25), wide, geodetic)


def verdicts(codes: list[Verdict]) -> Verdicts:
    n = len(codes)
    weight = np.array(
        [0.0 if code in (Verdict.REJECTED, Verdict.MISSING) else 1.0 for code in codes]
    )
    wide, whole = np.full((n, 3), np.nan), np.full(n, Reason.AGREES)
    return Verdicts(np.array(codes), weight, np.ones(n), wide, whole, np.zeros(n), wide)


def test_a_file_is_read_back_with_its_times_and_validity(tmp_path: Path) -> None:
    path = tmp_path / "out.nmea"
    codes = [Verdict.USED, Verdict.REJECTED, Verdict.DOWNWEIGHTED, Verdict.MISSING, Verdict.USED]
    whole = np.zeros(5, np.int64)
    with track_writer(path, geographic=True, has_depth=True) as writer:
        writer.write(track(5), verdicts(codes), sensors=["a"], sensor=whole, row=whole)
    (log,) = read_nmea(path)
    assert log.problems == ()
    fixes = log.fixes
    assert fixes is not None
    np.testing.assert_array_equal(fixes.time, NOON + np.arange(5))
    np.testing.assert_array_equal(fixes.valid, [True, False, True, False, True])
    np.testing.assert_allclose(fixes.position, track(5).geodetic, atol=1e-7)
    np.testing.assert_allclose(fixes.velocity[fixes.valid, :2], 1.0, atol=0.01)
    np.testing.assert_array_equal(fixes.sigma_position, 0.25)
    depths = next(c for c in log.channels if c.name == "depth_m")
    np.testing.assert_array_equal(depths.value, 500.0 + np.arange(5))


def test_one_group_of_sentences_an_instant(tmp_path: Path) -> None:
    path = tmp_path / "out.nmea"
    made = track(3)._replace(time=np.array([NOON, NOON, NOON + 1]))
    codes = [Verdict.USED, Verdict.REJECTED, Verdict.USED]
    whole = np.zeros(3, np.int64)
    with track_writer(path, geographic=True) as writer:
        writer.write(made, verdicts(codes), sensors=["a"], sensor=whole, row=whole)
    groups = path.read_bytes().split(b"$INGGA")[1:]
    assert [group[1:10] for group in groups] == [b"120000.00", b"120001.00"]
    assert b",1,,,-500.00" in groups[0]


def test_a_resampled_track_and_what_supports_it(tmp_path: Path) -> None:
    path = tmp_path / "out.nmea"
    with resampled_writer(path, geographic=True) as write:
        write(track(3), np.array([True, False, True]))
    statuses = [row.split(b",")[2] for row in path.read_bytes().split(b"\r\n") if b"RMC" in row]
    assert statuses == [b"A", b"V", b"A"]


def test_metric_tracks_are_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match="latitude and longitude"),
        track_writer(tmp_path / "out.nmea", geographic=False),
    ):
        pass
