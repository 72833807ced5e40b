"""The command ``surefix fleet``."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from surefix.cli_inputs import Columns, NoChecksum, Target, chosen_options
from surefix.cli_progress import over_units
from surefix.errors import OptionsError

if TYPE_CHECKING:
    from surefix.fleet.outcome import Outcome
    from surefix.fleet.run import Fleet

__all__ = ["fleet"]

_FAILED = 1
_WIDE = 200  # columns of a table that goes to a file or a pipe


def fleet(
    inputs: Annotated[
        list[Path],
        typer.Argument(
            help="Logs, folders of logs, or one Parquet data set of many tracks.",
            show_default=False,
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the outputs.")],
    mode: Annotated[
        Literal["realtime", "lagged", "offline"] | None,
        typer.Option(help="As of clean; so are the options of the file."),
    ] = None,
    method: Annotated[
        str | None, typer.Option(metavar="NAME", help="As of clean.", show_default=False)
    ] = None,
    options: Annotated[Path | None, typer.Option(help="TOML file with options of clean.")] = None,
    column: Columns = None,
    track: Annotated[
        str | None,
        typer.Option(
            metavar="COLUMN",
            help="Says which track a row of a data set belongs to; default track_id.",
        ),
    ] = None,
    depth: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Name of the depth log in the folder of each log."),
    ] = None,
    velocity: Annotated[
        str | None, typer.Option(metavar="FILE", help="The same for a velocity log.")
    ] = None,
    heading: Annotated[
        str | None, typer.Option(metavar="FILE", help="The same for a heading log.")
    ] = None,
    attitude: Annotated[
        str | None, typer.Option(metavar="FILE", help="The same for a log of roll and pitch.")
    ] = None,
    to: Annotated[
        Literal["parquet", "csv", "geojson", "gpx", "nmea"],
        typer.Option("--format", help="Of the outputs; tracks of a data set are Parquet."),
    ] = "parquet",
    jobs: Annotated[
        int | None, typer.Option(help="Processes that share the work; default one a processor.")
    ] = None,
    target: Target = None,
    no_checksum: NoChecksum = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Clean many logs, or a data set of many tracks, over processes; run it again to go on.

    What is done is kept, unless its input or the options have changed. A log that fails does not
    stop the others; the exit code is 1 then.
    """
    from surefix.fleet.options import FleetOptions
    from surefix.fleet.run import clean_fleet
    from surefix.io.columns import mapping

    chosen, columns = chosen_options(options, {"mode": mode, "method": method}, {})
    beside = {"depth": depth, "velocity": velocity, "heading": heading, "attitude": attitude}
    given = FleetOptions(
        clean=chosen,
        columns={**columns, **mapping(column or [])},
        beside={role: name for role, name in beside.items() if name is not None},
        require_checksum=not no_checksum,
        target=target,
        track=track,
        suffix=f".{to}",
        jobs=(os.cpu_count() or 1) if jobs is None else jobs,
    )
    if output.exists() and not output.is_dir():
        raise OptionsError(f"output {output}, which is a file", "a folder")
    with over_units(quiet=as_json) as told:
        done = clean_fleet(inputs, output, given, told)
    if as_json:
        typer.echo(json.dumps(_plain(done), indent=2, ensure_ascii=False, allow_nan=False))
    else:
        _print(done)
    if done.failed:
        raise typer.Exit(_FAILED)


def _plain(done: Fleet) -> dict[str, Any]:
    out = done._asdict()
    for name in ("examples", "failures"):
        out[name] = [_row(outcome) for outcome in out[name]]
    return out


def _row(outcome: Outcome) -> dict[str, Any]:
    return {name: value for name, value in outcome._asdict().items() if name != "lasting"}


def _print(done: Fleet) -> None:
    from rich.console import Console
    from rich.table import Table

    wide = None if sys.stdout.isatty() else _WIDE
    console = Console(width=wide, highlight=False, markup=False, soft_wrap=wide is not None)
    if done.examples:
        table = Table("cleaned", "fixes", "rejected", "2σ horizontal", "output", box=None)
        for each in done.examples:
            sigma = each.sigma2_horizontal_m
            told = "unknown" if sigma is None else f"{sigma:.3g} m"
            table.add_row(each.name, str(each.fixes), str(each.rejected), told, each.output)
        console.print(table)
        _more(done.cleaned, len(done.examples))
    for each in done.failures:
        told = "; ".join(
            part
            for part in (each.given, each.expected and f"expected {each.expected}", each.remedy)
            if part
        )
        name = "" if each.given.startswith(each.name) else f"{each.name}: "
        typer.echo(f"  failed: {name}{' '.join(told.split())}")
    _more(done.failed, len(done.failures))
    again = f", {done.kept} of {done.units} units done before" if done.kept else ""
    changed = f", {done.outdated} done anew after a change" if done.outdated else ""
    typer.echo(
        f"{done.cleaned} cleaned, {done.failed} failed; {done.fixes} fixes, "
        f"{done.rejected} rejected{again}{changed}"
    )
    for path in done.written:
        typer.echo(f"  wrote {path}")


def _more(total: int, shown: int) -> None:
    if total > shown:
        typer.echo(f"  … and {total - shown} more, in the summary")
