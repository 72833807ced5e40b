"""Split CSV text into blocks of whole lines, with every record kept.

The separator (``,``, ``;`` or tab), a decimal comma, a byte-order mark, comment lines before the
header (which may itself be the last comment), gzip, CRLF and trailing separators are recognised.
Bad rows lose no record: see `repair`. A quoted field must end on its own line.
"""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.csv as pacsv

from surefix.errors import InputError, ParseError

__all__ = ["Block", "Dialect", "Rows", "blocks", "line_of", "repair", "sniff", "table"]

_SAMPLE = 1 << 18
_LONGEST = 1 << 24  # bytes; a longer line is no record, only its beginning is kept
_KEPT = 1 << 10
_PART = 1 << 20  # bytes that one thread parses at a time
_NUMBER = re.compile(r"^[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?$")
_DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+$")
_DECIMAL_POINT = re.compile(r"^[+-]?\d*\.\d+$")
_DATE = re.compile(r"^\d{4}-\d\d-\d\d")
_WORDS = ("nan", "null", "na", "n/a", "none")
_NULLS = ["", "-", "--", "--.--", "NaN", *_WORDS, *(word.upper() for word in _WORDS)]


_Stream = BufferedReader | gzip.GzipFile


class Dialect(NamedTuple):
    """How one file writes its table.

    Parameters
    ----------
    separator
        Between fields.
    decimal_comma
        Whether numbers are written ``1,5``.
    names
        Of the columns.
    width
        Fields in a record; one more than names where every record ends with a separator.
    first
        The first record, as text.
    header_lines, header_bytes
        Lines and bytes up to the end of the header.
    old_mac
        Whether lines end with a carriage return alone.
    """

    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    width: int
    first: tuple[str, ...]
    header_lines: int
    old_mac: bool
    header_bytes: int = 0


class Block(NamedTuple):
    """Whole lines of a file.

    Parameters
    ----------
    data
        The lines.
    line
        Number of the first, from 1.
    cut
        Whether the input broke off after them (a damaged gzip file).
    """

    data: bytes
    line: int
    cut: bool = False


class Rows(NamedTuple):
    """How many records had a wrong number of fields, and the first of them."""

    bad: int
    example: str


def _open(path: Path) -> tuple[BufferedReader, _Stream]:
    """Open the file and, where it is packed, the text inside; both may be the same."""
    try:
        raw = path.open("rb")
    except IsADirectoryError as error:
        raise InputError(f"{path} is a directory", "a file", "name one file in it") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"{path}: {reason}", "a file that can be read", "check the path"
        ) from error
    packed = raw.peek(2)[:2] == b"\x1f\x8b"
    return raw, gzip.GzipFile(fileobj=raw) if packed else raw


def _read(stream: _Stream, size: int) -> tuple[bytes, bool]:
    """Read up to size bytes; True with what there is where a gzip stream is damaged."""
    parts: list[bytes] = []
    while size > 0:
        try:
            part = stream.read1(min(size, 1 << 20))
        except (EOFError, zlib.error, gzip.BadGzipFile):
            return b"".join(parts), True
        if not part:
            break
        parts.append(part)
        size -= len(part)
    return b"".join(parts), False


