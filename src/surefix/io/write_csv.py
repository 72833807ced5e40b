"""CSV output: clean decimals, and text that no spreadsheet runs as a formula."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import BinaryIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv

from surefix.io.records import Batch, Form, empty, table

__all__ = ["csv_sink", "escaped", "table_sink", "write_table"]

_DECIMALS = {"time": 6, "lat": 9, "lon": 9, "weight": 4, "innovation_sigma": 3}
_OTHERS = 4  # 0.1 mm, 0.1 mm/s
_SMALLEST = 6  # of standard deviations and rates, which must not become 0
_FORMULA = "^[=+\\-@\\t\\r]"


@contextlib.contextmanager
def csv_sink(file: BinaryIO, form: Form) -> Iterator[Callable[[Batch], None]]:
    """Write batches of a track to an open file."""
    write_table(file, empty(form), header=True)
    yield lambda batch: write_table(file, table(batch, form), header=False)


@contextlib.contextmanager
def table_sink(file: BinaryIO, schema: pa.Schema) -> Iterator[Callable[[pa.Table], None]]:
    """Write tables of one schema to an open file."""
    write_table(file, schema.empty_table(), header=True)
    yield lambda rows: write_table(file, rows, header=False)


def write_table(file: BinaryIO, rows: pa.Table, *, header: bool) -> None:
    """Write rows: numbers rounded to what is meant, text in quotes, missing values empty."""
    if header:
        file.write((",".join(rows.column_names) + "\n").encode())
    columns = {name: _printed(name, rows.column(name)) for name in rows.column_names}
    pacsv.write_csv(pa.table(columns), file, pacsv.WriteOptions(include_header=False))


def _printed(name: str, column: pa.ChunkedArray) -> pa.ChunkedArray:
    kind = column.type
    if pa.types.is_floating(kind):
        small = _SMALLEST if name.startswith("sigma") or name == "rate" else _OTHERS
        rounded = pc.round(column, _DECIMALS.get(name, small))
        return pc.add(rounded, 0.0)  # −0 becomes 0
    if pa.types.is_timestamp(kind):
        return pc.replace_substring(column.cast(pa.string()), " ", "T")
    return _words(column) if pa.types.is_string(kind) else column


def _words(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Text to be printed; what occurs more than once, such as a verdict, is looked at once."""
    coded = column.combine_chunks().dictionary_encode()
    words = escaped(pa.chunked_array([coded.dictionary])).combine_chunks()
    return pa.chunked_array(
        [pa.DictionaryArray.from_arrays(coded.indices, words).cast(column.type)]
    )


def escaped(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Put an apostrophe before text that a spreadsheet would run, and keep it on one line.

    >>> escaped(pa.chunked_array([["=1+1", "usbl"]])).to_pylist()
    ["'=1+1", 'usbl']
    """
    risky = pc.match_substring_regex(column, _FORMULA)
    safe = pc.if_else(risky, pc.binary_join_element_wise("'", column, ""), column)
    return pc.replace_substring_regex(safe, "[\\r\\n]+", " ")
