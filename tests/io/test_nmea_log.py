import math
from collections.abc import Iterable
from datetime import UTC, datetime
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from surefix.errors import InputError
from surefix.geo.time import DAY
from surefix.io.nmea_log import read_nmea, sniff
from surefix.types import Channel, Fixes, Log

DAY_1 = datetime(2014, 7, 31, tzinfo=UTC).timestamp()
DAY_2 = DAY_1 + DAY
KNOT = 1852.0 / 3600.0
PLACE = "4807.0380,N,01131.0000,W"


def line(body: str, received: str = "") -> str:
    check = reduce(xor, body.encode(), 0)
    return f"{received}${body}*{check:02X}"


def gga(second: str, talker: str = "GP", place: str = PLACE, height: float = 5.0) -> str:
    return f"{talker}GGA,{second},{place},1,08,0.9,{height},M,46.9,M,,"


def rmc(second: str, date: str, talker: str = "GP", status: str = "A", place: str = PLACE) -> str:
    return f"{talker}RMC,{second},{status},{place},10.0,090.0,{date},,,A"


def gll(second: str, talker: str = "GP", place: str = PLACE) -> str:
    return f"{talker}GLL,{place},{second},A,A"


def write(folder: Path, lines: Iterable[str]) -> Path:
    path = folder / "ship.nmea"
    path.write_bytes("\r\n".join(lines).encode("latin-1"))
    return path


def one(folder: Path, lines: Iterable[str], **options: bool) -> Log:
    (log,) = read_nmea(write(folder, lines), **options)
    return log


def rows(folder: Path, bodies: Iterable[str]) -> Fixes:
    fixes = one(folder, map(line, bodies)).fixes
    assert fixes is not None
    return fixes


def channel(log: Log, name: str) -> Channel:
    (found,) = (item for item in log.channels if item.name == name)
    return found


def test_one_row_per_epoch(tmp_path: Path) -> None:
    bodies = [
        gga("120000.00"),
        gll("120000.00"),
        "GPVTG,1.0,T,,M,5.0,N,,K",
        rmc("120000.00", "010814"),
    ]
    log = one(tmp_path, map(line, [*bodies, gga("120001.00")]))
    fixes = log.fixes
    assert fixes is not None
    assert fixes.geographic
    np.testing.assert_array_equal(fixes.row, [0, 1])
    np.testing.assert_array_equal(fixes.time, [DAY_2 + 43200.0, DAY_2 + 43201.0])
    np.testing.assert_allclose(fixes.position[0], [48 + 7.038 / 60, -(11 + 31 / 60), 5.0])
    np.testing.assert_allclose(fixes.velocity[0], [10 * KNOT, 0.0, np.nan], atol=1e-12)
    assert np.isnan(fixes.velocity[1]).all()
    assert log.sensors == ("ship GNSS",)
    assert log.counts == {"GGA": 2, "GLL": 1, "VTG": 1, "RMC": 1}
    assert log.problems == ()
    assert log.events == ()


def test_repeated_epochs_stay_rows_of_their_own(tmp_path: Path) -> None:
    pair = [gll("120000"), rmc("120000", "010814")]
    fixes = rows(tmp_path, pair * 3 + [gga("120001")] * 4 + [rmc("120001", "010814")])
    np.testing.assert_array_equal(fixes.time - DAY_2 - 43200.0, [0, 0, 0, 1, 1, 1, 1])
    np.testing.assert_array_equal(np.isfinite(fixes.velocity[:, 0]), [1, 1, 1, 0, 0, 0, 1])


def test_a_sentence_that_comes_late_finds_its_epoch(tmp_path: Path) -> None:
    bodies = [gga("120000"), gga("120001"), rmc("120000", "010814"), rmc("120001", "010814")]
    fixes = rows(tmp_path, bodies)
    assert len(fixes.time) == 2
    assert np.isfinite(fixes.velocity[:, 0]).all()


