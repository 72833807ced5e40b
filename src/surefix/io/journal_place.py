"""The data base that a journal is in: a SQLite file, or PostgreSQL, and the right to write to it.

Only one service may write to a journal. For a SQLite file that is whoever holds a lock on
``NAME.lock`` beside it; in PostgreSQL, whoever holds an advisory lock of the schema. Both end with
the process that holds them, however it ends. A connection to PostgreSQL may break, and the lock
with it: it is taken again before the next step is written, unless another service has been there.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from sqlalchemy import (
    BigInteger,
    Column,
    Double,
    Integer,
    MetaData,
    Table,
    create_engine,
    event,
    func,
    select,
    text,
)
from sqlalchemy.engine import URL, Connection, Engine, make_url
from sqlalchemy.exc import ArgumentError, DatabaseError, OperationalError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from surefix.errors import InputError, MissingExtraError, OptionsError, OutputError
from surefix.io.sqlite_file import is_sqlite

__all__ = ["NUMBER", "TABLES", "Place", "open_place", "said"]

NUMBER: Final = BigInteger().with_variant(Integer, "sqlite")
"""Type of a number that counts on for years."""

TABLES: Final = MetaData()
"""What is in the data base."""

_START = Table(
    "start",
    MetaData(),
    Column("number", Integer, primary_key=True, autoincrement=False),
    Column("time", Double, nullable=False),
)
_EXPECTED: Final = "sqlite:///PATH or postgresql://USER@HOST/NAME"
_PATIENCE: Final = 3.0  # s: a service that was killed may hold its lock for a moment
_CLIENT: Final = {
    "connect_timeout": "3",
    "tcp_user_timeout": "5000",
    "keepalives_idle": "5",
    "keepalives_interval": "2",
    "keepalives_count": "3",
    "application_name": "surefix",
}  # s, ms: how soon a server that is away is told to be away
_SESSION: Final = (
    "SET synchronous_commit = on",
    "SET statement_timeout = '20s'",
    "SET tcp_keepalives_idle = 10",
    "SET tcp_keepalives_interval = 5",
    "SET tcp_keepalives_count = 3",
)  # how soon the server lets go of the lock of a service that is away
_LOCK: Final = "SELECT pg_try_advisory_lock(1936875877, hashtext(current_schema()))"


class Place:
    """An open data base; from `open_place`.

    Parameters
    ----------
    engine
        Of the data base.
    lock
        What holds the right to write to a file, for as long as it is open.
    """

    def __init__(self, engine: Engine, lock: Connection | None = None) -> None:
        self._engine, self._lock = engine, lock
        self.aside = ""
        """Name of a damaged file that was put aside, if there was one."""
        self._served = engine.dialect.name == "postgresql"
        self._writer: Connection | None = None
        self._start = 0

    @property
    def name(self) -> str:
        """What it is called, without a password."""
        url = self._engine.url
        return url.render_as_string(hide_password=True) if self._served else str(url.database)

    def begin(self) -> None:
        """Make the tables that are not there, and note on a server that a service has begun.

        Raises
        ------
        OutputError
            It cannot be written, or another service writes there.
        """
        with self.writing() as connection:
            TABLES.create_all(connection)
            if self._served:
                _START.create(connection, checkfirst=True)
                self._start = _starts(connection) + 1
                connection.execute(_START.insert(), {"number": self._start, "time": time.time()})

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Write what the body does, whole or not at all.

        Raises
        ------
        OutputError
            The disk is full, the server is away, another service writes there.
        """
        try:
            if self._writer is None:
                self._writer = self._claimed()
            with self._writer.begin():
                yield self._writer
        except SQLAlchemyError as error:
            self._let_go()
            raise OutputError(
                f"the journal cannot be written: {said(error)}",
                "a server that answers, a disk with room" if self._served else "a disk with room",
            ) from error
        except OutputError:
            self._let_go()
            raise

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Read in the body.

        Raises
        ------
        InputError
            It cannot be read.
        """
        try:
            with self._engine.connect() as connection:
                yield connection
        except SQLAlchemyError as error:
            raise InputError(
                f"{self.name}: the journal cannot be read: {said(error)}",
                "a journal of surefix live",
            ) from error

    def close(self) -> None:
        """Let go of the data base, and of the right to write to it."""
        self._let_go()
        self._engine.dispose()
        if self._lock is not None:
            self._lock.close()
            self._lock.engine.dispose()

    def _claimed(self) -> Connection:
        """A connection that may write; that of PostgreSQL holds the lock."""
        connection = self._engine.connect()
        try:
            if self._served:
                self._claim(connection)
        except BaseException:
            connection.close()
            raise
        return connection

    def _claim(self, connection: Connection) -> None:
        end = time.monotonic() + _PATIENCE
        while not connection.execute(text(_LOCK)).scalar():
            if time.monotonic() > end:
                raise _another(self.name)
            time.sleep(0.1)
        if self._start and _starts(connection) != self._start:
            raise _another(self.name)
        connection.commit()

    def _let_go(self) -> None:
        if self._writer is None:
            return
        with contextlib.suppress(SQLAlchemyError):
            if self._served:
                self._writer.invalidate()  # the lock ends with it
            self._writer.close()
        self._writer = None


def open_place(url: str, *, new: bool = True) -> Place:
    """Open a data base to write to it, and begin it if there is none.

    A SQLite file that is damaged is put aside as ``NAME.damaged-TIME`` and a new one is begun.

    Parameters
    ----------
    url
        ``sqlite:///PATH`` or ``postgresql://USER@HOST/NAME``.
    new
        False: it must be there, and is only read: no file is changed or put aside.

    Raises
    ------
    OptionsError
        No such kind of data base.
    InputError, OutputError
        It cannot be read, not be begun, or another service writes there.
    MissingExtraError
        The driver of PostgreSQL is not installed.
    """
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError) as error:
        raise OptionsError(f"journal {url!r}", _EXPECTED) from error
    kind = parsed.get_backend_name()
    if kind not in ("sqlite", "postgresql") or not parsed.database:
        raise OptionsError(f"journal {parsed.render_as_string(hide_password=True)!r}", _EXPECTED)
    place = _file(parsed, new=new) if kind == "sqlite" else _server(parsed, new=new)
    if new:
        try:
            place.begin()
        except OutputError:
            place.close()
            raise
    return place


def said(error: SQLAlchemyError) -> str:
    """What a data base said was wrong, in one line."""
    return (str(getattr(error, "orig", None) or error).splitlines() or ["?"])[0]


def _starts(connection: Connection) -> int:
    return int(connection.execute(select(func.max(_START.c.number))).scalar() or 0)


def _another(name: str) -> OutputError:
    return OutputError(
        f"{name}: another service writes this journal",
        "a journal of its own for each service",
        "stop the other one, or name another journal",
    )


def _server(url: URL, *, new: bool) -> Place:
    rest = {key: value for key, value in _CLIENT.items() if key not in url.query}
    named = url.set(drivername="postgresql+psycopg").update_query_dict(rest)
    try:
        pool = {"pool_pre_ping": True} if new else {"poolclass": NullPool}
        engine = create_engine(named, **pool)
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            "PostgreSQL", "the package psycopg", "pip install 'surefix[live,postgres]'"
        ) from error
    event.listen(engine, "connect", _settled)
    return Place(engine)


def _settled(connection: Any, _record: object) -> None:
    """Let PostgreSQL say that it has written only what is on the disk, and notice who is gone."""
    connection.autocommit = True
    for words in _SESSION:
        connection.execute(words)
    connection.autocommit = False


def _file(url: URL, *, new: bool) -> Place:
    file = Path(str(url.database))
    if not new:
        if not is_sqlite(file) or not _sound(file):
            raise InputError(f"{file}: not a journal", "a file that surefix live has written")
        return Place(create_engine(url, poolclass=NullPool))
    try:
        beside = create_engine(f"sqlite:///{file}.lock", connect_args={"timeout": _PATIENCE})
        lock = beside.connect()
        lock.exec_driver_sql("BEGIN EXCLUSIVE")
    except OperationalError as error:
        if "locked" in said(error):
            raise _another(str(file)) from error
        raise OutputError(f"{file}: {said(error)}", "a file that can be written") from error
    aside = ""
    if file.exists() and not _sound(file):
        aside = f"{file.name}.damaged-{time.strftime('%Y%m%dT%H%M%S')}"
        for part in ("", "-wal", "-shm"):
            if (old := file.with_name(file.name + part)).exists():
                old.rename(file.with_name(aside + part))
    engine = create_engine(url)
    event.listen(engine, "connect", _durable)
    place = Place(engine, lock)
    place.aside = aside
    return place


def _durable(connection: Any, _record: object) -> None:
    """Let SQLite write ahead, and only say that it has written what is on the disk."""
    cursor = connection.cursor()
    for pragma in ("journal_mode = WAL", "synchronous = FULL", "busy_timeout = 5000"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _sound(file: Path) -> bool:
    engine = create_engine(f"sqlite:///{file}")
    try:
        with engine.connect() as connection:
            return connection.exec_driver_sql("PRAGMA quick_check").scalar() == "ok"
    except OperationalError:
        return True  # locked, or not to be opened: that says nothing of what is in it
    except DatabaseError:
        return False
    finally:
        engine.dispose()
