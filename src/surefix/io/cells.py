"""Cells of one column to numbers, times, flags and codes; what cannot be read is NaN."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from surefix.geo.time import parse_times
from surefix.types import BoolArray, Edit, FloatArray, IntArray

__all__ = ["Cells", "edits", "flags", "names", "numbers", "texts", "times"]

_MISSING = ["", "-", "--", "--.--", "--:--:--", "nan", "null", "na", "n/a", "none"]
_NUMBER = r"^[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?|inf(?:inity)?)$"
_DATE = r"^\s*(?:\d{4}[-/]\d|\d{1,2}\.\d{1,2}\.\d{4}|\d{1,2}:\d\d)"
_NO = ["false", "f", "0", "0.0", "v", "no", "n", "invalid"]
_STATUS_NO = ["v", "invalid", "false"]
_EDITS = {"accept": Edit.ACCEPT, "reject": Edit.REJECT, "accepted": Edit.ACCEPT}
_EDITS["rejected"] = Edit.REJECT


class Cells(NamedTuple):
    """What a column holds.

    Parameters
    ----------
    values
        (n,) NaN where missing or not to be read.
    bad
        (k,) records whose cell holds something that cannot be read.
    """

    values: FloatArray
    bad: IntArray


def _plain(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Unpack dictionaries and views, so that few types remain."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        return _plain(column.cast(kind.value_type))
    if pa.types.is_large_string(kind) or pa.types.is_string_view(kind):
        return column.cast(pa.string())
    return column


def _float(column: pa.ChunkedArray) -> FloatArray:
    wide = column.cast(pa.float64(), safe=False).fill_null(float("nan"))
    return np.asarray(wide, dtype=np.float64)  # may be read-only


def _where(mask: pa.ChunkedArray) -> IntArray:
    return np.flatnonzero(np.asarray(mask.fill_null(False))).astype(np.int64)


def texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return the cells as trimmed text, null where they say that they are missing."""
    column = _plain(column)
    trimmed = pc.utf8_trim_whitespace(column.cast(pa.string()))
    missing = pc.is_in(pc.utf8_lower(trimmed), value_set=pa.array(_MISSING))
    return pc.if_else(missing, pa.scalar(None, pa.string()), trimmed)


def numbers(column: pa.ChunkedArray, *, decimal_comma: bool = False) -> Cells:
    """Read a column of numbers; infinities stay.

    >>> numbers(pa.chunked_array([["1.5", "", "x"]])).bad
    array([2])
    """
    column, none = _plain(column), np.empty(0, np.int64)
    kind = column.type
    if pa.types.is_string(kind):
        return _text_numbers(column, decimal_comma)
    if pa.types.is_boolean(kind):
        return Cells(_float(column.cast(pa.uint8())), none)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return Cells(_float(column), none)
    return Cells(np.full(len(column), np.nan), _where(column.is_valid()))


def _text_numbers(column: pa.ChunkedArray, decimal_comma: bool) -> Cells:
    if decimal_comma:
        column = pc.replace_substring(column, ",", ".")
    try:
        return Cells(_float(column), np.empty(0, np.int64))
    except pa.ArrowInvalid:
        pass
    cells = texts(column)
    lower = pc.utf8_lower(cells)
    good = pc.match_substring_regex(lower, _NUMBER)
    values = pc.if_else(good, lower, pa.scalar(None, pa.string()))
    return Cells(_float(values), _where(pc.invert(good)))


def times(
    column: pa.ChunkedArray,
    date: pa.ChunkedArray | None = None,
    *,
    decimal_comma: bool = False,
    calendar: bool = False,
) -> tuple[Cells, bool]:
    """Read a column of times: numbers as they stand, calendar text and time stamps in s.

    ``date`` is put before a bare time of day; ``calendar`` says that digits alone are a date.

    Returns
    -------
    tuple
        The times, and True where they are Unix seconds already.
    """
    column = _plain(column)
    if pa.types.is_timestamp(column.type) or pa.types.is_date(column.type):
        return Cells(_stamps(column), np.empty(0, np.int64)), True
    if not pa.types.is_string(column.type):
        return numbers(column), False
    if not calendar and not _looks_like_date(column):
        found = numbers(column, decimal_comma=decimal_comma)
        if len(found.bad) <= np.isfinite(found.values).sum():
            return found, False
    return _calendar(column, date), True


def _looks_like_date(column: pa.ChunkedArray) -> bool:
    first = column.slice(0, 100).drop_null()
    return len(first) > 0 and bool(pc.match_substring_regex(first, _DATE)[0].as_py())


def _calendar(column: pa.ChunkedArray, date: pa.ChunkedArray | None) -> Cells:
    text = texts(column)
    if date is not None:
        joined = pc.binary_join_element_wise(texts(date), text, " ")
        text = pc.if_else(pc.match_substring_regex(text, r"^\d{1,2}:"), joined, text)
    try:  # nearly always all of one plain form, which Arrow reads fastest
        values = _stamps(pc.utf8_rtrim(text, "Z").cast(pa.timestamp("ns")))
    except pa.ArrowInvalid:
        values = parse_times(text.fill_null("").to_pylist())
    return Cells(values, np.flatnonzero(np.isnan(values) & np.asarray(text.is_valid())))


def _stamps(column: pa.ChunkedArray) -> FloatArray:
    ticks = column.cast(pa.timestamp("us"), safe=False).cast(pa.int64())
    return np.asarray(_float(ticks) / 1e6)


def flags(column: pa.ChunkedArray, *, status: bool = False) -> BoolArray:
    """Read whether the sensor calls its fix valid; an empty cell does.

    ``status`` takes only A and V (and the words for it) as an answer: other codes have other
    meanings.
    """
    column = _plain(column)
    words = pc.utf8_lower(texts(column))
    wrong = pc.is_in(words, value_set=pa.array(_STATUS_NO if status else _NO))
    return ~np.asarray(wrong.fill_null(False), dtype=np.bool_)


def edits(column: pa.ChunkedArray) -> tuple[IntArray, IntArray]:
    """Read codes of `Edit`, and the records whose cell holds another word."""
    words = pc.utf8_lower(texts(column))
    codes = np.full(len(words), Edit.NONE, dtype=np.int64)
    bad = np.asarray(words.is_valid())
    for word, code in _EDITS.items():
        same = np.asarray(pc.equal(words, word).fill_null(False))
        codes[same], bad = code, bad & ~same
    return codes, np.flatnonzero(bad).astype(np.int64)


def names(column: pa.ChunkedArray, known: list[str], default: str) -> IntArray:
    """Number the names in a column by their place in ``known``, which grows by new ones."""
    coded = texts(column).fill_null(default).combine_chunks().dictionary_encode()
    if isinstance(coded, pa.ChunkedArray):
        coded = coded.combine_chunks()
    found = coded.dictionary.to_pylist()
    known.extend(name for name in found if name not in known)
    place = np.array([known.index(name) for name in found], dtype=np.int64)
    indices = np.asarray(coded.indices, dtype=np.int64)
    return place[indices] if len(indices) else indices
