"""The recorded track: that of `surefix clean`, whole or readable, gone on with after a crash."""

import asyncio
import math
from pathlib import Path

import pyarrow as pa
import pyarrow.ipc
import pyarrow.parquet as pq
import pytest

from service.test_station import CLEAN, recorded
from surefix.errors import OptionsError, OutputError
from surefix.io.journal import open_journal
from surefix.io.writers import write_cleaned
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.service.inbox import Arrived
from surefix.service.live import begin_live, run_live, step
from surefix.service.options import read_live


def options_in(folder, *names, snapshot_s=1000.0):
    outputs = "".join(f"[[output]]\nto = 'file:{name}'\n" for name in names)
    (folder / "live.toml").write_text(
        "[clean]\nsettle_rows = 40\nreorder_s = 2.0\n"
        "[[input]]\nname = 'boat'\nfrom = 'file:boat.nmea?speed=0'\n"
        f"{outputs}[journal]\nurl = 'sqlite:///mission.db'\nsnapshot_s = {snapshot_s}\n"
    )
    (folder / "boat.nmea").write_bytes(recorded())
    return read_live(folder / "live.toml")


def expected(folder):
    """What `clean` writes of the same log, as text and as a table."""
    whole = clean_sources(open_inputs([folder / "boat.nmea"]), CLEAN)
    for name in ("whole.csv", "whole.parquet"):
        write_cleaned(folder / name, whole)
    return (folder / "whole.csv").read_bytes(), pq.read_table(folder / "whole.parquet")


def rows_of(place):
    """Rows of a recorded track, be it whole or not."""
    if place.suffix == ".csv":
        return max(place.read_bytes().count(b"\n") - 1, 0)
    return pa.ipc.open_stream(place.with_name("track.parquet.arrows")).read_all().num_rows


def test_a_replayed_log_is_recorded_as_clean_writes_it(tmp_path):
    options = options_in(tmp_path, "track.csv", "track.parquet")
    asyncio.run(run_live(begin_live(options), asyncio.Event()))
    text, rows = expected(tmp_path)
    assert (tmp_path / "track.csv").read_bytes() == text
    assert pq.read_table(tmp_path / "track.parquet").equals(rows)
    assert not (tmp_path / "track.parquet.arrows").exists()


def run_until(live, pieces, last):
    """Let a service take pieces, and leave it as a crash would after some of them."""

    async def run():
        for piece in pieces[live.taken : last]:
            await step(live, [Arrived(0, math.nan, piece)], 0.0)
            live.stored_at = -math.inf if live.taken % 40 == 0 else math.inf

    asyncio.run(run())
    live.journal.close()


@pytest.mark.parametrize("name", ["track.csv", "track.parquet"])
@pytest.mark.parametrize("cut", [0, 70])
def test_after_a_crash_no_row_is_lost_or_doubled(tmp_path, name, cut):
    """Crashed time and again, each time with the end of the file not on the disk."""
    options = options_in(tmp_path, name)
    pieces = [*recorded().splitlines(keepends=True), b""]
    grown = []
    for last in (250, 251, 290, 330, 450):
        live = begin_live(options)
        run_until(live, pieces, last)
        place = tmp_path / (name if name == "track.csv" else "track.parquet.arrows")
        if not place.exists():
            continue
        grown.append(rows_of(tmp_path / name))
        if last == 330:  # a line, or a record batch, that was being written
            with place.open("ab") as file:
                file.write(begun(tmp_path / name)[:cut])
    assert len(grown) >= 3
    assert grown[-1] > grown[0]
    live = begin_live(options)
    assert [each.missing for each in live.recorders] == [0]

    async def end():
        for piece in pieces[live.taken :]:
            await step(live, [Arrived(0, math.nan, piece)], 0.0)

    asyncio.run(end())
    live.recorders[0].close()
    live.journal.close()
    text, rows = expected(tmp_path)
    if name == "track.csv":
        assert (tmp_path / name).read_bytes() == text
    else:
        assert pq.read_table(tmp_path / name).equals(rows)


def begun(place):
    """What might be written next: a line, a record batch."""
    if place.suffix == ".csv":
        return place.read_bytes().splitlines()[-1]
    stream = pa.ipc.open_stream(place.with_name("track.parquet.arrows"))
    return stream.read_next_batch().serialize().to_pybytes()


def test_rows_that_were_moved_away_are_told(tmp_path):
    options = options_in(tmp_path, "track.csv", snapshot_s=0.001)
    pieces = recorded().splitlines(keepends=True)
    run_until(begin_live(options), pieces, 300)
    gone = rows_of(tmp_path / "track.csv")
    (tmp_path / "track.csv").rename(tmp_path / "yesterday.csv")
    live = begin_live(options)
    asyncio.run(run_live(live, asyncio.Event()))
    journal = open_journal(options.journal, new=False)
    (said,) = [each.text for each in journal.told() if "lacks" in each.text]
    journal.close()
    assert f"lacks {gone} rows" in said
    text = expected(tmp_path)[0].splitlines()
    assert (tmp_path / "track.csv").read_bytes().splitlines() == [text[0], *text[gone + 1 :]]


@pytest.mark.parametrize("name", ["track.csv", "track.parquet"])
def test_a_file_of_another_mission_is_put_aside(tmp_path, name):
    asyncio.run(run_live(begin_live(options_in(tmp_path, name)), asyncio.Event()))
    old = (tmp_path / name).read_bytes()
    (tmp_path / "mission.db").rename(tmp_path / "first.db")
    asyncio.run(run_live(begin_live(options_in(tmp_path, name)), asyncio.Event()))
    (aside,) = tmp_path.glob(f"{name}.before-????????T??????")
    assert aside.read_bytes() == old
    assert rows_of_whole(tmp_path / name) == rows_of_whole(aside) > 100


def rows_of_whole(place):
    if ".csv" in place.name:
        return place.read_bytes().count(b"\n")
    return pq.read_table(place).num_rows


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no disk that is full")
def test_a_full_disk_is_waited_for(tmp_path):
    options = options_in(tmp_path, "track.csv")
    live = begin_live(options)
    (tmp_path / "track.csv").symlink_to("/dev/full")
    pieces = [*recorded().splitlines(keepends=True), b""]

    async def run(some):
        for piece in some:
            await step(live, [Arrived(0, math.nan, piece)], 0.0)

    asyncio.run(run(pieces[:300]))
    live.recorders[0].flush()
    assert "track.csv" in live.recorders[0].trouble
    (tmp_path / "track.csv").unlink()
    asyncio.run(run(pieces[300:]))
    live.recorders[0].close()
    live.journal.close()
    assert (tmp_path / "track.csv").read_bytes() == expected(tmp_path)[0]


def test_a_file_that_is_none_is_refused(tmp_path):
    (tmp_path / "track.parquet").write_bytes(b"rubbish")
    with pytest.raises(OutputError, match="no Parquet"):
        begin_live(options_in(tmp_path, "track.parquet"))


@pytest.mark.parametrize(
    ("output", "why"),
    [
        ("to = 'file:track.txt'", r"\.csv or \.parquet"),
        ("to = 'file:track.csv?speed=1'", r"\.csv"),
        ("to = 'file:track.csv'\ntalker = 'IN'", "only to"),
    ],
)
def test_options_of_a_recorded_track(tmp_path, output, why):
    options_in(tmp_path)
    place = tmp_path / "live.toml"
    place.write_text(place.read_text() + f"[[output]]\n{output}\n")
    with pytest.raises(OptionsError, match=why):
        read_live(place)
