"""How long the command line takes to begin, and what the first run costs.

Run ``python bench/startup.py [--json FILE] [--cold]``. Wall time and processor time of whole
processes, medians of several; ``--cold`` also compiles everything anew in an empty folder.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from measured import conclude

ROUNDS = 5
RUN = "import sys; sys.argv[0] = 'surefix'; from surefix.cli import main; main()"


def main() -> None:
    """Print a row per command."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--json", type=Path)
    options.add_argument("--cold", action="store_true")
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as name:
        conclude(list(_rows(Path(name), given.cold)), given.json)


def _rows(folder: Path, cold: bool) -> Iterator[dict[str, str]]:
    log, out = folder / "log.csv", folder / "track.csv"
    random = np.random.default_rng(1)
    x, y = (300.0 * np.sin(np.arange(1000) / 200.0) + random.normal(0.0, 0.5, 1000) for _ in "xy")
    pacsv.write_csv(pa.table({"time": np.arange(1000.0), "x": x, "y": y}), log)
    # like an installed package, whose modules are compiled once, whatever the shell says
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(folder / "modules")
    if cold:
        kernels = environment | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
        yield _row("warmup, nothing compiled before", [_run(["warmup"], kernels)])
        yield _row("warmup again", [_run(["warmup"], kernels)])
        first = environment | {"NUMBA_CACHE_DIR": str(folder / "first")}
        words = ["clean", str(log), "-o", str(out)]
        yield _row("clean 1,000 fixes, nothing compiled before", [_run(words, first)])
    commands = {
        "--help": ["--help"],
        "clean 1,000 fixes": ["clean", str(log), "-o", str(out)],
        "the same, igg3": ["clean", str(log), "-o", str(out), "--method", "igg3"],
    }
    for what, words in commands.items():
        _run(words, environment)
        yield _row(what, [_run(words, environment) for _ in range(ROUNDS)])


def _row(what: str, taken: list[tuple[float, float]]) -> dict[str, str]:
    wall, used = np.median(taken, axis=0)
    return {"what": f"{what:32}", "wall s": f"{wall:7.2f}", "processor s": f"{used:7.2f}"}


def _run(words: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Wall time and processor time of one process and its children, s."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", RUN, *words], env=environment, capture_output=True, check=True
    )
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.stdout
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
