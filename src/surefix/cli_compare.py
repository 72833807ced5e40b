"""The command ``surefix compare``."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, cast

import typer

from surefix.cli_experiment import JsonFile, Report, Seed, check_place, check_report, tell
from surefix.cli_progress import over_runs

if TYPE_CHECKING:
    from surefix.pipelines.options import Mode

__all__ = ["compare"]

_PRINTED = ("rmse_ratio", "back_fixes")


def compare(
    methods: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,…",
            help="Values of --method of clean, or gnc, wolf, imm, sage-husa; default several; all.",
        ),
    ] = None,
    scenarios: Annotated[
        str | None, typer.Option(metavar="NAME,NAME,…", help="What goes wrong; default everything.")
    ] = None,
    modes: Annotated[
        str | None,
        typer.Option(metavar="NAME,NAME,…", help="Of offline, lagged, realtime; default all."),
    ] = None,
    seed: Seed = 1,
    runs: Annotated[int, typer.Option(help="Number of independent repetitions.")] = 5,
    epochs: Annotated[int, typer.Option(help="Fixes of a log.")] = 2400,
    jobs: Annotated[
        int | None, typer.Option(help="Processes that share the work; default one a processor.")
    ] = None,
    json_file: JsonFile = None,
    report: Report = None,
) -> None:
    """Compare methods on simulated logs with an oracle that knows every fault.

    The ratios are printed; honesty of the covariance, rejections and noise figures are in the JSON
    file and the report.
    """
    from surefix.comparison.options import CompareOptions
    from surefix.comparison.run import compare as run

    usual = CompareOptions()
    options = CompareOptions(
        methods=_names(methods, usual.methods),
        scenarios=_names(scenarios, usual.scenarios),
        modes=cast("tuple[Mode, ...]", _names(modes, usual.modes)),
        seed=seed,
        runs=runs,
        epochs=epochs,
    )
    most = min(os.cpu_count() or 1, options.trials)
    options = replace(options, jobs=most if jobs is None else jobs)
    check_report(report)
    check_place("--json", json_file)
    with over_runs(options.trials) as told:
        found = run(options, told)
    shown = [table for table in found.tables if table.key.startswith(_PRINTED)]
    tell(found, replace(found, tables=tuple(shown)), json_file, report)


def _names(text: str | None, usual: tuple[str, ...]) -> tuple[str, ...]:
    if text is None:
        return usual
    return tuple(name for each in text.split(",") if (name := each.strip()))
