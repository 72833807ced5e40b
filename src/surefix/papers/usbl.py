"""Paper 000: robust Kalman filters for USBL positions, Huber, IGG1 and IGG3 against the plain one.

Luo et al., Ocean Technology 39(5), 2020: a processed track with 121 gross errors added, 30 of them
on end; the RMSE of each axis (Table 1) and the share of the gross errors whose filtered error is
below 0.5 m (Table 2). How what is not printed was reconstructed is told in
`surefix.simulate.usbl_track` and in docs/papers/usbl.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surefix.experiment import Experiment, Progress, Table, check_least
from surefix.papers.usbl_figures import figures
from surefix.papers.usbl_methods import SEVERAL, Reading, compare
from surefix.papers.usbl_tables import FIRST, PRINTED_PCT, figures_of_run, tables
from surefix.simulate.usbl_track import simulate

__all__ = ["UsblOptions", "run"]


@dataclass(frozen=True, kw_only=True)
class UsblOptions:
    """How often the experiment is run, and from what.

    Parameters
    ----------
    seed
        Everything is drawn from it; run i draws from ``[seed, i]``.
    runs
        Independent repetitions, at least 1.
    epochs
        Length of the track, at least 150.

    Raises
    ------
    OptionsError
        A figure is too small.
    """

    seed: int = 1
    runs: int = 20
    epochs: int = 700

    def __post_init__(self) -> None:
        check_least(self, seed=0, runs=1, epochs=150)


def run(options: UsblOptions, progress: Progress | None = None) -> Experiment:
    """Run the experiment: both kinds of run of errors, every reading, every method.

    Parameters
    ----------
    options
        Seed, number of runs, and length.
    progress
        Told the number of finished runs.
    """
    found = []
    for i in range(options.runs):
        found.append(figures_of_run([options.seed, i], options.epochs))
        if progress is not None:
            progress(i + 1)
    made = tables(found)
    common = simulate([options.seed, 0], epochs=options.epochs)
    independent = simulate([options.seed, 0], epochs=options.epochs, run="independent")
    return Experiment(
        paper="usbl",
        title="Robust Kalman filters for USBL positions",
        source="Luo et al., Ocean Technology 39(5), 2020, doi:10.3969/j.issn.1003-2029.2020.05.007",
        seed=options.seed,
        runs=options.runs,
        tables=made,
        figures=figures(
            common, compare(common, Reading()), independent, compare(independent, Reading())
        ),
        findings=_findings({table.key: table for table in made}),
    )


def _findings(made: Mapping[str, Table]) -> tuple[str, ...]:
    def mean(key: str, row: str, column: int | None = None) -> float:
        line = made[key].mean[made[key].rows.index(row)]
        return float(line.mean() if column is None else line[column])

    def axes(row: str) -> str:
        line = made["rmse_m"].mean[made["rmse_m"].rows.index(row)]
        return "/".join(f"{figure:.2f}" for figure in line)

    readings = made["readings_rejected_pct"]
    huber = readings.mean[:, FIRST.index("Huber")]
    printed = float(np.mean(PRINTED_PCT["Huber"]))
    nearest = int(np.argmin(np.abs(huber - printed)))
    apart, ours = "rmse_independent_m", mean("rmse_m", "surefix, offline")
    several, told = f"{SEVERAL}, offline", "oracle, offline"
    shares = [
        figure
        for key in ("rejected_pct", "rejected_independent_pct")
        for figure in made[key].mean[made[key].rows.index(several)]
    ]
    ratios = [mean(key, several) / mean(key, told) for key in ("rmse_m", apart)]
    return (
        f"RMSE in X/Y/Z, run with a common offset: KF {axes('KF')} m, Huber {axes('Huber')} m, "
        f"IGG1 {axes('IGG1')} m, IGG3 {axes('IGG3')} m.",
        f"With independent errors within the run, mean of the axes: KF {mean(apart, 'KF'):.2f} m, "
        f"Huber {mean(apart, 'Huber'):.2f} m instead of {mean('rmse_m', 'Huber'):.2f} m, "
        f"IGG3 {mean(apart, 'IGG3'):.2f} m.",
        f"Huber rejects {huber[0]:.0f} % of the gross errors, the paper says {printed:.0f} %. "
        f"The nearest reading is “{readings.rows[nearest]}” with {huber[nearest]:.0f} %.",
        f"With gross errors from 2 m on, independent within the run, IGG1 errs by "
        f"{mean('least_size_m', 'from 2 m', 3):.2f} m and IGG3 by "
        f"{mean('least_size_m', 'from 2 m', 4):.2f} m: what is below k1 pulls them.",
        f"The same log through surefix, offline: {ours:.3f} m, "
        f"{ours / mean('rmse_m', 'IGG3'):.2f} times the error of IGG3.",
        f"Several hypotheses, offline, reject at least {min(shares):.1f} % of the gross errors on "
        f"every axis and with either kind of run, and err by {max(ratios):.3f} times as much as "
        "the smoother that is told them.",
    )
