"""Parquet output, in full precision."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from surefix.io.records import Batch, Form, empty, table

__all__ = ["parquet_sink", "table_sink"]

_PACKING = "zstd"


@contextlib.contextmanager
def parquet_sink(file: BinaryIO, form: Form) -> Iterator[Callable[[Batch], None]]:
    """Write batches of a track to an open file; each becomes a row group."""
    with table_sink(file, empty(form).schema) as sink:
        yield lambda batch: sink(table(batch, form))


@contextlib.contextmanager
def table_sink(file: BinaryIO, schema: pa.Schema) -> Iterator[Callable[[pa.Table], None]]:
    """Write tables of one schema to an open file; each becomes a row group.

    Texts repeat and go by a dictionary; to look numbers up in one takes longer than to write them.
    """
    words = [field.name for field in schema if pa.types.is_string(field.type)]
    with pq.ParquetWriter(file, schema, compression=_PACKING, use_dictionary=words) as writer:
        yield writer.write_table