def test_most_precise_position_wins(tmp_path: Path) -> None:
    coarse, fine = "4807.03,N,01131.00,W", "4807.039900,N,01131.000000,W"
    for bodies in (
        [gga("120000", place=coarse), gll("120000", place=fine)],
        [gll("120000", place=fine), gga("120000", place=coarse)],
    ):
        fixes = rows(tmp_path, bodies)
        assert fixes.position[0, 0] == 48 + 7.0399 / 60
        assert fixes.position[0, 2] == 5.0
    same = "4807.0399,N,01131.0000,W"
    fixes = rows(tmp_path, [gga("120000"), rmc("120000", "010814", place=same)])
    assert fixes.position[0, 0] == 48 + 7.038 / 60


def test_satellite_systems_of_one_receiver_are_one_fix(tmp_path: Path) -> None:
    other = "4807.0399,N,01131.0000,W"
    bodies = [
        gga(f"12000{n}", talker, other if talker == "GN" else PLACE, 9.0 if talker == "GN" else 5.0)
        for n in range(3)
        for talker in ("GP", "GN", "GL")
    ]
    fixes = rows(tmp_path, bodies)
    assert len(fixes.time) == 3
    np.testing.assert_allclose(fixes.position[:, 0], 48 + 7.0399 / 60)
    np.testing.assert_allclose(fixes.position[:, 2], 9.0)


def test_other_talkers_are_other_sensors(tmp_path: Path) -> None:
    log = one(tmp_path, map(line, [gga("120000"), gga("120000", "II"), rmc("120000", "010814")]))
    assert log.sensors == ("ship GNSS", "ship II")
    assert log.fixes is not None
    np.testing.assert_array_equal(log.fixes.sensor, [0, 1])
    np.testing.assert_array_equal(np.isfinite(log.fixes.velocity[:, 0]), [True, False])


def test_invalid_fixes_are_kept_and_marked(tmp_path: Path) -> None:
    void = "GPGGA,120002,,,,,0,00,,,M,,M,,"
    fixes = rows(tmp_path, [gga("120000"), rmc("120001", "010814", status="V"), void])
    np.testing.assert_array_equal(fixes.valid, [True, False, False])
    np.testing.assert_array_equal(np.isnan(fixes.position[:, 0]), [False, False, True])
    assert np.isnan(fixes.velocity[1, 0])


def test_one_warning_makes_the_epoch_invalid_but_not_another_system(tmp_path: Path) -> None:
    assert not rows(tmp_path, [gga("120000"), rmc("120000", "010814", status="V")]).valid[0]
    void = "GLGGA,120000,,,,,0,00,,,M,,M,,"
    assert rows(tmp_path, [void, gga("120000")]).valid[0]


def test_velocity_needs_speed_and_course(tmp_path: Path) -> None:
    still = "GPVTG,,T,,M,0.1,N,,K"
    fixes = rows(tmp_path, [gga("120000"), still, gga("120001"), "GPVTG,180.0,T,,M,10.0,N,,K"])
    assert np.isnan(fixes.velocity[0]).all()
    np.testing.assert_allclose(fixes.velocity[1, :2], [0.0, -10 * KNOT], atol=1e-12)


def test_declared_sigma_of_the_same_epoch(tmp_path: Path) -> None:
    gst = "GPGST,120001,1.0,,,,2.0,3.0,4.0"
    after = rows(tmp_path, [gga("120000"), gga("120001"), gst])
    before = rows(tmp_path, [gga("120000"), gst, gga("120001")])
    for fixes in (before, after):
        np.testing.assert_array_equal(fixes.sigma_position[1], [3.0, 2.0, 4.0])
        assert np.isnan(fixes.sigma_position[0]).all()


@pytest.mark.parametrize("first", ["GGA", "RMC"])
def test_midnight_adds_one_day_once(tmp_path: Path, first: str) -> None:
    bodies = []
    for second, date in [("235958", "310714"), ("235959", "310714"), ("000000", "010814"), ("000001", "010814")]:  # fmt: skip  # noqa: E501
        pair = [gga(second), rmc(second, date)]
        bodies += pair if first == "GGA" else pair[::-1]
    fixes = rows(tmp_path, bodies)
    np.testing.assert_array_equal(fixes.time - DAY_2, [-2.0, -1.0, 0.0, 1.0])


