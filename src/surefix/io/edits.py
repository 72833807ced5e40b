"""The edit log: what people decided about fixes, one JSON object a line, only ever added to.

::

    {"number": 1, "time": "2024-05-14T08:03:11.250Z", "by": "anna", "action": "reject",
     "fixes": [{"source": "usbl.csv", "sensor": "usbl", "row": [100], "time": [1715673600.0],
                "digest": ["9f3a12bc55d0e17c"]}]}
    {"number": 2, "time": "2024-05-14T08:03:15.000Z", "by": "anna", "action": "undo"}

What holds now is a pure fold of the lines, so undo and redo have no limit, and every beginning of a
log is a log. A fix is known by its source, its sensor and the digest of what was recorded of it
(`surefix.pipelines.editing.digests`); row and time are for people. A last line that a crash cut off
is left out and told; the next edit takes its place. Writers take turns by a lock on the file.
"""

from __future__ import annotations

import contextlib
import getpass
import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from surefix.errors import InputError, OptionsError, OutputError, ParseError
from surefix.types import Edit, FloatArray, IntArray

__all__ = [
    "Action",
    "Chosen",
    "Decided",
    "EditLog",
    "Entry",
    "append_edit",
    "decided",
    "read_edits",
    "standing",
]

Action = Literal["accept", "reject", "restore", "undo", "redo"]
"""What one line says; ``restore`` leaves fixes to the filter again."""

_EDITS: Final = {"accept": Edit.ACCEPT, "reject": Edit.REJECT, "restore": Edit.NONE}
_KEYS: Final = ("source", "sensor", "row", "time", "digest")
_FORM: Final = "an edit of surefix edit or surefix review"
_MEND: Final = "take the file from a copy: what follows a damaged line cannot be trusted"


class Chosen(NamedTuple):
    """Fixes of one sensor.

    Parameters
    ----------
    source, sensor
        Names of the input and of the sensor.
    row, time
        (n,) number of the record, and its time as recorded, s; NaN where it has none.
    digest
        (n,) what they are known by.
    """

    source: str
    sensor: str
    row: IntArray
    time: FloatArray
    digest: NDArray[np.uint64]


class Entry(NamedTuple):
    """One line.

    Parameters
    ----------
    number
        Counts from 1, without a gap.
    time, by
        When, ISO 8601 in UTC, and who.
    action
        What was done.
    fixes
        To which fixes; none for ``undo`` and ``redo``.
    """

    number: int
    time: str
    by: str
    action: Action
    fixes: tuple[Chosen, ...] = ()

    @property
    def total(self) -> int:
        """How many fixes it is about."""
        return sum(len(part.row) for part in self.fixes)


class EditLog(NamedTuple):
    """An edit log as it was read; ``torn`` is its damaged last line, or empty."""

    entries: tuple[Entry, ...]
    torn: str = ""


class Decided(NamedTuple):
    """What holds for the fixes of one sensor: (n,) codes of `Edit`, by rising digest."""

    fixes: Chosen
    edit: IntArray


def standing(entries: Sequence[Entry]) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
    """Tell which edits hold, in their order, and which are undone, the next to be redone last.

    A new edit forgets what was undone before it; undo and redo of nothing do nothing.
    """
    done: list[Entry] = []
    undone: list[Entry] = []
    for entry in entries:
        if entry.action == "undo":
            undone += [done.pop()] if done else []
        elif entry.action == "redo":
            done += [undone.pop()] if undone else []
        else:
            done.append(entry)
            undone.clear()
    return tuple(done), tuple(undone)


def decided(entries: Sequence[Entry]) -> tuple[Decided, ...]:
    """Fold a log to what holds now: of several edits of a fix the last."""
    by_sensor: dict[tuple[str, str], list[Decided]] = {}
    for entry in standing(entries)[0]:
        for fixes in entry.fixes:
            edit = np.full(len(fixes.row), _EDITS[entry.action], dtype=np.int64)
            by_sensor.setdefault(fixes[:2], []).append(Decided(fixes, edit))
    return tuple(_latest(parts) for parts in by_sensor.values())


def _latest(parts: list[Decided]) -> Decided:
    parts = parts[::-1]
    source, sensor = parts[0].fixes[:2]
    row, time, digest = (
        np.concatenate(column) for column in zip(*(part.fixes[2:] for part in parts), strict=True)
    )
    digest, first = np.unique(digest, return_index=True)
    fixes = Chosen(source, sensor, row[first], time[first], digest)
    return Decided(fixes, np.concatenate([part.edit for part in parts])[first])


def read_edits(path: str | Path, *, new: bool = False) -> EditLog:
    """Read an edit log.

    Parameters
    ----------
    path
        The file.
    new
        Whether it need not be there yet: then it is empty.

    Raises
    ------
    InputError
        It cannot be read.
    ParseError
        A line other than the last is damaged or missing, or says what no edit says.
    """
    place = Path(path)
    try:
        with place.open("rb") as file, _locked(file.fileno(), shared=True):
            return _parsed(place, file.read())[0]
    except FileNotFoundError as error:
        if new:
            return EditLog(())
        raise InputError(f"{place}: {error.strerror}", "an edit log") from error
    except OSError as error:
        raise InputError(f"{place}: {error.strerror}", "an edit log") from error


