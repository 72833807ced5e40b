"""In real time a log may be larger than the memory."""

import json
import os
import subprocess
import sys

import pyarrow as pa
import pyarrow.csv as pacsv
import pytest

from acceptance.product import survey

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="peak memory is measured the POSIX way"),
]

MEASURE = """
import json, pathlib, re, resource, sys
from surefix.cli import main
sys.argv = ["surefix", *sys.argv[1:]]
try:
    main()
finally:
    status = pathlib.Path("/proc/self/status")
    if status.exists():  # there the peak of getrusage may be that of the process before the fork
        peak = int(re.search(r"VmHWM:\\s+(\\d+)", status.read_text())[1]) / 1024
    else:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20)
    sys.stderr.write(json.dumps(peak))
"""
BLOCK = 100_000


def generate(path, blocks: int) -> None:
    """A long log at 5 Hz, block by block: the same 100,000 fixes again, later and farther on."""
    log = survey(BLOCK, interval=0.2)
    with path.open("wb") as file:
        for k in range(blocks):
            start = k * BLOCK * 0.2
            moved = {
                "time": log["time"] + start,
                "x": log["x"] + start,
                "y": log["y"] + 0.3 * start,
                "z": log["z"],
            }
            how = pacsv.WriteOptions(include_header=k == 0)
            pacsv.write_csv(pa.table({n: v.round(2) for n, v in moved.items()}), file, how)


def peak_mb(path, out) -> float:
    command = [sys.executable, "-c", MEASURE, "clean", str(path), "--mode", "realtime"]
    done = subprocess.run(
        [*command, "-o", str(out), "--json"],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["fixes"] > 0
    return float(done.stderr)


def test_memory_is_bounded_in_real_time(tmp_path):
    """Twice the log, the same memory: nothing is kept but what the filter carries.

    The bound holds the libraries (some 250 MB), the head, a block of text and its rows, and what
    is kept for the figures of the summary. A short log goes before, which compiles the kernels:
    that takes some 100 MB of its own.
    """
    peaks = {}
    for blocks in (1, 10, 20):
        path, out = tmp_path / "log.csv", tmp_path / "out.csv"
        generate(path, blocks)
        peaks[blocks] = peak_mb(path, out)
        with out.open("rb") as file:
            assert sum(1 for _ in file) == blocks * BLOCK + 1
        path.unlink()
        out.unlink()
    assert max(peaks[10], peaks[20]) < 580, peaks
    assert peaks[20] - peaks[10] < 100, peaks
