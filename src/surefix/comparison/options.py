"""Options of `surefix compare`: one frozen record, validated once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from surefix.comparison.methods import works_in
from surefix.errors import OptionsError
from surefix.experiment import check_least
from surefix.pipelines.options import Mode
from surefix.simulate.contamination import SCENARIOS, World, draw_world

__all__ = ["MODES", "CompareOptions", "check_methods", "world_of"]

MODES: tuple[Mode, ...] = ("offline", "lagged", "realtime")
"""The modes in the order of the tables."""


@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """What is compared, on what.

    Parameters
    ----------
    methods
        Of ``surefix.comparison.methods.COMPARED``: those of `surefix clean`, and baselines. One
        that does not work in a mode has no figure there.
    scenarios
        Names of `surefix.simulate.contamination.SCENARIOS`.
    modes
        Of ``MODES``.
    seed
        Everything is drawn from it; run i draws from ``[seed, i]``.
    runs
        Independent repetitions, at least 1. Each draws its own world, unless there is one for all.
    epochs
        Fixes of a log, at least 200.
    world
        Vehicle and sensors for all runs; None draws noise, rate and agility anew in each.
    jobs
        Processes that share the work, at least 1; the figures do not depend on it.

    Raises
    ------
    OptionsError
        A name nobody knows, twice the same, a method that works in none of the modes, or a figure
        that is too small.
    """

    methods: tuple[str, ...] = ("kalman", "huber", "student-t", "igg3", "multi-hypothesis")
    scenarios: tuple[str, ...] = tuple(SCENARIOS)
    modes: tuple[Mode, ...] = MODES
    seed: int = 1
    runs: int = 5
    epochs: int = 2400
    world: World | None = None
    jobs: int = 1

    def __post_init__(self) -> None:
        _known("scenario", self.scenarios, tuple(SCENARIOS))
        check_methods(self.methods, self.modes)
        check_least(self, seed=0, runs=1, epochs=200, jobs=1)

    @property
    def trials(self) -> int:
        """How many logs are drawn: what `compare` tells its progress in."""
        return self.runs * len(self.scenarios)


def check_methods(methods: Sequence[str], modes: Sequence[Mode]) -> None:
    """Check that there are such methods and modes, and something for each method to do.

    Parameters
    ----------
    methods, modes
        Names, each once.

    Raises
    ------
    OptionsError
        A name nobody knows, twice the same, or a method that works in none of the modes.
    """
    _distinct("methods", methods)
    _known("mode", modes, get_args(Mode))
    for method in methods:
        if not any(works_in(method, mode) for mode in modes):
            fit = ", ".join(mode for mode in MODES if works_in(method, mode))
            raise OptionsError(f"method {method} in mode {', '.join(modes)}", f"mode {fit}")


def world_of(options: CompareOptions, run: int) -> World:
    """Vehicle and sensors of one run, counted from 0."""
    return options.world or draw_world((options.seed, run), epochs=options.epochs)


def _known(what: str, given: Sequence[str], known: Sequence[str]) -> None:
    _distinct(f"{what}s", given)
    for name in given:
        if name not in known:
            raise OptionsError(f"{what} {name!r}", "one of " + ", ".join(known))


def _distinct(what: str, names: Sequence[str]) -> None:
    if not names or len(set(names)) < len(names):
        raise OptionsError(f"{what} {', '.join(names)!r}", "at least one name, each once")
