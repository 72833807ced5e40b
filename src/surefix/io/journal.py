"""The journal of a mission: what was received, what was told, and where the session stood.

A step is written in one transaction before anything of it leaves the house: what was received, what
it led to, sometimes a snapshot. After a crash the service goes on from the last snapshot and takes
what was received since through the same steps, so it stands where it stood. It is a SQLite file
beside the service, or in PostgreSQL: `surefix.io.journal_place`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

from sqlalchemy import Column, Double, LargeBinary, SmallInteger, Table, Text, func, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import Connection

from surefix.errors import InputError, OptionsError
from surefix.io.feeds import again, feeds, streams, task_of
from surefix.io.journal_place import NUMBER, TABLES, Place, open_place
from surefix.types import Log

__all__ = ["Journal", "Received", "Told", "journal_logs", "open_journal"]

_RECEIVED = Table(
    "received",
    TABLES,
    Column("number", NUMBER, primary_key=True, autoincrement=False),
    Column("source", SmallInteger, nullable=False),
    Column("time", Double),
    Column("data", LargeBinary, nullable=False),
)
_TOLD = Table(
    "told",
    TABLES,
    Column("number", NUMBER, primary_key=True, autoincrement=False),
    Column("after", NUMBER, nullable=False),
    Column("time", Double),
    Column("kind", Text, nullable=False),
    Column("text", Text, nullable=False),
)
_STATE = Table(
    "state",
    TABLES,
    Column("after", NUMBER, primary_key=True, autoincrement=False),
    Column("snapshot", LargeBinary, nullable=False),
)
_SOURCE = Table(
    "source",
    TABLES,
    Column("number", SmallInteger, primary_key=True, autoincrement=False),
    Column("name", Text, nullable=False),
    Column("role", Text, nullable=False),
)
_INSERT: Final[dict[str, Any]] = {"sqlite": sqlite.insert, "postgresql": postgresql.insert}
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
        ``nmea``, ``rows`` (of the track, packed), ``event``, ``alarm`` or ``sensor``, and what was
        said.
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

    def __init__(self, place: Place) -> None:
        self._place = place

    @property
    def aside(self) -> str:
        """Name of a damaged file that was put aside when it was opened, if there was one."""
        return self._place.aside

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
            The disk is full, the data base is away, or another service writes there.
        """
        with self._place.writing() as connection:
            _insert(connection, _RECEIVED, [_row(r) for r in received])
            _insert(connection, _TOLD, [_row(t) | {"text": _plain(t.text)} for t in told])
            if snapshot is not None:
                after, stored = snapshot
                _insert(connection, _STATE, [{"after": after, "snapshot": stored}])
                old = select(_STATE.c.after).order_by(_STATE.c.after.desc())
                keep = connection.execute(old.limit(_SNAPSHOTS)).scalars().all()
                connection.execute(_STATE.delete().where(_STATE.c.after < min(keep)))

    def snapshots(self) -> list[tuple[int, bytes]]:
        """Give the snapshots there are, the latest first, each with the bytes it is after."""
        newest = select(_STATE.c.after, _STATE.c.snapshot).order_by(_STATE.c.after.desc())
        with self._place.reading() as connection:
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
            with self._place.reading() as connection:
                rows = connection.execute(query.order_by(_RECEIVED.c.number).limit(_READ)).all()
            for number, sender, at, data in rows:
                yield Received(int(number), int(sender), _time(at), bytes(data))
            if len(rows) < _READ:
                return
            after = int(rows[-1][0])

    def told(self, kind: str | None = None) -> list[Told]:
        """Give what was put out, in its order; only that of a ``kind``, if one is named."""
        query = select(_TOLD).order_by(_TOLD.c.number)
        with self._place.reading() as connection:
            rows = connection.execute(query if kind is None else query.where(_TOLD.c.kind == kind))
            return [Told(n, after, _time(at), *words) for n, after, at, *words in rows]

    def newest(self, kind: str, most: int) -> list[str]:
        """Give the last texts of a kind that were told, at most so many, in their order."""
        query = select(_TOLD.c.text).where(_TOLD.c.kind == kind)
        with self._place.reading() as connection:
            rows = connection.execute(query.order_by(_TOLD.c.number.desc()).limit(most))
            return [str(text) for text in rows.scalars()][::-1]

    def sources(self) -> list[tuple[str, str]]:
        """Give name and role of the inputs."""
        with self._place.reading() as connection:
            query = select(_SOURCE.c.name, _SOURCE.c.role).order_by(_SOURCE.c.number)
            return [(str(name), str(role)) for name, role in connection.execute(query)]

    def last(self) -> tuple[int, int]:
        """Give the numbers of the last bytes received, and of the last thing told; 0 if none."""
        with self._place.reading() as connection:
            ends = [
                connection.execute(select(t.c.number).order_by(t.c.number.desc()).limit(1)).scalar()
                for t in (_RECEIVED, _TOLD)
            ]
        return int(ends[0] or 0), int(ends[1] or 0)

    def sizes(self) -> dict[int, int]:
        """Give how many bytes there are of each input, by its number."""
        total = func.sum(func.length(_RECEIVED.c.data))
        with self._place.reading() as connection:
            query = select(_RECEIVED.c.source, total).group_by(_RECEIVED.c.source)
            return {int(source): int(size) for source, size in connection.execute(query)}

    def begin(self, sources: Sequence[tuple[str, str]]) -> None:
        """Note the inputs of a new mission, or check that they are those of the old one.

        Raises
        ------
        OptionsError
            The journal is of other inputs.
        OutputError
            It cannot be written.
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
            with self._place.writing() as connection:
                _insert(connection, _SOURCE, rows)

    def close(self) -> None:
        """Let go of the data base."""
        self._place.close()


def open_journal(url: str, *, new: bool = True) -> Journal:
    """Open a journal to write on in it, and begin it if there is none.

    Parameters
    ----------
    url, new
        As for `surefix.io.journal_place.open_place`, which says what can go wrong.
    """
    return Journal(open_place(url, new=new))


def journal_logs(
    url: str, *, require_checksum: bool = True
) -> list[tuple[str, str, Iterator[Log]]]:
    """Open the inputs of a journal for reading: name and role of each, and its parts.

    An input that has several tasks is there several times.

    Raises
    ------
    InputError
        It is no journal.
    """
    journal = open_journal(url, new=False)

    sources = journal.sources()
    if not sources:
        raise InputError(f"{url}: a data base without inputs", "a journal of surefix live")
    names, tasks = [name for name, _ in sources], [task_of(task) for _, task in sources]

    def parts(number: int, first: bool) -> Iterator[Log]:
        stream = streams(names, tasks, [require_checksum] * len(names))[number]
        for piece in journal.received(source=number):
            if piece.data:
                log = stream.read(piece.data, piece.time)
                yield log if first else again(log)
        yield stream.rest() if first else again(stream.rest())

    return [(names[i], role, parts(i, k < len(names))) for k, (i, role) in enumerate(feeds(tasks))]


def _row(record: Received | Told) -> dict[str, object]:
    return record._asdict() | {"time": None if math.isnan(record.time) else record.time}


def _time(stored: float | None) -> float:
    return math.nan if stored is None else stored


def _insert(connection: Connection, table: Table, rows: list[dict[str, object]]) -> None:
    if not rows:
        return
    insert = _INSERT[connection.dialect.name]
    connection.execute(insert(table).on_conflict_do_nothing(), rows)


def _plain(text: str) -> str:
    """A text that every data base takes: without NUL and halves of characters."""
    return text.encode("utf-8", "replace").decode().replace("\0", "?")


def _names(sources: Sequence[tuple[str, str]]) -> str:
    return ", ".join(f"{name} ({role})" for name, role in sources)
