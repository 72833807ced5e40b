"""Methods held against each other on recorded logs, by how they foretell fixes left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from surefix.comparison.leave_out import PARTS, fixes_of, parts_of, recorded, records, without
from surefix.comparison.log_tables import LogOutcome, Scored, findings, picture, tables
from surefix.comparison.methods import cleaner_of, works_in
from surefix.comparison.options import check_methods
from surefix.comparison.scores import foretold, log_density, off_and_sigma, yardstick
from surefix.comparison.share import shared
from surefix.errors import InputError, OptionsError
from surefix.experiment import Experiment, Progress, check_least
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import Data, open_inputs
from surefix.pipelines.options import CleanOptions, Mode
from surefix.report.headline import headline
from surefix.types import Verdict

__all__ = ["LENGTHS", "LogOptions", "compare_logs"]

LENGTHS: Final = (1, 3, 10)
"""Fixes left out on end: by themselves, and in runs whose members cannot vouch for each other."""
_ENOUGH: Final = 1000  # fixes left out in all, from which no further part is needed


@dataclass(frozen=True, kw_only=True)
class LogOptions:
    """What is compared, on which logs.

    Parameters
    ----------
    logs
        Files or tables, each a log of its own.
    methods
        Of ``surefix.comparison.methods.COMPARED``.
    modes
        Offline or real time. In real time a fix is foretold from the past alone.
    folds
        How many of the ten parts into which the fixes are dealt are left out, each in a run of its
        own; with 10 every fix is left out once. None for as many as leave out 1,000 fixes.
    seed
        What the fixes are dealt by.
    depth, velocity, heading, columns, require_checksum
        As for `surefix.pipelines.inputs.open_inputs`; supporting logs go with one log.
    jobs
        Processes that share the work, at least 1; the figures do not depend on it.

    Raises
    ------
    OptionsError
        A name nobody knows or twice the same, a figure out of range, or a supporting log for
        several logs.
    """

    logs: tuple[Data, ...]
    methods: tuple[str, ...] = ("kalman", "huber", "student-t", "igg3", "multi-hypothesis")
    modes: tuple[Mode, ...] = ("offline",)
    folds: int | None = None
    seed: int = 1
    depth: Data | None = None
    velocity: Data | None = None
    heading: Data | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    require_checksum: bool = True
    jobs: int = 1

    def __post_init__(self) -> None:
        check_methods(self.methods, self.modes)
        if "lagged" in self.modes:
            raise OptionsError("logs in mode lagged", "mode offline or realtime")
        if self.folds is not None and not 1 <= self.folds <= PARTS:
            raise OptionsError(f"folds {self.folds}", f"a whole number from 1 to {PARTS}")
        if not self.logs:
            raise OptionsError("no log", "one or more")
        if len(self.logs) > 1 and (self.depth, self.velocity, self.heading) != (None,) * 3:
            raise OptionsError("a supporting log for several logs", "one log at a time")
        check_least(self, seed=0, jobs=1)

    @property
    def trials(self) -> int:
        """How many pieces of work there are: what `compare_logs` tells its progress in."""
        fit = sum(works_in(method, mode) for method in self.methods for mode in self.modes)
        return fit * len(self.logs)


class _Task(NamedTuple):
    options: LogOptions
    log: int
    method: str
    mode: Mode


def compare_logs(options: LogOptions, progress: Progress | None = None) -> Experiment:
    """Leave fixes of logs out in turn, and score how each method foretells them.

    Parameters
    ----------
    options
        What is compared, on which logs.
    progress
        Told the number of finished pieces of work, of ``options.trials``.

    Raises
    ------
    InputError, ParseError, OptionsError
        A log cannot be read, or has too few fixes.
    """
    names = _names(options.logs)
    tasks = list(_tasks(options))
    found: dict[tuple[str, Mode, str], LogOutcome] = {}
    for task, each in zip(tasks, shared(_run, tasks, options.jobs), strict=True):
        found[names[task.log], task.mode, task.method] = each
        if progress is not None:
            progress(len(found))
    made = tables(names, options.methods, options.modes, found)
    return Experiment(
        paper="compare-logs",
        title="Methods by how they foretell fixes that they did not get",
        source=", ".join(names),
        seed=options.seed,
        runs=1,
        tables=made,
        figures=picture(options.modes, made),
        findings=findings(names, options.methods, options.modes, found),
    )


def _names(logs: Sequence[Data]) -> tuple[str, ...]:
    """A name for each log, all different."""
    names = [Path(log).stem if isinstance(log, str | Path) else "table" for log in logs]
    return tuple(
        f"{name} #{names[: i + 1].count(name)}" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    )


def _tasks(options: LogOptions) -> Iterator[_Task]:
    for log in range(len(options.logs)):
        for mode in options.modes:
            for method in options.methods:
                if works_in(method, mode):
                    yield _Task(options, log, method, mode)


def _run(task: _Task) -> LogOutcome:
    given, cleaner = task.options, cleaner_of(task.method)
    options = CleanOptions(method=cleaner[0], mode=task.mode)
    recording = recorded(
        open_inputs(
            [given.logs[task.log]],
            depth=given.depth,
            velocity=given.velocity,
            heading=given.heading,
            columns=given.columns,
            require_checksum=given.require_checksum,
        )
    )
    whole = clean_sources(without(recording, {}), options, cleaner[1])
    held = fixes_of(whole)
    count = len(held.row)
    if count < 100:
        raise InputError(f"{_names(given.logs)[task.log]} has {count} fixes", "at least 100")
    measure = yardstick(whole, held)
    folds = given.folds or min(-(-_ENOUGH * PARTS // count), PARTS)
    lines = []
    for length in LENGTHS:
        part = parts_of(count, length, (given.seed, length))
        left = np.flatnonzero((part >= 0) & (part < folds))
        off, sigma = (np.full((count, len(measure.axes)), np.nan) for _ in range(2))
        for fold in range(folds):
            fixes = np.flatnonzero(part == fold)
            gone = records(whole, np.isin(held.with_copies, fixes))
            found = clean_sources(without(recording, gone), options, cleaner[1])
            off[fixes], sigma[fixes] = off_and_sigma(measure, whole, held, fixes, found)
        off, sigma = off[left], sigma[left]
        standard = np.nan_to_num(np.abs(off / sigma), nan=np.inf)
        nats = log_density(off, sigma, measure)
        lines.append(Scored(left, foretold(off, measure), nats, standard))
    rejected = whole.verdicts.verdict[held.row] == Verdict.REJECTED
    return LogOutcome(
        dict(zip(LENGTHS, lines, strict=True)),
        100.0 * float(rejected.mean()),
        headline(whole).clean_speed[1],
    )
