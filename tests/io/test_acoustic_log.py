"""Logs of acoustic systems: fixes per transponder, put on the ship at the time of validity."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from acoustic_logs import (
    HOME,
    dvl,
    evologics,
    gga,
    hdt,
    line,
    mission,
    received,
    relative,
    ship,
    ssb,
    vehicle,
)
from surefix.errors import OptionsError
from surefix.geo.time import parse_time
from surefix.io.nmea_log import read_nmea, sniff
from surefix.types import Fixes, Log

DAY = parse_time("2024-05-14")
START = 40_000.0


def log_of(folder: Path, lines: Iterable[bytes], target: str | None = None) -> Log:
    path = folder / "dive.log"
    path.write_bytes(b"".join(lines))
    (log,) = read_nmea(path, target=target)
    return log


def fixes_of(log: Log) -> Fixes:
    assert log.fixes is not None
    return log.fixes


def errors(fixes: Fixes) -> np.ndarray:
    """Metres east, north and up between fixes on the Earth and the truth."""
    x, y, _ = HOME.to_local(fixes.position[:, 0], fixes.position[:, 1])
    truth = np.array([vehicle(time - DAY - START) for time in fixes.time])
    return np.column_stack([x, y, fixes.position[:, 2]]) - truth * [1.0, 1.0, -1.0]


def kinds(log: Log) -> dict[str, int]:
    return {problem.kind: problem.total for problem in log.problems}


def test_relative_positions_are_put_on_the_ship_at_their_time(tmp_path: Path) -> None:
    log = log_of(tmp_path, mission(DAY, START))
    fixes = fixes_of(log)
    assert log.sensors == ("dive B01",)
    assert fixes.geographic
    assert log.depth_positive_down
    np.testing.assert_allclose(fixes.time - DAY - START, np.arange(0.5, 60, 2), atol=1e-6)
    assert np.abs(errors(fixes)).max() < 0.02  # the axes at the ship are not those of the truth
    np.testing.assert_array_equal(fixes.sigma_position, 0.75)
    assert fixes.valid.all()
    assert kinds(log) == {"other-target": 20}
    assert "fixes of B01" in log.events[0].text
    assert "B02" in log.events[0].text


def test_another_target_on_request(tmp_path: Path) -> None:
    log = log_of(tmp_path, mission(DAY, START), target="B02")
    assert log.sensors == ("dive B02",)
    assert len(fixes_of(log).time) == 20
    assert np.abs(errors(fixes_of(log))).max() < 0.02


def test_the_ship_itself_on_request(tmp_path: Path) -> None:
    log = log_of(tmp_path, mission(DAY, START), target="ship")
    assert log.sensors == ("dive GNSS",)
    assert len(fixes_of(log).time) == 61
    assert not log.depth_positive_down


def test_an_unknown_target_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(OptionsError, match="B01, B02, ship"):
        log_of(tmp_path, mission(DAY, START), target="B09")


def test_north_oriented_positions_need_no_heading(tmp_path: Path) -> None:
    lines = []
    for second in range(20):
        lines.append(gga(second, START))
        (x, y, _), (east, north, depth) = ship(second + 0.4), vehicle(second + 0.4)
        place = f"C,N,M,{north - y:.4f},{east - x:.4f},{depth:.3f}"
        lines.append(line(f"PSIMSSB,1106{40 + second:02d}.400,B01,A,,{place},1.0,N,,"))
    log = log_of(tmp_path, [line("GPZDA,110639.00,14,05,2024,00,00"), *lines])
    assert np.abs(errors(fixes_of(log))[:-1]).max() < 0.005
    assert np.isnan(fixes_of(log).position[-1, 0])  # nothing is extrapolated
    assert kinds(log) == {"unplaced": 1}


def test_psimsns_turns_positions_and_wins_over_the_gyro(tmp_path: Path) -> None:
    lines = [line("GPZDA,110639.00,14,05,2024,00,00")]
    for tick in range(100):
        time = tick / 5
        seconds = f"1106{40 + time:06.3f}"
        if tick % 5 == 0:
            lines += [gga(time, START), line("HEHDT,123.0,T")]
        lines.append(line(f"PSIMSNS,{seconds},,1,1,0.5,0.1,0.0,{ship(time)[2]:.4f},,,0.0,,"))
        if tick % 5 == 2:
            lines.append(ssb(time, START))
    log = log_of(tmp_path, lines)
    assert np.abs(errors(fixes_of(log))[:-1]).max() < 0.005


def test_without_gnss_positions_are_metric(tmp_path: Path) -> None:
    with_heading = [text for text in mission(DAY, START) if b"GGA" not in text]
    fixes = fixes_of(log_of(tmp_path, with_heading))
    assert not fixes.geographic
    times = fixes.time - DAY - START
    truth = np.array([np.subtract(vehicle(t)[:2], ship(t)[:2]) for t in times])
    np.testing.assert_allclose(fixes.position[:, :2], truth, atol=0.01)


def test_without_heading_positions_are_in_the_axes_of_the_ship(tmp_path: Path) -> None:
    bare = [text for text in mission(DAY, START) if b"HDT" not in text]
    log = log_of(tmp_path, bare)
    fixes = fixes_of(log)
    assert not fixes.geographic
    truth = np.array([relative(t) for t in fixes.time - DAY - START])
    np.testing.assert_allclose(fixes.position, truth * [1, 1, -1], atol=1e-3)
    assert "no heading" in log.events[0].text


def test_a_gap_of_the_ship_leaves_its_sightings_without_a_position(tmp_path: Path) -> None:
    def silent(text: bytes) -> bool:
        return b"GGA" in text and DAY + START + 20 < float(text.split()[0]) < DAY + START + 40

    log = log_of(tmp_path, [text for text in mission(DAY, START) if not silent(text)])
    fixes = fixes_of(log)
    missing = np.isnan(fixes.position[:, 0])
    inside = np.abs(fixes.time - DAY - START - 30) < 10
    np.testing.assert_array_equal(missing, inside)
    assert kinds(log)["unplaced"] == missing.sum() == 10
    assert len(fixes.time) == 30  # no row is lost


def test_midnight_and_bare_logs(tmp_path: Path) -> None:
    start = 86_390.0
    lines = [line("GPZDA,235950.00,14,05,2024,00,00")]
    for second in range(20):
        lines += [gga(second, start), hdt(second), ssb(second, start)]
    fixes = fixes_of(log_of(tmp_path, lines))
    np.testing.assert_allclose(fixes.time - DAY - start, np.arange(20), atol=1e-6)
    assert np.isfinite(fixes.position).all()


def test_gaps_has_its_own_date_and_the_ship_is_not_the_target(tmp_path: Path) -> None:
    bodies = []
    for second in range(5):
        time = f"23595{second + 5}.500,31,12,2023"
        bodies.append(f"PTSAG,#1,{time},0,4305.00000,N,00631.00000,E,F,2.0,1,9999.0")
        bodies.append(f"PTSAG,#1,{time},4,4305.50000,N,00631.50000,W,F,950.0,1,9999.0")
    log = log_of(tmp_path, [*map(line, bodies), line(
        "PTSAG,#1,000000.500,01,01,2024,4,4305.5,N,00631.5,W,F,950.0,1,9999.0")])  # fmt: skip
    fixes = fixes_of(log)
    assert log.sensors == ("dive 4",)
    assert fixes.time[0] == parse_time("2023-12-31T23:59:55.5")
    np.testing.assert_array_equal(np.diff(fixes.time), 1.0)
    np.testing.assert_allclose(fixes.position[0], [43 + 5.5 / 60, -6.525, -950.0])
    assert kinds(log) == {"other-target": 5}


def test_grid_positions_without_a_zone_stay_on_their_grid(tmp_path: Path) -> None:
    bodies = [
        f"PSONALL,7,T,1200{s:02d}.0,6507{s:02d}.0,5688900.0,30.0,,,G,,,,0.5,0.2" for s in range(5)
    ]
    log = log_of(tmp_path, map(line, bodies))
    fixes = fixes_of(log)
    assert not fixes.geographic
    np.testing.assert_array_equal(
        fixes.position[:2], [[650700, 5688900, -30], [650701, 5688900, -30]]
    )
    np.testing.assert_array_equal(fixes.sigma_position[0], [0.5, 0.5, 0.2])


def test_invalid_sightings_are_kept_and_marked(tmp_path: Path) -> None:
    lines = [*mission(DAY, START, 10), received(ssb(10.0, START, status="V,NRy"), DAY + START + 10)]
    fixes = fixes_of(log_of(tmp_path, lines))
    np.testing.assert_array_equal(fixes.valid, [True] * 5 + [False])


@pytest.mark.parametrize("offset", [0.0, -1.7e9], ids=["set", "since its start"])
def test_evologics_by_its_time_of_measurement(tmp_path: Path, offset: float) -> None:
    lines = []
    for second in range(20):
        at = DAY + START + second
        lines.append(received(gga(second, START), at))
        told, measured = at + 0.9, at + 0.2
        (x, y, _), (east, north, depth) = ship(second + 0.2), vehicle(second + 0.2)
        text = evologics(told + offset, measured + offset, east - x, north - y, -depth)
        lines.append(received(text, told))
    log = log_of(tmp_path, lines)
    fixes = fixes_of(log)
    assert log.sensors == ("dive 3",)
    np.testing.assert_allclose(fixes.time - DAY - START, np.arange(20) + 0.2, atol=2e-3)
    assert np.abs(errors(fixes)[:-1]).max() < 0.01
    np.testing.assert_array_equal(fixes.sigma_position[0], 1.0375)


def test_dvl_alone_and_in_a_mixture(tmp_path: Path) -> None:
    reports = [dvl(DAY + k + 0.2, DAY + k, valid=k != 3) for k in range(8)]
    alone = log_of(tmp_path, reports)
    mixed = log_of(tmp_path, [*mission(DAY, 0.0, 10), *reports, b'{"response_to": 1}\r\n'])
    for log in (alone, mixed):
        series = {c.name: c for c in log.channels if c.sensor == "dive DVL"}
        assert set(series) == {"forward_mps", "starboard_mps", "down_mps", "velocity_sigma_mps"}
        forward = series["forward_mps"]
        np.testing.assert_allclose(forward.time, DAY + np.arange(8), atol=1e-6)
        np.testing.assert_array_equal(np.isnan(forward.value), np.arange(8) == 3)
        assert log.counts["DVL"] == 8
    assert alone.problems == ()
    assert kinds(mixed) == {"not-nmea": 1}
    assert log_of(tmp_path, mission(DAY, 0.0, 10)).fixes is not None


def test_a_device_dates_a_log_that_begins_with_it(tmp_path: Path) -> None:
    """Its calendar gives the day; a device that counts from its start has no time until then."""
    lines = [dvl(DAY + START - 5 + 3 * k + 0.2, DAY + START - 5 + 3 * k) for k in range(2)]
    for second in range(5):
        lines += [gga(second, START), dvl(DAY + START + second + 0.3, DAY + START + second + 0.1)]
    lines.append(line("GPZDA,110645.00,14,05,2024,00,00"))
    log = log_of(tmp_path, lines)
    expected = [-5.0, -2.0, *np.arange(5) + 0.1]
    forward = next(c for c in log.channels if c.name == "forward_mps")
    np.testing.assert_allclose(forward.time - DAY - START, expected, atol=1e-5)
    np.testing.assert_allclose(fixes_of(log).time - DAY - START, np.arange(5), atol=1e-6)
    assert log.events == ()
    early = log_of(tmp_path, [dvl(12.3, 12.1), *lines[2:]])
    forward = next(c for c in early.channels if c.name == "forward_mps")
    assert math.isnan(forward.time[0])
    # Undated until the end: told 0.3 s after the fix of the ship, but taken to be told with it.
    np.testing.assert_allclose(forward.time[1:] - DAY - START, np.arange(5) - 0.2, atol=1e-5)


def test_sniff_knows_lines_of_other_protocols() -> None:
    assert sniff(b"".join(dvl(100.2 + k, 100.0 + k) for k in range(5)))
    assert sniff(evologics(20.0, 19.5, 1.0, 2.0, -3.0) * 3)
    assert sniff(ssb(0.0, START) * 3)
    assert not sniff(b'{"a": 1}\n' * 5)


@pytest.mark.parametrize("mode", ["all", "none"])
def test_mixed_frames_never_meet(tmp_path: Path, mode: str) -> None:
    """A position on a grid beside one on the Earth is a row without a position, and is told."""
    grid = "PSIMSSB,110641.000,B01,A,,U,E,M,600000.0,6500000.0,50.0,1.0,N,,"
    lines = [*mission(DAY, START, 20), received(line(grid), DAY + START + 20)]
    log = log_of(tmp_path, lines if mode == "all" else lines[:-1])
    fixes = fixes_of(log)
    assert fixes.geographic
    assert kinds(log).get("unplaced", 0) == np.isnan(fixes.position[:, 0]).sum() == (mode == "all")
    assert not math.isnan(fixes.position[0, 0])
