"""A fleet over the processes of one machine, which can be interrupted and gone on with."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from surefix.fleet.found import find_inputs
from surefix.fleet.ledger import Ledger, open_ledger
from surefix.fleet.options import FleetOptions
from surefix.fleet.outcome import SCHEMA, Outcome, failed_outcome
from surefix.fleet.plan import SUMMARY, TRACKS, Planned, plan_logs, plan_units
from surefix.fleet.work import Done, LogTask, TrackTask, do
from surefix.fleet.workers import worked_off
from surefix.io import write_csv, write_parquet
from surefix.io.atomic import replacing

__all__ = ["Fleet", "clean_fleet"]

_SHOWN = 20  # outcomes of a kind that are kept for the terminal

Progress = Callable[[int, int, int], None]
"""Told how many units are done, how many there are, and in how many something failed."""


class Fleet(NamedTuple):
    """What came of a fleet.

    Parameters
    ----------
    cleaned, failed
        Logs, or tracks.
    fixes, rejected
        Fixes of those that were cleaned.
    units, kept
        Units of work, and how many of them an earlier run had done.
    outdated
        Units that an earlier run had done with other inputs or options.
    examples, failures
        The first few that were cleaned, and that failed.
    written
        The summary.
    """

    cleaned: int
    failed: int
    fixes: int
    rejected: int
    units: int
    kept: int
    outdated: int
    examples: tuple[Outcome, ...]
    failures: tuple[Outcome, ...]
    written: tuple[str, ...]


def clean_fleet(
    inputs: Sequence[str | Path],
    place: str | Path,
    options: FleetOptions | None = None,
    progress: Progress | None = None,
) -> Fleet:
    """Clean many logs, or all tracks of a data set, into a folder.

    What an earlier call has done with the same inputs and options is kept; what is outdated is
    removed, and the rest is done. A log or track that fails does not stop the others.

    Parameters
    ----------
    inputs
        Logs, folders of logs, or one data set.
    place
        Folder of the outputs, the summary and the notes about what is done.
    options
        How.
    progress
        Told after each unit.

    Raises
    ------
    OptionsError, InputError, ParseError
        Nothing can be cleaned as asked.
    OutputError
        The folder cannot be written to, or another fleet is at work there.
    """
    chosen, folder = options or FleetOptions(), Path(place).absolute()
    found = find_inputs(inputs, folder, chosen.track)
    with open_ledger(folder) as ledger:
        if found.root is None:
            planned = plan_logs(found, folder, chosen, ledger.names())
        else:
            planned = plan_units(found, folder, chosen)
        _sweep(folder)
        outdated = _forget(planned, ledger, folder, parts=found.root is not None)
        kept = _work(planned, ledger, chosen.jobs, progress)
        ledger.select([*(name for name, _ in planned.bad), *(task.name for task in planned.tasks)])
        shutil.rmtree(folder / ".arranged", ignore_errors=True)
        return Fleet(
            **ledger.totals(),
            units=len(planned.tasks),
            kept=kept,
            outdated=outdated,
            examples=tuple(ledger.some("cleaned", _SHOWN)),
            failures=tuple(ledger.some("failed", _SHOWN)),
            written=tuple(_summary(ledger, folder)),
        )


def _sweep(folder: Path) -> None:
    """Remove what a process that was killed had begun to write."""
    for draft in [*folder.glob(".*.part"), *(folder / TRACKS).glob(".*.part")]:
        if draft.is_file():
            draft.unlink()


def _forget(planned: Planned, ledger: Ledger, folder: Path, *, parts: bool) -> int:
    """Remove what was done with other inputs or options, and units that are no longer there."""
    marks = ledger.marks()
    due = {task.name: task.mark for task in planned.tasks}
    changed = [name for name, mark in due.items() if name in marks and marks[name] != mark]
    gone = [name for name in ledger.parts() if name not in due] if parts else []
    for name in [*changed, *gone]:
        for output in ledger.forget(name):
            (folder / output).unlink(missing_ok=True)
    return len(changed)


def _work(planned: Planned, ledger: Ledger, jobs: int, progress: Progress | None) -> int:
    """Do what is not done; gives how much was."""
    for name, error in planned.bad:
        ledger.note(name, "", "bad", (), (failed_outcome(name, error),))
    due = [task for task in planned.tasks if not ledger.is_done(task.name, task.mark)]
    total, failed = len(planned.tasks), len(planned.bad)
    kept = done = total - len(due)
    if due:
        planned.prepare()
    if progress is not None:
        progress(done, total, failed)
    with closing(worked_off(do, due, min(jobs, max(len(due), 1)))) as results:
        for task, found in results:
            result = found if isinstance(found, Done) else _failed(task, found)
            note = task.name, task.source, task.mark, result.outputs, result.outcomes
            ledger.note(*note)
            done += 1
            failed += any(outcome.status == "failed" for outcome in result.outcomes)
            if progress is not None:
                progress(done, total, failed)
    return kept


def _failed(task: LogTask | TrackTask, error: Exception) -> Done:
    return Done((failed_outcome(task.source or task.name, error),), ())


def _summary(ledger: Ledger, folder: Path) -> list[str]:
    """Write a row for each log or track, as CSV and as Parquet."""
    places = [folder / f"{SUMMARY}.csv", folder / f"{SUMMARY}.parquet"]
    with (
        replacing(places[0]) as text,
        replacing(places[1]) as exact,
        write_csv.table_sink(text, SCHEMA) as one,
        write_parquet.table_sink(exact, SCHEMA) as two,
    ):
        for rows in ledger.tables():
            one(rows)
            two(rows)
    return [str(place) for place in places]
