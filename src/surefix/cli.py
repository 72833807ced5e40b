"""The command line: words in, options checked, a pipeline run, words out; nothing else."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.exceptions import TyperException

from surefix.cli_begin import begin
from surefix.cli_compare import compare
from surefix.cli_edit import edit
from surefix.cli_experiment import JsonFile, Report, Seed, check_place, check_report, tell
from surefix.cli_fleet import fleet
from surefix.cli_inputs import (
    Attitude,
    Columns,
    Depth,
    Heading,
    NoChecksum,
    Ship,
    Target,
    Velocity,
    chosen_options,
    delays,
    keep_inputs,
    seconds,
)
from surefix.cli_live import live
from surefix.cli_locate import locate
from surefix.cli_progress import over_bytes, over_runs
from surefix.cli_review import review
from surefix.cli_signals import obeyed
from surefix.cli_warmup import announced, warmup
from surefix.errors import SurefixError

__all__ = ["app", "clean", "demo", "info", "main", "reproduce"]

app = typer.Typer(
    name="surefix",
    help="Turn logs full of wild position fixes into a sure track, with a verdict for every fix.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

_INTERRUPTED = 130

Inputs = Annotated[
    list[str],
    typer.Argument(
        help="Logs: CSV, Parquet, NMEA 0183, or the journal of a live service, a file or a URL.",
        show_default=False,
        metavar="INPUTS...",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(installed("surefix"))
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command()
def clean(
    inputs: Inputs,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--output",
            help="Where to write the track: .csv, .parquet, .geojson, .gpx or .nmea; repeatable.",
        ),
    ] = None,
    mode: Annotated[
        Literal["realtime", "lagged", "offline"] | None,
        typer.Option(help="How much of the log each fix is judged by; default offline, all of it."),
    ] = None,
    method: Annotated[
        Literal[
            "multi-hypothesis",
            "kalman",
            "gate",
            "huber",
            "igg1",
            "igg3",
            "igg3-yang",
            "student-t",
            "cipra-romera",
            "53h",
            "hampel",
            "median",
        ]
        | None,
        typer.Option(
            help="Several hypotheses (the default), a robust loss, or a cleaner before a filter."
        ),
    ] = None,
    model: Annotated[
        Literal["auto", "cv", "ca"] | None,
        typer.Option(help="Motion: constant velocity or acceleration; default auto, the likelier."),
    ] = None,
    k0: Annotated[
        float | None,
        typer.Option(help="Where down-weighting begins, in σ; with a cleaner, rejection."),
    ] = None,
    k1: Annotated[float | None, typer.Option(help="Where rejection begins, in σ.")] = None,
    lag: Annotated[
        str | None, typer.Option(metavar="DURATION", help="Future seen in the lagged mode.")
    ] = None,
    recovery: Annotated[
        str | None,
        typer.Option(
            metavar="DURATION",
            help="Longest run of wrong fixes that is survived; a longer one is taken for a jump.",
        ),
    ] = None,
    sigma_position: Annotated[
        float | None, typer.Option(help="Noise of the fixes, m, horizontal.")
    ] = None,
    sigma_height: Annotated[
        float | None, typer.Option(help="Noise of the fixes, m, vertical.")
    ] = None,
    sigma_velocity: Annotated[
        float | None, typer.Option(help="Noise of the velocities, m/s.")
    ] = None,
    process: Annotated[
        float | None,
        typer.Option(help="Root density of the driving noise, m/s^1.5 (cv) or m/s^2.5 (ca)."),
    ] = None,
    every: Annotated[
        str | None,
        typer.Option(metavar="DURATION", help="Write the track at regular times, such as 0.5s."),
    ] = None,
    latency: Annotated[
        Literal["report", "remove", "ignore"] | None,
        typer.Option(help="Fixes that are late against a velocity; default report."),
    ] = None,
    drags: Annotated[
        bool,
        typer.Option("--drags", help="Look for fixes that wander off slowly; see the docs first."),
    ] = False,
    sensor_delay: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=DURATION", help="How late the times of a sensor are; repeatable."
        ),
    ] = None,
    depth: Depth = None,
    velocity: Velocity = None,
    heading: Heading = None,
    attitude: Attitude = None,
    ship: Ship = None,
    column: Columns = None,
    options: Annotated[
        Path | None, typer.Option(help="TOML file with options; the command line wins.")
    ] = None,
    edits: Annotated[
        Path | None, typer.Option(help="Edits of single fixes, from surefix edit or review.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Write a report, one HTML file.")] = None,
    iso: Annotated[bool, typer.Option("--iso", help="Write times as ISO 8601 in UTC.")] = False,
    no_checksum: NoChecksum = False,
    target: Target = None,
    as_json: AsJson = False,
) -> None:
    """Clean a log: one row per fix, each with its verdict, beside the clean track."""
    from surefix.io.columns import mapping
    from surefix.io.edits import read_edits
    from surefix.pipelines.clean import clean_batches
    from surefix.pipelines.deliver import deliver
    from surefix.pipelines.editing import edit_sources
    from surefix.pipelines.inputs import open_inputs
    from surefix.pipelines.summary import lines, summary

    chosen, columns = chosen_options(
        options,
        {
            "mode": mode,
            "method": method,
            "model": model,
            "k0": k0,
            "k1": k1,
            "lag_s": seconds("--lag", lag),
            "recovery_s": seconds("--recovery", recovery),
            "sigma_position": sigma_position,
            "sigma_height": sigma_height,
            "sigma_velocity": sigma_velocity,
            "process": process,
            "every_s": seconds("--every", every),
            "latency": latency,
            "drags": drags or None,
        },
        delays(sensor_delay or []),
    )
    check_report(report)
    beside = {"depth": depth, "velocity": velocity, "heading": heading, "attitude": attitude}
    given = (*inputs, *beside.values(), *(ship or []), options, edits)
    files = [Path(path) for path in given if path is not None]
    keep_inputs(files, [*(output or []), *([report] if report is not None else [])])
    with announced(chosen), over_bytes(files, quiet=as_json) as told:
        sources = open_inputs(
            inputs,
            **beside,
            ship=ship or (),
            columns={**columns, **mapping(column or [])},
            require_checksum=not no_checksum,
            target=target,
            progress=told,
        )
        if edits is not None:
            sources = edit_sources(sources, read_edits(edits))
        done = deliver(clean_batches(sources, chosen), output or [], iso=iso)
    written = list(done.written)
    if report is not None:
        from surefix.report.page import write_report

        write_report(done.cleaned, report)
        written.append(str(report))
    result = done.cleaned, done.counts, written
    _print(summary(*result), lines(*result), as_json)


@app.command()
def info(
    inputs: Inputs,
    depth: Depth = None,
    velocity: Velocity = None,
    heading: Heading = None,
    attitude: Attitude = None,
    ship: Ship = None,
    column: Columns = None,
    no_checksum: NoChecksum = False,
    target: Target = None,
    as_json: AsJson = False,
) -> None:
    """Say what is in a log: sensors, rates, gaps, faults, and the command that cleans it."""
    from surefix.io.columns import mapping
    from surefix.pipelines.info import describe, info_lines

    beside = {"depth": depth, "velocity": velocity, "heading": heading, "attitude": attitude}
    given = (*inputs, *beside.values(), *(ship or []))
    files = [Path(path) for path in given if path is not None]
    with announced(), over_bytes(files, quiet=as_json) as told:
        found = describe(
            inputs,
            **beside,
            ship=ship or (),
            columns=mapping(column or []),
            require_checksum=not no_checksum,
            target=target,
            progress=told,
        )
    _print(found, info_lines(found), as_json)


@app.command()
def demo(
    folder: Annotated[Path, typer.Option("-o", "--output", help="Where the files go.")] = Path(
        "demo"
    ),
    seed: Annotated[int, typer.Option(help="Of the simulated dive.")] = 7,
) -> None:
    """Simulate an ROV dive, clean it, and hold the result against the truth."""
    typer.echo("Simulating a dive with USBL, DVL and depth, and cleaning it …")
    from surefix.pipelines.demo import demonstrate
    from surefix.pipelines.options import CleanOptions

    with announced(CleanOptions()):
        done = demonstrate(folder, seed)
    for line in (*done.lines, *(f"wrote {path}" for path in done.written)):
        typer.echo(f"  {line}")


@app.command()
def reproduce(
    paper: Annotated[
        Literal["usbl", "cooperative", "towed", "ship", "radar"],
        typer.Argument(help="Which of the five papers.", show_default=False),
    ],
    seed: Seed = 1,
    runs: Annotated[int, typer.Option(help="Number of independent repetitions.")] = 20,
    json_file: JsonFile = None,
    report: Report = None,
    log: Annotated[
        list[Path] | None,
        typer.Option(help="With ship: a recorded log instead of simulated ones; repeatable."),
    ] = None,
) -> None:
    """Run a paper's experiment again: its methods, its baselines, and the printed figures."""
    from surefix.papers.reproduce import reproduce as run

    check_report(report)
    check_place("--json", json_file)
    keep_inputs(log or [], [path for path in (json_file, report) if path is not None])
    with announced(), over_runs(runs) as told:
        experiment = run(paper, seed=seed, runs=runs, logs=log or (), progress=told)
    tell(experiment, experiment, json_file, report)