def sniff(path: Path) -> Dialect:
    """Find out how a file writes its table.

    Raises
    ------
    InputError
        It cannot be read, is empty, is binary, or has no records.
    ParseError
        It has no header or no separator.
    """
    raw, stream = _open(path)
    with raw, stream:
        sample, _ = _read(stream, _SAMPLE)
    if not sample.strip():
        raise InputError(f"{path} is empty", "a table with a header and records")
    if sample[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{path} is UTF-16 text", "UTF-8 text", "save it as CSV in UTF-8")
    if _is_binary(sample):
        raise InputError(
            f"{path} is binary", "a CSV or Parquet table", "export the log as CSV with a header"
        )
    old_mac = b"\n" not in sample and b"\r" in sample
    raw_lines = sample.split(b"\r" if old_mac else b"\n")
    if len(sample) == _SAMPLE and len(raw_lines) > 2:
        raw_lines = raw_lines[:-1]
    dialect = _dialect(path, [_decoded(line).rstrip("\r") for line in raw_lines], old_mac)
    size = sum(len(line) + 1 for line in raw_lines[: dialect.header_lines])
    return dialect._replace(header_bytes=size)


def _is_binary(sample: bytes) -> bool:
    """Whether there are NUL bytes at the top, or many of them; a few are damage further down."""
    return b"\0" in b"".join(sample.splitlines()[:2])[:1024] or sample.count(0) > len(sample) // 10


def _decoded(line: bytes) -> str:
    """Decode UTF-8, or Latin-1 where it is not (``°`` in the header of older instruments)."""
    try:
        return line.removeprefix(b"\xef\xbb\xbf").decode()
    except UnicodeDecodeError:
        return line.decode("latin-1")


def _dialect(path: Path, lines: Sequence[str], old_mac: bool) -> Dialect:
    at = next((i for i, line in enumerate(lines) if line.strip() and line[0] != "#"), None)
    if at is None:
        raise InputError(f"{path} holds comments only", "a table with a header and records")
    separator = _separator(lines[at])
    if separator is None:
        raise ParseError(
            f"{path}, line {at + 1}: no separator in {lines[at][:60]!r}",
            "a header with names separated by , or ; or tab",
            "export the log as CSV with a header",
        )
    names, header_lines = _split(lines[at], separator), at + 1
    if _is_data(names):
        names, header_lines = _commented_header(path, lines, at, separator), at
    records = [_split(line, separator) for line in lines[header_lines:][:200] if line.strip()]
    if not records:
        raise InputError(f"{path} has a header but no records", "at least one record")
    while len(names) > 1 and not names[-1].strip() and len(records[0]) < len(names):
        names = names[:-1]
    trailing = len(records[0]) == len(names) + 1 and not records[0][-1].strip()
    comma = separator != "," and _has_decimal_comma(records)
    return Dialect(
        separator,
        comma,
        tuple(name.strip() for name in names),
        len(names) + trailing,
        tuple(field.replace(",", ".") if comma else field for field in records[0]),
        header_lines,
        old_mac,
    )


def _separator(line: str) -> str | None:
    counts = {mark: line.count(mark) for mark in ";\t,"}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] else None


