"""Change the constants of the multi-hypothesis filter one by one and print what that does.

Run ``python docs/sensitivity.py``; docs/explanation/hypotheses.md shows what it printed. Every
variant cleans the same simulated logs, through the same pipeline as ``surefix compare``, in a
process of its own: kernels read constants when they are compiled.
"""

from __future__ import annotations

import argparse
import os
import pickle
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from itertools import product
from math import exp, fsum, log
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, Final, NamedTuple

__all__ = ["CONSTANTS", "SCENARIOS", "Plan", "Variant", "measure", "value_of", "varied", "vary"]

CONSTANTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Prior.isolated": "probability",
        "Prior.partial": "probability",
        "Prior.poor": "probability",
        "Prior.burst": "probability",
        "Prior.ending": "probability",
        "Prior.longest": "size",
        "Prior.manoeuvre": "probability",
        "Prior.velocity": "probability",
        "Prior.again": "odds",
        "hypotheses.MOST": "size",
        "hypotheses.POOR_WEIGHT": "size",
        "hypothesis_axis.HASTE": "size",
        "hypothesis_axis._SWIFT": "size",
        "hypothesis_bank._ALIKE": "size",
        "hypothesis_bank._FAR": "size",
        "hypothesis_branches._ALIKE": "odds",
        "hypothesis_branches._GROSS": "size",
        "hypothesis_branches._PATIENCE": "size",
        "hypothesis_branches._PREFERS": "size",
        "hypothesis_branches._STRANGE": "size",
        "learning._DIFFER": "size",
        "learning._MANY": "probability",
        "learning._WILD": "size",
    }
)
"""What is changed, and how: fields of ``Prior``, and constants of modules of ``surefix.filters``.

A size is halved and doubled; a probability is divided by 3 and multiplied by 3; of one that is near
to certainty the odds are.
"""
SCENARIOS: Final = (
    "isolated-40",
    "burst-common",
    "burst-independent",
    "jump",
    "small",
    "one-axis",
    "dvl-faults",
    "speedboat",
)
GROUPS: Final = tuple(product(("offline", "realtime"), ("aided", "alone")))
_NAMES: Final = {"realtime": "real time"}
_LEAST = 0.5  # change that is shown, %

Cell = tuple[str, str, str]  # mode, aided or alone, scenario


class Variant(NamedTuple):
    """One constant of ``CONSTANTS``, and whether it is raised or lowered."""

    name: str
    up: bool


class Plan(NamedTuple):
    """Scenarios, seed, number of worlds, and fixes of each log: run i draws from (seed, i)."""

    scenarios: tuple[str, ...]
    seed: int
    runs: int
    epochs: int


def varied(rule: str, value: float, up: bool) -> float:
    """Give the changed value of a constant, of the same type."""
    factor = (2.0 if rule == "size" else 3.0) ** (1 if up else -1)
    if rule == "odds":
        return value * factor / (1.0 - value + value * factor)
    return type(value)(value * factor)


def value_of(name: str) -> float:
    """Value of a constant; of the longest run, in intervals between fixes."""
    module, attribute = name.split(".")
    if module != "Prior":
        return getattr(import_module(f"surefix.filters.{module}"), attribute)
    longest = import_module("surefix.pipelines.options").CleanOptions().patience(1.0)
    usual = import_module("surefix.filters.learning").supposed(1, 1.0, 1.0, 1.0, longest)
    return getattr(usual, attribute)


def vary(variant: Variant) -> None:
    """Change a constant of this process, before anything is imported that uses it."""
    module, attribute = variant.name.split(".")
    rule = CONSTANTS[variant.name]
    if module == "Prior":
        learning = import_module("surefix.filters.learning")
        usual = learning.supposed

        def supposed(*given: float) -> Any:
            prior = usual(*given)
            value = varied(rule, getattr(prior, attribute), variant.up)
            return prior._replace(**{attribute: value})

        learning.supposed = supposed
        return
    home = import_module(f"surefix.filters.{module}")
    value = varied(rule, getattr(home, attribute), variant.up)
    setattr(home, attribute, value)
    if attribute == "MOST":
        home.no_hypotheses.__defaults__ = (value,)


def measure(plan: Plan) -> dict[Cell, float]:
    """RMSE over that of the oracle, mean over the runs, with the constants as they are."""
    from surefix.comparison.options import CompareOptions, world_of
    from surefix.comparison.run import outcomes
    from surefix.simulate.contamination import alone, draw

    method = "multi-hypothesis"
    options = CompareOptions(seed=plan.seed, runs=plan.runs, epochs=plan.epochs)
    found: dict[Cell, list[float]] = {}
    for run, scenario in product(range(plan.runs), plan.scenarios):
        trial = draw(scenario, world_of(options, run), (plan.seed, run))
        both = {"aided": trial, "alone": alone(trial)}
        if trial.scenario.velocity_runs:
            del both["alone"]
        for kind, each in both.items():
            for (mode, name), outcome in outcomes(each, (method,), ("offline", "realtime")).items():
                if name == method:
                    ratio = outcome.merit.rmse_ratio
                    found.setdefault((mode, kind, scenario), []).append(ratio)
    return {cell: fsum(ratios) / plan.runs for cell, ratios in found.items()}


