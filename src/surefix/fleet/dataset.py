"""A Parquet data set of many tracks: where each track lies, and units of work made of whole ones.

The rows of all files, in the order of the files' paths, count as one long table. If each track is
one run of it, the data set is *laid out by track*, and a unit of work is a range of rows that is
read without looking at any other. If not, `surefix.fleet.arrange` brings it into that order first.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from surefix.errors import InputError
from surefix.fleet.tracks import run_starts
from surefix.types import IntArray

__all__ = [
    "DataSet",
    "File",
    "Piece",
    "Unit",
    "digest",
    "hive_value",
    "index",
    "joined",
    "read_piece",
    "read_unit",
    "schema_of",
    "units",
]

_UNIT_ROWS = (
    (100_000, 1_000),
    (1_000_000, 5_000),
    (10_000_000, 20_000),
    (math.inf, 100_000),
)
"""Rows of a data set up to which a unit has so many: enough units to share, and to resume."""


class File(NamedTuple):
    """A file: its path, its rows, and what tells that it has changed."""

    path: str
    rows: int
    state: str


class Piece(NamedTuple):
    """Rows ``first`` up to ``last`` of a file."""

    path: str
    first: int
    last: int
    state: str


class Unit(NamedTuple):
    """Whole tracks that are cleaned together: their pieces in order, and how many rows."""

    name: str
    pieces: tuple[Piece, ...]
    rows: int


class DataSet(NamedTuple):
    """Where the tracks lie.

    Parameters
    ----------
    files
        In the order of their paths.
    tracks
        (runs,) whose rows each run holds; each track once where it is laid out by track.
    lengths
        (runs,) rows.
    bad
        Files that cannot be read, and why.
    """

    files: tuple[File, ...]
    tracks: pa.Array
    lengths: IntArray
    bad: tuple[tuple[str, InputError], ...]

    @property
    def laid_out(self) -> bool:
        """Whether the rows of each track stand together."""
        return len(self.tracks.unique()) == len(self.tracks)


def hive_value(path: str, root: str, track: str) -> str | None:
    """The track that a path below the root names, as in ``track_id=7/part-0.parquet``."""
    for part in Path(path).relative_to(root).parts[:-1]:
        key, equals, value = part.partition("=")
        if equals and key == track:
            return unquote(value)
    return None


def schema_of(paths: Sequence[str], root: str, track: str) -> pa.Schema:
    """Columns of the first file that can be read; a track named by the path is text.

    Raises
    ------
    InputError
        None can be read.
    """
    error: InputError | None = None
    for path in paths:
        try:
            with _opened(path) as file:
                schema = file.schema_arrow
        except InputError as found:
            error = error or found
            continue
        if track not in schema.names and hive_value(path, root, track) is not None:
            schema = schema.append(pa.field(track, pa.string()))
        return schema
    raise error or InputError(f"{root}: no Parquet file", "a Parquet file, or a folder of them")


def index(paths: Sequence[str], root: str, track: str, kind: pa.DataType) -> DataSet:
    """Find the runs of equal tracks; only that one column is read."""
    files: list[File] = []
    tracks: list[pa.Array] = [pa.array([], kind)]
    lengths: list[IntArray] = [np.empty(0, np.int64)]
    bad: list[tuple[str, InputError]] = []
    for path in sorted(paths):
        try:
            rows, values, counts = _runs_of(path, hive_value(path, root, track), track, kind)
        except InputError as error:
            bad.append((path, error))
            continue
        files.append(File(path, rows, digest(path)))
        tracks.append(values)
        lengths.append(counts)
    values, counts = pa.concat_arrays(tracks), np.concatenate(lengths)
    starts = run_starts(values)  # a run may go on in the next file
    joined = np.add.reduceat(counts, starts) if len(starts) else counts
    return DataSet(tuple(files), values.take(pa.array(starts)), joined, tuple(bad))


def _runs_of(
    path: str, named: str | None, track: str, kind: pa.DataType
) -> tuple[int, pa.Array, IntArray]:
    with _opened(path) as file:
        total = file.metadata.num_rows
        if named is not None:
            many = int(total > 0)
            return total, pa.array([named] * many, kind), np.full(many, total, np.int64)
        if track not in file.schema_arrow.names:
            raise InputError(f"{path}: no column {track}", "the columns of the other files")
        values, ends, at = [pa.array([], kind)], [np.zeros(1, np.int64)], 0
        try:
            for batch in file.iter_batches(1 << 20, columns=[track]):
                column = batch.column(0)
                if pa.types.is_dictionary(column.type):
                    column = column.dictionary_decode()
                starts = run_starts(column)
                values.append(column.take(pa.array(starts)).cast(kind))
                ends.append(at + np.append(starts[1:], len(column)))
                at += len(column)
        except (OSError, pa.ArrowException) as error:
            raise _unsound(path, error) from error
    bounds: IntArray = np.concatenate(ends)
    return total, pa.concat_arrays(values), bounds[1:] - bounds[:-1]


def units(data: DataSet) -> list[Unit]:
    """Cut a data set that is laid out by track into units of whole tracks."""
    ends = np.cumsum(data.lengths)
    total = int(ends[-1]) if len(ends) else 0
    size = next(rows for most, rows in _UNIT_ROWS if total <= most)
    bounds = np.concatenate([[0], np.cumsum([file.rows for file in data.files])]).astype(np.int64)
    out: list[Unit] = []
    first = 0
    while first < total:
        reached = int(np.searchsorted(ends, first + size))
        last = int(ends[min(reached, len(ends) - 1)])
        name = f"part-{len(out):06d}"
        out.append(Unit(name, tuple(_pieces(data.files, bounds, first, last)), last - first))
        first = last
    return out


def _pieces(files: Sequence[File], bounds: IntArray, first: int, last: int) -> list[Piece]:
    """The rows ``first`` up to ``last`` of the whole, file by file."""
    out = []
    at = int(np.searchsorted(bounds, first, side="right")) - 1
    while at < len(files) and bounds[at] < last:
        start, stop = max(first, int(bounds[at])), min(last, int(bounds[at + 1]))
        if stop > start:
            file, offset = files[at], int(bounds[at])
            out.append(Piece(file.path, start - offset, stop - offset, file.state))
        at += 1
    return out


def read_unit(unit: Unit, root: str, track: str, kind: pa.DataType) -> pa.Table:
    """Read the rows of a unit, with the column of the track.

    Raises
    ------
    InputError
        A file cannot be read any more, or two have values of different kinds in one column.
    """
    return joined([read_piece(piece, root, track, kind) for piece in unit.pieces])


def joined(parts: Sequence[pa.Table]) -> pa.Table:
    """Put tables one under the other; a column that one of them lacks is empty there.

    Raises
    ------
    InputError
        Two have values of different kinds in one column.
    """
    try:
        return pa.concat_tables(parts, promote_options="permissive")
    except pa.ArrowException as error:
        raise InputError(
            f"files that do not fit together ({error})", "one kind of values in each column"
        ) from error


def read_piece(piece: Piece, root: str, track: str, kind: pa.DataType) -> pa.Table:
    """Read some rows of a file, with the column of the track.

    No row group is read that holds none of them.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    with _opened(piece.path) as file:
        sizes = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
        ends = np.cumsum(sizes)
        low = int(np.searchsorted(ends, piece.first, side="right"))
        high = int(np.searchsorted(ends, piece.last - 1, side="right"))
        try:
            rows = file.read_row_groups(list(range(low, high + 1)))
        except (OSError, pa.ArrowException) as error:
            raise _unsound(piece.path, error) from error
    rows = rows.slice(piece.first - int(ends[low] - sizes[low]), piece.last - piece.first)
    named = hive_value(piece.path, root, track)
    if named is not None:
        column = pa.repeat(pa.scalar(named, kind), rows.num_rows)
        return rows.append_column(pa.field(track, kind), column)
    at = rows.column_names.index(track)
    return rows.set_column(at, pa.field(track, kind), rows.column(at).cast(kind))


def digest(*paths: str) -> str:
    """What tells that files have changed: path, size and time of the last change."""
    told = []
    for path in paths:
        state = Path(path).stat()
        told.append(f"{Path(path).absolute()}\0{state.st_size}\0{state.st_mtime_ns}")
    return hashlib.sha256("\n".join(told).encode()).hexdigest()


def _opened(path: str) -> pq.ParquetFile:
    try:
        return pq.ParquetFile(path)
    except (OSError, pa.ArrowException) as error:
        raise _unsound(path, error) from error


def _unsound(path: str, error: Exception) -> InputError:
    return InputError(
        f"{path}: not a sound Parquet file ({error})", "a whole Parquet file", "write it again"
    )
