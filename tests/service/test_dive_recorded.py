"""A recorded dive off an anchored boat, each instrument on a line of its own, live and recorded."""

import math

import numpy as np
import pandas as pd
import pytest

from acoustic_logs import angle, clock, line, received
from service.test_dive_inputs import CLEAN, counted, options, same
from surefix.geo.time import DAY
from surefix.io.journal import Received
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.joining import join
from surefix.service.station import begin_station, receive

SECONDS = 500.0


@pytest.fixture
def recorded(data):
    """Sentences of the boat and the acoustic system, by line: (time of reception, sentence)."""
    folder = data / "usbl_ugps_raw"

    def read(name):
        table = pd.read_csv(next(folder.glob(f"*{name}.csv")))
        begin = table.timestamp.iloc[0]
        return table[table.timestamp < begin + SECONDS]

    gnss, gyro, usbl = read("nmea_GGA"), read("nmea_HDT"), read("g2_acoustic")
    usbl = usbl[usbl.position_valid].drop_duplicates(["x", "y", "z"])
    lines = {"usbl": [], "gnss": [], "gyro": []}
    for row in gnss.itertuples():
        place = f"{angle(row.latitude, 2, 'NS')},{angle(row.longitude, 3, 'EW')}"
        told = f"GPGGA,{row.utc:09.2f},{place},2,25,0.7,1.4,M,0.0,M,,"
        lines["gnss"].append((row.timestamp, line(told)))
    for row in gyro.itertuples():
        lines["gyro"].append((row.timestamp, line(f"HEHDT,{row.heading:.1f},T")))
    for row in usbl.itertuples():
        place = f"C,H,M,{row.y:.4f},{row.x:.4f},{row.z:.4f}"
        told = f"PSIMSSB,{clock(row.timestamp % DAY)},B01,A,,{place},{row.std:.2f},N,,"
        lines["usbl"].append((row.timestamp, line(told)))
    return lines, folder


def test_a_recorded_dive(tmp_path, recorded):
    """Live, from three logs, and from one: the same fixes; and the ship from tables, too."""
    lines, folder = recorded
    for name, told in lines.items():
        text = b"".join(received(text, at) for at, text in told)
        (tmp_path / f"{name}.log").write_bytes(text)
    logs = {name: tmp_path / f"{name}.log" for name in lines}
    ship = [logs["gnss"], logs["gyro"]]
    whole = clean_sources(open_inputs([logs["usbl"]], ship=ship), CLEAN)
    assert len(whole.track.time) == len(lines["usbl"]) > 200
    assert counted(whole).get("unplaced", 0) <= 5  # before its first and after its last fix

    station, given = begin_station(options(tuple(lines))), []
    coming = [
        (at, source, received(text, at))
        for source, told in enumerate(lines.values())
        for at, text in told
    ]
    ends = [(math.nan, source, b"") for source in range(3)]
    for number, (at, source, text) in enumerate([*sorted(coming), *ends], 1):
        station, batches = receive(station, [Received(number, source, at, text)])
        given += batches
    same(join(given), whole)

    together = tmp_path / "usbl.all" / "usbl.log"
    together.parent.mkdir()
    together.write_bytes(b"".join(text for _, _, text in sorted(coming)))
    one = clean_sources(open_inputs([together]), CLEAN)
    np.testing.assert_array_equal(one.raw_coordinates, whole.raw_coordinates)

    tables = [next(folder.glob(f"*{name}.csv")) for name in ("nmea_GGA", "nmea_HDT")]
    columns = {"ship.time": "timestamp:s"}  # of reception, .06 s after the time in the sentence
    other = clean_sources(open_inputs([logs["usbl"]], ship=tables, columns=columns), CLEAN)
    apart = (other.raw_coordinates - whole.raw_coordinates)[:, :2] * [111_200.0, 73_400.0]
    there = np.isfinite(apart).all(axis=1)
    assert there.sum() > 200
    assert np.abs(apart[there]).max() < 0.5  # at anchor; the heading is told to 0.1°
