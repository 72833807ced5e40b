"""Logs of real instruments: nothing is lost, nothing is believed that should not be."""

import re
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pynmea2
import pytest

from surefix.geo.time import parse_time
from surefix.io.nmea import checksum, parse
from surefix.io.nmea_log import read_nmea, sniff
from surefix.io.nmea_record import Position, Refused
from surefix.types import Log

SENTENCE = re.compile(rb"""[$!]([A-Z0-9]{2}[ "#%-)+-~]*)\*([0-9A-Fa-f]{2})""")
TIMED = ("PCOD", "s330", "seap")


def read(path: Path, **options: bool) -> Log:
    (log,) = read_nmea(path, **options)
    return log


def problems(log: Log) -> dict[str, int]:
    return {problem.kind: problem.total for problem in log.problems}


def palmer(data: Path, name: str) -> Path:
    return data / "ship_palmer" / f"NBP1406_{name}-2014-08-01"


def test_all_receiver_logs(data: Path) -> None:
    paths = sorted((data / "nmea_receivers").glob("*.log"))
    assert len(paths) == 138
    good = bad = read_good = read_bad = 0
    for path in paths:
        for body, digits in SENTENCE.findall(path.read_bytes()):
            right = reduce(xor, body, 0) == int(digits, 16)
            good, bad = good + right, bad + (not right)
        log = read(path)
        refused = problems(log)
        fields = sum(refused.get(kind, 0) for kind in ("field", "range"))
        read_good += sum(log.counts.values()) + fields
        read_bad += refused.get("checksum", 0)
        if log.fixes is not None:
            assert np.isfinite(log.fixes.position[log.fixes.valid][:, :2]).all()
    assert (read_good, read_bad) == (good, bad) == (22317, 57)


def test_pynmea2_reads_the_same_positions(data: Path) -> None:
    compared = 0
    for path in sorted((data / "nmea_receivers").glob("*.log")):
        for match in SENTENCE.finditer(path.read_bytes()):
            record = parse(match[0])
            if not isinstance(record, Position) or np.isnan(record.latitude):
                continue
            other = pynmea2.parse(match[0].decode())
            assert record.latitude == pytest.approx(other.latitude, abs=1e-9)
            assert record.longitude == pytest.approx(other.longitude, abs=1e-9)
            compared += 1
    assert compared > 4000


@pytest.mark.parametrize("name", TIMED)
def test_palmer_times_are_near_their_reception(data: Path, name: str) -> None:
    log = read(palmer(data, name))
    fixes = log.fixes
    assert fixes is not None
    lines = palmer(data, name).read_text().splitlines()
    received = [parse_time(text.split()[0]) for text in lines if "GGA," in text]
    assert np.abs(fixes.time - received).max() < 3.0
    assert (np.diff(fixes.time) > 0.0).all()
    assert fixes.valid.all()
    assert np.isfinite(fixes.velocity[:-1, :2]).all()
    assert problems(log) == {}


def test_palmer_p_code_is_one_rollover_behind(data: Path) -> None:
    (event,) = read(palmer(data, "PCOD")).events
    assert event.kind == "week-rollover"
    assert "1 × 1024" in event.text
    assert read(palmer(data, "s330")).events == ()


def test_palmer_gp02_has_no_checksums(data: Path) -> None:
    log = read(palmer(data, "gp02"))
    assert log.fixes is None
    assert problems(log) == {"no-checksum": 5000}
    log = read(palmer(data, "gp02"), require_checksum=False)
    assert problems(log) == {}
    assert log.fixes is not None
    assert len(log.fixes.time) == log.counts["GLL"]
    assert np.isfinite(log.fixes.velocity[:-1, 0]).mean() > 0.99


def test_palmer_gyro_and_sounder(data: Path) -> None:
    (heading,) = read(palmer(data, "gyr1")).channels
    assert (heading.name, heading.period, len(heading.value)) == ("heading_deg", 360.0, 5000)
    assert np.median(np.diff(heading.time)) == pytest.approx(0.2, abs=0.01)
    (depth,) = read(palmer(data, "mbdp")).channels
    assert (depth.name, len(depth.value)) == ("depth_m", 5000)
    assert 4000 < np.nanmedian(depth.value) < 5000


def test_palmer_files_of_other_kinds_are_recognised(data: Path) -> None:
    nmea = {
        path.name.split("_")[1][:4]
        for path in (data / "ship_palmer").iterdir()
        if sniff(path.read_bytes()[:65536])
    }
    assert nmea == {"PCOD", "gp02", "gyr1", "mbdp", "s330", "seap"}
    assert problems(read(palmer(data, "knud"))).keys() == {"not-nmea"}


@pytest.mark.parametrize("name", ["20140628", "20130802", "20130803", "20140822"])
def test_yachts(data: Path, name: str) -> None:
    (path,) = (data / "ship_yachts").glob(f"*{name}*")
    assert sniff(path.read_bytes()[:65536])
    log = read(path)
    fixes = log.fixes
    assert fixes is not None
    assert sum(problems(log).values()) <= 2
    assert np.isfinite(fixes.time).all()
    assert fixes.time.max() - fixes.time.min() < 5 * 3600
    assert max(log.counts["RMC"], log.counts["GLL"]) <= len(fixes.time)
    assert len(fixes.time) < 1.2 * max(log.counts["RMC"], log.counts["GLL"])
    ship = fixes.sensor == log.sensors.index(f"{path.stem} II")
    repeated = int((np.diff(fixes.time[ship]) == 0.0).sum())
    assert 300 < repeated < 1000
    depth = next(c for c in log.channels if c.name == "depth_m" and c.sensor.endswith("IIDPT"))
    assert 2.0 < np.nanmedian(depth.value) < 30.0


def test_no_cut_of_a_real_sentence_is_believed(data: Path) -> None:
    lines = palmer(data, "s330").read_bytes().splitlines()[:10]
    for text in (line[line.index(b"$") :] for line in lines):
        for end in range(len(text)):
            assert isinstance(parse(text[:end]), Refused)
        assert checksum(text[1:-3]) == int(text[-2:], 16)