def test_midnight_without_further_dates_and_a_late_sentence(tmp_path: Path) -> None:
    bodies = [rmc("235958", "310714"), *map(gga, ["235959", "000000", "235959", "000001"])]
    fixes = rows(tmp_path, bodies)
    np.testing.assert_array_equal(fixes.time - DAY_2, [-2.0, -1.0, 0.0, -1.0, 1.0])


def test_leap_second_never_runs_backwards(tmp_path: Path) -> None:
    times = ["235959.0", "235959.5", "235960.0", "235960.5", "000000.0"]
    fixes = rows(tmp_path, [rmc("235958.5", "311216"), *map(gga, times)])
    assert (np.diff(fixes.time) >= 0.0).all()


def test_gap_of_more_than_half_a_day_is_dated_by_the_sentence_with_the_date(tmp_path: Path) -> None:
    bodies = [rmc("200000", "310714"), gll("100000"), rmc("100000", "010814")]
    np.testing.assert_array_equal(np.diff(rows(tmp_path, bodies).time), [14 * 3600.0])


def test_rows_before_the_first_date_get_it_too(tmp_path: Path) -> None:
    bodies = [
        "GPVTG,1.0,T,,M,5.0,N,,K",
        gga("235959"),
        "SDDPT,7.0,0.5",
        gga("000000"),
        "GPZDA,000001,01,08,2014,,",
    ]
    log = one(tmp_path, map(line, bodies))
    assert log.fixes is not None
    np.testing.assert_array_equal(log.fixes.time - DAY_2, [-1.0, 0.0])
    np.testing.assert_array_equal(channel(log, "depth_m").time, [DAY_2 - 1.0])
    assert log.events == ()


def test_no_date_at_all_counts_from_day_nought(tmp_path: Path) -> None:
    log = one(tmp_path, map(line, map(gga, ["235959", "000000", "000001"])))
    assert log.fixes is not None
    np.testing.assert_array_equal(log.fixes.time, [86399.0, 86400.0, 86401.0])
    assert [event.kind for event in log.events] == ["note"]


def test_a_date_after_undated_chunks_changes_nothing(tmp_path: Path) -> None:
    bodies = [gga(f"1200{n:02d}") for n in range(40)] + [rmc("120040", "010814")]
    logs = list(read_nmea(write(tmp_path, map(line, bodies)), chunk_fixes=10))
    times = np.concatenate([log.fixes.time for log in logs if log.fixes is not None])
    np.testing.assert_array_equal(times, 43200.0 + np.arange(41.0))
    assert [event.kind for log in logs for event in log.events] == ["note"]


@pytest.mark.parametrize(
    "received",
    ["2014-08-01T00:00:01.500Z ", "1406851201.5 ", "1406851201500,", "2014-08-01 00:00:01.5,",
     "[2014-08-01T02:00:01.5+02:00] ", "\\s:GN,c:1406851201500*00\\"],
)  # fmt: skip
def test_time_of_reception(tmp_path: Path, received: str) -> None:
    bodies = [gga("235959"), rmc("235959", "161294"), gga("000001"), "SDDPT,7.0,0.5"]
    log = one(tmp_path, [line(body, received) for body in bodies])
    assert log.fixes is not None
    np.testing.assert_array_equal(log.fixes.time - DAY_2, [-1.0, 1.0])
    np.testing.assert_array_equal(channel(log, "depth_m").time - DAY_2, [1.5])


