"""Inputs opened as sources: which reader a file needs, and what supports the fixes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from surefix.errors import InputError, OptionsError, ParseError
from surefix.io.acoustic_plan import SHIP
from surefix.io.columns import Role
from surefix.io.nmea_log import read_nmea, sniff
from surefix.io.sqlite_file import is_sqlite
from surefix.io.table import from_frame, read_table
from surefix.pipelines.clean import Source
from surefix.types import Log

__all__ = ["Data", "Progress", "open_inputs", "open_log"]

Data = Any
"""A file, or a table: a data frame, an Arrow table, a mapping of names to arrays."""

Progress = Callable[[int], None]
_HEAD = 1 << 16
_JOURNALS = ("postgresql://", "sqlite:///")


def open_inputs(
    inputs: Sequence[Data],
    *,
    depth: Data | None = None,
    velocity: Data | None = None,
    heading: Data | None = None,
    attitude: Data | None = None,
    ship: Sequence[Data] = (),
    columns: Mapping[str, str] | None = None,
    require_checksum: bool = True,
    target: str | None = None,
    progress: Progress | None = None,
) -> list[Source]:
    """Open files, or tables in memory, as sources.

    Parameters
    ----------
    inputs
        Logs with positions: files (CSV, Parquet, NMEA 0183, the SQLite journal of a live service),
        URLs of its journals, or tables (data frames, Arrow tables, mappings of names to arrays).
    depth, velocity, heading, attitude
        Other sensors, each a file or a table, with their own clocks and rates.
    ship
        Logs with position and heading of the ship that an acoustic positioning system is on, the
        one to be preferred first, where they are not in its own log.
    columns
        Roles and columns as in `surefix.io.columns`. ``depth.time`` is a role of the depth log
        alone; a plain ``time`` also holds for the other logs that have such a column.
    require_checksum
        False accepts NMEA sentences without a checksum.
    target
        Whose fixes are taken from logs of an acoustic positioning system: a transponder, or
        ``ship``; default the transponder that is seen most often.
    progress
        Told the bytes that were read, over all files.

    Raises
    ------
    InputError, ParseError, OptionsError
        As the readers; or a column is named for a log that is not given.
    """
    if not inputs:
        raise OptionsError("no input", "one file or more")
    opener = _Opener(dict(columns or {}), require_checksum, target, bool(ship), progress)
    given = {"depth": depth, "velocity": velocity, "heading": heading, "attitude": attitude}
    given[SHIP] = ship or None
    opener.check({role for role, data in given.items() if data is not None})
    sources: list[Source] = []
    for data in inputs:
        if (journal := _journal(data)) is not None:
            sources += _journalled(journal, require_checksum)
        else:
            sources.append(Source(opener.open(data, "fixes"), "fixes", _name(data)))
    sources += [Source(opener.open_ship(data), SHIP, _name(data, SHIP)) for data in ship]
    if depth is not None:
        sources.append(Source(opener.open(depth, "depth"), "depth", _name(depth, "depth")))
    lies: tuple[tuple[Data, Role], ...] = ((heading, "heading"), (attitude, "attitude"))
    for data, role in lies:
        if data is None:
            continue
        if not any(_same(data, other) for other in inputs):
            sources.append(Source(opener.open(data, role), role, _name(data, role)))
        elif role == "heading" and velocity is not None:  # cleaned beside the fixes already
            sources.append(Source(opener.open(data, role), "turning", _name(data, role)))
    if velocity is not None:
        logs = opener.open(velocity, "velocity")
        sources.append(Source(logs, "velocity", _name(velocity, "velocity")))
    return sources


def _journal(data: Data) -> str | None:
    """URL of the journal that an input is; None if it is none."""
    if isinstance(data, str) and data.startswith(_JOURNALS):
        return data
    return f"sqlite:///{data}" if isinstance(data, str | Path) and is_sqlite(Path(data)) else None


def _journalled(url: str, require_checksum: bool) -> list[Source]:
    """The inputs of a live service from its journal, as they were received."""
    from surefix.io.journal import journal_logs

    return [
        Source(logs, role, name)
        for name, role, logs in journal_logs(url, require_checksum=require_checksum)
    ]


def _name(data: Data, role: str = "table") -> str:
    return Path(data).name if isinstance(data, str | Path) else role


def _same(one: Data, two: Data) -> bool:
    if isinstance(one, str | Path) and isinstance(two, str | Path):
        return Path(one).resolve() == Path(two).resolve()
    return one is two


class _Opener:
    """Opens logs with the columns that are meant for each, and adds up the bytes they report."""

    def __init__(
        self,
        columns: dict[str, str],
        require_checksum: bool,
        target: str | None,
        apart: bool,
        progress: Progress | None,
    ) -> None:
        self._target, self._apart = target, apart
        self._columns, self._require_checksum = columns, require_checksum
        self._progress = progress
        self._done: list[int] = []

    def check(self, roles: set[str]) -> None:
        """Refuse columns for logs that are not given."""
        for key in self._columns:
            role, dot, _ = key.partition(".")
            if dot and role not in roles:
                told = ", ".join(sorted(roles)) or "none"
                raise OptionsError(f"a column for {key!r}", f"a log that is given: {told}")

    def open(self, data: Data, role: Role, task: str = "") -> Iterator[Log]:
        """Open one log; a time column named for all need not be there in a supporting one.

        ``task`` is what it is for, where that is not its role.
        """
        task = task or role
        own = self._own(task)
        if task == "fixes" or "time" in own or "time" not in self._columns:
            return self._open(data, role, own, task)
        try:
            return self._open(data, role, {"time": self._columns["time"], **own}, task)
        except (ParseError, OptionsError):
            return self._open(data, role, own, task)

    def open_ship(self, data: Data) -> Iterator[Log]:
        """Open a log of the ship; a table may have its heading alone."""
        try:
            return self.open(data, "fixes", SHIP)
        except ParseError as error:
            try:
                return self.open(data, "heading", SHIP)
            except ParseError:
                raise error from None

    def _own(self, role: str) -> dict[str, str]:
        if role == "fixes":
            return {key: column for key, column in self._columns.items() if "." not in key}
        parts = {key.partition("."): column for key, column in self._columns.items()}
        return {key: column for (prefix, _, key), column in parts.items() if prefix == role and key}

    def _open(self, data: Data, role: Role, columns: Mapping[str, str], task: str) -> Iterator[Log]:
        if not isinstance(data, str | Path):
            name = "fix" if task == "fixes" else task
            return iter([from_frame(data, mapping=columns, role=role, sensor=name, source="table")])
        return open_log(
            data,
            role=role,
            columns=columns,
            require_checksum=self._require_checksum,
            target={"fixes": self._target, SHIP: SHIP}.get(task),
            apart=self._apart and task in ("fixes", SHIP),
            progress=self._next_progress(),
        )

    def _next_progress(self) -> Progress | None:
        if self._progress is None:
            return None
        at, report = len(self._done), self._progress
        self._done.append(0)

        def tell(done: int) -> None:
            self._done[at] = done
            report(sum(self._done))

        return tell


def open_log(
    path: str | Path,
    *,
    role: Role = "fixes",
    columns: Mapping[str, str] | None = None,
    require_checksum: bool = True,
    target: str | None = None,
    apart: bool = False,
    progress: Progress | None = None,
) -> Iterator[Log]:
    """Open one file with the reader it needs.

    Raises
    ------
    InputError, ParseError, OptionsError
        As the readers.
    """
    place = Path(path)
    try:
        with place.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise InputError(f"{place}: {error.strerror}", "a readable file") from error
    if sniff(head):
        return read_nmea(
            place, require_checksum=require_checksum, target=target, apart=apart, progress=progress
        )
    if target is not None and not (apart and target == SHIP):
        raise OptionsError(
            f"target {target!r} for {place}", "a log of an acoustic positioning system"
        )
    return read_table(place, mapping=columns, role=role, sensor=place.stem, progress=progress)
