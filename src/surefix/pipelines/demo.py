"""A simulated dive, cleaned like any other log and held against its truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from surefix.io.atomic import replacing
from surefix.metrics import rejection_rates, rmse
from surefix.pipelines.clean import clean_batches
from surefix.pipelines.deliver import deliver
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions
from surefix.report.page import write_report
from surefix.simulate.rov_dive import (
    RovDive,
    columns,
    depth_columns,
    simulate,
    velocity_columns,
)
from surefix.types import Cleaned, FloatArray, Reason, Verdict

__all__ = ["Demonstration", "demonstrate"]


@dataclass(frozen=True)
class Demonstration:
    """The dive, what was made of it, and the files."""

    dive: RovDive
    cleaned: Cleaned
    written: tuple[str, ...]
    lines: tuple[str, ...]


def demonstrate(folder: Path, seed: int) -> Demonstration:
    """Simulate a dive, write its raw logs, clean them, write track and report.

    Parameters
    ----------
    folder
        Where the files go; made if it is not there.
    seed
        Of the dive.
    """
    folder.mkdir(parents=True, exist_ok=True)
    dive = simulate(seed, geographic=True)
    raw = {
        "usbl.csv": columns(dive),
        "depth.csv": depth_columns(dive),
        "dvl.csv": velocity_columns(dive),
    }
    for name, table in raw.items():
        _write(folder / name, table)
    sources = open_inputs(
        [folder / "usbl.csv"], depth=folder / "depth.csv", velocity=folder / "dvl.csv"
    )
    done = deliver(clean_batches(sources, CleanOptions()), [folder / "clean.csv"], iso=False)
    report = folder / "report.html"
    write_report(done.cleaned, report, title="Demonstration dive")
    written = (*(str(folder / name) for name in raw), *done.written, str(report))
    return Demonstration(dive, done.cleaned, written, tuple(_compare(dive, done.cleaned)))


def _write(path: Path, table: dict[str, FloatArray]) -> None:
    with replacing(path) as file:
        rows = {name: pa.array(values, from_pandas=True) for name, values in table.items()}
        pacsv.write_csv(pa.table(rows), file)


def _compare(dive: RovDive, cleaned: Cleaned) -> list[str]:
    """What was found, beside what is true."""
    x, y, _ = dive.frame.to_local(dive.fixes.position[:, 0], dive.fixes.position[:, 1])
    raw = np.column_stack([x, y, dive.fixes.position[:, 2]]) - dive.fix_position
    assert cleaned.track.geodetic is not None
    x, y, _ = dive.frame.to_local(cleaned.track.geodetic[:, 0], cleaned.track.geodetic[:, 1])
    clean = np.column_stack([x, y, cleaned.track.geodetic[:, 2]]) - dive.fix_position
    rejected = cleaned.verdicts.verdict == Verdict.REJECTED
    rates = rejection_rates(rejected, dive.gross)
    before, after = rmse(raw), rmse(clean)
    jumps = np.flatnonzero(cleaned.verdicts.reason == Reason.JUMP)
    jumped = ", ".join(f"{t - dive.time[0]:.0f} s" for t in cleaned.track.time[jumps])
    within = np.abs(clean[:, :2]) <= 2.0 * cleaned.track.sigma_position[:, :2]
    return [
        f"{len(dive.fixes.time)} fixes, {dive.gross.sum()} of them gross errors "
        f"({dive.burst.sum()} in one burst)",
        f"gross errors rejected: {100.0 * rates.detected:.1f} %",
        f"good fixes rejected:   {100.0 * rates.false_alarms:.2f} %",
        f"jump of the track:     found at {jumped or 'no time'}, "
        f"true at {dive.jump_time - dive.time[0]:.0f} s",
        f"error, east north up:  {_metres(before)} m raw, {_metres(after)} m clean",
        f"within 2σ:             {100.0 * within.mean():.1f} % (95.4 % if all were normal)",
    ]


def _metres(values: FloatArray) -> str:
    return " ".join(f"{value:.2f}" for value in values)
