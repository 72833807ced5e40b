"""Read columns of a table by their names, as numbers and times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from surefix.errors import InputError, ParseError
from surefix.geo.time import unix_seconds, unix_unit
from surefix.io import delimited
from surefix.io.cells import numbers, times
from surefix.io.table import CHUNK
from surefix.types import FloatArray, Problem

__all__ = ["read_columns"]


def read_columns(
    data: Any, time: str, names: Sequence[str]
) -> tuple[FloatArray, dict[str, FloatArray], tuple[Problem, ...]]:
    """Read a time and some columns of numbers; what cannot be read is NaN and counted.

    Parameters
    ----------
    data
        Path of a CSV or Parquet file, a data frame, or a mapping of names to arrays.
    time
        Column of the time: Unix s, ms, µs or ns, or calendar text.
    names
        Columns to be read.

    Returns
    -------
    time, columns, problems
        (n,) s, (n,) by name, and bad cells and rows.

    Raises
    ------
    InputError
        It cannot be read as a table.
    ParseError
        A column is not there.

    Examples
    --------
    >>> read_columns({"t": [0.0, 1.0], "r": ["5.5", "x"]}, "t", ["r"])[1]["r"]
    array([5.5, nan])
    """
    table, comma, problems = _table(data, [time, *names])
    cells, dated = times(table.column(time), decimal_comma=comma)
    seconds = cells.values
    if not dated:
        seconds = unix_seconds(seconds, unix_unit(seconds))
    columns: dict[str, FloatArray] = {}
    for name in dict.fromkeys(names):
        found = numbers(table.column(name), decimal_comma=comma)
        columns[name] = np.array(found.values)
        if len(found.bad):
            example = f"record {int(found.bad[0])} of {name}"
            problems.append(Problem("cell", len(found.bad), example, "taken as missing"))
    return np.array(seconds), columns, tuple(problems)


def _table(data: Any, wanted: Sequence[str]) -> tuple[pa.Table, bool, list[Problem]]:
    """The wanted columns, whether numbers have a decimal comma, and what was wrong."""
    if not isinstance(data, str | Path):
        try:
            frame = pa.table(dict(data) if isinstance(data, Mapping) else data)
        except (TypeError, ValueError, pa.ArrowException) as error:
            raise InputError(
                f"{type(data).__name__} is no table ({error})",
                "a data frame, an Arrow table, or a mapping of names to arrays of one length",
            ) from error
        _check("the table", frame.column_names, wanted)
        return frame.select(list(dict.fromkeys(wanted))), False, []
    path = Path(data)
    if path.suffix.lower() == ".parquet":
        try:
            frame = pq.read_table(path)
        except (OSError, pa.ArrowException) as error:
            raise InputError(f"{path}: {error}", "a sound Parquet file") from error
        _check(str(path), frame.column_names, wanted)
        return frame.select(list(dict.fromkeys(wanted))), False, []
    return _text(path, wanted)


def _text(path: Path, wanted: Sequence[str]) -> tuple[pa.Table, bool, list[Problem]]:
    dialect = delimited.sniff(path)
    _check(str(path), dialect.names, wanted)
    place = {name: dialect.names.index(name) for name in wanted}
    parts, bad, example = [], 0, ""
    for block in delimited.blocks(path, dialect, CHUNK, None):
        part, rows = delimited.table(block, dialect, sorted(set(place.values())), place[wanted[0]])
        parts.append(part)
        bad, example = bad + rows.bad, example or rows.example
        if block.cut:
            raise InputError(f"{path}: the gzip data break off", "a whole file", "fetch it again")
    whole = pa.concat_tables(parts)
    named = pa.table({name: whole.column(str(place[name])) for name in place})
    problems = [Problem("row", bad, example, "look at the line; its time was kept")] if bad else []
    return named, dialect.decimal_comma, problems


def _check(source: str, names: Sequence[str], wanted: Sequence[str]) -> None:
    for name in wanted:
        if name not in names:
            listed = ", ".join(list(names)[:30])
            raise ParseError(
                f"{source}: no column {name}", f"one of {listed}", "correct the survey"
            )
