"""Contestants side by side: every round runs each once, so that all see the same machine."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

BURST = 0.002  # s: a short run is less likely to be interrupted
BEST_OF = 5  # bursts in a round: what else the machine does strikes the best of them least
LONG, LONGEST = 0.2, 5.0  # s: a long burst is taken twice, the first of them finds the memory
SPENT = 4.0  # s for each slow contestant


@dataclass(frozen=True)
class Contestant:
    """One way to do a piece of work.

    ``run`` does ``count`` units of it and gives the figures that are compared with ours; None where
    they are those of another method.
    """

    name: str
    count: int
    run: Callable[[], object]
    figures: Callable[[object], np.ndarray] | None = None


@dataclass
class Contest:
    """A row of the table: what is done, by whom, and what is aimed at.

    ``aims`` maps a contestant, or ``fastest``, to how many times its cost ours may be; below 1 we
    must be sooner. ``limit`` is an absolute cost in ``unit``.
    """

    name: str
    unit: str
    scale: float
    contestants: list[Contestant]
    aims: dict[str, float] = field(default_factory=dict)
    limit: float | None = None
    skipped: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Standing:
    """Cost per unit of work of one contestant: median, quartiles, ratio to ours, agreement."""

    name: str
    cost: float
    low: float
    high: float
    times_ours: float
    agreement: float | None


def decide(contest: Contest, rounds: int) -> list[Standing]:
    """Run a contest; the first contestant is ours."""
    warm = {each.name: each.run() for each in contest.contestants}
    ours = contest.contestants[0]
    repeats = {each.name: _repeats(each) for each in contest.contestants}
    budget = {each.name: _rounds(each, repeats[each.name], rounds) for each in contest.contestants}
    costs: dict[str, list[float]] = {each.name: [] for each in contest.contestants}
    beside: dict[str, list[float]] = {each.name: [] for each in contest.contestants}
    rounds = budget[ours.name]
    for turn in range(rounds):
        mine = _cost(ours, repeats[ours.name])
        costs[ours.name].append(mine)
        beside[ours.name].append(1.0)
        for each in contest.contestants[1:]:
            if turn % max(rounds // budget[each.name], 1) == 0:
                theirs = _cost(each, repeats[each.name])
                costs[each.name].append(theirs)
                beside[each.name].append(theirs / mine)
    standings = []
    for each in contest.contestants:
        low, middle, high = np.percentile(costs[each.name], [25, 50, 75]) * contest.scale
        standings.append(
            Standing(
                each.name,
                float(middle),
                float(low),
                float(high),
                float(np.median(beside[each.name])),
                _agreement(ours, each, warm),
            )
        )
    return standings


def seconds(call: Callable[[], object]) -> float:
    """Time one call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def _repeats(each: Contestant) -> int:
    return max(1, round(BURST / max(seconds(each.run), 1e-7)))


def _rounds(each: Contestant, repeats: int, rounds: int) -> int:
    """Slow contestants have fewer turns, at least three."""
    burst = seconds(each.run) * repeats
    tries = BEST_OF if burst < LONG else 1
    return int(np.clip(SPENT / max(tries * burst, 1e-9), 3, rounds))


def _cost(each: Contestant, repeats: int) -> float:
    """Seconds per unit of work: the best of a few bursts, each the mean of its calls."""

    def burst() -> None:
        for _ in range(repeats):
            each.run()

    if repeats > 1:
        each.run()  # whoever was before has left the caches full of something else
    best = seconds(burst)
    more = BEST_OF if best < LONG else 2 if best < LONGEST else 1
    return min(best, *(seconds(burst) for _ in range(more - 1)), np.inf) / (repeats * each.count)


def _agreement(ours: Contestant, other: Contestant, warm: dict[str, object]) -> float | None:
    """Largest difference of a figure from ours over the largest figure."""
    if ours.figures is None or other.figures is None:
        return None
    theirs = other.figures(warm[other.name])
    mine = ours.figures(warm[ours.name])[: len(theirs)]
    known = np.isfinite(mine) & np.isfinite(theirs)
    if (np.isfinite(mine) != np.isfinite(theirs)).any() or not known.any():
        return float("inf")
    return float(np.abs(mine - theirs)[known].max() / np.abs(mine[known]).max())
