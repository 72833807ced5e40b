"""What batch and stream on Spark share: the plan of a data frame, and the columns of the result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from surefix.errors import MissingExtraError
from surefix.fleet.outcome import Outcome
from surefix.fleet.tracks import TrackPlan, plan_tracks
from surefix.pipelines.options import CleanOptions

if TYPE_CHECKING:
    from pyspark.sql import DataFrame

__all__ = ["ERROR", "plan_frame", "result_schema", "told", "with_error"]

ERROR = "error"
"""Column of the result: why a track has no rows; else null."""


def plan_frame(
    frame: DataFrame, track: str, options: CleanOptions, columns: Mapping[str, str] | None
) -> TrackPlan:
    """Check columns and options of a data frame.

    Raises
    ------
    MissingExtraError
        PySpark is not installed.
    ParseError, OptionsError
        As `surefix.fleet.tracks.plan_tracks`.
    """
    try:
        from pyspark.sql.pandas.types import to_arrow_schema
    except ImportError as error:
        raise MissingExtraError(
            "PySpark is not installed", "Apache Spark 4", "pip install 'surefix[spark]'"
        ) from error
    schema = to_arrow_schema(frame.schema)
    return plan_tracks(schema, track, options, columns or {}, "the data frame")


def result_schema(plan: TrackPlan) -> pa.Schema:
    """Columns of the result, the error last."""
    return plan.schema.append(pa.field(ERROR, pa.string()))


def with_error(rows: pa.Table, plan: TrackPlan) -> pa.Table:
    """Rows of a track that was cleaned."""
    none = pa.nulls(rows.num_rows, pa.string())
    return rows.append_column(ERROR, none).cast(result_schema(plan))


def told(value: Any, outcome: Outcome, plan: TrackPlan) -> pa.Table:
    """The one row of a track that failed: its name, and the error in words."""
    words = [outcome.given, outcome.expected and f"expected {outcome.expected}", outcome.remedy]
    said = "; ".join(word for word in words if word)
    schema = result_schema(plan)
    row = {plan.track: [value], ERROR: [said]}
    return pa.table(
        [pa.array(row.get(field.name, [None]), field.type) for field in schema], schema=schema
    )