app.command()(compare)
app.command()(locate)
app.command()(fleet)
app.command()(live)
app.command()(edit)
app.command()(review)
app.command()(warmup)


def main() -> None:
    """Run the command line; every failure ends with one line and a non-zero exit."""
    _use_utf8()
    with obeyed():
        _run()


def _run() -> None:
    try:
        if len(sys.argv) > 1 and not {"--help", "--version"} & {*sys.argv}:
            begin()
        code = app(standalone_mode=False)
        if code == _INTERRUPTED:
            _fail("interrupted", _INTERRUPTED)
        sys.exit(code if isinstance(code, int) else 0)
    except TyperException as error:
        said = error.format_message().replace("Value error, ", "")
        _fail(f"{said} (surefix --help lists commands and options)", 2)
    except typer.Abort:
        _fail("interrupted", _INTERRUPTED)
    except SurefixError as error:
        _fail(str(error), 1)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(141)
    except KeyboardInterrupt:
        _fail("interrupted", _INTERRUPTED)
    except Exception as error:
        if os.environ.get("SUREFIX_DEBUG"):
            raise
        kind = type(error).__name__
        _fail(
            f"internal error, please report it: {kind}: {error}; "
            "SUREFIX_DEBUG=1 shows where it happened",
            70,
        )


def _fail(text: str, code: int) -> None:
    typer.echo(f"surefix: {' '.join(text.split())}", err=True)
    sys.exit(code)


def _use_utf8() -> None:
    """Print σ and … whatever the terminal's locale."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure: Callable[..., None] | None = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(encoding="utf-8", errors="replace")


def _print(found: dict[str, Any], text: list[str], as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False))
    else:
        for line in text:
            typer.echo(line)
