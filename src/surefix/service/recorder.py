"""The clean track in a file, row by row as it is decided for good.

The rows are those of ``surefix clean --mode realtime -o``. A CSV file grows; a Parquet file, which
cannot, is made of a stream of Arrow beside it (``NAME.arrows``) when the service ends. What a crash
leaves can be read, and the service goes on where it ends: rows that the file lacks are cleaned
again from the journal, rows that it has are not written twice.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final

import pyarrow as pa
import pyarrow.ipc
import pyarrow.parquet as pq

from surefix.errors import OutputError
from surefix.io.atomic import replacing, told_by_name
from surefix.io.records import Batch, Form, table
from surefix.io.write_csv import write_table
from surefix.io.write_parquet import table_sink
from surefix.types import Cleaned

__all__ = ["Recorder"]


class Recorder:
    """A file that the track is recorded in; nothing is written before `flush`.

    Parameters
    ----------
    place
        Its suffix is one of `surefix.service.addresses.RECORDED`.
    before
        Rows of the mission that came before those that it will be given.

    Raises
    ------
    OutputError
        The file is there and cannot be read.
    """

    def __init__(self, place: Path, before: int) -> None:
        self.place = place
        self.trouble = ""
        """Why the last rows are not in it, in words; they wait."""
        self._kind: _Csv | _Arrow = (_Csv if place.suffix == ".csv" else _Arrow)(place)
        with told_by_name(place):
            have = self._kind.begin()
        self._total, self._skip, self._have = before, max(have - before, 0), have
        self.missing = max(before - have, 0)
        """Rows of the mission that it will never have: it was moved away, or its end was lost."""
        self._form: Form | None = None
        self._waiting: list[pa.Table] = []

    def add(self, batches: Sequence[Cleaned]) -> None:
        """Take what was decided for good, in its order."""
        for batch in batches:
            rows = _rows(batch, self._form)
            if rows is None:
                continue
            self._form = self._form or _form(batch)
            self._total += len(rows)
            known, self._skip = self._skip, max(self._skip - len(rows), 0)
            if known < len(rows):
                self._waiting.append(rows.slice(known))

    def ready(self) -> None:
        """All that is in the journal was given: a file that knows more is of another mission."""
        if not self._total and self._have:
            aside = f"{self.place.name}.before-{time.strftime('%Y%m%dT%H%M%S')}"
            with told_by_name(self.place):
                self._kind.put_aside(aside)
        self._skip = 0

    def flush(self) -> None:
        """Bring to the disk what waits; without success it goes on waiting."""
        if not self._waiting:
            return
        try:
            with told_by_name(self.place):
                self._kind.write(pa.concat_tables(self._waiting))
        except OutputError as error:
            self.trouble = str(error)
            return
        self.trouble = ""
        self._waiting.clear()

    def close(self) -> None:
        """Write what waits, and leave the file whole.

        Raises
        ------
        OutputError
            It cannot be written.
        """
        self.flush()
        if self.trouble:
            raise OutputError(self.trouble, "a place that can be written to")
        with told_by_name(self.place):
            self._kind.finish()


def _rows(batch: Cleaned, form: Form | None) -> pa.Table | None:
    """Rows of a batch as they are recorded, in the form of those before; None if it has none."""
    if not len(batch.track.time):
        return None
    told = Batch(batch.track, batch.verdicts, batch.sensors, batch.sensor, batch.row)
    return table(told, form or _form(batch))


def _form(batch: Cleaned) -> Form:
    return Form(batch.track.geodetic is not None, batch.has_depth)


class _Csv:
    """A text that grows line by line."""

    def __init__(self, place: Path) -> None:
        self._place = place
        self._size = 0  # bytes that are whole lines

    def begin(self) -> int:
        """Cut off a line that is not whole; gives how many rows there are."""
        if not self._place.exists():
            return 0
        lines = 0
        with self._place.open("rb") as file:
            for line in file:
                if line.endswith(b"\n"):
                    lines += 1
                    self._size += len(line)
        return max(lines - 1, 0)

    def write(self, rows: pa.Table) -> None:
        with _appending(self._place, self._size) as file:
            write_table(file, rows, header=self._size == 0)
            self._size = file.tell()

    def put_aside(self, name: str) -> None:
        self._place.rename(self._place.with_name(name))
        self._size = 0

    def finish(self) -> None:
        """It is whole at any time."""


class _Arrow:
    """A stream of record batches, of which a Parquet file is made in the end."""

    def __init__(self, place: Path) -> None:
        self._place, self._spool = place, place.with_name(f"{place.name}.arrows")
        self._size = 0  # bytes that are whole record batches

    def begin(self) -> int:
        """Stand at the end of the stream, or make one of the Parquet file; gives its rows."""
        if not self._spool.exists():
            if not self._place.exists():
                return 0
            try:
                self.write(pq.read_table(self._place))
            except pa.ArrowInvalid as error:
                raise OSError(f"it is no Parquet file: {error}") from error
        rows = 0
        with self._spool.open("rb") as file:
            for batch in _batches(file):
                rows += batch.num_rows
                self._size = file.tell()
        return rows

    def write(self, rows: pa.Table) -> None:
        (batch,) = rows.combine_chunks().to_batches()
        head = b"" if self._size else rows.schema.serialize().to_pybytes()
        with _appending(self._spool, self._size) as file:
            file.write(head + batch.serialize().to_pybytes())
            self._size = file.tell()

    def put_aside(self, name: str) -> None:
        for old in (self._spool, self._place):
            if old.exists():
                old.rename(old.with_name(old.name.replace(self._place.name, name)))
        self._size = 0

    def finish(self) -> None:
        """Make the Parquet file; the stream goes when it has its name."""
        if not self._size:
            return
        with self._spool.open("rb") as file, replacing(self._place) as target:
            batches = _batches(file)
            first = next(batches)
            with table_sink(target, first.schema) as sink:
                for some in _joined(first, batches):
                    sink(some)
        self._spool.unlink()
        self._size = 0


_GROUP: Final = 100_000  # rows of a row group, at least


def _joined(first: pa.RecordBatch, others: Iterator[pa.RecordBatch]) -> Iterator[pa.Table]:
    held = [first]
    for batch in others:
        held.append(batch)
        if sum(each.num_rows for each in held) >= _GROUP:
            yield pa.Table.from_batches(held).combine_chunks()
            held = []
    if held:
        yield pa.Table.from_batches(held).combine_chunks()


def _batches(file: BinaryIO) -> Iterator[pa.RecordBatch]:
    """Record batches of a stream up to where it was cut."""
    with contextlib.suppress(pa.ArrowInvalid, OSError, StopIteration):
        stream = pa.ipc.open_stream(file)
        while True:
            yield stream.read_next_batch()


@contextlib.contextmanager
def _appending(place: Path, size: int) -> Iterator[BinaryIO]:
    """Open a file to go on after so many bytes; on failure it is as long as before."""
    with place.open("r+b" if place.exists() else "xb") as file:
        file.seek(size)
        file.truncate()
        try:
            yield file
            file.flush()
            os.fsync(file.fileno())
        except OSError:
            with contextlib.suppress(OSError):
                file.truncate(size)
            raise