def test_week_rollover_is_mended_and_told_once(tmp_path: Path) -> None:
    lines = [
        line(rmc(f"0000{n:02d}", "161294"), f"2014-08-01T00:00:{n:02d}.500Z ") for n in range(60)
    ]
    logs = list(read_nmea(write(tmp_path, lines), chunk_fixes=10))
    times = np.concatenate([log.fixes.time for log in logs if log.fixes is not None])
    np.testing.assert_array_equal(times - DAY_2, np.arange(60.0))
    (event,) = (event for log in logs for event in log.events)
    assert event.kind == "week-rollover"
    assert "1 × 1024 weeks" in event.text


def test_other_wrong_dates_are_no_rollover(tmp_path: Path) -> None:
    log = one(tmp_path, [line(rmc("000000", "010100"), "2014-08-01T00:00:00Z ")])
    assert log.fixes is not None
    assert log.fixes.time[0] == DAY_2
    assert log.events == ()


def test_clock_steps_are_left_alone(tmp_path: Path) -> None:
    bodies = [rmc(s, "010814") for s in ("120000", "130001", "120002")]
    np.testing.assert_array_equal(np.diff(rows(tmp_path, bodies).time), [3601.0, -3599.0])


def test_velocity_of_a_sentence_without_time_by_reception(tmp_path: Path) -> None:
    vtg = "GPVTG,180.0,T,,M,10.0,N,,K"
    soon = [line(gga("000000"), "2014-08-01T00:00:00Z "), line(vtg, "2014-08-01T00:00:00.2Z ")]
    late = [soon[0], line(vtg, "2014-08-01T00:00:00.9Z ")]
    for lines, known in ((soon, True), (late, False)):
        log = one(tmp_path, lines)
        assert log.fixes is not None
        assert np.isfinite(log.fixes.velocity[0, 0]) == known


def test_positions_without_time(tmp_path: Path) -> None:
    lines = [line(f"GPGLL,{PLACE}", f"2014-08-01T00:00:0{n}.25Z ") for n in range(3)]
    log = one(tmp_path, lines)
    assert log.fixes is not None
    np.testing.assert_array_equal(log.fixes.time - DAY_2, [0.25, 1.25, 2.25])


def test_channels(tmp_path: Path) -> None:
    bodies = [
        rmc("120000", "010814"), "HEHDT,350.0,T", "HCHDG,101.0,,,1.0,E", "HCHDM,99.0,M",
        "SDDPT,7.0,0.5", "VWVHW,,T,118.0,M,5.0,N,,K", "VDVBW,4.0,,A,3.0,,V",
    ]  # fmt: skip
    log = one(tmp_path, map(line, bodies))
    found = {(c.name, c.sensor): (c.value[0], c.period) for c in log.channels}
    nan = pytest.approx(math.nan, nan_ok=True)
    assert found == {
        ("speed_mps", "ship GPRMC"): (pytest.approx(10 * KNOT), 0.0),
        ("course_deg", "ship GPRMC"): (90.0, 360.0),
        ("heading_deg", "ship HEHDT"): (350.0, 360.0),
        ("heading_deg", "ship HCHDG"): (102.0, 360.0),
        ("heading_magnetic_deg", "ship HCHDM"): (99.0, 360.0),
        ("depth_m", "ship SDDPT"): (7.5, 0.0),
        ("water_speed_mps", "ship VWVHW"): (pytest.approx(5 * KNOT), 0.0),
        ("heading_magnetic_deg", "ship VWVHW"): (118.0, 360.0),
        ("water_speed_along_mps", "ship VDVBW"): (pytest.approx(4 * KNOT), 0.0),
        ("ground_speed_along_mps", "ship VDVBW"): (nan, 0.0),
    }
    assert all(c.time[0] == DAY_2 + 43200.0 for c in log.channels)


def test_problems_are_counted_with_an_example(tmp_path: Path) -> None:
    lines = [
        "# my log", line(gga("120000")), "$HEHDT,218.53,T*00", "winch 12.5", "$HEHDT,1.0,T",
        "\xff\x01", "$HEHDT,218.53,T*00", "rubbish" + line("HEHDT,2.0,T"),
    ]  # fmt: skip
    log = one(tmp_path, lines)
    totals = {problem.kind: problem.total for problem in log.problems}
    assert totals == {"not-nmea": 3, "checksum": 2, "no-checksum": 1, "binary": 1}
    example = next(problem.example for problem in log.problems if problem.kind == "checksum")
    assert example == "line 3: $HEHDT,218.53,T*00"
    assert all(problem.remedy for problem in log.problems)
    assert log.counts == {"GGA": 1, "HDT": 1}


