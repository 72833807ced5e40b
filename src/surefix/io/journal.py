"""The journal of a mission: what was received, what was told, and where the session stood.

A step is written in one transaction before anything of it leaves the house: what was received, what
it led to, sometimes a snapshot. After a crash the service goes on from the last snapshot and takes
what was received since through the same steps, so it stands where it stood. SQLite keeps it in one
file beside the service.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from sqlalchemy import (
    Column,
    Double,
    Integer,
    LargeBinary,
    MetaData,
    SmallInteger,
    Table,
    Text,
    create_engine,
    event,
    select,
)
from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.engine import Connection, Engine, make_url
from sqlalchemy.exc import ArgumentError, DatabaseError, OperationalError, SQLAlchemyError

from surefix.errors import InputError, OptionsError, OutputError
from surefix.io.nmea_stream import NmeaStream
from surefix.io.sqlite_file import is_sqlite
from surefix.types import Log

__all__ = ["Journal", "Received", "Told", "journal_logs", "open_journal"]

_TABLES = MetaData()
_RECEIVED = Table(
    "received",
    _TABLES,
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("source", SmallInteger, nullable=False),
    Column("time", Double),
    Column("data", LargeBinary, nullable=False),
)
_TOLD = Table(
    "told",
    _TABLES,
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("after", Integer, nullable=False),
    Column("time", Double),
    Column("kind", Text, nullable=False),
    Column("text", Text, nullable=False),
)
_STATE = Table(
    "state",
    _TABLES,
    Column("after", Integer, primary_key=True, autoincrement=False),
    Column("snapshot", LargeBinary, nullable=False),
)
_SOURCE = Table(
    "source",
    _TABLES,
    Column("number", SmallInteger, primary_key=True, autoincrement=False),
    Column("name", Text, nullable=False),
    Column("role", Text, nullable=False),
)
_SNAPSHOTS = 3  # that are kept
_READ = 10_000  # records read at a time


class Received(NamedTuple):
    """Some bytes of a source.

    Parameters
    ----------
    number
        Counts on from 1 over all sources.
    source
        Number of the input.
    time
        s, Unix, when they arrived; NaN if they carry their own times of reception.
    data
        As they came.
    """

    number: int
    source: int
    time: float
    data: bytes


class Told(NamedTuple):
    """Something that was put out: a sentence, a position, an event.

    Parameters
    ----------
    number
        Counts on from 1.
    after
        Number of the last bytes it follows from.
    time
        s, Unix, of validity.
    kind, text
        ``nmea``, ``rows`` (see `surefix.service.history`), ``event`` or ``alarm``, and what was said.
    """

    number: int
    after: int
    time: float
    kind: str
    text: str


class Journal:
    """An open journal; from `open_journal`. Its methods may take as long as the disk does.

    Those that read raise `InputError` if it cannot be read.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def write(
        self,
        received: Sequence[Received] = (),
        told: Sequence[Told] = (),
        snapshot: tuple[int, bytes] | None = None,
    ) -> None:
        """Write a step, whole or not at all; what is there already stays and is not doubled.

        Parameters
        ----------
        received, told
            Of the step, in the order of their numbers.
        snapshot
            The session after the bytes of that number.

        Raises
        ------
        OutputError
            The disk is full, or the file cannot be written.
        """
        try:
            with self._engine.begin() as connection:
                _insert(connection, _RECEIVED, [_row(r) for r in received])
                _insert(connection, _TOLD, [_row(t) for t in told])
                if snapshot is not None:
                    after, stored = snapshot
                    _insert(connection, _STATE, [{"after": after, "snapshot": stored}])
                    old = select(_STATE.c.after).order_by(_STATE.c.after.desc())
                    keep = connection.execute(old.limit(_SNAPSHOTS)).scalars().all()
                    connection.execute(_STATE.delete().where(_STATE.c.after < min(keep)))
        except SQLAlchemyError as error:
            raise OutputError(
                f"the journal cannot be written: {_said(error)}",
                "a disk with room",
            ) from error

    def snapshots(self) -> list[tuple[int, bytes]]:
        """Give the snapshots there are, the latest first, each with the bytes it is after."""
        newest = select(_STATE.c.after, _STATE.c.snapshot).order_by(_STATE.c.after.desc())
        with self._reading() as connection:
            return [(int(after), bytes(stored)) for after, stored in connection.execute(newest)]

    def received(self, after: int = 0, source: int | None = None) -> Iterator[Received]:
        """Give what was received after the bytes of a number, in the order of arrival.

        Parameters
        ----------
        after
            The number.
        source
            Only of this input; None: of all.
        """
        while True:
            query = select(_RECEIVED).where(_RECEIVED.c.number > after)
            if source is not None:
                query = query.where(_RECEIVED.c.source == source)
            with self._reading() as connection:
                rows = connection.execute(query.order_by(_RECEIVED.c.number).limit(_READ)).all()
            for number, sender, at, data in rows:
                yield Received(int(number), int(sender), _time(at), bytes(data))
            if len(rows) < _READ:
                return
            after = int(rows[-1][0])

    def told(self) -> list[Told]:
        """Give what was put out, in its order."""
        with self._reading() as connection:
            rows = connection.execute(select(_TOLD).order_by(_TOLD.c.number))
            return [Told(n, after, _time(at), *words) for n, after, at, *words in rows]

    def newest(self, kind: str, most: int) -> list[str]:
        """Give the last texts of a kind that were told, at most so many, in their order."""
        query = select(_TOLD.c.text).where(_TOLD.c.kind == kind)
        with self._reading() as connection:
            rows = connection.execute(query.order_by(_TOLD.c.number.desc()).limit(most))
            return [str(text) for text in rows.scalars()][::-1]

    def sources(self) -> list[tuple[str, str]]:
        """Give name and role of the inputs."""
        with self._reading() as connection:
            query = select(_SOURCE.c.name, _SOURCE.c.role).order_by(_SOURCE.c.number)
            return [(str(name), str(role)) for name, role in connection.execute(query)]

    def last(self) -> tuple[int, int]:
        """Give the numbers of the last bytes received, and of the last thing told; 0 if none."""
        with self._reading() as connection:
            ends = [
                connection.execute(select(t.c.number).order_by(t.c.number.desc()).limit(1)).scalar()
                for t in (_RECEIVED, _TOLD)
            ]
        return int(ends[0] or 0), int(ends[1] or 0)

    def begin(self, sources: Sequence[tuple[str, str]]) -> None:
        """Note the inputs of a new mission, or check that they are those of the old one.

        Raises
        ------
        OptionsError
            The journal is of other inputs.
        """
        known = self.sources()
        if known and known != list(sources):
            raise OptionsError(
                f"a journal of the inputs {_names(known)}",
                f"one of {_names(sources)}",
                "begin another journal, or take the inputs of this one",
            )
        if not known:
            rows = [
                {"number": i, "name": name, "role": role} for i, (name, role) in enumerate(sources)
            ]
            with self._engine.begin() as connection:
                _insert(connection, _SOURCE, rows)

    def close(self) -> None:
        """Let go of the data base."""
        self._engine.dispose()

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        try:
            with self._engine.connect() as connection:
                yield connection
        except SQLAlchemyError as error:
            raise InputError(
                f"{self._engine.url.database}: the journal cannot be read: {_said(error)}",
                "a journal of surefix live",
            ) from error


