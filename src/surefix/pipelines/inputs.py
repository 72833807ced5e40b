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
from surefix.io.table import from_frame, read_table
from surefix.pipelines.channels import ChannelState, clean_channel
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import Source
from surefix.types import Channel, Fixes, FloatArray, Log

__all__ = ["Progress", "open_frames", "open_inputs", "open_log"]

Progress = Callable[[int], None]
_HEAD = 1 << 16
_BODY = ("forward_mps", "starboard_mps", "down_mps")


def open_inputs(
    inputs: Sequence[str | Path],
    *,
    depth: str | Path | None = None,
    velocity: str | Path | None = None,
    heading: str | Path | None = None,
    columns: Mapping[str, str] | None = None,
    require_checksum: bool = True,
    progress: Progress | None = None,
) -> list[Source]:
    """Open files as sources.

    Parameters
    ----------
    inputs
        Files with positions, CSV, Parquet or NMEA 0183.
    depth, velocity, heading
        Files of other sensors, with their own clocks and rates.
    columns
        Roles and columns as in `surefix.io.columns`. ``depth.time`` is a role of the depth file
        alone; a plain ``time`` also holds for the other files that have such a column.
    require_checksum
        False accepts NMEA sentences without a checksum.
    progress
        Told the bytes that were read, over all inputs.
    """
    if not inputs:
        raise OptionsError("no input", "one file or more")
    chosen = dict(columns or {})
    told = _Told(progress)
    sources = []
    for path in inputs:
        own = {role: column for role, column in chosen.items() if "." not in role}
        logs = open_log(path, columns=own, require_checksum=require_checksum, progress=told.next())
        sources.append(Source(logs, "fixes", Path(path).name))
    extra: tuple[tuple[Role, str | Path | None], ...] = (("depth", depth), ("heading", heading))
    for role, other in extra:
        if other is not None:
            logs = _supporting(other, role, chosen, require_checksum, told.next())
            sources.append(Source(logs, role, Path(other).name))
    if velocity is not None:
        logs = _supporting(velocity, "velocity", chosen, require_checksum, told.next())
        turning = None
        if heading is not None:
            turning = list(_supporting(heading, "heading", chosen, require_checksum, None))
        sources.append(Source(_earth_frame(logs, turning), "velocity", Path(velocity).name))
    return sources


def open_frames(
    fixes: Any,
    *,
    depth: Any = None,
    velocity: Any = None,
    heading: Any = None,
    columns: Mapping[str, str] | None = None,
) -> list[Source]:
    """Open tables (data frames, Arrow tables, mappings of names to arrays) as sources.

    Arguments as for `open_inputs`.
    """
    chosen = dict(columns or {})
    own = {role: column for role, column in chosen.items() if "." not in role}
    sources = [Source(iter([from_frame(fixes, mapping=own)]), "fixes", "table")]

    def supporting(table: Any, role: Role) -> Log:
        mine = _own(chosen, role)
        shared = {"time": chosen["time"]} if "time" in chosen and "time" not in mine else {}
        try:
            return from_frame(table, mapping={**shared, **mine}, role=role, sensor=role)
        except (ParseError, OptionsError):
            return from_frame(table, mapping=mine, role=role, sensor=role)

    if depth is not None:
        sources.append(Source(iter([supporting(depth, "depth")]), "depth", "depth"))
    turning = [supporting(heading, "heading")] if heading is not None else None
    if turning is not None:
        sources.append(Source(iter(turning), "heading", "heading"))
    if velocity is not None:
        logs = _earth_frame(iter([supporting(velocity, "velocity")]), turning)
        sources.append(Source(logs, "velocity", "velocity"))
    return sources


def _own(columns: Mapping[str, str], role: str) -> dict[str, str]:
    """Columns that are meant for the file of one role: ``depth.time`` → ``time``."""
    return {
        key.partition(".")[2]: value for key, value in columns.items() if key.startswith(role + ".")
    }


def open_log(
    path: str | Path,
    *,
    role: Role = "fixes",
    columns: Mapping[str, str] | None = None,
    require_checksum: bool = True,
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
        return read_nmea(place, require_checksum=require_checksum, progress=progress)
    return read_table(place, mapping=columns, role=role, sensor=place.stem, progress=progress)


class _Told:
    """Adds up the bytes that several readers report, each for its own file."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._done: list[int] = []

    def next(self) -> Progress | None:
        if self._progress is None:
            return None
        at, report = len(self._done), self._progress
        self._done.append(0)

        def tell(done: int) -> None:
            self._done[at] = done
            report(sum(self._done))

        return tell


def _supporting(
    path: str | Path,
    role: Role,
    columns: Mapping[str, str],
    require_checksum: bool,
    progress: Progress | None,
) -> Iterator[Log]:
    """Open a file of another sensor; a shared time column need not be there."""
    own = _own(columns, role)
    shared = {"time": columns["time"]} if "time" in columns and "time" not in own else {}
    try:
        return open_log(
            path,
            role=role,
            columns={**shared, **own},
            require_checksum=require_checksum,
            progress=progress,
        )
    except (ParseError, OptionsError):
        if not shared:
            raise
    return open_log(
        path, role=role, columns=own, require_checksum=require_checksum, progress=progress
    )


def _earth_frame(logs: Iterator[Log], turning: list[Log] | None) -> Iterator[Log]:
    """Velocities of the vehicle's own axes turned into east, north, up by its heading."""
    heading: tuple[FloatArray, FloatArray, FloatArray] | None = None
    for log in logs:
        body = {channel.name: channel for channel in log.channels if channel.name in _BODY}
        if not body:
            yield log
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
    return Fixes(
        time, empty, velocity, empty, empty, zero, zero, np.ones(n, np.bool_), np.arange(n), False
    )
