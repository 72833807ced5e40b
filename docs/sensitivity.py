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

__all__ = ["CONSTANTS", "LOGS", "MODES", "Plan", "Variant", "measure", "value_of", "varied", "vary"]

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
        "Prior.alike": "odds",
        "Prior.row": "probability",
        "hypotheses.MOST": "size",
        "hypotheses.POOR_WEIGHT": "size",
        "hypothesis_axis.HASTE": "size",
        "hypothesis_axis._SWIFT": "size",
        "hypothesis_bank._ALIKE": "size",
        "hypothesis_bank._FAR": "size",
        "hypothesis_branches._AIDED": "size",
        "hypothesis_branches.GROSS": "size",
        "hypothesis_branches._PATIENCE": "size",
        "hypothesis_branches._PREFERS": "size",
        "hypothesis_branches._STRANGE": "size",
        "learning._DIFFER": "size",
        "learning._MANY": "probability",
        "learning._WILD": "size",
        "learning_shares._ONE": "size",
    }
)
"""What is changed, and how: fields of ``Prior``, and constants of modules of ``surefix.filters``.

A size is halved and doubled; a probability is divided by 3 and multiplied by 3; of one that is near
to certainty the odds are.
"""
LOGS: Final = (
    "isolated-40 alone",
    "burst-common aided",
    "burst-common alone",
    "burst-independent alone",
    "jump aided",
    "small alone",
    "one-axis alone",
    "dvl-faults aided",
    "speedboat aided",
    "speedboat alone",
)
"""Scenarios of `surefix compare`, aided by velocities or alone."""
MODES: Final = ("offline", "realtime")
_NAMES: Final = {"realtime": "real time"}
_LEAST, _NONE = 0.5, "·"  # change that is shown, %, and what stands for less

Cell = tuple[str, str]  # mode and log


class Variant(NamedTuple):
    """One constant of ``CONSTANTS``, and whether it is raised or lowered."""

    name: str
    up: bool


class Plan(NamedTuple):
    """Logs, seed, number of worlds, and fixes of each log: run i draws from (seed, i)."""

    logs: tuple[str, ...]
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

        def supposed(*given: float, **words: bool) -> Any:
            prior = usual(*given, **words)
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
    for run, drawn in product(range(plan.runs), plan.logs):
        scenario, kind = drawn.split(" ")
        trial = draw(scenario, world_of(options, run), (plan.seed, run))
        made = outcomes(trial if kind == "aided" else alone(trial), (method,), MODES)
        for mode in MODES:
            found.setdefault((mode, drawn), []).append(made[mode, method].merit.rmse_ratio)
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
    return not name.startswith(("Prior.", "learning")) and name != "hypotheses.MOST"


def _once(learn: Callable[..., Any]) -> Callable[..., Any]:
    """Learn once from the same log: both modes learn the same."""
    known: dict[bytes, Any] = {}

    def learnt(*given: Any, **settings: Any) -> Any:
        key = pickle.dumps((given, settings))
        if key not in known:
            known[key] = learn(*given, **settings)
        return known[key]

    return learnt


def _base_table(base: Mapping[Cell, float], logs: Sequence[str]) -> Iterator[str]:
    yield _row(["RMSE / oracle", *map(_named, MODES)])
    yield _row(["---", *["---:"] * len(MODES)])
    for drawn in logs:
        yield _row([drawn, *(f"{base[mode, drawn]:.3f}" for mode in MODES)])


def _changes(base: Mapping[Cell, float], found: Mapping[Cell, float]) -> dict[Cell, float]:
    """Change of every figure, %."""
    return {cell: 100.0 * (found[cell] / base[cell] - 1.0) for cell in base}


def _variant_row(variant: Variant, changes: Mapping[Cell, float]) -> str:
    """Mean change in each mode, and where the figures change most in either direction."""
    value = varied(CONSTANTS[variant.name], value_of(variant.name), variant.up)
    cells = []
    for mode in MODES:
        logs = [log(1.0 + change / 100.0) for cell, change in changes.items() if cell[0] == mode]
        cells.append(_shown(100.0 * (exp(fsum(logs) / len(logs)) - 1.0)))
    for sign in (1.0, -1.0):
        most, where = max((sign * change, cell) for cell, change in changes.items())
        shown = _shown(sign * max(most, 0.0))
        cells.append(shown if shown == _NONE else f"{shown} {where[1]}, {_named(where[0])}")
    return _row([f"`{variant.name}`", f"{value:.3g}", *cells])


def _shown(change: float) -> str:
    return _NONE if abs(change) < _LEAST else f"{change:+.1f}".replace("-", "−")


def _named(mode: str) -> str:
    return _NAMES.get(mode, mode)


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, known in (("constants", tuple(CONSTANTS)), ("logs", LOGS)):
        parser.add_argument(f"--{name}", nargs="+", default=known, metavar="NAME", choices=known)
    for name, usual in (("seed", 11), ("runs", 2), ("epochs", 1200), ("jobs", 1)):
        parser.add_argument(f"--{name}", type=int, default=usual, help=f"default {usual}")
    return parser.parse_args()


def main() -> None:
    """Print the figures of the filter as it is, the change by each variant, and the worst."""
    given = _parsed()
    plan = Plan(tuple(given.logs), given.seed, given.runs, given.epochs)
    variants = [Variant(name, up) for name in given.constants for up in (False, True)]
    worst: dict[str, float] = {}
    with TemporaryDirectory() as place:
        kernels = Path(place)
        with ProcessPoolExecutor(given.jobs, get_context("spawn"), max_tasks_per_child=1) as pool:
            base = pool.submit(_apart, None, plan, kernels).result()
            print("\n".join(_base_table(base, plan.logs)), end="\n\n", flush=True)
            modes = [f"{_named(mode)}, %" for mode in MODES]
            print(_row(["constant", "changed to", *modes, "worst, %", "best, %"]))
            print(_row(["---", "---:", *["---:"] * len(modes), "---", "---"]))
            waiting = [pool.submit(_apart, each, plan, kernels) for each in variants]
            for variant, found in zip(variants, waiting, strict=True):
                changes = _changes(base, found.result())
                worst[variant.name] = max(worst.get(variant.name, 0.0), *changes.values())
                print(_variant_row(variant, changes), flush=True)
    ranked = sorted(worst, key=lambda name: -worst[name])
    print("\nWorst change: " + ", ".join(f"`{name}` {worst[name]:+.1f} %" for name in ranked))


if __name__ == "__main__":
    main()
