"""One unit of a fleet: a log, or a few whole tracks of a data set; done by any process."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from surefix.fleet.dataset import Unit, read_unit
from surefix.fleet.outcome import Outcome, cleaned_outcome, failed_outcome
from surefix.fleet.tracks import TrackPlan, clean_track, run_starts
from surefix.io.atomic import replacing
from surefix.io.write_parquet import table_sink
from surefix.pipelines.clean import clean_batches
from surefix.pipelines.deliver import deliver
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions

__all__ = ["Done", "LogTask", "TrackTask", "do"]


class LogTask(NamedTuple):
    """A log of its own: where it is, what stands beside it, where its rows go."""

    name: str
    source: str
    mark: str
    output: str
    folder: str
    options: CleanOptions
    columns: dict[str, str]
    beside: dict[str, str]
    require_checksum: bool
    target: str | None


class TrackTask(NamedTuple):
    """Some tracks of a data set: their rows, how they are cleaned, where they go."""

    name: str
    source: str
    mark: str
    output: str
    folder: str
    root: str
    unit: Unit
    plan: TrackPlan


class Done(NamedTuple):
    """What came of a unit, and the files that were written, relative to the folder."""

    outcomes: tuple[Outcome, ...]
    outputs: tuple[str, ...]


def do(task: LogTask | TrackTask) -> Done:
    """Do a unit; whatever goes wrong becomes its outcome."""
    try:
        return _log(task) if isinstance(task, LogTask) else _tracks(task)
    except Exception as error:
        return Done((failed_outcome(task.source or task.name, error),), ())


def _log(task: LogTask) -> Done:
    sources = open_inputs(
        [task.source],
        columns=task.columns,
        depth=task.beside.get("depth"),
        velocity=task.beside.get("velocity"),
        heading=task.beside.get("heading"),
        attitude=task.beside.get("attitude"),
        require_checksum=task.require_checksum,
        target=task.target,
    )
    folder = Path(task.folder)
    done = deliver(clean_batches(sources, task.options), [folder / task.output], iso=False)
    written = tuple(str(Path(path).relative_to(folder)) for path in done.written)
    outcome = cleaned_outcome(task.source, done.cleaned, done.counts, task.output)
    return Done((outcome,), written)


def _tracks(task: TrackTask) -> Done:
    plan = task.plan
    rows = read_unit(task.unit, task.root, plan.track, plan.kind)
    starts = [*run_starts(rows.column(plan.track)), rows.num_rows]
    parts: list[pa.Table] = []
    outcomes: list[Outcome] = []
    for first, last in pairwise(starts):
        found, outcome = clean_track(rows.slice(first, last - first), plan, task.output)
        parts.append(found)
        outcomes.append(outcome)
    place = Path(task.folder) / task.output
    place.parent.mkdir(exist_ok=True)
    with replacing(place) as file, table_sink(file, plan.schema) as write:
        write(pa.concat_tables(parts))
    return Done(tuple(outcomes), (task.output,))
