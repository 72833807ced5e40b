"""Bring a data set into the order of its tracks, with memory for a part of it at a time.

Two passes: every row goes to the bucket of its track, in the order of the data set; each bucket is
then sorted by track, which keeps the order of arrival within a track. This is what a shuffle is on
one machine, and what it costs: every row is written twice and read twice more.
"""

from __future__ import annotations

import contextlib
import hashlib
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from surefix.fleet.dataset import DataSet, File, Piece, joined, read_piece
from surefix.types import IntArray

__all__ = ["arrange", "arranged"]

_BUCKET_ROWS = 1_000_000
_MOST_BUCKETS = 200  # files open at a time
_READ_ROWS = 500_000


def arranged(data: DataSet, place: Path) -> DataSet:
    """What a data set will be once `arrange` has brought it into the order of its tracks.

    Parameters
    ----------
    data
        Not laid out by track.
    place
        Folder that the arranged files go to, inside one named by what they are made from.
    """
    encoded = data.tracks.dictionary_encode(null_encoding="encode")
    codes = encoded.indices.to_numpy(zero_copy_only=False)
    lengths = np.bincount(codes, weights=data.lengths).astype(np.int64)
    state = hashlib.sha256("".join(file.state for file in data.files).encode()).hexdigest()
    folder = place / state[:16]
    bucket = _buckets(lengths)
    files = [
        File(str(folder / f"bucket-{k:03d}.parquet"), int(lengths[bucket == k].sum()), state)
        for k in range(int(bucket.max(initial=-1)) + 1)
    ]
    return DataSet(tuple(files), encoded.dictionary, lengths, data.bad)


def _buckets(lengths: IntArray) -> IntArray:
    """The bucket of each track: consecutive ones share one."""
    size = max(_BUCKET_ROWS, int(lengths.sum()) // _MOST_BUCKETS + 1)
    begins = np.cumsum(lengths) - lengths
    bucket: IntArray = np.unique(begins // size, return_inverse=True)[1]
    return bucket


def arrange(data: DataSet, target: DataSet, root: str, track: str, kind: pa.DataType) -> None:
    """Write the files of ``target``, unless they are there; whole or not at all.

    Parameters
    ----------
    data
        As found.
    target
        From `arranged`.
    root, track, kind
        Of the data set, the column that names the track, and its type.

    Raises
    ------
    InputError
        A file cannot be read any more, or two have values of different kinds in one column.
    """
    folder = Path(target.files[0].path).parent
    if folder.is_dir():
        return
    shutil.rmtree(folder.parent, ignore_errors=True)  # of an earlier state of the data set
    draft = folder.with_name(f".{folder.name}.part")
    draft.mkdir(parents=True)
    bucket = _buckets(target.lengths)
    paths = [draft / Path(file.path).name for file in target.files]
    form = joined([read_piece(Piece(f.path, 0, 0, f.state), root, track, kind) for f in data.files])
    with contextlib.ExitStack() as stack:
        writers: list[pq.ParquetWriter | None] = [None] * len(paths)
        for file in data.files:
            for first in range(0, file.rows, _READ_ROWS):
                last = min(first + _READ_ROWS, file.rows)
                rows = read_piece(Piece(file.path, first, last, file.state), root, track, kind)
                rows = joined([form, rows])
                codes = _codes(rows.column(track), target.tracks)
                order = np.argsort(bucket[codes], kind="stable")
                ends = np.searchsorted(bucket[codes][order], np.arange(len(paths) + 1))
                for k in np.flatnonzero(np.diff(ends)):
                    part = rows.take(pa.array(order[ends[k] : ends[k + 1]]))
                    writer = writers[k]
                    if writer is None:
                        writer = stack.enter_context(pq.ParquetWriter(paths[k], form.schema))
                        writers[k] = writer
                    writer.write_table(part)
    for path in paths:
        rows = pq.read_table(path)
        codes = _codes(rows.column(track), target.tracks)
        sorted_path = path.with_suffix(".sorted")
        pq.write_table(
            rows.take(pa.array(np.argsort(codes, kind="stable"))),
            sorted_path,
            row_group_size=1 << 16,
        )
        sorted_path.replace(path)
    draft.rename(folder)


def _codes(column: pa.ChunkedArray, tracks: pa.Array) -> IntArray:
    """Place of each value among the tracks."""
    found = pc.index_in(column, value_set=tracks)
    return np.asarray(found.to_numpy(), np.int64)
