"""Paper 004: real-time medians as a robust filter, and fusion by the scale of its residuals.

Huang, Chen and Zhang: two radars follow an aircraft that flies straight and swerves weakly once;
radar A is jammed for a while. Kalman filters of constant velocity and the current statistical model
are the baselines. How what is lost was reconstructed is told in `surefix.filters.median_recursion`,
`surefix.simulate.radar` and docs/papers/radar.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from surefix.errors import OptionsError
from surefix.experiment import Experiment, Progress, Table, check_least
from surefix.papers.radar_breakdown import BOUND, MILD
from surefix.papers.radar_figures import figures
from surefix.papers.radar_hypotheses import SEVERAL, TOLD_SEVERAL
from surefix.papers.radar_methods import (
    COUNTED,
    CURRENT,
    OURS,
    PRINTED,
    ROBUST,
    SEVERAL_ONE,
    TOLD,
    TOLD_CV,
    cartesian,
    cv_names,
    filter_one,
    fuse_both,
    systematic,
)
from surefix.papers.radar_series import Cartesian, Fusion
from surefix.papers.radar_tables import Parts, figures_of_run, tables
from surefix.simulate.radar import RadarFlight, simulate
from surefix.types import FloatArray

__all__ = ["RadarOptions", "run"]

_REGISTERED_BY = "running median, reference"


@dataclass(frozen=True, kw_only=True)
class RadarOptions:
    """How the experiment is run.

    Parameters
    ----------
    seed, runs
        Everything is drawn from the seed, run i from ``[seed, i]``; how often.
    samples
        Length of the flight at 20 Hz, at least 2,000; its parts keep their shares.
    window
        Samples m in the medians, 10 … 200.
    burst
        Length of the burst in radar A, samples.
    density
        Q₀ of the Kalman filters of constant velocity, m²/s³.
    trials
        Bursts of each kind and length a run.

    Raises
    ------
    OptionsError
        A figure is out of its range.
    """

    seed: int = 1
    runs: int = 20
    samples: int = 10_000
    window: int = 39
    burst: int = 15
    density: float = 0.02
    trials: int = 5

    def __post_init__(self) -> None:
        check_least(self, seed=0, runs=1, samples=2_000, window=10, trials=1, burst=1)
        if self.window > 200 or self.burst > 200:
            raise OptionsError(f"window {self.window}, burst {self.burst}", "at most 200 samples")
        if not 0.0 < self.density < np.inf:
            raise OptionsError(f"density {self.density}", "a positive figure in m²/s³")


class _Run(NamedTuple):
    flight: RadarFlight
    parts: Parts
    bias: dict[str, FloatArray]
    series: tuple[Cartesian, Cartesian]
    one: dict[str, FloatArray]
    both: dict[str, Fusion]
    weight: FloatArray


def run(options: RadarOptions, progress: Progress | None = None) -> Experiment:
    """Run the experiment.

    Parameters
    ----------
    options
        Seed, number of runs, and the scene.
    progress
        Told the number of finished runs.
    """
    found = []
    first = _fly(options, 0)
    for i in range(options.runs):
        made = _fly(options, i) if i else first
        figures_ = figures_of_run(
            made.flight, made.parts, made.bias, made.series[0], made.one, made.both,
            [options.seed, i, 1],
            density=options.density, window=options.window, trials=options.trials,
        )  # fmt: skip
        found.append(figures_)
        if progress is not None:
            progress(i + 1)
    tabled = tables(found, first.flight.dt)
    named = {table.key: table for table in tabled}
    return Experiment(
        paper="radar",
        title="Real-time medians: a robust filter for radars, and fusion by residual scale",
        source="Huang He, Chen Qingliang and Zhang Xu, Luoyang Electronic Equipment Test Center",
        seed=options.seed,
        runs=options.runs,
        tables=tabled,
        figures=figures(
            first.flight, first.parts, first.series, first.one, first.both, first.weight, named
        ),
        findings=_findings(options, named),
    )


def _fly(options: RadarOptions, i: int) -> _Run:
    """One flight: registered, filtered, fused."""
    n = options.samples
    begin, noisy = n // 4, (n * 4 // 5, n * 9 // 10)
    swerve = (n * 11 // 20, n * 7 // 10)
    flight = simulate(
        [options.seed, i],
        samples=n,
        manoeuvre=swerve,
        bursts=((begin, options.burst),),
        noisy=(*noisy, 3.0),
    )
    burst = slice(begin, begin + options.burst + 2 * options.window)
    settled = n // 5
    straight = np.arange(n) >= settled
    for part in (burst, slice(*swerve), slice(*noisy)):
        straight[part] = False
    parts = Parts(settled, burst, slice(*swerve), slice(*noisy), straight)
    bias = systematic(flight, settled)
    a, b = (
        cartesian(log, each) for log, each in zip(flight.radars, bias[_REGISTERED_BY], strict=True)
    )
    one = filter_one(flight, a, options.density, options.window)
    both, weight = fuse_both(flight, a, b, options.density, options.window)
    return _Run(flight, parts, bias, (a, b), one, both, weight)


def _findings(options: RadarOptions, made: Mapping[str, Table]) -> tuple[str, ...]:
    def mean(key: str, row: str, column: int | str) -> float:
        table = made[key]
        place = table.columns.index(column) if isinstance(column, str) else column
        return float(table.mean[table.rows.index(row), place])

    burst, swerve, legs, fused = "disturbed_m", "manoeuvre_m", "straight_m", "fusion_m"
    best_constants = made["constants"].mean[:, 1:].max()
    slow, fast = cv_names()[0], cv_names()[-1]
    length = str(options.burst)
    common, milder = "survived_common_pct", "survived_common_5_pct"
    shares = (
        f"Of bursts of {length} with one common offset, the printed form survives "
        f"{mean(common, PRINTED, length):.0f} %, repeated medians "
        f"{mean(common, 'medians, repeated', length):.0f} %, the form with feedback "
        f"{mean(common, OURS, length):.0f} %; of bursts of 50, the last survives "
        f"{mean(common, OURS, '50'):.0f} %. By a criterion of {MILD:g} σ instead of {BOUND:g} σ "
        f"the printed form survives {mean(milder, PRINTED, length):.0f} % of those of {length}.",
    )
    return (
        f"Around a burst of {length}, the largest error in Y is {mean(burst, OURS, 1):.0f} m with "
        f"feedback, {mean(burst, PRINTED, 1):.0f} m as printed, {mean(burst, slow, 1):.0f} m under "
        f"{slow}, {mean(burst, fast, 1):.0f} m under {fast} and {mean(burst, CURRENT, 1):.0f} m "
        "under the current statistical model.",
        f"In the manoeuvre the RMSE in Z is {mean(swerve, OURS, 2):.1f} m with feedback, "
        f"{mean(swerve, slow, 2):.1f} m under {slow}, {mean(swerve, fast, 2):.1f} m under {fast} "
        f"and {mean(swerve, CURRENT, 2):.1f} m under the current statistical model.",
        "On the straight legs, with isolated wild measurements, the RMSE in Y is "
        f"{mean(legs, OURS, 0):.1f} m with feedback and {mean(legs, slow, 0):.1f} m under {slow}. "
        f"{fast} gives {mean(legs, TOLD_CV, 0):.1f} m when told which are wild: medians over "
        f"{options.window} samples smooth less than a Kalman filter may.",
        *(shares if length in made[common].columns else ()),
        f"No gain and gate tried brings the printed form above {best_constants:.0f} % at 15.",
        f"Fused by residual scale: {mean(fused, 'residual scale', 'straight'):.1f} m straight and "
        f"{mean(fused, 'residual scale', 'burst'):.1f} m around the burst, "
        f"{mean(fused, 'residual scale', 'straight') / mean(fused, TOLD, 'straight'):.2f} and "
        f"{mean(fused, 'residual scale', 'burst') / mean(fused, TOLD, 'burst'):.2f} times the "
        "oracle.",
        f"Where radar A is noisier, weights by the usual noise give "
        f"{mean(fused, 'usual noise', 'noisy'):.1f} m, by residual scale "
        f"{mean(fused, 'residual scale', 'noisy'):.1f} m.",
        f"{ROBUST}, errs in Y by {mean(burst, ROBUST, 0):.1f} m around the burst, "
        f"{mean(legs, ROBUST, 0):.1f} m on the straight legs and {mean(swerve, ROBUST, 0):.1f} m "
        f"in the manoeuvre, and survives {mean(common, ROBUST, '50'):.0f} % of the bursts of 50.",
        f"{SEVERAL_ONE}, survives {mean(common, SEVERAL_ONE, '39'):.0f} % of the bursts of 39 with "
        f"one common offset and {mean('survived_own_pct', SEVERAL_ONE, '39'):.0f} % of those with "
        "independent errors.",
        f"Both radars in one filter of several hypotheses: {_spread(made[fused], '')} times the "
        "error of that filter told all faults in the four parts of the flight, offline "
        f"{_spread(made[fused], ', offline')} times, and "
        f"{mean(fused, SEVERAL, 'straight') / mean(fused, TOLD, 'straight'):.2f} and "
        f"{mean(fused, f'{SEVERAL}, offline', 'straight') / mean(fused, TOLD, 'straight'):.2f} "
        "times that of the oracle of the medians on the straight legs.",
        f"σ²min as printed is {1.0 / mean('nees', 'residual scale', 'straight'):.1f} times the "
        "squared error of the fused track on the straight legs; with the smoothing counted, "
        f"{1.0 / mean('nees', COUNTED, 'straight'):.2f} times.",
    )


def _spread(table: Table, ending: str) -> str:
    """Least and greatest ratio of several hypotheses to the same filter told all faults."""
    ours, told = (table.mean[table.rows.index(name + ending)] for name in (SEVERAL, TOLD_SEVERAL))
    return f"{(ours / told).min():.2f} to {(ours / told).max():.2f}"
