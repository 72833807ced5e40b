"""The methods of paper 003 on recorded logs, where nobody knows the truth.

What can be said without it: how many samples each method edits; how well two sensors of one
quantity agree before and after; and how many errors are found that are put into the log on
purpose, where the log is quiet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from surefix.errors import InputError, OptionsError
from surefix.experiment import Experiment, Figure, Panel, Progress, Table, check_least, gather
from surefix.papers.ship_figures import thinned
from surefix.papers.ship_log_rows import EDITORS, LENGTHS, agreement, edited, seeded, unit_of
from surefix.papers.ship_methods import METHODS, OURS, PAPER, Series
from surefix.papers.ship_run import Rows
from surefix.pipelines.ship import Integrated, integrate
from surefix.pipelines.ship_cleaning import Stream
from surefix.pipelines.ship_fusion import Quality
from surefix.pipelines.ship_inputs import LEAST, streams_of
from surefix.pipelines.ship_options import PERIODS, ShipOptions, thresholds
from surefix.types import FloatArray

__all__ = ["ShipLogOptions", "run_logs"]

_DEGREE = 180.0 / np.pi


def _limits() -> ShipOptions:
    """What any vessel can do, a yacht that tacks included."""
    return ShipOptions(
        max_acceleration=2.0, max_turn_rate=float(np.radians(20.0)), max_depth_rate=5.0
    )


@dataclass(frozen=True, kw_only=True)
class ShipLogOptions:
    """Which logs, and how often errors are put into them.

    Parameters
    ----------
    paths
        Logs of one ship.
    seed
        Errors of run i are drawn from ``[seed, i]``.
    runs
        How often, at least 1.
    chain
        Options of the chain; the thresholds are those of its limits.

    Raises
    ------
    OptionsError
        No log, or a figure too small.
    """

    paths: tuple[str | Path, ...]
    seed: int = 1
    runs: int = 20
    chain: ShipOptions = field(default_factory=_limits)

    def __post_init__(self) -> None:
        if not self.paths:
            raise OptionsError("no log", "one or more")
        check_least(self, seed=0, runs=1)


def run_logs(options: ShipLogOptions, progress: Progress | None = None) -> Experiment:
    """Run the methods and the chain on recorded logs.

    Parameters
    ----------
    options
        Logs, seed, number of runs.
    progress
        Told the number of finished runs.

    Raises
    ------
    InputError, ParseError
        A log cannot be read, or there is no series long enough in any.
    """
    streams = streams_of(options.paths)
    if not streams:
        given = ", ".join(Path(path).name for path in options.paths)
        raise InputError(
            f"{given}: no series of {LEAST} samples", "positions, speeds, headings or depths"
        )
    latitude = np.concatenate(
        [s.value for s in streams if s.quantity == "latitude"] or [np.empty(0)]
    )
    series = [_series(stream, latitude, options.chain) for stream in streams]
    names = _names(streams, options.paths)
    fixed: Rows = {
        "edited_pct": {name: edited(given) for name, given in zip(names, series, strict=True)},
        "agreement": agreement(names, streams, series, _middle(latitude)),
    }
    record = integrate(streams, options.chain)
    fixed["record"] = _record_rows(record)
    found: list[Rows] = []
    for i in range(options.runs):
        found.append({"seeded_pct": seeded(np.random.default_rng([options.seed, i]), series)})
        if progress is not None:
            progress(i + 1)
    tables = _tables(fixed, found)
    return Experiment(
        paper="ship",
        title="On-line cleaning of recorded navigation data",
        source=", ".join(Path(path).name for path in options.paths),
        seed=options.seed,
        runs=options.runs,
        tables=tables,
        figures=(_figure(names, streams, series, record.time[0]),),
        findings=_findings({table.key: table for table in tables}),
    )


def _middle(latitude: FloatArray) -> float:
    known = latitude[np.isfinite(latitude)]
    return float(np.median(known)) if known.size else 0.0


def _names(streams: Sequence[Stream], paths: Sequence[str | Path]) -> list[str]:
    """Sensor and quantity; of the names of the files only what tells them apart."""
    stems = [Path(path).stem for path in paths]
    before = _alike(stems)
    after = _alike([stem[before:][::-1] for stem in stems])
    short = {stem: stem[before : len(stem) - after] for stem in stems}
    names: list[str] = []
    for stream in streams:
        stem, _, talker = stream.sensor.rpartition(" ")
        name = " ".join(filter(None, (short.get(stem, stem), talker)))
        names.append(f"{name} {stream.quantity}")
    return names


def _alike(words: Sequence[str]) -> int:
    """How many characters all words begin with."""
    ends = min(words), max(words)
    pairs = enumerate(zip(*ends, strict=False))
    return next((i for i, (one, other) in pairs if one != other), min(map(len, ends)))


def _series(stream: Stream, latitude: FloatArray, options: ShipOptions) -> Series:
    limit = thresholds(stream.quantity, stream.time, latitude, options)
    value = np.where(stream.valid, stream.value, np.nan)
    return Series(value, stream.time, limit, PERIODS.get(stream.quantity, 0.0))


def _record_rows(record: Integrated) -> dict[str, list[float]]:
    """By quantity: sensors, share of the epochs by mark in percent, median σ."""
    rows = {}
    for name, fused in record.quantities.items():
        unit, word = unit_of("depth" if name in ("east", "north") else name, 0.0)
        sigma = fused.sigma[np.isfinite(fused.sigma)]
        shares = [100.0 * float((fused.quality == mark).mean()) for mark in Quality]
        middle = unit * float(np.median(sigma)) if sigma.size else float("nan")
        rows[f"{name}, {word}"] = [float(len(record.sensors[name])), *shares, middle]
    return rows


def _tables(fixed: Rows, found: Sequence[Rows]) -> tuple[Table, ...]:
    def made(
        key: str, title: str, columns: Sequence[str], *, unit: str = "", note: str = ""
    ) -> Table:
        rows = [fixed[key]] if key in fixed else [each[key] for each in found]
        return gather(key, title, columns, rows, unit=unit, digits=2, note=note)

    lengths = [f"{length} long" if length > 1 else "alone" for length in LENGTHS]
    tables = [
        made(
            "edited_pct",
            "Samples, and the share of them that each method edits, in %",
            ("samples", *EDITORS),
        ),
        made(
            "seeded_pct",
            "Errors put into the log that are brought back within T, by length of the burst",
            lengths,
            unit="%",
            note="Errors of 3 … 20 T and random sign, where the log is quiet.",
        ),
        made(
            "agreement",
            "Differences of two sensors: robust σ, and the share beyond 5σ in %",
            ("σ", "logged", "improved 53H", "Hampel, 61", "rate + 53H"),
            note="σ of the differences in the last column.",
        ),
        made(
            "record",
            "The integrated record",
            ("sensors", "valid, %", "doubtful, %", "invalid, %", "median σ"),
            note="From the first sample of any sensor to the last; invalid is where there is none.",
        ),
    ]
    return tuple(table for table in tables if table.rows)


def _figure(
    names: Sequence[str], streams: Sequence[Stream], series: Sequence[Series], start: float
) -> Figure:
    panels = []
    for name, stream, given in zip(names, streams, series, strict=True):
        unit, word = unit_of(stream.quantity, 0.0)
        if stream.quantity in ("latitude", "longitude"):
            unit, word = _DEGREE, "°"
        hours = (stream.time - start) / 3600.0
        cleaned = METHODS[OURS](given)
        wild = np.where(cleaned.replaced, unit * given.value, np.nan)
        traces = [thinned("as logged", hours, unit * given.value, "raw", 600)]
        if not given.period or stream.quantity == "longitude":
            traces.append(thinned(OURS, hours, unit * cleaned.value, "line", 600))
        traces.append(thinned("left out or replaced", hours, wild, "bad", 600))
        label = f"{stream.quantity}, {word}"
        panels.append(Panel(title=name, x_label="time, h", y_label=label, traces=tuple(traces)))
    title = "The series, as logged and cleaned"
    return Figure(key="series", title=title, panels=tuple(panels), columns=2)


def _findings(made: Mapping[str, Table]) -> tuple[str, ...]:
    table = made["seeded_pct"]

    def mean(row: str, column: int) -> float:
        return float(table.mean[table.rows.index(row), column])

    found = [
        f"Of errors put into the log improved 53H removes {mean(PAPER, 0):.1f} % of those that "
        f"come alone and {mean(PAPER, 3):.1f} % of those in bursts of 5; with a rate check before "
        f"it {mean(OURS, 0):.1f} and {mean(OURS, 3):.1f} %.",
    ]
    if "agreement" in made:
        share = made["agreement"].mean[:, 1:].mean(axis=0)
        found.append(
            f"Sensors of one quantity differ by more than 5σ in {share[0]:.2f} % of the samples as "
            f"logged, in {share[1]:.2f} % after improved 53H, in {share[3]:.2f} % with a rate "
            "check before it."
        )
    return tuple(found)
