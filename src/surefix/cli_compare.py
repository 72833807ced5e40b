"""The command ``surefix compare``."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from surefix.cli_experiment import JsonFile, Report, Seed, check_place, check_report, tell
from surefix.cli_inputs import Columns, Depth, Heading, NoChecksum, Velocity, keep_inputs
from surefix.cli_progress import over_runs
from surefix.errors import OptionsError

if TYPE_CHECKING:
    from surefix.experiment import Experiment
    from surefix.pipelines.options import Mode

__all__ = ["compare"]

_PRINTED: tuple[str, ...] = ("rmse_ratio", "back_fixes")
_PRINTED_OF_LOGS: tuple[str, ...] = (
    "median_m",
    "q90_m",
    "score_nats",
    "within2_pct",
    "rejected_pct",
)


def compare(
    methods: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,…",
            help="Of --method of clean, gnc, wolf, imm, sage-husa; or all; default several.",
        ),
    ] = None,
    scenarios: Annotated[
        str | None, typer.Option(metavar="NAME,NAME,…", help="What goes wrong; default everything.")
    ] = None,
    modes: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,NAME,…",
            help="Of offline, lagged, realtime; default all, with --log offline.",
        ),
    ] = None,
    seed: Seed = 1,
    runs: Annotated[
        int | None, typer.Option(help="Number of independent repetitions; default 5.")
    ] = None,
    epochs: Annotated[int | None, typer.Option(help="Fixes of a log; default 2400.")] = None,
    log: Annotated[
        list[Path] | None,
        typer.Option(help="A recorded log instead of simulated ones; repeatable."),
    ] = None,
    folds: Annotated[
        int | None,
        typer.Option(help="Tenths of the fixes of a --log that are left out; default by its size."),
    ] = None,
    depth: Depth = None,
    velocity: Velocity = None,
    heading: Heading = None,
    column: Columns = None,
    no_checksum: NoChecksum = False,
    jobs: Annotated[
        int | None, typer.Option(help="Processes that share the work; default one a processor.")
    ] = None,
    json_file: JsonFile = None,
    report: Report = None,
) -> None:
    """Compare methods on simulated logs with an oracle, or on recorded ones by fixes left out.

    Of simulated logs every fault is known: the ratios to the oracle are printed. Of a recorded log
    fixes are left out in turn, and each method has to foretell them. All other figures are in the
    JSON file and the report.
    """
    check_report(report)
    check_place("--json", json_file)
    of_logs = {
        "folds": folds,
        "depth": depth,
        "velocity": velocity,
        "heading": heading,
        "column": column,
        "no_checksum": no_checksum or None,
    }
    simulated = {"scenarios": scenarios, "runs": runs, "epochs": epochs}
    words: dict[str, Any] = {"seed": seed}
    if methods is not None:
        words["methods"] = _methods(methods)
    if modes is not None:
        words["modes"] = cast("tuple[Mode, ...]", _names(modes))
    if log:
        _refuse(simulated, "simulated logs, without --log")
        files = [path for path in (*log, depth, velocity, heading) if path is not None]
        keep_inputs(files, [path for path in (json_file, report) if path is not None])
        printed = _PRINTED_OF_LOGS
        found = _recorded(log, words, of_logs, jobs)
    else:
        _refuse(of_logs, "a recorded log, with --log")
        words |= {name: value for name, value in simulated.items() if value is not None}
        printed = _PRINTED
        found = _simulated(words, jobs)
    shown = [table for table in found.tables if table.key.startswith(printed)]
    tell(found, replace(found, tables=tuple(shown)), json_file, report)


def _simulated(words: dict[str, Any], jobs: int | None) -> Experiment:
    from surefix.comparison.options import CompareOptions
    from surefix.comparison.run import compare as run

    if "scenarios" in words:
        words["scenarios"] = _names(words["scenarios"])
    options = CompareOptions(**words)
    options = replace(options, jobs=_jobs(options.trials, jobs))
    with over_runs(options.trials) as told:
        return run(options, told)


def _recorded(
    log: list[Path], words: dict[str, Any], given: dict[str, Any], jobs: int | None
) -> Experiment:
    from surefix.comparison.logs import LogOptions, compare_logs
    from surefix.io.columns import mapping

    options = LogOptions(
        logs=tuple(log),
        **words,
        **{name: given[name] for name in ("folds", "depth", "velocity", "heading")},
        columns=mapping(given["column"] or []),
        require_checksum=not given["no_checksum"],
    )
    options = replace(options, jobs=_jobs(options.trials, jobs))
    with over_runs(options.trials) as told:
        return compare_logs(options, told)


def _jobs(trials: int, jobs: int | None) -> int:
    return min(os.cpu_count() or 1, trials) if jobs is None else jobs


def _refuse(given: dict[str, Any], fit: str) -> None:
    for name, value in given.items():
        if value is not None:
            raise OptionsError(f"--{name.replace('_', '-')}", fit)


def _methods(text: str) -> tuple[str, ...]:
    if text.strip() != "all":
        return _names(text)
    from surefix.comparison.methods import COMPARED

    return COMPARED


def _names(text: str) -> tuple[str, ...]:
    return tuple(name for each in text.split(",") if (name := each.strip()))
