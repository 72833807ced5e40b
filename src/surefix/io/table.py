"""Read tables of fixes and of scalar series: CSV, Parquet and data frames.

Bad data never stops a file. A cell that cannot be read is NaN, counted as ``cell``; a record with
a wrong number of fields stays as a missing one, counted as ``row``; an impossible latitude or
longitude takes the position with it, counted as ``range``, like a roll or pitch
beyond 90°; a standard deviation that is not a positive number is NaN, counted as ``sigma``; a word
other than accept or reject, as ``edit``.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from surefix.errors import InputError
from surefix.io import delimited
from surefix.io.columns import Role, recognise
from surefix.io.convert import Converter
from surefix.types import Log

__all__ = ["from_frame", "read_table"]

CHUNK = 1 << 21
"""Bytes of text read at a time."""

_ROWS = 1 << 16  # records of a Parquet file read at a time

Progress = Callable[[int], None]


def read_table(
    path: str | Path,
    *,
    mapping: Mapping[str, str] | None = None,
    role: Role = "fixes",
    sensor: str = "fix",
    chunk: int = CHUNK,
    progress: Progress | None = None,
) -> Iterator[Log]:
    """Read a CSV (``.csv``, ``.txt``, ``.tsv`` …, also gzip) or Parquet file in chunks.

    Parameters
    ----------
    path
        The file.
    mapping
        What the columns mean, where their names do not say it; see `surefix.io.columns`.
    role
        ``fixes``: positions, with the scalar series beside them. ``depth``, ``heading``: one
        series, with a heading also roll and pitch, if they are there. ``attitude``: roll and pitch,
        also heading, if it is there. ``velocity``: fixes without position, or in the body frame the
        series ``forward_mps``, ``starboard_mps``, ``down_mps``.
    sensor
        Name of the sensor where no column names it.
    chunk
        Bytes of text held at a time.
    progress
        Called with the bytes of the file read so far.

    Returns
    -------
    Iterator[Log]
        At least one chunk; ``row`` runs on from chunk to chunk, from 0.

    Raises
    ------
    InputError
        The file cannot be read, is empty, or is no table.
    ParseError
        It has no header, or its columns are not clear.
    OptionsError
        The mapping is wrong.
    """
    file = Path(path)
    if _is_parquet(file):
        return _parquet(file, mapping or {}, role, sensor, progress)
    return _csv(file, mapping or {}, role, sensor, chunk, progress)


def from_frame(
    frame: Any,
    *,
    mapping: Mapping[str, str] | None = None,
    role: Role = "fixes",
    sensor: str = "fix",
    source: str = "frame",
) -> Log:
    """Read a data frame (pandas, Polars, Arrow) or a mapping of names to arrays as one log.

    Anything that speaks the Arrow C stream interface is taken without a copy of its text; the
    other arguments are those of `read_table`.

    >>> log = from_frame({"time": [0.0, 1.0], "x": [5.0, 6.0], "y": [7.0, None]})
    >>> log.fixes.position[0, 0], log.fixes.geographic
    (np.float64(5.0), False)

    Raises
    ------
    InputError
        It is no table or has no records.
    ParseError, OptionsError
        As `read_table`.
    """
    try:
        table = _flat(pa.table(dict(frame) if isinstance(frame, Mapping) else frame))
    except (TypeError, ValueError, pa.ArrowException) as error:
        raise InputError(
            f"{source}: {type(frame).__name__} is no table ({error})",
            "a data frame, an Arrow table, or a mapping of names to arrays of one length",
        ) from error
    if table.num_rows == 0:
        raise InputError(f"{source} has no records", "at least one")
    layout = recognise(
        table.column_names,
        chosen=mapping or {},
        role=role,
        source=source,
        first=[str(value) for value in table.slice(0, 1).to_pylist()[0].values()],
    )
    columns = {i: table.column(i) for i in layout.columns()}
    return Converter(source, layout, sensor).log(columns, table.num_rows)


def _flat(table: pa.Table) -> pa.Table:
    """Take nested columns apart: ``gps`` holding ``lat`` becomes ``gps.lat``."""
    while any(pa.types.is_struct(kind) for kind in table.schema.types):
        table = table.flatten()
    return table


def _csv(
    path: Path,
    mapping: Mapping[str, str],
    role: Role,
    sensor: str,
    chunk: int,
    progress: Progress | None,
) -> Iterator[Log]:
    dialect = delimited.sniff(path)
    layout = recognise(
        dialect.names, chosen=mapping, role=role, source=str(path), first=dialect.first
    )
    converter = Converter(str(path), layout, sensor, decimal_comma=dialect.decimal_comma)
    columns = layout.columns()

    def logs() -> Iterator[Log]:
        for block in delimited.blocks(path, dialect, chunk, progress):
            table, rows = delimited.table(block, dialect, columns, layout.time.column)
            if rows.bad:
                converter.count(
                    "row", rows.bad, rows.example, "look at the line; its time was kept"
                )
            if block.cut:
                raise InputError(
                    f"{path}: the gzip data break off", "a whole file", "fetch it again"
                )
            named = {int(name): table.column(name) for name in table.column_names}
            place = _place(block)
            yield converter.log(named, table.num_rows, place)

    return logs()


def _place(block: delimited.Block) -> Callable[[int], str]:
    return lambda record: delimited.line_of(block, record)


def _is_parquet(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(4) == b"PAR1" or path.suffix.lower() == ".parquet"
    except OSError:  # the reader of text says what is wrong with it
        return False


@contextlib.contextmanager
def _parquet_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, pa.ArrowException) as error:
        raise InputError(
            f"{path}: not a sound Parquet file ({error})", "a whole Parquet file", "write it again"
        ) from error


def _parquet(
    path: Path,
    mapping: Mapping[str, str],
    role: Role,
    sensor: str,
    progress: Progress | None,
) -> Iterator[Log]:
    with _parquet_errors(path), pq.ParquetFile(path) as file:
        empty = _flat(file.schema_arrow.empty_table())
        head = next(file.iter_batches(1), None)
        if head is None or file.metadata.num_rows == 0:
            raise InputError(f"{path} has no records", "at least one")
    first = [str(value) for value in _flat(pa.table(head)).to_pylist()[0].values()]
    names = empty.column_names
    layout = recognise(names, chosen=mapping, role=role, source=str(path), first=first)
    converter = Converter(str(path), layout, sensor)
    wanted = layout.columns()
    size = path.stat().st_size

    def logs() -> Iterator[Log]:
        with pq.ParquetFile(path, pre_buffer=False) as file:  # else what was read is kept
            batches = file.iter_batches(_ROWS, columns=[names[i] for i in wanted])
            while True:
                with _parquet_errors(path):
                    batch = next(batches, None)
                if batch is None:
                    return
                table = _flat(pa.table(batch))
                columns = {i: table.column(names[i]) for i in wanted}
                yield converter.log(columns, table.num_rows)
                if progress is not None:
                    progress(size * converter.row // file.metadata.num_rows)

    return logs()
