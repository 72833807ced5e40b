"""Sentences and lines that tell how a vehicle lies."""

import math
from pathlib import Path

import numpy as np
import pytest

from surefix.errors import ParseError
from surefix.io.acoustic_line import read_line
from surefix.io.acoustic_record import Attitude
from surefix.io.nmea import checksum, parse
from surefix.io.nmea_log import read_nmea, sniff
from surefix.io.nmea_record import Refused
from surefix.io.table import from_frame


def said(body):
    return parse(b"$%s*%02X" % (body, checksum(body)))


@pytest.mark.parametrize(
    ("body", "told"),
    [
        (
            b"PASHR,204132.040,010.99,T,+00.41,-00.75,-00.84,0.151,0.088,0.569,1,0",
            (74492.04, 10.99, 0.41, -0.75),
        ),
        (b"PASHR,,,,1.5,-2.5,", (math.nan, math.nan, 1.5, -2.5)),
        (b"PSXN,23,0.58,-1.09,218.83,0.78", (math.nan, 218.83, 0.58, -1.09)),
        (b"PHTRO,10.37,P,7.62,T", (math.nan, None, 7.62, -10.37)),
        (b"PHTRO,10.37,M,7.62,B", (math.nan, None, -7.62, 10.37)),
        (b"YXXDR,A,-4.5,D,PTCH,A,6.25,D,ROLL", (math.nan, None, 6.25, -4.5)),
        (b"IIXDR,C,,C,AIRTEMP,A,2.0,D,Pitch", (math.nan, None, None, 2.0)),
        (b"IIXDR,A,,D,ROLL,A,1.0,V,PITCH", (math.nan, None, math.nan, None)),
    ],
)
def test_what_they_tell(body, told):
    record = said(body)
    assert isinstance(record, Attitude)
    assert repr(record[2:]) == repr(told)


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        (b"PASHR,204132.040,010.99,T,+90.41,-00.75,-00.84", "range"),
        (b"PASHR,204132.040,361.99,T,+00.41,-00.75,-00.84", "range"),
        (b"PSXN,23,0.58,-181.09,218.83,0.78", "range"),
        (b"HCXDR,A,171,D,PITCH,A,-37,D,ROLL", "range"),  # tenths of degrees that do not say so
        (b"PHTRO,110.37,P,7.62,T", "range"),
        (b"PSXN,23,0.58,x,218.83,0.78", "field"),
        (b"YXXDR,A,x,D,ROLL", "field"),
        (b"PHTRO,10.37,Q,7.62,T", "field"),
        (b"PSXN,23,0.58,1.0", "field"),
        (b"PSXN,20,1,0,0,0", "unknown-type"),
        (b"PASHR,POS,0,03,183530.00", "unknown-type"),
        (b"IIXDR,C,,C,AIRTEMP,A,-1.0,D,HEEL", "unknown-type"),
    ],
)
def test_what_is_refused(body, kind):
    record = said(body)
    assert isinstance(record, Refused)
    assert record.kind == kind


def test_a_line_of_a_motion_sensor():
    before, record = read_line(b"2014-08-01T00:00:00Z :00FFCA -0003F-0325  0319")
    assert before == b"2014-08-01T00:00:00Z "
    assert record[2:] == (pytest.approx(math.nan, nan_ok=True), None, -3.25, 3.19)
    for text in (b":00FFCA -0003f-0325  0319", b":00FFCA -0003F-9325  0319"):
        unsettled = read_line(text)[1]
        assert math.isnan(unsettled.roll)
        assert math.isnan(unsettled.pitch)
    assert read_line(b":00FFCA -0003F-0325  031") is None
    assert sniff(b":00FFCA -0003F-0325  0319\r\n" * 5)


def test_logs_of_ships_that_roll(data: Path):
    path = data / "ship_palmer" / "NBP1406_seap-2014-08-01"
    (log,) = read_nmea(path)
    series = {each.name: each for each in log.channels if each.sensor.endswith("PSXN")}
    assert series.keys() == {"heading_deg", "roll_deg", "pitch_deg"}
    assert len(series["roll_deg"].time) == path.read_bytes().count(b"$PSXN,23,") > 700
    assert np.std(series["pitch_deg"].value) == pytest.approx(1.8, abs=0.1)
    assert log.problems == ()
    (log,) = read_nmea(data / "nmea_receivers" / "rst39.log")
    (roll,) = (each for each in log.channels if each.name == "roll_deg")
    assert np.median(np.diff(roll.time)) == pytest.approx(0.04)
    (log,) = read_nmea(data / "nmea_receivers" / "tnt-revolution.log")
    assert ("range", 10) in [(each.kind, each.total) for each in log.problems]


def test_columns_of_tables():
    frame = {"time": [0, 1, 2, 3], "Roll [deg]": [1.0, 358.0, 91.0, None], "pitch": [0, -1, 2, -90]}
    log = from_frame(frame, role="attitude")
    roll, pitch = log.channels
    np.testing.assert_array_equal(roll.value, [1.0, -2.0, np.nan, np.nan])
    np.testing.assert_array_equal(pitch.value, [0.0, -1.0, 2.0, -90.0])
    (problem,) = log.problems
    assert (problem.kind, problem.total) == ("range", 1)
    assert "91" in problem.example
    beside = from_frame(frame | {"x": [0.0, 1.0, 2.0, 3.0], "heading": [350.0] * 4})
    assert [each.name for each in beside.channels] == ["heading_deg", "roll_deg", "pitch_deg"]
    turned = from_frame(frame | {"heading": [1.0] * 4}, role="heading")
    assert [each.name for each in turned.channels] == ["heading_deg", "roll_deg", "pitch_deg"]
    with pytest.raises(ParseError, match="pitch"):
        from_frame({"time": [0, 1], "roll": [0.0, 1.0]}, role="attitude")
