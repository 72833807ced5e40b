"""Whatever breaks, no half-written file stands, an older output stays, and one line says why."""

import gzip
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from acceptance.product import PROGRAM, process, read, surefix, survey, told_in_one_line, write

OLD = "an older output\n"
ROWS = 20_000


@pytest.fixture(scope="module")
def long_log(tmp_path_factory):
    return write(tmp_path_factory.mktemp("long") / "log.csv", survey(300_000, interval=0.2))


@pytest.fixture
def log(tmp_path):
    (tmp_path / "in").mkdir()
    return write(tmp_path / "in" / "log.csv", survey(ROWS))


@pytest.fixture
def out(tmp_path):
    """A place where an older output stands."""
    (tmp_path / "out").mkdir()
    place = tmp_path / "out" / "track.csv"
    place.write_text(OLD)
    return place


def untouched(out):
    assert [path.name for path in out.parent.iterdir()] == [out.name]
    assert out.read_text() == OLD


@pytest.mark.parametrize("mode", ["realtime", "offline"])
def test_truncated_gzip(log, out, mode):
    packed = log.with_suffix(".csv.gz")
    content = gzip.compress(log.read_bytes(), compresslevel=1)
    packed.write_bytes(content[: len(content) // 2])
    line = told_in_one_line(surefix("clean", packed, "--mode", mode, "-o", out))
    assert packed.name in line
    untouched(out)


@pytest.mark.parametrize("mode", ["realtime", "offline"])
def test_a_second_input_that_breaks(log, out, mode):
    """Batches of the first may already be on their way to the disk."""
    broken = log.with_name("depth.parquet")
    depth = pd.DataFrame({"time": survey(ROWS)["time"], "depth": np.full(ROWS, 1.0)})
    depth.to_parquet(broken, row_group_size=1000)
    content = bytearray(broken.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 3000] = bytes(3000)
    broken.write_bytes(content)
    done = surefix("clean", log, "--depth", broken, "--mode", mode, "-o", out)
    assert broken.name in told_in_one_line(done)
    untouched(out)


def test_inputs_that_are_none(log, out, tmp_path):
    binary = tmp_path / "in" / "binary.log"
    binary.write_bytes(bytes(range(256)) * 100)
    empty = tmp_path / "in" / "empty.csv"
    empty.write_bytes(b"")
    for path in (tmp_path, tmp_path / "nowhere.csv", binary, empty):
        for command in (("clean", "-o", out), ("info",)):
            line = told_in_one_line(surefix(*command, path))
            assert path.name in line
            untouched(out)
        assert path.name in told_in_one_line(surefix("clean", log, path, "-o", out))
        untouched(out)


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="only Linux has such a file")
def test_unreadable_input(out):
    """A file whose every read fails, for root as well."""
    assert "mem" in told_in_one_line(surefix("clean", "/proc/self/mem", "-o", out))
    untouched(out)


def test_outputs_that_cannot_be_written(log, out, tmp_path):
    for place in (tmp_path / "nowhere" / "t.csv", tmp_path / "out.csv", log / "t.csv"):
        if place.name == "out.csv":
            place.mkdir()
        line = told_in_one_line(surefix("clean", log, "-o", out, "-o", place))
        assert str(place) in line
        untouched(out)
    line = told_in_one_line(surefix("clean", log, "-o", "/dev/full"))
    assert "/dev/full" in line


def test_a_second_output_that_fails_leaves_none(log, out):
    """Metric fixes have no place in GPX: the CSV beside it is not written either."""
    told_in_one_line(surefix("clean", log, "-o", out, "-o", out.with_suffix(".gpx")))
    untouched(out)


def test_a_report_that_cannot_be_written(log, out, tmp_path):
    done = surefix("clean", log, "-o", out, "--report", tmp_path / "nowhere" / "r.html")
    assert "r.html" in told_in_one_line(done)
    assert sorted(p.name for p in out.parent.iterdir()) == [out.name]


@pytest.mark.skipif(os.name != "posix", reason="limits of a process are POSIX")
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("mode", ["realtime", "offline"])
def test_full_disk(log, out, suffix, mode):
    """A limit of the file size stands for the disk: the system refuses the rest."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    place = out.with_suffix(suffix)
    if place != out:
        out.rename(place)
    done = process("clean", log, "--mode", mode, "-o", place, preexec_fn=limit)
    assert place.name in told_in_one_line(done)
    untouched(place)


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("mode", ["realtime", "offline"])
def test_interrupted(long_log, out, mode, number):
    command = [*PROGRAM, "clean", str(long_log), "--mode", mode, "-o", str(out)]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    if mode == "realtime":  # wait until it has begun to write
        while time.monotonic() < until and len(list(out.parent.iterdir())) == 1:
            time.sleep(0.005)
            assert running.poll() is None
    else:
        time.sleep(1.2)
    running.send_signal(number)
    said, err = running.communicate(timeout=60)
    assert running.returncode not in (0, None)
    assert "Traceback" not in err
    if number == signal.SIGINT:
        assert running.returncode == 130
        assert err == "surefix: interrupted\n"
        assert said == ""
    untouched(out)


STOPPED_WHILE_FINALISING = """
import signal, sys, time
from surefix import cli

class Last:
    def __del__(self):
        signal.raise_signal(int(sys.argv[1]))
        for _ in range(10):
            pass

def app(**_):
    Last()
    time.sleep(5.0)

cli.app = app
cli.main()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_not_lost_where_exceptions_are_dropped(number, code):
    """The interpreter drops what is raised while an object is finalised."""
    command = [sys.executable, "-c", STOPPED_WHILE_FINALISING, str(int(number))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == code
    assert done.stderr == ("surefix: interrupted\n" if number == signal.SIGINT else "")


def test_python_dash_m():
    command = [sys.executable, "-m", "surefix", "--version"]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_an_older_output_is_replaced_whole(log, out):
    assert process("clean", log, "-o", out).returncode == 0
    assert len(read(out)) == ROWS
    assert [path.name for path in out.parent.iterdir()] == [out.name]


INTERRUPTED_WHILE_READING = """
import os, signal, sys, threading, time
from surefix.cli_begin import begin

begin()
import pyarrow as pa, pyarrow.csv as pacsv

signal.signal(signal.SIGINT, signal.default_int_handler)
text, met = pa.py_buffer(b"a,b\\n" + b"1.5,2.5\\n" * 20_000), 0
for k in range(60):
    teller = threading.Timer(k * 0.0005, os.kill, (os.getpid(), signal.SIGINT))
    try:
        teller.start()
        until = time.monotonic() + 0.05
        while time.monotonic() < until or teller.is_alive():
            pacsv.read_csv(pa.BufferReader(text))
        time.sleep(0.01)
    except KeyboardInterrupt:
        met += 1
print(met)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX")
def test_no_interruption_is_lost_while_arrow_reads():
    words = [sys.executable, "-c", INTERRUPTED_WHILE_READING]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.split() == ["60"]