def test_without_checksum_on_request(tmp_path: Path) -> None:
    lines = ["$" + gga("120000"), "$HEHDT,1.0,T"]
    assert one(tmp_path, lines).fixes is None
    log = one(tmp_path, lines, require_checksum=False)
    assert log.fixes is not None
    assert log.problems == ()


def test_chunks_give_what_one_piece_gives(tmp_path: Path) -> None:
    bodies: list[str] = []
    for n in range(100):
        second = f"12{n // 60:02d}{n % 60:02d}"
        bodies += [gga(second), gll(second, "II"), rmc(second, "010814"), f"SDDPT,{n}.0,0.5"]
    path = write(tmp_path, map(line, bodies))
    (whole,) = read_nmea(path)
    seen: list[int] = []
    chunks = list(read_nmea(path, chunk_fixes=7, progress=seen.append))
    assert len(chunks) > 20
    assert seen[-1] == path.stat().st_size
    parts = [chunk.fixes for chunk in chunks if chunk.fixes is not None]
    assert whole.fixes is not None
    for name in Fixes._fields[:-1]:
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole.fixes, name))
    depths = [c.value for chunk in chunks for c in chunk.channels if c.name == "depth_m"]
    np.testing.assert_array_equal(np.concatenate(depths), channel(whole, "depth_m").value)
    assert sum(chunk.counts.get("DPT", 0) for chunk in chunks) == 100


def test_a_log_without_fixes_comes_in_chunks_too(tmp_path: Path) -> None:
    path = write(tmp_path, [line("HEHDT,1.0,T")] * 5000)
    chunks = list(read_nmea(path, chunk_fixes=100))
    assert len(chunks) > 3
    assert sum(len(chunk.channels[0].value) for chunk in chunks) == 5000


@pytest.mark.parametrize("content", [b"", b"\0" * 3_000_000, b"\xff\r\n$\r\n", b"$GPGGA,\n"])
def test_rubbish_gives_one_empty_log(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x"
    path.write_bytes(content)
    (log,) = read_nmea(path)
    assert log.fixes is None
    assert sum(problem.total for problem in log.problems) < 3


PIECES = [
    *map(line, [gga("235959"), gga("000000", "GN"), rmc("000001", "010814"), gll("", "II")]),
    line("GPZDA,000002,01,08,2014,,"),
    line("GPGST,000000,1.0,,,,2.0,3.0,4.0"),
    line("GPVTG,180.0,T,,M,10.0,N,,K"),
    line("SDDPT,7.0,0.5", "2014-08-01T00:00:00Z "),
    line(rmc("000001", "161294"), "1406851201 "),
    "$GPGGA,1200",
    "\r\n",
]


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    pieces=st.lists(
        st.one_of(st.sampled_from([piece.encode() + b"\n" for piece in PIECES]), st.binary())
    ),
    chunk=st.integers(1, 5),
)
def test_no_mixture_raises(tmp_path: Path, pieces: list[bytes], chunk: int) -> None:
    path = tmp_path / "mixture"
    path.write_bytes(b"".join(pieces))
    sniff(path.read_bytes())
    numbers: list[int] = []
    for log in read_nmea(path, require_checksum=False, chunk_fixes=chunk):
        if log.fixes is not None:
            numbers += log.fixes.row.tolist()
            assert log.fixes.sensor.max() < len(log.sensors)
            assert np.isfinite(log.fixes.position[log.fixes.valid, :2]).all()
    assert numbers == list(range(len(numbers)))


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="none"):
        list(read_nmea(tmp_path / "none"))
