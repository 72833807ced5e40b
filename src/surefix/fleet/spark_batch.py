"""A data set of many tracks in one Spark job, by ``mapInArrow``.

Where the rows of each track stand together in one partition already, they are taken as they come:
no row moves. Otherwise they are brought together first, which is a shuffle of every row.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from surefix.errors import InputError
from surefix.fleet.spark_plan import plan_frame, result_schema, told, with_error
from surefix.fleet.tracks import TrackPlan, clean_track, run_starts
from surefix.pipelines.options import CleanOptions

if TYPE_CHECKING:
    from pyspark.sql import DataFrame

__all__ = ["clean_tracks", "is_laid_out"]

_FILE = "file"


def clean_tracks(
    frame: DataFrame,
    options: CleanOptions | None = None,
    *,
    track: str = "track_id",
    columns: Mapping[str, str] | None = None,
    order: Sequence[str] | None = None,
    shuffle: bool | None = None,
) -> DataFrame:
    """Clean all tracks of a data frame.

    Parameters
    ----------
    frame
        Columns as of a single log, and one that names the track. Others are read for nothing:
        leave them out.
    options
        How each track is cleaned, in any mode.
    track
        The column that names the track.
    columns
        What columns mean, as for a single log.
    order
        Columns that give the order of arrival within a track, where rows are shuffled; default
        the time, then all others. Rows that are not shuffled keep their order.
    shuffle
        Whether rows must be brought together by track. None finds out with `is_laid_out`, a job
        that reads one column. False promises that they are: a promise that is broken within a
        partition fails the job, one broken across partitions is not noticed.

    Returns
    -------
    DataFrame
        The track, the columns of the output files, and ``error``: a track that cannot be cleaned
        has one row that says why.

    Raises
    ------
    MissingExtraError, ParseError, OptionsError
        PySpark is missing, or columns or options are wrong.
    """
    plan = plan_frame(frame, track, options or CleanOptions(), columns)
    from pyspark.sql.pandas.types import from_arrow_schema

    needed = not is_laid_out(frame, track) if shuffle is None else shuffle
    if needed:
        keys = _order(frame, plan) if order is None else list(order)
        frame = frame.repartition(track).sortWithinPartitions(track, *keys)
    schema = from_arrow_schema(result_schema(plan))

    def clean(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        return _cleaned(batches, plan)

    return frame.mapInArrow(clean, schema)


def is_laid_out(frame: DataFrame, track: str = "track_id") -> bool:
    """Whether each track stands together, in one partition and one file.

    Only the column of the track is read. Spark packs small files into a partition in an order of
    its own, so that a track in two files counts as not laid out.

    Parameters
    ----------
    frame
        Read from files, perhaps with columns chosen; anything else is not laid out.
    track
        The column that names the track.
    """
    if not frame.inputFiles():
        return False
    from pyspark.errors import AnalysisException
    from pyspark.sql import functions as F
    from pyspark.sql.types import StructType

    kind = StructType([frame.schema[track]])
    try:
        read = frame.select(track, F.input_file_name().alias(_FILE))
        runs = read.mapInArrow(_heads, kind)
    except AnalysisException:  # of more than one source
        return False
    return bool(runs.groupBy(track).count().where("count > 1").isEmpty())


def _order(frame: DataFrame, plan: TrackPlan) -> list[str]:
    """The time, and all other columns to part rows of one time."""
    from surefix.io.columns import recognise

    names = [name for name in frame.columns if name != plan.track]
    time = recognise(names, chosen=plan.columns, source="the data frame").time.name
    return [time, *(name for name in names if name != time)]


def _heads(batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """The first row of every run of one track in one file."""
    last: tuple[Any, Any] | None = None
    for batch in batches:
        if not batch.num_rows:
            continue
        starts = np.union1d(run_starts(batch.column(0)), run_starts(batch.column(1)))
        if last == (batch.column(0)[0].as_py(), batch.column(1)[0].as_py()):
            starts = starts[1:]
        yield batch.select([0]).take(pa.array(starts))
        last = batch.column(0)[-1].as_py(), batch.column(1)[-1].as_py()


def _cleaned(batches: Iterable[pa.RecordBatch], plan: TrackPlan) -> Iterator[pa.RecordBatch]:
    """Clean the tracks of a partition, one after the other."""
    for rows in _whole(batches, plan.track):
        found, outcome = clean_track(rows, plan)
        if outcome.status == "failed":
            found = told(rows.column(plan.track)[0].as_py(), outcome, plan)
        else:
            found = with_error(found, plan)
        yield from found.to_batches()


def _whole(batches: Iterable[pa.RecordBatch], track: str) -> Iterator[pa.Table]:
    """The rows of each track, from batches that are cut anywhere."""
    held: list[pa.Table] = []
    seen: set[Any] = set()
    for batch in batches:
        rows = pa.table(batch)
        column = rows.column(track)
        starts = [*run_starts(column).tolist(), rows.num_rows]
        for first, last in pairwise(starts):
            value = column[first].as_py()
            if held and held[0].column(track)[0].as_py() != value:
                yield pa.concat_tables(held)
                held = []
            if not held:
                if value in seen:
                    raise InputError(
                        f"track {value} comes back after other tracks of its partition",
                        "the rows of a track together",
                        "leave out shuffle=False",
                    )
                seen.add(value)
            held.append(rows.slice(first, last - first))
    if held:
        yield pa.concat_tables(held)
