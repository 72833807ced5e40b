"""What cleaning costs from 10⁴ fixes on: seconds, and the most memory in use at one time.

Run ``python bench/scale.py [--most 1e7] [--methods igg3] [--modes realtime] [--json FILE]``, and
``python bench/scale.py --draw bench/scale.json`` for the picture ``docs/scale.svg``. The log has
positions at 100 Hz, one in twenty wrong; it is read from Parquet and the track written to Parquet.
Each run is a process of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from measured import conclude

PART = 250_000
RUN = "import sys; sys.argv[0] = 'surefix'; from surefix.cli import main; main()"
PICTURE = Path(__file__).parents[1] / "docs" / "scale.svg"


def main() -> None:
    """Print a row per method, mode and size, or draw recorded rows."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--most", type=float, default=1e7)
    options.add_argument("--methods", default="igg3,multi-hypothesis")
    options.add_argument("--modes", default="realtime,lagged,offline")
    options.add_argument("--json", type=Path)
    options.add_argument("--draw", type=Path)
    given = options.parse_args()
    if given.draw is not None:
        _draw(json.loads(given.draw.read_text())["rows"])
        return
    with tempfile.TemporaryDirectory() as name:
        rows = _rows(Path(name), given.methods.split(","), given.modes.split(","), given.most)
        conclude(list(rows), given.json)


def _rows(
    folder: Path, methods: list[str], modes: list[str], most: float
) -> Iterator[dict[str, str | float]]:
    sizes = [10**k for k in range(4, 8) if 10**k <= most]
    for size in sizes:
        _write(folder / f"{size}.parquet", size)
    for method in methods:
        for mode in modes:
            words = ["--method", method, "--mode", mode, "-o", str(folder / "track.parquet")]
            _clean([str(folder / f"{sizes[0]}.parquet"), *words])
            for size in sizes:
                wall, used, memory = _clean([str(folder / f"{size}.parquet"), *words])
                yield {
                    "method": method,
                    "mode": mode,
                    "fixes": size,
                    "wall s": round(wall, 2),
                    "processor s": round(used, 2),
                    "MB": round(memory),
                }


def _write(place: Path, size: int) -> None:
    """Write a log part by part: a child's memory counts from that of this process."""
    random = np.random.default_rng(1)
    schema = pa.schema([(name, pa.float64()) for name in ("time", "x", "y")])
    with pq.ParquetWriter(place, schema) as writer:
        for first in range(0, size, PART):
            writer.write_table(_fixes(random, first, min(PART, size - first)))


def _fixes(random: np.random.Generator, first: int, n: int) -> pa.Table:
    """Positions at 100 Hz on a curved way, noise 0.5 m, one in twenty wrong by some 30 m."""
    time = 0.01 * np.arange(first, first + n)
    x, y = 300.0 * np.sin(time / 200.0), 300.0 * np.cos(time / 310.0)
    x, y = (axis + random.normal(0.0, 0.5, n) for axis in (x, y))
    wrong = random.random(n) < 0.05
    x[wrong] += random.normal(0.0, 30.0, int(wrong.sum()))
    return pa.table({"time": np.round(1.7e9 + time, 2), "x": np.round(x, 3), "y": np.round(y, 3)})


def _clean(words: list[str]) -> tuple[float, float, float]:
    """Wall time, processor time, s, and the most memory, MB, of one process."""
    begun = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, "clean", *words], stdout=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0
    return time.perf_counter() - begun, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3


def _draw(rows: list[dict[str, str | float]]) -> None:
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "surefix"
    from matplotlib import pyplot as plt
    from matplotlib.ticker import LogLocator, NullFormatter

    figure, (cost, memory) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    for method, mode in dict.fromkeys((row["method"], row["mode"]) for row in rows):
        mine = [row for row in rows if (row["method"], row["mode"]) == (method, mode)]
        size = [row["fixes"] for row in mine]
        cost.loglog(size, [row["processor s"] for row in mine], "o-", label=f"{method}, {mode}")
        memory.semilogx(size, [row["MB"] for row in mine], "o-")
    cost.set(xlabel="fixes", ylabel="processor time, s", title="Cost")
    memory.set(xlabel="fixes", ylabel="most memory, MB", title="Memory")
    memory.set_ylim(bottom=0.0)
    cost.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    cost.yaxis.set_major_formatter("{x:g}")
    cost.yaxis.set_minor_formatter(NullFormatter())
    cost.legend(fontsize="small")
    for axes in (cost, memory):
        axes.grid(alpha=0.3)
    figure.savefig(PICTURE, metadata={"Date": None})


if __name__ == "__main__":
    main()
