"""Methods × scenarios × modes over seeds, each through the product itself, against the oracle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from surefix.comparison.figures import figures
from surefix.comparison.findings import findings
from surefix.comparison.merit import ORACLE, Outcome, Outcomes, judge, judge_oracle
from surefix.comparison.methods import cleaner_of, works_in
from surefix.comparison.options import CompareOptions, world_of
from surefix.comparison.oracle import lag_of, oracle
from surefix.comparison.share import shared
from surefix.comparison.tables import tables
from surefix.experiment import Experiment, Progress
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions, Mode
from surefix.simulate.contamination import Trial, World, alone, columns, columns_beside, draw
from surefix.types import Cleaned

__all__ = ["clean_trial", "compare", "outcomes"]


class _Task(NamedTuple):
    """One log to be drawn, and cleaned by every method in every mode."""

    scenario: str
    world: World
    seed: tuple[int, int]
    methods: tuple[str, ...]
    modes: tuple[Mode, ...]


def compare(options: CompareOptions, progress: Progress | None = None) -> Experiment:
    """Run methods on scenarios in modes, with and without velocities.

    Parameters
    ----------
    options
        What is compared, on what.
    progress
        Told the number of finished trials, of ``options.trials``.
    """
    found: list[Outcomes] = []
    for done, each in enumerate(shared(_run, _tasks(options), options.jobs), start=1):
        found.append(each)
        if progress is not None:
            progress(done)
    size = len(options.scenarios)
    runs = [
        dict(zip(options.scenarios, found[i : i + size], strict=True))
        for i in range(0, len(found), size)
    ]
    made = tables(options, runs)
    drawn = "each run with a noise, rate and agility of its own"
    return Experiment(
        paper="compare",
        title="Methods against an oracle that knows every fault",
        source=f"Simulated logs, {drawn if options.world is None else 'all of one vehicle'}",
        seed=options.seed,
        runs=options.runs,
        tables=made,
        figures=figures(options, {table.key: table for table in made}, runs[0]),
        findings=findings(options, {table.key: table for table in made}),
    )


def outcomes(
    trial: Trial, methods: Sequence[str], modes: Sequence[Mode]
) -> dict[tuple[Mode, str], Outcome]:
    """Clean one trial by several methods in several modes; the oracle is added to them.

    Parameters
    ----------
    trial
        From `surefix.simulate.contamination.draw`, with or without velocities.
    methods, modes
        As in `CompareOptions`.

    Returns
    -------
    outcomes
        By mode and method, of the methods that work in the mode.
    """
    found = {}
    for mode in modes:
        best = oracle(trial, mode)
        found[mode, ORACLE] = judge_oracle(trial, best, mode)
        for method in (each for each in methods if works_in(each, mode)):
            found[mode, method] = judge(trial, clean_trial(trial, method, mode), best, mode)
    return found


def clean_trial(trial: Trial, method: str, mode: Mode) -> Cleaned:
    """Clean the log of a trial as ``surefix clean`` would; only the lag is given.

    Parameters
    ----------
    trial
        What is to be cleaned. Its scenario may want a wrong noise to be given, and drags
        are only looked for where there are any.
    method, mode
        Of `CompareOptions`.
    """
    cleaner, estimator = cleaner_of(method)
    told = trial.scenario.misjudged * trial.world.sigma_m
    wrong = told if trial.scenario.misjudged != 1.0 else None
    options = CleanOptions(
        mode=mode,
        method=cleaner,
        lag_s=lag_of(trial) if mode == "lagged" else None,
        sigma_position=wrong,
        sigma_height=wrong,
        drags=trial.scenario.drag is not None,
    )
    beside = columns_beside(trial)
    if trial.scenario.beside == "depth":
        sources = open_inputs([columns(trial)], depth=beside)
    else:
        sources = open_inputs([*([beside] if beside else []), columns(trial)])
    return clean_sources(sources, options, estimator)


def _tasks(options: CompareOptions) -> Iterator[_Task]:
    for i in range(options.runs):
        world = world_of(options, i)
        for scenario in options.scenarios:
            yield _Task(scenario, world, (options.seed, i), options.methods, options.modes)


def _run(task: _Task) -> Outcomes:
    trial = draw(task.scenario, task.world, task.seed)
    both = {"aided": trial, "alone": alone(trial)}
    if trial.scenario.velocity_runs:  # whose faults are those of the velocities
        del both["alone"]
    return {
        (kind, *key): outcome
        for kind, each in both.items()
        for key, outcome in outcomes(each, task.methods, task.modes).items()
    }
