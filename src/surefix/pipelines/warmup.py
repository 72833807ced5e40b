"""Compile ahead what cleaning a log needs, in parts that can be compiled side by side.

Numba compiles a kernel when it is first called and keeps the machine code on disk. Here all that
`surefix clean` calls is called once, on a log of a few dozen rows. No kernel is in two parts, so
that no two processes compile the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from io import BytesIO
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.track import by_axis, filter_track, start
from surefix.jit import compilations, on_disk
from surefix.pipelines.clean import Source, clean_sources
from surefix.pipelines.options import CleanOptions, Mode

__all__ = ["PARTS", "Part", "compile_part", "missing", "parts_for"]

_ROWS = 60
_MODES: tuple[Mode, ...] = ("realtime", "lagged", "offline")


class Part(NamedTuple):
    """Kernels that are compiled one after the other.

    Parameters
    ----------
    call
        Calls each of them.
    module, kernel
        The one that takes longest.
    """

    call: Callable[[], None]
    module: str
    kernel: str


def parts_for(options: CleanOptions) -> tuple[str, ...]:
    """Names of the parts that a log of fixes cleaned with these options calls."""
    if options.method in ("53h", "hampel", "median"):
        return ("filter and smoother", "cleaners")
    if options.method != "multi-hypothesis":
        return ("filter and smoother",)
    lagged = ("fixed lag",) if options.mode == "lagged" else ()
    return ("hypotheses", "filter and smoother", *lagged)


def missing(names: Iterable[str]) -> list[str]:
    """Those parts of which nothing is on disk, in the order of `PARTS`."""
    wanted = set(names)
    return [name for name in PARTS if name in wanted and not on_disk(_kernel(PARTS[name]))]


def _kernel(part: Part) -> Callable[..., object]:
    kernel: Callable[..., object] = getattr(import_module(part.module), part.kernel)
    return kernel


def compile_part(name: str) -> int:
    """Compile one of `PARTS`; gives the number of kernels that were not on disk yet."""
    with _counted() as count:
        PARTS[name].call()
    return count[0]


@contextmanager
def _counted() -> Iterator[list[int]]:
    count = [0]

    def one(_: str) -> None:
        count[0] += 1

    with compilations(one):
        yield count


def _epochs(axes: int, order: int = 2) -> tuple[Motion, Epochs]:
    """A vehicle that goes straight on, with a wild fix."""
    time = np.arange(float(_ROWS))
    z = np.full((_ROWS, 2 * axes), np.nan)
    z[:, :axes] = time[:, None]
    z[_ROWS // 2, 0] += 50.0
    none = np.zeros(_ROWS, np.int64)
    epochs = Epochs(time, z, np.ones_like(z), np.full_like(z, np.nan), none, none)
    return Motion(order, axes, np.full(axes, 0.01), by_axis(axes), 2 * axes, 0.0), epochs


def _hypotheses() -> None:
    from surefix.filters.hypotheses import no_hypotheses
    from surefix.filters.hypothesis_trail import decide, follow, runs, undecided
    from surefix.filters.learning import supposed
    from surefix.filters.multi_hypothesis import filter_hypotheses

    motion, epochs = _epochs(2)
    prior = supposed(2, 1.0, 1.0, 1.0, 39.5)
    _, _, trail = filter_hypotheses(motion, prior, epochs, no_hypotheses(motion))
    said = undecided(motion, _ROWS)
    decide(motion, np.isfinite(epochs.z), trail, _ROWS - 1, 0, said)
    follow(motion, trail, 0, 0, said)
    runs(said.run, said.fixed)


def _filter() -> None:
    from surefix.filters.hypothesis_review import review
    from surefix.filters.learning import supposed
    from surefix.filters.rts import smooth
    from surefix.robust.loss import loss_named

    _clean("igg3")
    recovery, loss = Recovery(np.inf, 1.0, keeps_rate=True), loss_named("kalman")
    for axes, order in ((1, 3), (3, 3), (1, 2), (2, 2)):  # states of a size of their own
        motion, epochs = _epochs(axes, order)
        _, filtered, _ = filter_track(motion, loss, recovery, epochs, start(motion, recovery))
        smoothed = smooth(motion, recovery, epochs.time, filtered)
    prior, locked = supposed(2, 1.0, 1.0, 1.0, 39.5), np.zeros((_ROWS, 2), np.bool_)
    review(motion, prior, epochs, np.ones_like(epochs.z), smoothed, locked)


def _lag() -> None:
    from surefix.filters.hypothesis_lag import filter_decided, not_followed, smooth_windows
    from surefix.filters.hypothesis_trail import undecided

    motion, epochs = _epochs(2)
    said, kept = undecided(motion, _ROWS), not_followed(motion, _ROWS)
    filter_decided(motion, 1.0, epochs, said, 0, _ROWS, kept)
    last, wanted = np.minimum(np.arange(_ROWS) + 5, _ROWS - 1), np.ones(_ROWS, np.bool_)
    mean, sigma = np.empty((2, _ROWS, 4))
    smooth_windows(motion, epochs.time, said.jump, kept, last, wanted, 0, _ROWS, mean, sigma)


def _cleaners() -> None:
    from surefix.filters.deciding import THRESHOLDS, Decider, decide

    motion, epochs = _epochs(1)
    for method, k0 in THRESHOLDS.items():
        decide(Decider(method, k0), motion, Recovery(np.inf, 1.0, keeps_rate=True), epochs, {})


def _sentences() -> None:
    from surefix.io.nmea_scan import scan

    scan(b"$HEHDT,218.53,T*12\r\n")


def _lines() -> None:
    from surefix.io.write_csv import write_table

    write_table(BytesIO(), pa.table({"x": [0.5], "verdict": ["used"]}), header=False)


def _clean(method: str) -> None:
    from surefix.io.table import from_frame

    random = np.random.default_rng(1)
    time = np.arange(float(_ROWS))
    x, y, z = random.normal(0.0, 0.5, (3, _ROWS)) + 0.5 * time
    x[[9, 30, 31]] += 40.0
    frame = {"time": time, "x": x, "y": y, "z": z, "heading": time % 360.0}
    for mode in _MODES:
        options = CleanOptions(mode=mode, method=method)
        clean_sources([Source(iter([from_frame(frame)]), "fixes", "log")], options)


PARTS: dict[str, Part] = {
    "hypotheses": Part(_hypotheses, "surefix.filters.multi_hypothesis", "_run"),
    "filter and smoother": Part(_filter, "surefix.filters.track_step", "run"),
    "cleaners": Part(_cleaners, "surefix.filters.median_step", "run"),
    "sentences": Part(_sentences, "surefix.io.nmea_scan", "_scan"),
    "fixed lag": Part(_lag, "surefix.filters.hypothesis_lag", "_smooth"),
    "lines of text": Part(_lines, "surefix.io.print_rows", "print_rows"),
}
"""By name, the longest first."""
