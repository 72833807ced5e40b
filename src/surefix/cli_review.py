"""`surefix review`: look at a cleaned log in a browser, and accept or reject single fixes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from surefix.cli_inputs import (
    Attitude,
    Columns,
    Depth,
    Heading,
    NoChecksum,
    Target,
    Velocity,
    chosen_options,
    keep_inputs,
)
from surefix.cli_progress import over_bytes
from surefix.cli_warmup import announced
from surefix.errors import MissingExtraError

if TYPE_CHECKING:
    from surefix.pipelines.clean import Source
    from surefix.pipelines.inputs import Progress

__all__ = ["review"]

_SECRET = re.compile(r"(://[^/@:]*:)[^/@]*@")  # a password in a URL
_NEEDED = ("fastapi", "plotly", "uvicorn")


def review(
    inputs: Annotated[
        list[str],
        typer.Argument(
            help="Logs, or the journal of a live service, a file or a URL.",
            show_default=False,
            metavar="INPUTS...",
        ),
    ],
    edits: Annotated[
        Path, typer.Option(help="The edit log; begun if it is not there.", show_default=False)
    ] = Path("edits.jsonl"),
    port: Annotated[int, typer.Option(help="Port of this machine; 0: any that is free.")] = 0,
    mode: Annotated[
        Literal["realtime", "lagged", "offline"] | None,
        typer.Option(help="As of surefix clean; its other options go into the options file."),
    ] = None,
    depth: Depth = None,
    velocity: Velocity = None,
    heading: Heading = None,
    attitude: Attitude = None,
    column: Columns = None,
    options: Annotated[
        Path | None, typer.Option(help="TOML file with options; the command line wins.")
    ] = None,
    no_checksum: NoChecksum = False,
    target: Target = None,
) -> None:
    """Open a cleaned log in a browser: accept or reject fixes, undo, clean again, export."""
    for name in _NEEDED:
        if find_spec(name) is None:
            raise MissingExtraError(
                f"{name} is not installed", remedy="pip install 'surefix[live]'"
            )
    from surefix.io.columns import mapping
    from surefix.pipelines.inputs import open_inputs
    from surefix.service.review import begin_review
    from surefix.service.review_server import open_server

    chosen, columns = chosen_options(options, {"mode": mode}, {})
    beside = (depth, velocity, heading, attitude)
    supporting = [path for path in beside if path is not None]
    files = [*map(Path, inputs), *supporting]
    keep_inputs([*files, *([options] if options is not None else [])], [edits])

    def opener(told: Progress | None) -> list[Source]:
        return open_inputs(
            inputs,
            depth=depth,
            velocity=velocity,
            heading=heading,
            attitude=attitude,
            columns={**columns, **mapping(column or [])},
            require_checksum=not no_checksum,
            target=target,
            progress=told,
        )

    given: dict[str, Sequence[Path | str | None]] = {
        "--depth": [depth],
        "--velocity": [velocity],
        "--heading": [heading],
        "--attitude": [attitude],
        "--options": [options],
        "--mode": [mode],
        "--target": [target],
        "--column": column or [],
        "--edits": [edits],
    }
    words = ["surefix", "clean", *(_SECRET.sub(r"\1…@", each) for each in inputs)]
    for name, values in given.items():
        words += [word for value in values if value is not None for word in (name, str(value))]
    words += ["--no-checksum"] if no_checksum else []
    with announced(chosen), over_bytes(files, quiet=False) as told:
        begun = begin_review(opener, chosen, edits, files, told)
    server = open_server(begun, f"{Path(inputs[0]).stem}.clean", shlex.join(words), port)
    typer.echo(f"open {server.url}")
    typer.echo("Ctrl+C ends it")
    server.run()
    typer.echo(f"ended; {len(begun.log.entries):,} edits in {edits}")
