"""`surefix edit`: accept or reject fixes by hand, with undo and redo, without a page."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surefix.cli_inputs import Columns, NoChecksum, Target, keep_inputs
from surefix.errors import OptionsError

if TYPE_CHECKING:
    from surefix.io.edits import Entry
    from surefix.pipelines.editing import Wanted

__all__ = ["edit"]

_STRETCH = re.compile(r"(\d+)(?:\s*-\s*(\d+))?")
_SHOWN = 5  # stretches of rows


def edit(
    inputs: Annotated[
        list[str] | None,
        typer.Argument(
            help="The logs, to find the fixes in.", show_default=False, metavar="INPUTS..."
        ),
    ] = None,
    edits: Annotated[
        Path, typer.Option(help="The edit log; begun if it is not there.", show_default=False)
    ] = Path("edits.jsonl"),
    accept: Annotated[bool, typer.Option("--accept", help="Believe the fixes fully.")] = False,
    reject: Annotated[bool, typer.Option("--reject", help="Take the fixes out.")] = False,
    restore: Annotated[
        bool, typer.Option("--restore", help="Leave the fixes to the filter again.")
    ] = False,
    rows: Annotated[
        str | None,
        typer.Option(metavar="ROWS", help="Numbers of the records, such as 100-109,120."),
    ] = None,
    since: Annotated[
        str | None, typer.Option(metavar="TIME", help="From this time on: ISO 8601, or seconds.")
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="TIME", help="Up to this time, which belongs to it.")
    ] = None,
    sensor: Annotated[
        list[str] | None, typer.Option(help="Only fixes of this sensor; repeatable.")
    ] = None,
    undo: Annotated[bool, typer.Option("--undo", help="Undo the last edit that holds.")] = False,
    redo: Annotated[bool, typer.Option("--redo", help="Redo what was undone last.")] = False,
    show: Annotated[bool, typer.Option("--list", help="Show the edits.")] = False,
    column: Columns = None,
    no_checksum: NoChecksum = False,
    target: Target = None,
) -> None:
    """Accept or reject single fixes, undo and redo; surefix clean --edits obeys."""
    from surefix.io.columns import mapping
    from surefix.io.edits import Action, append_edit, read_edits
    from surefix.pipelines.editing import choose
    from surefix.pipelines.inputs import open_inputs

    given: dict[Action, bool] = {
        "accept": accept, "reject": reject, "restore": restore, "undo": undo, "redo": redo
    }  # fmt: skip
    actions = [action for action, wanted in given.items() if wanted]
    if len(actions) + show != 1:
        expected = "one of " + ", ".join(f"--{action}" for action in given) + " or --list"
        raise OptionsError(f"{len(actions) + show} things to do", expected)
    if show:
        log = read_edits(edits)
        _list(log.entries)
        if log.torn:
            typer.echo(f"left out, cut off in a crash: {log.torn}")
        return
    wanted = _wanted(rows, since, until, sensor or [])
    if actions[0] in ("undo", "redo"):
        if inputs or wanted is not None:
            raise OptionsError(f"fixes beside --{actions[0]}", f"--{actions[0]} alone")
        done = append_edit(edits, actions[0])
    else:
        if not inputs or wanted is None:
            expected = "a log, and --rows, --since, --until or --sensor"
            raise OptionsError(f"--{actions[0]} without fixes", expected)
        keep_inputs([Path(each) for each in inputs], [edits])
        sources = open_inputs(
            inputs,
            columns=mapping(column or []),
            require_checksum=not no_checksum,
            target=target,
        )
        done = append_edit(edits, actions[0], choose(sources, wanted))
    _list(done, last=True)


def _wanted(
    rows: str | None, since: str | None, until: str | None, sensors: list[str]
) -> Wanted | None:
    """Which fixes are meant; None if nothing is said about them."""
    from surefix.pipelines.editing import Wanted

    if rows is None and since is None and until is None and not sensors:
        return None
    return Wanted(
        None if rows is None else tuple(_stretch(part) for part in rows.split(",")),
        -math.inf if since is None else _time("--since", since),
        math.inf if until is None else _time("--until", until),
        tuple(sensors),
    )


def _stretch(text: str) -> tuple[int, int]:
    match = _STRETCH.fullmatch(text.strip())
    if match is None or int(match[2] or match[1]) < int(match[1]):
        raise OptionsError(f"--rows {text!r}", "numbers such as 100-109,120")
    return int(match[1]), int(match[2] or match[1])


def _time(option: str, text: str) -> float:
    from surefix.geo.time import parse_time

    try:
        value = float(text)
    except ValueError:
        value = parse_time(text)
    if not math.isfinite(value):
        raise OptionsError(f"{option} {text!r}", "ISO 8601, such as 2024-05-14T08:00:00, or s")
    return value


def _list(entries: Sequence[Entry], *, last: bool = False) -> None:
    """Say what was done, a line each, and what of it is undone; or only what was done last."""
    from surefix.io.edits import standing

    undone = {entry.number for entry in standing(entries)[1]}
    for entry in entries[-1:] if last else entries:
        mark = "  (undone)" if entry.number in undone else ""
        typer.echo(f"{entry.number:>4}  {entry.time}  {entry.by}  {_told(entry)}{mark}")


def _told(entry: Entry) -> str:
    """An edit in words: 'reject 10 of usbl.csv usbl, rows 100-109'."""
    parts = [
        f"{len(part.row):,} of {part.source} {part.sensor}, rows {_stretches(part.row.tolist())}"
        for part in entry.fixes
    ]
    return " ".join([entry.action, "; ".join(parts)]).strip()


def _stretches(rows: list[int]) -> str:
    """Numbers in short: '3-5, 9'."""
    runs: list[list[int]] = []
    for row in sorted(rows):
        if runs and row <= runs[-1][1] + 1:
            runs[-1][1] = row
        else:
            runs.append([row, row])
    said = [f"{a}-{b}" if b > a else f"{a}" for a, b in runs[:_SHOWN]]
    return ", ".join(said + (["…"] if len(runs) > _SHOWN else []))
