"""Lines of modems and velocity logs that do not speak NMEA."""

import json
import math

import pytest

from acoustic_logs import dvl, evologics
from surefix.io.acoustic_clock import DeviceClock
from surefix.io.acoustic_line import read_line
from surefix.io.acoustic_record import BodyVelocity, Sighting
from surefix.io.nmea_record import Refused

PUBLISHED = (
    b"+++AT:124:USBLLONG,10446.991981,10446.534643,3,-0.0604,-1.0888,-0.5851,-0.4233,-1.0020,"
    b"-0.5901,0.0063,0.0269,-0.3295,825,-36,77,1.2375"
)


def said(line: bytes) -> object:
    told = read_line(line)
    assert told is not None
    return told[1]


def test_published_usbllong_gives_east_north_and_the_time_of_measurement() -> None:
    record = said(PUBLISHED)
    assert isinstance(record, Sighting)
    assert (record.target, record.place, record.valid) == ("3", "north", True)
    assert (record.x, record.y, record.depth, record.sigma_x) == (-0.4233, -1.002, 0.5901, 1.2375)
    assert (record.measured, record.told) == (10446.534643, 10446.991981)


def test_what_stands_before_it_is_handed_back() -> None:
    told = read_line(b"2024-05-14T08:00:00Z " + PUBLISHED)
    assert told is not None
    assert told[0] == b"2024-05-14T08:00:00Z "


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (PUBLISHED[:-1], "truncated"),
        (PUBLISHED + b"0", "truncated"),
        (PUBLISHED.replace(b"-1.0888", b"-1.08x8"), "field"),
        (PUBLISHED.replace(b"-1.0888", b"-1.088\xff"), "field"),
        (PUBLISHED.replace(b"10446.534643", b"10447.534643"), "range"),  # after it was told
        (PUBLISHED.replace(b"10446.534643", b"10346.534643"), "range"),  # 100 s before
        (b"+++AT:13:DELIVEREDIM,3", "unknown-type"),
    ],
)
def test_damaged_notices_are_refused_by_kind(line: bytes, kind: str) -> None:
    record = said(line)
    assert isinstance(record, Refused)
    assert record.kind == kind


def test_velocity_report() -> None:
    line = dvl(1638191471.752336, 1638191471.563017)
    assert len(line) > 1024
    record = said(line)
    assert record == BodyVelocity("", "DVL", 0.5, -0.1, 0.02, 0.004, 1638191471.563017,
                                  1638191471.752336)  # fmt: skip


def test_velocity_without_lock_is_missing() -> None:
    record = said(dvl(100.2, 100.0, valid=False))
    assert isinstance(record, BodyVelocity)
    assert all(math.isnan(v) for v in (record.forward, record.starboard, record.down, record.sigma))


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({"vx": None}, "field"),
        ({"vx": "0.5"}, "field"),
        ({"vx": True}, "field"),
        ({"vx": 10**400}, "field"),
        ({"fom": -1.0}, "field"),
        ({"velocity_valid": 1}, "field"),
        ({"time_of_validity": 200_000_000}, "field"),
        ({"type": "velocity_water"}, "unknown-type"),
        ({"type": "position_local"}, "unknown-type"),
    ],
)
def test_wrong_reports_are_refused_by_kind(change: dict[str, object], kind: str) -> None:
    record = said(dvl(100.2, 100.0, **change))
    assert isinstance(record, Refused)
    assert record.kind == kind


def test_not_a_number_and_nesting_are_refused() -> None:
    text = dvl(100.2, 100.0).replace(b'"vx": 0.5', b'"vx": NaN')
    assert said(text) == Refused("field", "")
    assert said(b'{"type": ' + b"[" * 3000 + b"}") == Refused("field", "")
    assert said(dvl(100.2, 100.0)[:-9]) == Refused("truncated", "")


@pytest.mark.parametrize("line", [b"", b"hello", b"{", b'{"a": 1}', b"[1]", b"+++AT", b"+++ATZ4",
                                  b'{"type": "velocity", "format": "other_v1"}'])  # fmt: skip
def test_lines_of_others_are_not_claimed(line: bytes) -> None:
    assert read_line(line) is None


def test_unknown_fields_do_not_matter() -> None:
    report = json.loads(dvl(100.2, 100.0)) | {"tracking_mode": "bottom", "format": "json_v3.3"}
    assert isinstance(said(json.dumps(report).encode()), BodyVelocity)


def test_a_device_set_to_the_same_time_is_believed() -> None:
    clock = DeviceClock()
    assert clock.at(1.7e9 + 0.25, 1.7e9 + 0.75, 1.7e9 + 1.1) == 1.7e9 + 0.25


def test_a_device_that_counts_from_its_start_says_how_long_ago() -> None:
    clock = DeviceClock()
    times = [clock.at(10.0 + k, 10.5 + k, 1.7e9 + k) for k in range(3)]
    assert times == pytest.approx([1.7e9 - 0.5, 1.7e9 + 0.5, 1.7e9 + 1.5], abs=1e-6)


def test_between_two_times_of_the_log_the_device_goes_on_by_itself() -> None:
    clock = DeviceClock()
    times = [clock.at(10.0 + k, 10.5 + k, 1.7e9) for k in range(3)]
    assert times == pytest.approx([1.7e9 - 0.5, 1.7e9 + 0.5, 1.7e9 + 1.5], abs=1e-6)


def test_usbllong_writer_of_the_tests_is_right() -> None:
    record = said(evologics(20.0, 19.5, 1.0, 2.0, -3.0))
    assert isinstance(record, Sighting)
    assert (record.x, record.y, record.depth) == (1.0, 2.0, 3.0)
