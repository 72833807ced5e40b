"""Compile ahead what cleaning a log needs, in several processes at once.

Numba compiles a kernel when it is first called and keeps the machine code on disk. Here all that
`surefix clean` calls is called once, on a log of a few dozen rows: nothing is compiled then that
`clean` would not use, and nothing is left out that it does.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from io import BytesIO

import numpy as np
import pyarrow as pa

from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis_modes import offline_hypotheses, realtime_hypotheses
from surefix.filters.records import Epochs, Motion
from surefix.filters.track import by_axis
from surefix.io.nmea_scan import scan
from surefix.io.table import from_frame
from surefix.io.write_csv import write_table
from surefix.jit import compilations
from surefix.pipelines.clean import Source, clean_sources
from surefix.pipelines.options import CleanOptions, Mode

__all__ = ["PARTS", "compile_part", "warm_up"]

_ROWS = 60
_MODES: tuple[Mode, ...] = ("realtime", "lagged", "offline")


def warm_up(told: Callable[[str, int], None], *, processes: int | None = None) -> int:
    """Compile what is not on disk yet; gives the number of kernels compiled.

    Parameters
    ----------
    told
        Called with the name of each part that is ready, and how many kernels it compiled.
    processes
        At most so many at once; default as many as the machine has cores.
    """
    total = 0
    for names in (tuple(PARTS), ("all",)):
        workers = min(processes or os.cpu_count() or 1, len(names))
        for name, count in _in_processes(names, workers) if workers > 1 else _here(names):
            told(name, count)
            total += count
    return total


def _here(names: tuple[str, ...]) -> Iterator[tuple[str, int]]:
    for name in names:
        yield name, compile_part(name)


def _in_processes(names: tuple[str, ...], workers: int) -> Iterator[tuple[str, int]]:
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=spawn) as pool:
        waiting = {pool.submit(compile_part, name): name for name in names}
        for done in as_completed(waiting):
            yield waiting[done], done.result()


def compile_part(name: str) -> int:
    """Compile one of `PARTS`, or ``all`` there is; gives the number of kernels compiled."""
    with _counted() as count:
        if name != "all":
            PARTS[name]()
        else:
            for part in PARTS.values():
                part()
            _clean("multi-hypothesis")
    return count[0]


@contextmanager
def _counted() -> Iterator[list[int]]:
    count = [0]

    def one(_: str) -> None:
        count[0] += 1

    with compilations(one):
        yield count


def _hypotheses() -> None:
    """The hypotheses by themselves: what `clean` needs before them is another part."""
    time = np.arange(float(_ROWS))
    z = np.column_stack([time, -time, np.full((_ROWS, 2), np.nan)])
    z[_ROWS // 2, 0] += 50.0
    epochs = Epochs(
        time, z, np.ones((_ROWS, 4)), np.full((_ROWS, 4), np.nan), np.zeros(_ROWS, np.int64),
        np.zeros(_ROWS, np.int64),
    )  # fmt: skip
    motion = Motion(2, 2, np.full(2, 0.01), by_axis(2), 4, 0.0)
    prior = supposed(2, 1.0, 1.0, 1.0, 39.5)
    realtime_hypotheses(motion, prior, epochs, no_hypotheses(motion))
    offline_hypotheses(motion, prior, epochs)


def _loss() -> None:
    _clean("igg3")


def _cleaners() -> None:
    for method in ("53h", "hampel", "median"):
        _clean(method, modes=("offline",))


def _sentences() -> None:
    scan(b"$HEHDT,218.53,T*12\r\n")


def _lines() -> None:
    write_table(BytesIO(), pa.table({"x": [0.5], "verdict": ["used"]}), header=False)


PARTS: dict[str, Callable[[], None]] = {
    "hypotheses": _hypotheses,
    "filter and smoother": _loss,
    "sentences": _sentences,
    "lines of text": _lines,
    "cleaners": _cleaners,
}
"""What can be compiled side by side, the longest first."""


def _clean(method: str, modes: tuple[Mode, ...] = _MODES) -> None:
    random = np.random.default_rng(1)
    time = np.arange(float(_ROWS))
    x, y, z = random.normal(0.0, 0.5, (3, _ROWS)) + 0.5 * time
    x[[9, 30, 31]] += 40.0
    frame = {"time": time, "x": x, "y": y, "z": z, "heading": time % 360.0}
    for mode in modes:
        options = CleanOptions(mode=mode, method=method)
        clean_sources([Source(iter([from_frame(frame)]), "fixes", "log")], options)
