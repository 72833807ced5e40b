"""Parquet output, in full precision."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from surefix.io.records import Batch, Form, empty, table

__all__ = ["parquet_sink", "write_table"]

_PACKING = "zstd"


@contextlib.contextmanager
def parquet_sink(file: BinaryIO, form: Form) -> Iterator[Callable[[Batch], None]]:
    """Write batches of a track to an open file; each becomes a row group."""
    with pq.ParquetWriter(file, empty(form).schema, compression=_PACKING) as writer:
        yield lambda batch: writer.write_table(table(batch, form))


def write_table(file: BinaryIO, rows: pa.Table) -> None:
    """Write a whole table."""
    pq.write_table(rows, file, compression=_PACKING)