def append_edit(
    path: str | Path, action: Action, fixes: Sequence[Chosen] = (), *, by: str = ""
) -> tuple[Entry, ...]:
    """Add an edit, and give the whole log with it; when this returns it is on the disk.

    Parameters
    ----------
    path
        The file; begun if it is not there.
    action, fixes
        What is done, and to which fixes.
    by
        Who does it; empty: the user of the computer.

    Raises
    ------
    OptionsError
        No fix is chosen, or there is nothing to undo or redo.
    InputError, ParseError
        As `read_edits`.
    OutputError
        It cannot be written; the log is as it was.
    """
    place = Path(path)
    if action in _EDITS and not any(len(part.row) for part in fixes):
        raise OptionsError(f"{action} of no fix", "one fix or more", "choose other fixes")
    flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)
    try:
        handle = os.open(place, flags, 0o666)
        with os.fdopen(handle, "r+b", buffering=0) as file, _locked(handle):
            log, sound = _parsed(place, file.read())
            _check_step(log, action)
            entry = Entry(len(log.entries) + 1, _now(), by or _user(), action, tuple(fixes))
            _write(handle, sound, _line(entry))
            return (*log.entries, entry)
    except OSError as error:
        raise OutputError(
            f"{place}: {error.strerror or error}", "a place that can be written to"
        ) from error


def _check_step(log: EditLog, action: Action) -> None:
    done, undone = standing(log.entries)
    if action == "undo" and not done:
        raise OptionsError("undo", "an edit that holds", "there is none: nothing was changed")
    if action == "redo" and not undone:
        raise OptionsError("redo", "an edit that was undone", "there is none: nothing was changed")


def _write(handle: int, sound: bytes, line: bytes) -> None:
    """Add a line after what is sound; on failure the file ends where that ends."""
    end = len(sound)
    os.ftruncate(handle, end)
    left = line if not sound or sound.endswith(b"\n") else b"\n" + line
    try:
        while left:
            left = left[os.write(handle, left) :]
        os.fsync(handle)
    except BaseException:
        with contextlib.suppress(OSError):
            os.ftruncate(handle, end)
        raise


def _parsed(place: Path, content: bytes) -> tuple[EditLog, bytes]:
    """Read a file's content; beside the log, the part of it that is sound."""
    lines = content.splitlines(keepends=True)
    entries: list[Entry] = []
    for number, line in enumerate(lines, start=1):
        where = f"{place}, line {number}"
        try:
            said = json.loads(line)
        except ValueError as error:  # text that is not UTF-8 is one, too
            if number < len(lines):
                raise ParseError(f"{where} is damaged", _FORM, _MEND) from error
            told = f"{where}: {line.decode('utf-8', 'replace')[:60].rstrip()}"
            return EditLog(tuple(entries), told), b"".join(lines[:-1])
        try:
            entry = _entry(said)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ParseError(f"{where} says no edit", _FORM, _MEND) from error
        if entry.number != number:
            given = f"{where} has the number {entry.number}"
            raise ParseError(given, f"{number}: lines are missing or twice", _MEND)
        entries.append(entry)
    return EditLog(tuple(entries)), content


def _entry(said: Any) -> Entry:
    if said["action"] not in get_args(Action):
        raise ValueError(said["action"])
    fixes = tuple(_chosen(*(part[key] for key in _KEYS)) for part in said.get("fixes", ()))
    return Entry(int(said["number"]), str(said["time"]), str(said["by"]), said["action"], fixes)


def _chosen(source: str, sensor: str, row: list[int], time: list[Any], digest: list[str]) -> Chosen:
    if not len(row) == len(time) == len(digest):
        raise ValueError("columns of different lengths")
    times = [math.nan if value is None else float(value) for value in time]
    known = np.array([int(text, 16) for text in digest], dtype=np.uint64)
    return Chosen(str(source), str(sensor), np.array(row, np.int64), np.array(times), known)


def _line(entry: Entry) -> bytes:
    said: dict[str, Any] = dict(zip(entry._fields[:4], entry[:4], strict=True))
    if entry.fixes:
        said["fixes"] = [
            {
                "source": part.source,
                "sensor": part.sensor,
                "row": part.row.tolist(),
                "time": [value if math.isfinite(value) else None for value in part.time.tolist()],
                "digest": [f"{value:016x}" for value in part.digest.tolist()],
            }
            for part in entry.fixes
        ]
    return json.dumps(said, ensure_ascii=False, allow_nan=False).encode("utf-8") + b"\n"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a user without a name
        return "unknown"


@contextlib.contextmanager
def _locked(handle: int, *, shared: bool = False) -> Iterator[None]:
    """Hold a lock on an open file, where its file system has locks; closing it lets go."""
    if sys.platform != "win32":
        import fcntl

        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_SH if shared else fcntl.LOCK_EX)
    yield
