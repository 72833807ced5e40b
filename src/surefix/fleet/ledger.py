"""What a fleet has done: written after each unit, read when it is run again.

One SQLite file in the folder of the outputs. A unit is noted in one transaction after its outputs
have taken their place, so that whatever is noted is there, and whatever is not is done again. The
file stays locked while a fleet is at work.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa

from surefix.errors import OutputError
from surefix.fleet.outcome import COLUMNS, SCHEMA, Outcome

__all__ = ["Ledger", "open_ledger"]

_ROWS = 50_000
_FIELDS = ", ".join(Outcome._fields)
_TABLES = f"""
CREATE TABLE IF NOT EXISTS unit
    (name TEXT PRIMARY KEY, source TEXT, mark TEXT, outputs TEXT) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS outcome (unit TEXT, place INTEGER, {_FIELDS});
CREATE INDEX IF NOT EXISTS outcome_unit ON outcome (unit, place);
"""


class Ledger:
    """The notes of one folder; from `open_ledger`."""

    def __init__(self, notes: sqlite3.Connection, folder: Path) -> None:
        self._notes, self._folder = notes, folder

    def names(self) -> dict[str, str]:
        """Names of the units by their source."""
        return dict(self._notes.execute("SELECT source, name FROM unit WHERE source != ''"))

    def parts(self) -> list[str]:
        """Names of the units that hold tracks of a data set."""
        return [name for (name,) in self._notes.execute("SELECT name FROM unit WHERE source = ''")]

    def marks(self) -> dict[str, str]:
        """By unit, what it was made of and how."""
        return dict(self._notes.execute("SELECT name, mark FROM unit"))

    def is_done(self, name: str, mark: str) -> bool:
        """Whether a unit was done with this input and these options, and its outputs are there.

        What failed for a reason outside of data and options is not done.
        """
        found = self._notes.execute("SELECT mark, outputs FROM unit WHERE name = ?", (name,))
        row = found.fetchone()
        if row is None or row[0] != mark:
            return False
        again = "SELECT 1 FROM outcome WHERE unit = ? AND status = 'failed' AND NOT lasting"
        if self._notes.execute(again, (name,)).fetchone():
            return False
        return all(_size(self._folder / path) == size for path, size in json.loads(row[1]).items())

    def note(
        self, name: str, source: str, mark: str, outputs: Sequence[str], found: Sequence[Outcome]
    ) -> None:
        """Note that a unit is done, in the place of what was noted of it before."""
        sizes = {path: _size(self._folder / path) for path in outputs}
        rows = [(name, place, *outcome) for place, outcome in enumerate(found)]
        marks = ", ".join("?" * (len(Outcome._fields) + 2))
        with _written(self._folder), self._notes:
            self._notes.execute("DELETE FROM outcome WHERE unit = ?", (name,))
            self._notes.execute(
                "INSERT OR REPLACE INTO unit VALUES (?, ?, ?, ?)",
                (name, source, mark, json.dumps(sizes)),
            )
            self._notes.executemany(f"INSERT INTO outcome VALUES ({marks})", rows)

    def forget(self, name: str) -> list[str]:
        """Forget a unit that is no longer asked for; gives its outputs."""
        found = self._notes.execute("SELECT outputs FROM unit WHERE name = ?", (name,)).fetchone()
        with _written(self._folder), self._notes:
            self._notes.execute("DELETE FROM outcome WHERE unit = ?", (name,))
            self._notes.execute("DELETE FROM unit WHERE name = ?", (name,))
        return list(json.loads(found[0])) if found else []

    def select(self, units: Sequence[str]) -> None:
        """Say which units the summary is about, in their order."""
        self._notes.execute("CREATE TEMP TABLE IF NOT EXISTS chosen (unit TEXT, rank INTEGER)")
        self._notes.execute("DELETE FROM chosen")
        ranked = ((unit, rank) for rank, unit in enumerate(units))
        self._notes.executemany("INSERT INTO chosen VALUES (?, ?)", ranked)
        self._notes.execute("CREATE INDEX IF NOT EXISTS temp.chosen_unit ON chosen (unit)")

    def tables(self) -> Iterator[pa.Table]:
        """Rows of the summary, a part at a time; at least one part."""
        cells = ", ".join(f"outcome.{name}" for name in COLUMNS)
        rows = self._notes.execute(
            f"SELECT {cells} FROM chosen JOIN outcome USING (unit) ORDER BY rank, place"
        )
        first = True
        while (part := rows.fetchmany(_ROWS)) or first:
            columns = zip(*part, strict=True) if part else ([] for _ in COLUMNS)
            kinds = zip(columns, SCHEMA.types, strict=True)
            yield pa.table([pa.array(column, kind) for column, kind in kinds], schema=SCHEMA)
            first = False

    def totals(self) -> dict[str, int]:
        """How many were cleaned and failed, and how many fixes they had."""
        rows = self._notes.execute(
            "SELECT status, COUNT(*), SUM(fixes), SUM(rejected) "
            "FROM chosen JOIN outcome USING (unit) GROUP BY status"
        )
        found = {status: (count, fixes, rejected) for status, count, fixes, rejected in rows}
        cleaned, failed = found.get("cleaned", (0, 0, 0)), found.get("failed", (0, 0, 0))
        return {
            "cleaned": cleaned[0],
            "failed": failed[0],
            "fixes": cleaned[1],
            "rejected": cleaned[2],
        }

    def some(self, status: str, most: int) -> list[Outcome]:
        """The first few outcomes of a status."""
        cells = ", ".join(f"outcome.{name}" for name in Outcome._fields)
        rows = self._notes.execute(
            f"SELECT {cells} FROM chosen JOIN outcome USING (unit) WHERE status = ? "
            "ORDER BY rank, place LIMIT ?",
            (status, most),
        )
        return [Outcome._make(row) for row in rows]


@contextlib.contextmanager
def open_ledger(folder: Path) -> Iterator[Ledger]:
    """Open, or begin, the notes of a folder.

    Raises
    ------
    OutputError
        The folder cannot be written to, the notes are damaged, or another fleet is at work there.
    """
    with _written(folder):
        folder.mkdir(parents=True, exist_ok=True)
        notes = sqlite3.connect(folder / "fleet.sqlite", timeout=0.5)
    with contextlib.closing(notes):
        with _written(folder):
            notes.execute("PRAGMA locking_mode = EXCLUSIVE")
            notes.executescript(f"BEGIN EXCLUSIVE; {_TABLES} COMMIT;")
        yield Ledger(notes, folder)


@contextlib.contextmanager
def _written(folder: Path) -> Iterator[None]:
    try:
        yield
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            raise OutputError(
                f"{folder}: another fleet is at work there", "a folder for each", "wait for it"
            ) from error
        raise OutputError(f"{folder}: {error}", "a folder that can be written to") from error
    except sqlite3.DatabaseError as error:
        raise OutputError(
            f"{folder / 'fleet.sqlite'}: {error}",
            "the notes of an earlier fleet",
            "remove the file; everything is done again then",
        ) from error
    except OSError as error:
        raise OutputError(
            f"{folder}: {error.strerror}", "a folder that can be written to"
        ) from error


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return -1