def _apart(variant: Variant | None, plan: Plan, kernels: Path) -> dict[Cell, float]:
    """Measure in a process that has imported nothing yet; the base compiles for all."""
    with TemporaryDirectory() as place:
        if variant and _compiled(variant.name):  # what knows no constant need not be compiled again
            own = Path(place) / "kernels"
            kernels = shutil.copytree(kernels, own, ignore=shutil.ignore_patterns("*hypothes*"))
        os.environ["NUMBA_CACHE_DIR"] = str(kernels)
        if variant:
            vary(variant)
        learning = import_module("surefix.filters.learning")
        learning.learn = _once(learning.learn)
        return measure(plan)


def _compiled(name: str) -> bool:
    """Whether kernels know the constant."""
    return not name.startswith(("Prior.", "learning.")) and name != "hypotheses.MOST"


def _once(learn: Callable[..., Any]) -> Callable[..., Any]:
    """Learn once from the same log: both modes learn the same."""
    known: dict[bytes, Any] = {}

    def learnt(*given: Any, **settings: Any) -> Any:
        key = pickle.dumps((given, settings))
        if key not in known:
            known[key] = learn(*given, **settings)
        return known[key]

    return learnt


def _base_table(base: Mapping[Cell, float], scenarios: Sequence[str]) -> Iterator[str]:
    yield _row(["scenario", *(_named(*group) for group in GROUPS)])
    yield _row(["---", *["---:"] * len(GROUPS)])
    for scenario in scenarios:
        ratios = [base.get((*group, scenario)) for group in GROUPS]
        yield _row([scenario, *("–" if r is None else f"{r:.3f}" for r in ratios)])


def _changes(base: Mapping[Cell, float], found: Mapping[Cell, float]) -> dict[Cell, float]:
    """Change of every figure, %."""
    return {cell: 100.0 * (found[cell] / base[cell] - 1.0) for cell in base}


def _variant_row(variant: Variant, changes: Mapping[Cell, float]) -> str:
    """Mean change of each group, and where the figures change most in either direction."""
    value = varied(CONSTANTS[variant.name], value_of(variant.name), variant.up)
    cells = []
    for group in GROUPS:
        logs = [log(1.0 + x / 100.0) for cell, x in changes.items() if cell[:2] == group]
        cells.append(_shown(100.0 * (exp(fsum(logs) / len(logs)) - 1.0)) if logs else "–")
    for extreme in (max, min):
        cell = extreme(changes, key=lambda each: changes[each])
        wrong = changes[cell] <= 0.0 if extreme is max else changes[cell] >= 0.0
        shown = "·" if wrong else _shown(changes[cell])
        cells.append(shown if shown == "·" else f"{shown} {cell[2]}, {_named(*cell[:2])}")
    return _row([f"`{variant.name}`", f"{value:.3g}", *cells])


def _shown(change: float) -> str:
    return "·" if abs(change) < _LEAST else f"{change:+.1f}".replace("-", "−")


def _named(mode: str, kind: str) -> str:
    return f"{_NAMES.get(mode, mode)} {kind}"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, known in (("constants", tuple(CONSTANTS)), ("scenarios", SCENARIOS)):
        parser.add_argument(f"--{name}", nargs="+", default=known, metavar="NAME", choices=known)
    for name, usual in (("seed", 11), ("runs", 2), ("epochs", 1200), ("jobs", 1)):
        parser.add_argument(f"--{name}", type=int, default=usual, help=f"default {usual}")
    return parser.parse_args()


def main() -> None:
    """Print the figures of the filter as it is, the change by each variant, and the worst."""
    given = _parsed()
    plan = Plan(tuple(given.scenarios), given.seed, given.runs, given.epochs)
    variants = [Variant(name, up) for name in given.constants for up in (False, True)]
    worst: dict[str, float] = {}
    with TemporaryDirectory() as place:
        kernels = Path(place)
        with ProcessPoolExecutor(given.jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
            base = pool.submit(_apart, None, plan, kernels).result()
            print("\n".join(_base_table(base, plan.scenarios)), end="\n\n", flush=True)
            groups = [_named(*group) for group in GROUPS]
            print(_row(["constant", "changed to", *groups, "worst, %", "best, %"]))
            print(_row(["---", "---:", *["---:"] * len(groups), "---", "---"]))
            waiting = [pool.submit(_apart, each, plan, kernels) for each in variants]
            for variant, found in zip(variants, waiting, strict=True):
                changes = _changes(base, found.result())
                worst[variant.name] = max(worst.get(variant.name, 0.0), *changes.values())
                print(_variant_row(variant, changes), flush=True)
    ranked = sorted(worst, key=lambda name: -worst[name])
    print("\nWorst change: " + ", ".join(f"`{name}` {worst[name]:+.1f} %" for name in ranked))


if __name__ == "__main__":
    sys.exit(main())
