"""One track of a data set: its rows in, its clean rows and a row of the summary out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from surefix.errors import InputError, OptionsError
from surefix.fleet.outcome import Outcome, cleaned_outcome, failed_outcome
from surefix.io.columns import recognise
from surefix.io.records import Batch, Form, empty, table
from surefix.io.table import from_frame
from surefix.pipelines.clean import Source, clean_sources
from surefix.pipelines.options import CleanOptions
from surefix.report.headline import counts
from surefix.types import Cleaned, IntArray, Log

__all__ = [
    "TrackPlan",
    "clean_track",
    "plan_tracks",
    "run_starts",
    "track_log",
    "track_rows",
]


class TrackPlan(NamedTuple):
    """How the tracks of one data set are cleaned; the same for all of them.

    Parameters
    ----------
    track
        Name of the column that says which track a row belongs to.
    kind
        Its type.
    form
        Columns of the output.
    options, columns
        As for a single log.
    """

    track: str
    kind: pa.DataType
    form: Form
    options: CleanOptions
    columns: dict[str, str]

    @property
    def schema(self) -> pa.Schema:
        """Columns of the output: the track, then those of every table that is written."""
        return pa.schema([pa.field(self.track, self.kind), *empty(self.form).schema])


def plan_tracks(
    schema: pa.Schema,
    track: str,
    options: CleanOptions,
    columns: Mapping[str, str],
    source: str,
) -> TrackPlan:
    """Check columns and options of a data set before any of its tracks is read.

    Raises
    ------
    ParseError, OptionsError
        There is no column that names the track, the columns are not clear, or an option does not
        fit.
    """
    if track not in schema.names:
        raise OptionsError(
            f"{source}: no column {track}",
            "a column that says which track a row belongs to",
            f"one of {', '.join(schema.names)} with --track",
        )
    if options.every_s is not None:
        raise OptionsError(
            "a track at regular times of a data set", "one row per fix", "leave out every_s"
        )
    names = [name for name in schema.names if name != track]
    layout = recognise(names, chosen=columns, source=source)
    kind = schema.field(track).type
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    form = Form(layout.geographic, layout.depth_positive_down)
    return TrackPlan(track, kind, form, options, dict(columns))


def run_starts(column: pa.ChunkedArray | pa.Array) -> IntArray:
    """Where each run of equal values begins; missing values are equal to each other.

    >>> run_starts(pa.array(["a", "a", "b", None, None, "a"])).tolist()
    [0, 2, 3, 5]
    """
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if not len(array):
        return np.empty(0, np.int64)
    if not pa.types.is_dictionary(array.type):
        array = array.dictionary_encode(null_encoding="encode")
    codes = array.indices.fill_null(-1).to_numpy(zero_copy_only=False)
    return np.concatenate([[0], np.flatnonzero(np.diff(codes)) + 1]).astype(np.int64)


def track_log(rows: pa.Table, plan: TrackPlan, source: str) -> Log:
    """The rows of one track as a log; series beside the positions are left out."""
    rest = rows.drop_columns([plan.track]) if plan.track in rows.column_names else rows
    return replace(from_frame(rest, mapping=plan.columns, source=source), channels=())


def clean_track(rows: pa.Table, plan: TrackPlan, output: str = "") -> tuple[pa.Table, Outcome]:
    """Clean one track; an error becomes its outcome, and then there are no rows.

    Parameters
    ----------
    rows
        All rows of the track, in the order of arrival; at least one.
    plan
        From `plan_tracks`.
    output
        Where the rows will be, for the summary.
    """
    value = rows.column(plan.track)[0]
    name = str(value.as_py())
    try:
        if not value.is_valid:
            raise InputError(
                f"{rows.num_rows} rows without {plan.track}", "a track for every row", "name it"
            )
        source = Source(iter([track_log(rows, plan, name)]), "fixes", name)
        cleaned = clean_sources([source], plan.options)
        found = track_rows(cleaned, value, plan)
    except Exception as error:
        return plan.schema.empty_table(), failed_outcome(name, error)
    return found, cleaned_outcome(name, cleaned, counts(cleaned.verdicts), output)


def track_rows(cleaned: Cleaned, value: pa.Scalar, plan: TrackPlan) -> pa.Table:
    """Rows of the output of one track, or of a part of it."""
    batch = Batch(cleaned.track, cleaned.verdicts, cleaned.sensors, cleaned.sensor, cleaned.row)
    rows = table(batch, plan.form)
    named = pa.repeat(value.cast(plan.kind), rows.num_rows)
    return rows.add_column(0, pa.field(plan.track, plan.kind), named)
