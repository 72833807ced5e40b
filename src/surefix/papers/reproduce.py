"""The papers' experiments, run again: one name a paper, one `Experiment` each."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from surefix.errors import OptionsError
from surefix.experiment import Experiment, Progress, Table
from surefix.io.atomic import replacing

__all__ = ["PAPERS", "contents", "reproduce", "text_lines", "write_json"]

PAPERS = ("usbl", "cooperative", "towed", "ship", "radar")


def reproduce(
    paper: str,
    *,
    seed: int = 1,
    runs: int = 20,
    logs: Sequence[str | Path] = (),
    progress: Progress | None = None,
) -> Experiment:
    """Run a paper's experiment with its methods, its baselines and ours.

    Parameters
    ----------
    paper
        One of ``PAPERS``.
    seed
        What everything is drawn from; the same seed gives the same figures.
    runs
        Number of independent repetitions, at least 1.
    logs
        With ``ship``, recorded logs that the methods are run on instead of simulated ones.
    progress
        Told the number of finished runs.

    Raises
    ------
    OptionsError
        No such paper, a negative seed, no runs, or logs for a paper that takes none.
    InputError, ParseError
        A log cannot be read.
    """
    if logs and paper != "ship":
        raise OptionsError(f"logs for the paper {paper!r}", "no logs, or the paper ship")
    match paper:
        case "usbl":
            from surefix.papers import usbl

            return usbl.run(usbl.UsblOptions(seed=seed, runs=runs), progress)
        case "towed":
            from surefix.papers import towed

            return towed.run(towed.TowedOptions(seed=seed, runs=runs), progress)
        case "cooperative":
            from surefix.papers import cooperative

            return cooperative.run(cooperative.CooperativeOptions(seed=seed, runs=runs), progress)
        case "radar":
            from surefix.papers import radar

            return radar.run(radar.RadarOptions(seed=seed, runs=runs), progress)
        case "ship":
            from surefix.papers import ship, ship_log

            if logs:
                given = ship_log.ShipLogOptions(paths=tuple(logs), seed=seed, runs=runs)
                return ship_log.run_logs(given, progress)
            return ship.run(ship.ShipPaperOptions(seed=seed, runs=runs), progress)
        case _:
            raise OptionsError(f"paper {paper!r}", f"one of {', '.join(PAPERS)}")


def contents(experiment: Experiment) -> dict[str, Any]:
    """Give an experiment as plain data for JSON: means, spreads and what the paper printed.

    ``tables`` holds ``key → row → one mean a column``; ``spread`` and ``printed`` are alike.
    A figure that does not exist is None.
    """
    tables = experiment.tables
    return {
        "paper": experiment.paper,
        "title": experiment.title,
        "source": experiment.source,
        "seed": experiment.seed,
        "runs": experiment.runs,
        "surefix": version("surefix"),
        "columns": {table.key: list(table.columns) for table in tables},
        "titles": {table.key: _heading(table) for table in tables},
        "tables": {table.key: _rows(table, table.mean.tolist()) for table in tables},
        "spread": {table.key: _rows(table, table.spread.tolist()) for table in tables},
        "printed": {
            table.key: {row: [_known(v) for v in values] for row, values in table.printed.items()}
            for table in tables
            if table.printed
        },
        "notes": {table.key: table.note for table in tables if table.note},
        "findings": list(experiment.findings),
    }


def write_json(experiment: Experiment, path: str | Path) -> None:
    """Write `contents` to a file, whole or not at all.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with replacing(path) as file:
        text = json.dumps(contents(experiment), indent=2, ensure_ascii=False, allow_nan=False)
        file.write(f"{text}\n".encode())


def text_lines(experiment: Experiment, width: int | None = None) -> list[str]:
    """Give an experiment as lines of text: each table with means, spreads, and printed figures.

    Parameters
    ----------
    experiment
        From `reproduce`.
    width
        Characters of a line; a wider table is given in parts, each with the names of the rows.
        None for one line a row.
    """
    lines = [experiment.title, experiment.source]
    several = ": mean ± spread of the runs" if experiment.runs > 1 else ""
    lines.append(f"seed {experiment.seed}, {_counted(experiment.runs)}{several}")
    for table in experiment.tables:
        lines += ["", _heading(table), *_aligned(table, width)]
        lines += [f"  {table.note}"] if table.note else []
    return [*lines, *([""] if experiment.findings else []), *experiment.findings]


def _counted(runs: int) -> str:
    return f"{runs} runs" if runs > 1 else "1 run"


def _heading(table: Table) -> str:
    return f"{table.title}, {table.unit}" if table.unit else table.title


def _rows(table: Table, values: list[list[float]]) -> dict[str, list[float | None]]:
    return {row: [_known(v) for v in line] for row, line in zip(table.rows, values, strict=True)}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _aligned(table: Table, width: int | None) -> list[str]:
    """Columns of equal width; a printed row follows its own as ``paper``."""
    grid = [["", *table.columns]]
    for row, mean, spread in zip(table.rows, table.mean, table.spread, strict=True):
        cells = (_figure(m, s, table.digits) for m, s in zip(mean, spread, strict=True))
        grid.append([row, *cells])
        if row in table.printed:
            shown = (_figure(v, math.nan, table.digits) for v in table.printed[row])
            grid.append(["  paper", *shown])
    widths = [max(map(len, column)) for column in zip(*grid, strict=True)]
    lines: list[str] = []
    for part in _parts(widths, width):
        lines += [
            "  ".join(
                ["  " + line[0].ljust(widths[0]), *(line[i].rjust(widths[i]) for i in part)]
            ).rstrip()
            for line in grid
        ]
    return lines


def _parts(widths: list[int], width: int | None) -> list[list[int]]:
    """Columns 1, 2 … in groups that fit beside column 0, at least one in each."""
    parts: list[list[int]] = [[]]
    for i in range(1, len(widths)):
        wide = 2 + widths[0] + sum(2 + widths[j] for j in (*parts[-1], i))
        if width is not None and wide > width and parts[-1]:
            parts.append([])
        parts[-1].append(i)
    return parts


def _figure(mean: float, spread: float, digits: int) -> str:
    if not math.isfinite(mean):
        return "–"
    said = f"{mean:.{digits}f}"
    return f"{said} ± {spread:.{digits}f}" if math.isfinite(spread) else said
