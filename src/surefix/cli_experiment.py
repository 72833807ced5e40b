"""What the commands that run experiments share: an experiment in words, as JSON, as a report."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surefix.errors import OptionsError

if TYPE_CHECKING:
    from surefix.experiment import Experiment

__all__ = ["JsonFile", "Report", "Seed", "check_place", "check_report", "tell"]

Seed = Annotated[int, typer.Option(help="What everything is drawn from.")]
JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON.")
]
Report = Annotated[Path | None, typer.Option(help="Write a report, one HTML file.")]


def check_report(path: Path | None) -> None:
    """Refuse a report that cannot be written before the work is done.

    Raises
    ------
    OptionsError
        The name is not that of an HTML file.
    MissingExtraError
        Plotly is not installed.
    """
    if path is None:
        return
    from surefix.report.shell import check_extra

    check_extra()
    if path.suffix.lower() not in (".html", ".htm"):
        raise OptionsError(f"--report {path}", "a name that ends in .html")
    check_place("--report", path)


def check_place(option: str, path: Path | None) -> None:
    """Refuse a file in a directory that is not there, before the work is done.

    Raises
    ------
    OptionsError
        There is no such directory.
    """
    if path is not None and not path.absolute().parent.is_dir():
        raise OptionsError(f"{option} {path}", "a file in a directory that exists")


def tell(
    experiment: Experiment, printed: Experiment, json_file: Path | None, report: Path | None
) -> None:
    """Print an experiment and write its files.

    Parameters
    ----------
    experiment
        All of it.
    printed
        What of it is printed.
    json_file, report
        Where the rest goes; None for nowhere.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    from surefix.papers.reproduce import text_lines, write_json

    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in text_lines(printed, width):
        typer.echo(line)
    if json_file is not None:
        write_json(experiment, json_file)
        typer.echo(f"wrote {json_file}")
    if report is not None:
        from surefix.report.experiment import write_experiment

        write_experiment(experiment, report)
        typer.echo(f"wrote {report}")