def open_journal(url: str, *, new: bool = True) -> Journal:
    """Open a journal to write on in it, and begin it if there is none.

    A SQLite file that is damaged is put aside as ``NAME.damaged-TIME`` and a new one is begun.

    Parameters
    ----------
    url
        ``sqlite:///mission.db``.
    new
        False: it must be there, and is only read: no file is changed or put aside.

    Raises
    ------
    OptionsError
        No such kind of data base.
    InputError, OutputError
        It cannot be read, or not be begun.
    """
    try:
        parsed = make_url(url)
        if parsed.get_backend_name() != "sqlite" or not parsed.database:
            raise ArgumentError
    except ArgumentError as error:
        raise OptionsError(f"journal {url!r}", "sqlite:///PATH") from error
    place = Path(parsed.database)
    if not new:
        if not is_sqlite(place) or not _sound(place):
            raise InputError(f"{place}: not a journal", "a file that surefix live has written")
        return Journal(create_engine(parsed))
    if place.exists() and not _sound(place):
        aside = f"{place.name}.damaged-{time.strftime('%Y%m%dT%H%M%S')}"
        for part in ("", "-wal", "-shm"):
            if (old := place.with_name(place.name + part)).exists():
                old.rename(place.with_name(aside + part))
    engine = create_engine(parsed)
    event.listen(engine, "connect", _durable)
    try:
        _TABLES.create_all(engine)
    except SQLAlchemyError as error:
        raise OutputError(f"{url}: {_said(error)}", "a data base that can be written") from error
    return Journal(engine)


def journal_logs(
    path: Path, *, require_checksum: bool = True
) -> list[tuple[str, str, Iterator[Log]]]:
    """Open the inputs of a journal for reading: name and role of each, and its parts.

    Raises
    ------
    InputError
        It is no journal.
    """
    journal = open_journal(f"sqlite:///{path}", new=False)

    def parts(number: int, name: str) -> Iterator[Log]:
        stream = NmeaStream(Path(name), require_checksum)
        for piece in journal.received(source=number):
            if piece.data:
                yield stream.read(piece.data, piece.time)
        yield stream.rest()

    sources = journal.sources()
    if not sources:
        raise InputError(f"{path}: a data base without inputs", "a journal of surefix live")
    return [(name, role, parts(i, name)) for i, (name, role) in enumerate(sources)]


def _durable(connection: object, _record: object) -> None:
    """Let SQLite write ahead, and only say that it has written what is on the disk."""
    cursor = connection.cursor()  # type: ignore[attr-defined]
    for pragma in ("journal_mode = WAL", "synchronous = FULL", "busy_timeout = 5000"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _sound(place: Path) -> bool:
    engine = create_engine(f"sqlite:///{place}")
    try:
        with engine.connect() as connection:
            return connection.exec_driver_sql("PRAGMA quick_check").scalar() == "ok"
    except OperationalError:
        return True  # locked, or not to be opened: that says nothing of what is in it
    except DatabaseError:
        return False
    finally:
        engine.dispose()


def _row(record: Received | Told) -> dict[str, object]:
    return record._asdict() | {"time": None if math.isnan(record.time) else record.time}


def _time(stored: float | None) -> float:
    return math.nan if stored is None else stored


def _insert(connection: Connection, table: Table, rows: list[dict[str, object]]) -> None:
    if not rows:
        return
    connection.execute(insert(table).on_conflict_do_nothing(), rows)


def _said(error: SQLAlchemyError) -> str:
    return str(getattr(error, "orig", None) or error).splitlines()[0]


def _names(sources: Sequence[tuple[str, str]]) -> str:
    return ", ".join(f"{name} ({role})" for name, role in sources)
