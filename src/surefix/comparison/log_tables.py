"""Tables, picture and findings of a comparison on recorded logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.comparison.tables import MODE_WORDS
from surefix.experiment import Figure, Panel, Table, Trace, gather
from surefix.pipelines.options import Mode
from surefix.types import FloatArray, IntArray

__all__ = ["LogOutcome", "Scored", "findings", "picture", "tables"]

_CLUSTER: Final = 30  # neighbouring fixes whose scores are not taken for independent


class Scored(NamedTuple):
    """Scores of j fixes that were left out.

    Parameters
    ----------
    fix
        (j,) their numbers.
    distance
        (j,) from what was foretold, m.
    nats
        (j,) logarithm of the density foretold.
    standard
        (j, a) distance on each axis over the standard deviation foretold.
    """

    fix: IntArray
    distance: FloatArray
    nats: FloatArray
    standard: FloatArray


class LogOutcome(NamedTuple):
    """What became of one log under one method.

    Parameters
    ----------
    scored
        By the number of fixes left out on end.
    rejected_pct
        Share of the fixes of the whole log that were rejected, %.
    fastest_mps
        Greatest speed of the track of the whole log.
    """

    scored: Mapping[int, Scored]
    rejected_pct: float
    fastest_mps: float


Outcomes = Mapping[tuple[str, Mode, str], LogOutcome]
"""By log, mode and method."""


class _Column(NamedTuple):
    title: str
    unit: str
    digits: int
    of: Callable[[Scored], float]


def _within(sigmas: float) -> Callable[[Scored], float]:
    return lambda scored: 100.0 * float((scored.standard <= sigmas).mean())


def _quantile(share: float) -> Callable[[Scored], float]:
    return lambda scored: float(np.quantile(scored.distance, share))


_FIGURES: Final[Mapping[str, _Column]] = {
    "median_m": _Column("Distance of what was foretold, median", "m", 3, _quantile(0.5)),
    "q68_m": _Column("Distance of what was foretold, 68 %", "m", 3, _quantile(0.68)),
    "q90_m": _Column("Distance of what was foretold, 90 %", "m", 3, _quantile(0.9)),
    "score_nats": _Column("Log score", "nats", 3, lambda scored: float(scored.nats.mean())),
    "within1_pct": _Column("Within 1 σ foretold, honest 68.3", "%", 1, _within(1.0)),
    "within2_pct": _Column("Within 2 σ foretold, honest 95.4", "%", 1, _within(2.0)),
    "within3_pct": _Column("Within 3 σ foretold, honest 99.7", "%", 1, _within(3.0)),
}
_WHOLE: Final = {
    "rejected_pct": ("Fixes of the whole log rejected", "%", 2),
    "fastest_mps": ("Greatest speed of the track of the whole log", "m/s", 2),
}


def tables(
    logs: Sequence[str], methods: Sequence[str], modes: Sequence[Mode], found: Outcomes
) -> tuple[Table, ...]:
    """Make a table of logs (rows) and methods (columns) of each figure and mode.

    Keys are ``FIGURE-MODE``; a row is called by its log and the number of fixes left out on end.

    Parameters
    ----------
    logs, methods, modes
        Names, in order.
    found
        Outcomes; a method that does not work in a mode has none.
    """
    made = []
    for mode in modes:
        for key, shown in _FIGURES.items():
            rows: dict[str, list[float]] = {}
            for log in logs:
                each = [found.get((log, mode, method)) for method in methods]
                for length in next(one for one in each if one is not None).scored:
                    rows[f"{log} ×{length}"] = [
                        np.nan if one is None else shown.of(one.scored[length]) for one in each
                    ]
            made.append(_table(key, shown.title, mode, methods, rows, shown.unit, shown.digits))
        for key, (title, unit, digits) in _WHOLE.items():
            rows = {
                log: [getattr(found.get((log, mode, m)), key, np.nan) for m in methods]
                for log in logs
            }
            made.append(_table(key, title, mode, methods, rows, unit, digits))
    return tuple(made)


def _table(
    key: str,
    title: str,
    mode: Mode,
    methods: Sequence[str],
    rows: Mapping[str, Sequence[float]],
    unit: str,
    digits: int,
) -> Table:
    return gather(
        f"{key}-{mode}",
        f"{title}, {MODE_WORDS[mode]}",
        methods,
        [rows],
        unit=unit,
        digits=digits,
        of="Log × fixes left out on end",
    )


def picture(modes: Sequence[Mode], made: Sequence[Table]) -> tuple[Figure, ...]:
    """Draw how far each method's log score is below the best, in every row.

    Parameters
    ----------
    modes
        In order; a panel each.
    made
        From `tables`.
    """
    panels = []
    for mode in modes:
        (table,) = (each for each in made if each.key == f"score_nats-{mode}")
        below = np.nanmax(table.mean, axis=1)[:, None] - table.mean
        places = np.arange(len(table.rows), dtype=np.float64)
        panels.append(
            Panel(
                title=MODE_WORDS[mode],
                x_label="",
                y_label="below the best, nats",
                traces=tuple(
                    Trace(method, places, below[:, i], "points")
                    for i, method in enumerate(table.columns)
                ),
                x_names=table.rows,
            )
        )
    title = "Log score below that of the best method"
    return (Figure(key="score", title=title, panels=tuple(panels)),)


def findings(
    logs: Sequence[str], methods: Sequence[str], modes: Sequence[Mode], found: Outcomes
) -> tuple[str, ...]:
    """Say for each log and mode which method foretells best, and how surely better than the others.

    Parameters
    ----------
    logs, methods, modes, found
        As for `tables`.
    """
    return tuple(_sentence(log, mode, methods, found) for mode in modes for log in logs)


def _sentence(log: str, mode: Mode, methods: Sequence[str], found: Outcomes) -> str:
    there = [method for method in methods if (log, mode, method) in found]
    nats, fix = {}, np.empty(0, np.int64)
    for method in there:
        every = found[log, mode, method].scored.values()
        nats[method] = np.concatenate([each.nats for each in every])
        fix = np.concatenate([each.fix for each in every])
    order = sorted(there, key=lambda method: -nats[method].mean())
    best, *others = order
    behind = []
    for method in others:
        mean, error = _difference(nats[best] - nats[method], fix)
        behind.append(f"{method} {mean:.3f} ± {error:.3f}")
    count = len(np.unique(fix))
    less = f"; below it in nats a fix: {', '.join(behind)}" if behind else ""
    return f"{log}, {MODE_WORDS[mode]}, {count} fixes: best log score {best}{less}."


def _difference(less: FloatArray, fix: IntArray) -> tuple[float, float]:
    """Mean of a difference and its standard error, neighbours not being independent."""
    cluster = fix // _CLUSTER
    off = np.bincount(cluster, less - less.mean())
    return float(less.mean()), float(np.sqrt((off**2).sum()) / len(less))
