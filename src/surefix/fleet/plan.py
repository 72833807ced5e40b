"""What a fleet has to do: its units of work, each with a mark of what it is made of and how."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from surefix.errors import InputError, OptionsError
from surefix.fleet.arrange import arrange, arranged
from surefix.fleet.dataset import Unit, digest, index, schema_of, units
from surefix.fleet.found import Found
from surefix.fleet.names import output_names
from surefix.fleet.options import TRACK, FleetOptions
from surefix.fleet.tracks import plan_tracks
from surefix.fleet.work import LogTask, TrackTask

__all__ = ["SUMMARY", "TRACKS", "Planned", "plan_logs", "plan_units"]

SUMMARY = "summary"
"""Name of the summary, and therefore of no output."""
TRACKS = "tracks"
"""Folder of the rows of a data set."""


class Planned(NamedTuple):
    """Units of work, in the order of the summary.

    Parameters
    ----------
    tasks
        What can be done.
    bad
        What cannot even be tried, and why.
    prepare
        To be called before the first of them is done.
    """

    tasks: tuple[LogTask | TrackTask, ...]
    bad: tuple[tuple[str, InputError], ...] = ()
    prepare: Callable[[], None] = lambda: None


def plan_logs(found: Found, folder: Path, options: FleetOptions, known: dict[str, str]) -> Planned:
    """One unit for each log.

    Parameters
    ----------
    found
        The logs.
    folder
        Of the outputs.
    options
        How.
    known
        Names of an earlier run, by log.

    Raises
    ------
    OptionsError
        An output would take the place of a log.
    """
    more = options.suffix, options.require_checksum, options.target, sorted(options.beside.items())
    how = _how(options, *more)
    tasks = []
    reserved = {**known, "": SUMMARY}
    for log, name in output_names(found.logs, reserved).items():
        output = f"{name}{options.suffix}"
        beside = {role: str(log.parent / file) for role, file in options.beside.items()}
        if (folder / output).resolve() in found.logs:
            raise OptionsError(f"output {folder / output} is also an input", "another folder")
        mark = f"{how}:{_state(log, beside)}"
        plain = dict(options.columns)
        task = (name, str(log), mark, output, str(folder), options.clean, plain, beside)
        tasks.append(LogTask(*task, options.require_checksum, options.target))
    return Planned(tuple(tasks))


def plan_units(found: Found, folder: Path, options: FleetOptions) -> Planned:
    """Units of whole tracks of a data set.

    Parameters
    ----------
    found
        The data set.
    folder
        Of the outputs; a data set that is not laid out by track is brought into order there.
    options
        How.

    Raises
    ------
    OptionsError, ParseError, InputError
        The data set as a whole cannot be cleaned as asked.
    """
    if options.beside:
        raise OptionsError("logs beside a data set of many tracks", "logs of one track each")
    root, track = str(found.root), options.track or TRACK
    schema = schema_of(found.files, root, track)
    plan = plan_tracks(schema, track, options.clean, options.columns, root)
    data = index(found.files, root, plan.track, plan.kind)
    prepare: Callable[[], None] = lambda: None  # noqa: E731
    if not data.laid_out:
        target = arranged(data, folder / ".arranged")
        prepare = partial(arrange, data, target, root, plan.track, plan.kind)
        data, root = target, str(folder)
    how = _how(options, plan.track)
    tasks = tuple(
        TrackTask(
            unit.name,
            "",
            f"{how}:{_content(unit)}",
            f"{TRACKS}/{unit.name}.parquet",
            str(folder),
            root,
            unit,
            plan,
        )
        for unit in units(data)
    )
    return Planned(tasks, data.bad, prepare)


def _how(options: FleetOptions, *more: object) -> str:
    """Digest of everything but the input that the result depends on."""
    clean = {f.name: getattr(options.clean, f.name) for f in fields(options.clean)}
    said = [clean, dict(options.columns), more, version("surefix")]
    text = json.dumps(said, sort_keys=True, default=dict)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _content(unit: Unit) -> str:
    return hashlib.sha256(repr(unit.pieces).encode()).hexdigest()[:16]


def _state(log: Path, beside: dict[str, str]) -> str:
    try:
        return digest(str(log), *beside.values())[:16]
    except OSError:  # its own outcome will say what is wrong
        return "absent"
