"""CSV output: clean decimals, and text that no spreadsheet runs as a formula."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from surefix.io.print_rows import MISSING, WIDEST, print_rows
from surefix.io.records import Batch, Form, empty, table

__all__ = ["csv_sink", "escaped", "table_sink", "write_table"]

_DECIMALS = {"time": 6, "lat": 9, "lon": 9, "weight": 4, "innovation_sigma": 3}
_OTHERS = 4  # 0.1 mm, 0.1 mm/s
_SMALLEST = 6  # of standard deviations and rates, which must not become 0
_EXACT = 2.0**52  # beyond it neighbours in the last decimal are not told apart
_FORMULA = "^[=+\\-@\\t\\r]"
_ROWS = 8192  # printed at a time


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
    for at in range(0, rows.num_rows, _ROWS):
        some = rows.slice(at, _ROWS)
        file.write(_text([_column(name, some.column(name)) for name in rows.column_names]))


class _Column(NamedTuple):
    """(n,) cells as `print_rows` wants them, their decimals, and the words they stand for."""

    cells: NDArray[np.int64]
    decimals: int
    words: NDArray[np.uint8] = np.empty(0, np.uint8)
    starts: NDArray[np.int64] = np.zeros(1, np.int64)


def _text(columns: list[_Column]) -> memoryview:
    """The lines of some rows."""
    cells = np.empty((len(columns), len(columns[0].cells)), np.int64)
    starts, known, length, width = [np.zeros(1, np.int64)], 0, 0, 0
    for at, column in enumerate(columns):
        cells[at] = column.cells
        if column.decimals >= 0:
            width += 1 + WIDEST
            continue
        cells[at][cells[at] != MISSING] += known
        starts.append(column.starts[1:] + length)
        known, length = known + len(column.starts) - 1, length + len(column.words)
        width += 1 + int(np.diff(column.starts).max(initial=0))
    decimals = np.array([column.decimals for column in columns])
    words = np.concatenate([column.words for column in columns])
    out = np.empty(cells.shape[1] * width, np.uint8)
    return out[print_rows(cells, decimals, words, np.concatenate(starts), out) :].data


def _column(name: str, column: pa.ChunkedArray) -> _Column:
    kind = column.type
    if pa.types.is_floating(kind):
        small = _SMALLEST if name.startswith("sigma") or name == "rate" else _OTHERS
        return _numbers(column, _DECIMALS.get(name, small))
    if pa.types.is_signed_integer(kind):
        return _Column(pc.fill_null(column.cast(pa.int64()), MISSING).to_numpy(), 0)
    if pa.types.is_timestamp(kind):
        return _words(pc.replace_substring(column.cast(pa.string()), " ", "T"), _quoted)
    text = pa.types.is_string(kind) or pa.types.is_large_string(kind)
    return _words(column.cast(pa.string()), _quoted) if text else _words(column, _plain)


def _numbers(column: pa.ChunkedArray, decimals: int) -> _Column:
    """Numbers in units of their last decimal; as the library writes them, if one is too large."""
    values, unit = column.cast(pa.float64()).to_numpy(), 10.0**decimals
    with np.errstate(over="ignore"):
        scaled = np.rint(values * unit)
    unknown, fits = np.isnan(values), np.abs(scaled) < _EXACT
    if not (fits | unknown).all():
        shown = np.where(fits, scaled / unit + 0.0, values)  # −0 becomes 0
        return _words(pa.chunked_array([pa.array(shown, from_pandas=True)]), _plain)
    scaled[unknown] = 0.0
    cells = scaled.astype(np.int64)
    cells[unknown] = MISSING
    return _Column(cells, decimals)


def _words(column: pa.ChunkedArray, shown: Callable[[pa.Array], pa.Array]) -> _Column:
    """Text; what occurs more than once, such as a verdict, is looked at once."""
    coded = column.combine_chunks().dictionary_encode()
    words = shown(coded.dictionary)
    if not len(words):
        return _Column(np.full(len(column), MISSING), -1)
    _, starts, data = words.buffers()
    places = np.frombuffer(starts, np.int32, len(words) + 1, 4 * words.offset)
    text = np.frombuffer(data or b"", np.uint8)[places[0] : places[-1]]
    cells = pc.fill_null(coded.indices.cast(pa.int64()), MISSING).to_numpy()
    return _Column(cells, -1, text, np.asarray(places - places[0], np.int64))


def _quoted(words: pa.Array) -> pa.Array:
    safe = escaped(pa.chunked_array([words])).combine_chunks()
    return pc.binary_join_element_wise('"', pc.replace_substring(safe, '"', '""'), '"', "")


def _plain(words: pa.Array) -> pa.Array:
    return words.cast(pa.string())


def escaped(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Put an apostrophe before text that a spreadsheet would run, and keep it on one line.

    >>> escaped(pa.chunked_array([["=1+1", "usbl"]])).to_pylist()
    ["'=1+1", 'usbl']
    """
    risky = pc.match_substring_regex(column, _FORMULA)
    safe = pc.if_else(risky, pc.binary_join_element_wise("'", column, ""), column)
    return pc.replace_substring_regex(safe, "[\\r\\n]+", " ")
