"""Inputs opened as sources: which reader a file needs, and what supports the fixes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from surefix.errors import InputError, OptionsError, ParseError, SurefixError
from surefix.geo.angle import wrap
from surefix.geo.local_frame import rotate
from surefix.io.columns import Role
from surefix.io.nmea_log import read_nmea, sniff
from surefix.io.sqlite_file import is_sqlite
from surefix.io.table import from_frame, read_table
from surefix.pipelines.channels import ChannelState, clean_channel
from surefix.pipelines.clean import Source
from surefix.pipelines.options import CleanOptions
from surefix.types import Channel, Fixes, FloatArray, Log

__all__ = ["Data", "Progress", "open_inputs", "open_log"]

Data = Any
"""A file, or a table: a data frame, an Arrow table, a mapping of names to arrays."""

Progress = Callable[[int], None]
_HEAD = 1 << 16
_JOURNALS = ("postgresql://", "sqlite:///")
_BODY = ("forward_mps", "starboard_mps", "down_mps")
_SIGMA = "velocity_sigma_mps"  # standard deviation that a sensor declares for each of them


def open_inputs(
    inputs: Sequence[Data],
    *,
    depth: Data | None = None,
    velocity: Data | None = None,
    heading: Data | None = None,
    attitude: Data | None = None,
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
    opener = _Opener(dict(columns or {}), require_checksum, target, progress)
    given = {"depth": depth, "velocity": velocity, "heading": heading, "attitude": attitude}
    opener.check({role for role, data in given.items() if data is not None})
    sources: list[Source] = []
    for data in inputs:
        if (journal := _journal(data)) is not None:
            sources += _journalled(journal, require_checksum)
        else:
            sources.append(Source(opener.open(data, "fixes"), "fixes", _name(data)))
    if depth is not None:
        sources.append(Source(opener.open(depth, "depth"), "depth", _name(depth, "depth")))
    lies: tuple[tuple[Data, Role], ...] = ((heading, "heading"), (attitude, "attitude"))
    for data, role in lies:
        if data is not None and not any(_same(data, other) for other in inputs):
            sources.append(Source(opener.open(data, role), role, _name(data, role)))
    if velocity is not None:
        turning = list(opener.open(heading, "heading")) if heading is not None else None
        logs = _earth_frame(opener.open(velocity, "velocity"), turning)
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
        progress: Progress | None,
    ) -> None:
        self._target = target
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

    def open(self, data: Data, role: Role) -> Iterator[Log]:
        """Open one log; a time column named for all need not be there in a supporting one."""
        own = self._own(role)
        if role == "fixes" or "time" in own or "time" not in self._columns:
            return self._open(data, role, own)
        try:
            return self._open(data, role, {"time": self._columns["time"], **own})
        except (ParseError, OptionsError):
            return self._open(data, role, own)

    def _own(self, role: Role) -> dict[str, str]:
        if role == "fixes":
            return {key: column for key, column in self._columns.items() if "." not in key}
        parts = {key.partition("."): column for key, column in self._columns.items()}
        return {key: column for (prefix, _, key), column in parts.items() if prefix == role and key}

    def _open(self, data: Data, role: Role, columns: Mapping[str, str]) -> Iterator[Log]:
        if not isinstance(data, str | Path):
            name = "fix" if role == "fixes" else role
            return iter([from_frame(data, mapping=columns, role=role, sensor=name, source="table")])
        return open_log(
            data,
            role=role,
            columns=columns,
            require_checksum=self._require_checksum,
            target=self._target if role == "fixes" else None,
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
        return read_nmea(place, require_checksum=require_checksum, target=target, progress=progress)
    if target is not None:
        raise OptionsError(
            f"target {target!r} for {place}", "a log of an acoustic positioning system"
        )
    return read_table(place, mapping=columns, role=role, sensor=place.stem, progress=progress)


def _earth_frame(logs: Iterator[Log], turning: list[Log] | None) -> Iterator[Log]:
    """Velocities of the vehicle's own axes turned into east, north, up by its heading."""
    heading: tuple[FloatArray, FloatArray, FloatArray] | None = None
    for log in logs:
        body = {
            channel.name: channel for channel in log.channels if channel.name in (*_BODY, _SIGMA)
        }
        if not body:
            yield log if heading is None else replace(log, fixes=None, channels=())
            continue
        if heading is None:
            heading = _headings(turning, log.source)
        yield replace(log, fixes=_turned(body, heading), channels=(), sensors=(_sensor(body),))


def _sensor(body: Mapping[str, Channel]) -> str:
    return next(iter(body.values())).sensor


def _headings(turning: list[Log] | None, source: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, clean heading and its rate, as known in real time: no look into the future."""
    series = [c for log in turning or () for c in log.channels if c.name == "heading_deg"]
    if not series:
        raise _no_heading(source)
    whole = series[0]._replace(
        time=np.concatenate([c.time for c in series]),
        value=np.concatenate([c.value for c in series]),
    )
    cleaned, _ = clean_channel(whole, ChannelState(), CleanOptions(mode="realtime"), final=True)
    return cleaned.time, cleaned.value, cleaned.rate


def _no_heading(source: str) -> SurefixError:
    return OptionsError(
        f"{source} has velocities along the vehicle's own axes",
        "a heading to turn them to east and north",
        "add --heading FILE",
    )


def _turned(
    body: Mapping[str, Channel], heading: tuple[FloatArray, FloatArray, FloatArray]
) -> Fixes:
    """Body velocities as observations in the earth frame; level flight is assumed."""
    time = next(iter(body.values())).time
    n = len(time)
    forward, starboard, down = (
        body[name].value if name in body else np.full(n, np.nan) for name in _BODY
    )
    known_at, value, rate = heading
    order = np.argsort(known_at, kind="stable")
    latest = np.searchsorted(known_at[order], time, side="right") - 1
    index = order[np.maximum(latest, 0)]
    degrees = value[index] + rate[index] * (time - known_at[index])
    azimuth = np.where(latest >= 0, np.radians(wrap(degrees)), np.nan)
    east, north = rotate(starboard, forward, -azimuth)
    empty = np.full((n, 3), np.nan)
    zero = np.zeros(n, np.int64)
    velocity = np.column_stack([east, north, -down])
    sigma = np.column_stack([body[_SIGMA].value] * 3) if _SIGMA in body else empty
    return Fixes(
        time, empty, velocity, empty, sigma, zero, zero, np.ones(n, np.bool_), np.arange(n), False
    )
