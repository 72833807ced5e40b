"""Tables of positions from single sights and of the verdicts on them, as CSV or Parquet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from surefix.io.atomic import replacing
from surefix.io.writers import table_sink
from surefix.reasons import texts
from surefix.types import AXES, FloatArray, IntArray, Verdict, Verdicts

__all__ = ["position_table", "verdict_table", "write_rows"]


def position_table(
    time: FloatArray, position: FloatArray, covariance: FloatArray, row: IntArray
) -> pa.Table:
    """Positions with standard deviations and covariances, one row where there is one.

    `surefix clean` reads it as a log of fixes with declared standard deviations.

    Parameters
    ----------
    time, position, covariance, row
        (n,) s, (n, 3) m, (n, 3, 3) m², and (n,) number of the record.
    """
    axes = [a for a in range(3) if np.isfinite(position[:, a]).any()]
    there = np.isfinite(position[:, axes]).all(axis=1) if axes else np.zeros(len(time), np.bool_)
    columns = {"time": time[there]}
    columns |= {AXES[a]: position[there, a] for a in axes}
    columns |= {f"sigma_{AXES[a]}": np.sqrt(covariance[there, a, a]) for a in axes}
    columns |= {
        f"covariance_{AXES[a]}{AXES[b]}": covariance[there, a, b]
        for a in axes
        for b in axes
        if a < b
    }
    return pa.table({**columns, "row": row[there]})


def verdict_table(
    time: FloatArray, row: IntArray, names: tuple[str, ...], value: FloatArray, verdicts: Verdicts
) -> pa.Table:
    """Every sight there was with its verdict, one row each.

    Parameters
    ----------
    time, row
        (n,) s and number of the record.
    names, value
        Of the c columns, and (n, c) what stands there.
    verdicts
        (n·c,), record by record.
    """
    n, c = value.shape
    there = np.flatnonzero(verdicts.verdict != Verdict.MISSING)
    here = Verdicts._make(column[there] for column in verdicts)
    words = np.array([verdict.name.lower() for verdict in Verdict], dtype=object)
    return pa.table(
        {
            "time": np.repeat(time, c)[there],
            "row": np.repeat(row, c)[there],
            "sight": pa.array(np.tile(np.array(names, dtype=object), n)[there], pa.string()),
            "value": value.ravel()[there],
            "verdict": pa.array(words[here.verdict], pa.string()),
            "weight": here.weight,
            "innovation_sigma": pa.array(here.innovation_sigma, pa.float64(), from_pandas=True),
            "reason": pa.array(texts(here), pa.string()),
        }
    )


def write_rows(path: str | Path, rows: pa.Table) -> None:
    """Write a table whole or not at all; the suffix says in which format.

    Raises
    ------
    OutputError
        The suffix is neither ``.csv`` nor ``.parquet``, or the file cannot be written.
    """
    place = Path(path)
    sink = table_sink(place)
    with replacing(place) as file, sink(file, rows.schema) as add:
        add(rows)
