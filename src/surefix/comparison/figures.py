"""Pictures of a comparison: every scenario at a glance, and errors over time in one of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surefix.comparison.merit import ORACLE, Outcomes
from surefix.comparison.options import CompareOptions, world_of
from surefix.comparison.tables import KIND_WORDS, MODE_WORDS
from surefix.experiment import Figure, Panel, Table, Trace
from surefix.pipelines.options import Mode
from surefix.simulate.contamination import alone, draw
from surefix.types import FloatArray

__all__ = ["figures"]

_TOLD = "burst-common"  # the scenario whose errors are drawn, where it is among those compared
_BEFORE, _AFTER = 80, 160  # rows drawn round what happens in it
_BURST = 30  # rows in which the gross errors are counted to find that
_RANGE = (0.6, 60.0)  # of the ratios shown


def figures(
    options: CompareOptions, tables: Mapping[str, Table], first: Mapping[str, Outcomes]
) -> tuple[Figure, ...]:
    """Draw the ratios of every mode, and errors round a run of bad fixes in one scenario.

    Parameters
    ----------
    options
        What was compared.
    tables
        All tables by key.
    first
        Outcomes of the first run by scenario; the errors are from it.
    """
    scenario = _TOLD if _TOLD in options.scenarios else options.scenarios[0]
    return (*(_ratios(mode, tables) for mode in options.modes), _errors(options, scenario, first))


def _ratios(mode: Mode, tables: Mapping[str, Table]) -> Figure:
    found = {kind: tables.get(f"rmse_ratio-{mode}-{kind}") for kind in KIND_WORDS}
    return Figure(
        key=f"ratio-{mode}",
        title=f"RMSE ÷ oracle, {MODE_WORDS[mode]}; mean of the runs",
        panels=tuple(
            Panel(
                title=KIND_WORDS[kind],
                x_label="",
                y_label="RMSE ÷ oracle",
                traces=(
                    Trace(ORACLE, _places(table), np.ones(len(table.rows)), "truth"),
                    *(
                        Trace(method, _places(table), table.mean[:, i], "points")
                        for i, method in enumerate(table.columns)
                    ),
                ),
                y_range=_RANGE,
                log_y=True,
                x_names=table.rows,
            )
            for kind, table in found.items()
            if table is not None
        ),
    )


def _places(table: Table) -> FloatArray:
    return np.arange(len(table.rows), dtype=np.float64)


def _errors(options: CompareOptions, scenario: str, first: Mapping[str, Outcomes]) -> Figure:
    """Error of the position over time, of each method and the oracle; bad fixes marked."""
    trial = draw(scenario, world_of(options, 0), (options.seed, 0))
    kind = "aided" if trial.scenario.velocity_runs else "alone"
    trial = trial if kind == "aided" else alone(trial)
    wrong = np.sqrt((trial.error**2).sum(axis=1))
    crowd = np.convolve(wrong > 0.0, np.ones(_BURST), mode="valid")
    centre = trial.jump if trial.jump >= 0 else int(np.argmax(crowd))
    rows = slice(max(centre - _BEFORE, 0), centre + _AFTER)
    time, wrong = trial.time[rows], wrong[rows]
    bad = wrong > 0.0
    panels = []
    for mode in options.modes:
        lines = {
            method: outcome.error
            for method in (ORACLE, *options.methods)
            if (outcome := first[scenario].get((kind, mode, method))) is not None
        }
        panels.append(
            Panel(
                title=MODE_WORDS[mode],
                x_label="time, s" if mode == options.modes[-1] else "",
                y_label="error, m",
                traces=(
                    Trace("bad fix", time[bad], wrong[bad], "bad"),
                    *(
                        Trace(name, time, error[rows], "truth" if name == ORACLE else "line")
                        for name, error in lines.items()
                    ),
                ),
                y_range=(0.03 * trial.world.sigma_m, 200.0 * trial.world.sigma_m),
                log_y=True,
            )
        )
    return Figure(
        key="errors",
        title=f"Error of the position in the scenario {scenario}, first run, " + KIND_WORDS[kind],
        panels=tuple(panels),
    )
