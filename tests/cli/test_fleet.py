"""`surefix fleet`: words, exit codes, and what is left after it was stopped in the middle."""

import json
import signal
import subprocess
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from acceptance.product import PROGRAM, surefix
from fleet.tracks import in_time, one, tracks


def data_set(folder, table):
    folder.mkdir()
    pq.write_table(table, folder / "tracks.parquet", row_group_size=500)
    return folder


def rows(place):
    return pa.concat_tables([pq.read_table(p) for p in sorted(place.glob("tracks/*.parquet"))])


def test_tracks_are_told_in_a_table_and_as_json(tmp_path):
    folder = data_set(tmp_path / "in", tracks(3))
    words = "fleet", folder, "-o", tmp_path / "out", "--method", "igg3", "--jobs", 1
    done = surefix(*words)
    assert done.code == 0, done.err
    assert "3 cleaned, 0 failed; 201 fixes" in done.out
    assert "t001" in done.out
    told = json.loads(surefix(*words, "--json").out)
    assert (told["cleaned"], told["kept"]) == (3, told["units"])
    assert told["examples"][1]["name"] == "t001"
    assert "1 of 1 units done before" in surefix(*words).out


def test_a_failure_is_told_and_is_the_exit_code(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "bad.csv").write_text("u,v\n1,2\n")
    pq.write_table(one(tracks(1), "t000"), tmp_path / "in" / "good.parquet")
    words = "fleet", tmp_path / "in", "-o", tmp_path / "out", "--format", "csv", "--jobs", 1
    done = surefix(*words, "--method", "igg3")
    assert done.code == 1
    assert done.err == ""
    assert "1 cleaned, 1 failed" in done.out
    assert "bad.csv: no time column" in done.out
    assert (tmp_path / "out" / "good.csv").is_file()
    assert json.loads(surefix(*words, "--method", "igg3", "--json").out)["failed"] == 1


@pytest.mark.parametrize("words", [("--jobs", "0"), ("--method", "best"), ("--track", "vessel")])
def test_wrong_words_end_in_one_line(tmp_path, words):
    folder = data_set(tmp_path / "in", tracks(1))
    done = surefix("fleet", folder, "-o", tmp_path / "out", *words)
    assert done.code == 1
    assert done.err.count("\n") == 1
    assert "expected" in done.err


def children(process):
    text = Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii")
    return [int(word) for word in text.split()]


def alive(process):
    try:
        return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text(encoding="utf-8")
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="asks Linux for processes")
@pytest.mark.parametrize(
    ("stop", "mixed"), [(signal.SIGKILL, False), (signal.SIGKILL, True), (signal.SIGINT, False)]
)
def test_a_fleet_that_was_stopped_goes_on(tmp_path, stop, mixed):
    table = tracks(20, rows=200)
    folder = data_set(tmp_path / "in", in_time(table) if mixed else table)
    place = tmp_path / "out"
    words = ["fleet", folder, "-o", place, "--method", "igg3"]
    command = [*PROGRAM, *map(str, words), "--jobs", "2"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as running:
        while len(list(place.glob("tracks/part-*.parquet"))) < 2 and running.poll() is None:
            time.sleep(0.01)
        helpers = children(running.pid)
        assert len(helpers) >= 2
        running.send_signal(stop)
        _, said = running.communicate(timeout=60)
    if stop == signal.SIGINT:
        assert running.returncode == 130
        assert said == "surefix: interrupted\n"
        assert not [p for p in place.rglob(".*.part") if p.is_file()]
    until = time.monotonic() + 30.0
    while any(alive(helper) for helper in helpers) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(alive(helper) for helper in helpers)
    first = {p.name: p.stat().st_mtime_ns for p in place.glob("tracks/part-*.parquet")}
    done = json.loads(surefix(*words, "--jobs", 1, "--json").out)
    assert 1 <= done["kept"] < done["units"]
    assert done["cleaned"] == 20
    last = {p.name: p.stat().st_mtime_ns for p in place.glob("tracks/part-*.parquet")}
    assert sum(last[name] == stamp for name, stamp in first.items()) == done["kept"]
    assert not [p for p in place.rglob(".*.part") if p.is_file()]
    surefix("fleet", folder, "-o", tmp_path / "whole", "--method", "igg3", "--jobs", 1)
    assert rows(place).equals(rows(tmp_path / "whole"))