def _split(line: str, separator: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return []


def _is_data(fields: Sequence[str]) -> bool:
    """Whether a line holds values where the header should be."""
    texts = [field.strip() for field in fields if field.strip()]
    return 2 * sum(bool(_NUMBER.match(t) or _DATE.match(t)) for t in texts) >= len(texts)


def _commented_header(path: Path, lines: Sequence[str], at: int, separator: str) -> list[str]:
    """Return the names of a header that is the last comment (``# time,x,y``)."""
    names = _split(lines[at - 1].lstrip("# "), separator) if at else []
    if len(names) != len(_split(lines[at], separator)) or _is_data(names):
        raise ParseError(
            f"{path}, line {at + 1}: no header, the table begins with {lines[at][:60]!r}",
            "a first line that names the columns",
            "add one, for example: time,lat,lon,depth",
        )
    return names


def _has_decimal_comma(records: Sequence[Sequence[str]]) -> bool:
    fields = [field.strip() for record in records for field in record]
    commas = sum(bool(_DECIMAL_COMMA.match(field)) for field in fields)
    return commas > sum(bool(_DECIMAL_POINT.match(field)) for field in fields)


def blocks(
    path: Path, dialect: Dialect, size: int, progress: Callable[[int], None] | None
) -> Iterator[Block]:
    """Read the records in blocks of whole lines of about ``size`` bytes.

    ``progress`` is told how many bytes of the file have been read so far.
    """
    raw, stream = _open(path)
    with raw, stream:
        _read(stream, dialect.header_bytes)
        rest, line, dropping, last = b"", dialect.header_lines + 1, False, False
        while not last:
            data, cut = _read(stream, size)
            last = cut or len(data) < size
            if progress is not None:
                progress(raw.tell())
            data = data.replace(b"\r", b"\n") if dialect.old_mac else data
            if dropping:  # the rest of an over-long line, whose beginning is out already
                at = data.find(b"\n")
                dropping, data = at < 0, b"" if at < 0 else data[at + 1 :]
            data = rest + data
            whole = len(data) if last else data.rfind(b"\n") + 1
            data, rest = data[:whole], data[whole:]
            if len(rest) > _LONGEST:
                data, rest, dropping = data + rest[:_KEPT] + b"\n", b"", True
            if data or cut:
                yield Block(data, line, cut)
            line += data.count(b"\n")


def table(
    block: Block, dialect: Dialect, columns: Sequence[int], time: int
) -> tuple[pa.Table, Rows]:
    """Split a block into columns of text, named by their number; missing cells are null.

    ``time`` is the column that holds the time; see `repair`.
    """
    lines = block.data.count(b"\n") + (not block.data.endswith(b"\n"))
    try:
        found = _parsed(block.data, dialect, columns, _PART)
    except pa.ArrowInvalid:
        found = None
    if found is not None and found.num_rows == lines:
        return found, Rows(0, "")
    data, rows = repair(block, dialect, time)
    return _parsed(data, dialect, columns, 4 * _LONGEST), rows


def _parsed(data: bytes, dialect: Dialect, columns: Sequence[int], part: int) -> pa.Table:
    names = [str(i) for i in range(dialect.width)]
    wanted = [str(i) for i in columns]
    if not data:
        return pa.table({name: pa.array([], pa.string()) for name in wanted})
    return pacsv.read_csv(
        pa.BufferReader(data),
        read_options=pacsv.ReadOptions(column_names=names, block_size=part),
        parse_options=pacsv.ParseOptions(delimiter=dialect.separator),
        convert_options=pacsv.ConvertOptions(
            column_types=dict.fromkeys(wanted, pa.string()),
            include_columns=wanted,
            null_values=_NULLS,
            strings_can_be_null=True,
        ),
    )


def repair(block: Block, dialect: Dialect, time: int) -> tuple[bytes, Rows]:
    """Give every record of a block the right number of fields.

    Blank lines and comments go. Empty fields too many at the end go. A record with fields too few
    or too many stays as a missing one: nothing in it can be trusted but its time, where ``time`` is
    the first column, or stands before the place where a short record was cut off.
    """
    kept: list[str] = []
    bad, example = 0, ""
    for number, raw in enumerate(block.data.split(b"\n")):
        text = _decoded(raw).replace("\0", "").strip("\r").replace("\r", " ")
        if not text.strip() or text.startswith("#"):
            continue
        if '"' not in text and text.count(dialect.separator) == dialect.width - 1:
            kept.append(text)
            continue
        fields = _split(text, dialect.separator)
        if any(fields[dialect.width :]) or len(fields) < dialect.width:
            bad += 1
            example = example or f"line {block.line + number}: {text[:80]}"
            fields = _only_time(fields, dialect.width, time)
        kept.append(_joined(fields[: dialect.width], dialect.separator))
    return "".join(f"{text}\n" for text in kept).encode(), Rows(bad, example)


def _only_time(fields: Sequence[str], width: int, time: int) -> list[str]:
    whole = time < len(fields) - 1 if len(fields) < width else time == 0
    return [fields[i] if i == time and whole else "" for i in range(width)]


def _joined(fields: Sequence[str], separator: str) -> str:
    quoted = (field.replace('"', '""') for field in fields)
    return separator.join(f'"{field}"' if field else "" for field in quoted)


def line_of(block: Block, record: int) -> str:
    """Return where a record of the block stands, for a message: ``line 12``."""
    for number, raw in enumerate(block.data.split(b"\n")):
        if raw.strip() and not raw.startswith(b"#"):
            record -= 1
        if record < 0:
            return f"line {block.line + number}"
    return f"after line {block.line}"
