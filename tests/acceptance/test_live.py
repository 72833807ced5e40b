"""Recorded streams, cut into pieces as they come: live says what `clean --mode realtime` says."""

import asyncio
import math
import time

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from surefix.api import to_table
from surefix.io.journal import Received
from surefix.io.writers import write_cleaned
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.service.addresses import Address
from surefix.service.live import begin_live, run_live
from surefix.service.options import InputOptions, LiveOptions, read_live
from surefix.service.station import begin_station, receive

CLEAN = CleanOptions(mode="realtime", settle_rows=120, reorder_s=2.0)
YACHTS = ("irene_flensburg_20130802_NMEA0005.TXT", "psaros33_20140822_NMEA0000.TXT")
PALMER = tuple(f"NBP1406_{name}-2014-08-01" for name in ("s330", "gp02", "PCOD", "gyr1"))


def streamed(paths, count):
    """Batches of logs that arrive side by side in so many pieces each."""
    inputs = tuple(InputOptions(name=path.stem, address=Address("file")) for path in paths)
    station = begin_station(LiveOptions(clean=CLEAN, inputs=inputs))
    contents = [path.read_bytes() for path in paths]
    sizes = [len(content) // count + 1 for content in contents]
    given, number = [], 0
    for k in range(count + 1):
        for source, (content, size) in enumerate(zip(contents, sizes, strict=True)):
            number += 1
            data = content[k * size : (k + 1) * size] if k < count else b""
            station, batches = receive(station, [Received(number, source, math.nan, data)])
            given += batches
    return join(given)


LOGS = [("ship_yachts", YACHTS[:1]), ("ship_yachts", YACHTS[1:]), ("ship_palmer", PALMER)]


@pytest.mark.parametrize(("folder", "names"), LOGS)
def test_a_recorded_stream_is_cleaned_live_as_from_its_file(data, folder, names):
    paths = [data / folder / name for name in names]
    live, whole = streamed(paths, 400), clean_sources(open_inputs(paths), CLEAN)
    pd.testing.assert_frame_equal(
        to_table(live).to_pandas(), to_table(whole).to_pandas(), check_exact=True
    )
    series = [{(c.sensor, c.name): c for c in one.channels} for one in (live, whole)]
    assert series[0].keys() == series[1].keys()
    for key, one in series[0].items():
        np.testing.assert_array_equal(one.value, series[1][key].value)
        np.testing.assert_array_equal(one.verdicts.verdict, series[1][key].verdicts.verdict)


def replayed(folder, paths, speed):
    """Seconds that a replay of logs took, with the track that it recorded."""
    inputs = "".join(
        f"[[input]]\nname = '{path.stem}'\nfrom = 'file:{path}?speed={speed}'\n" for path in paths
    )
    (folder / "live.toml").write_text(
        f"[clean]\nsettle_rows = 120\nreorder_s = 2.0\n{inputs}"
        "[[output]]\nto = 'file:track.parquet'\n"
        "[[output]]\nto = 'tcp-listen://127.0.0.1:0'\n"
        "[journal]\nurl = 'sqlite:///mission.db'\n"
    )
    began = time.monotonic()
    asyncio.run(run_live(begin_live(read_live(folder / "live.toml")), asyncio.Event()))
    return time.monotonic() - began, pq.read_table(folder / "track.parquet")


@pytest.mark.parametrize(
    ("folder", "names", "size"), [("ship_yachts", YACHTS[:1], 240_000), ("ship_palmer", PALMER, -1)]
)
def test_a_log_replayed_at_a_hundred_times_its_pace_is_cleaned_as_its_file(
    data, tmp_path, folder, names, size
):
    """The whole path: paced bytes, inbox, journal, output, recorded file."""
    paths = []
    for name in names:
        paths.append(tmp_path / name)
        paths[-1].write_bytes((data / folder / name).read_bytes()[:size])
    whole = clean_sources(open_inputs(paths), CLEAN)
    write_cleaned(tmp_path / "whole.parquet", whole)
    took, rows = replayed(tmp_path, paths, 100)
    assert rows.equals(pq.read_table(tmp_path / "whole.parquet"))
    lasted = float(whole.track.time[-1] - whole.track.time[0])
    assert took > 0.9 * lasted / 100.0  # at its pace, and not as fast as can be
