"""Figures about recorded series whose truth nobody knows: edits, agreement, seeded errors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from surefix.cleaning.hampel import MAD_TO_SIGMA
from surefix.geo.angle import wrap
from surefix.papers.ship_methods import METHODS, OURS, PAPER, Series
from surefix.pipelines.ship_cleaning import Stream, resolution
from surefix.pipelines.ship_inputs import LEAST
from surefix.pipelines.ship_options import PERIODS
from surefix.types import BoolArray, FloatArray

__all__ = ["AGREEING", "EDITORS", "LENGTHS", "agreement", "edited", "seeded", "unit_of"]

LENGTHS = (1, 2, 3, 5, 10)
"""Lengths of the runs of errors that are put into a log."""

EDITORS = ("Lagrange, 3 points", PAPER, "Hampel, 11 samples", "Hampel, 61 samples", OURS)
"""Methods that leave good samples as they are."""

AGREEING = (PAPER, "Hampel, 61 samples", OURS)
"""Methods whose results are compared between sensors."""

_SMOOTHERS = ("five-point cubic", "weighted least squares")
_RADIUS = 6_371_008.8
_APART, _QUIET = 25, 6  # samples between two seeded errors, and around one without an edit
_SIZES = (3.0, 20.0)  # thresholds
_CHANCES = 12  # starts tried for each error


def edited(given: Series) -> list[float]:
    """Samples there are, and the share of them that each of `EDITORS` edits, percent."""
    known = np.isfinite(given.value)
    shares = [100.0 * float(METHODS[name](given).replaced[known].mean()) for name in EDITORS]
    return [float(known.sum()), *shares]


def unit_of(quantity: str, latitude: float) -> tuple[float, str]:
    """How many of the unit shown there are in one of the stream's, and its name.

    Positions are shown in m, at ``latitude`` in rad.
    """
    if quantity == "longitude":
        return _RADIUS * float(np.cos(latitude)), "m"
    if quantity == "latitude":
        return _RADIUS, "m"
    if quantity in PERIODS or quantity in ("roll", "pitch"):
        return 180.0 / np.pi, "°"
    return 1.0, "m/s" if quantity == "speed" else "m"


def agreement(
    names: Sequence[str], streams: Sequence[Stream], series: Sequence[Series], latitude: float
) -> dict[str, list[float]]:
    """Compare every two sensors of one quantity, courses excepted.

    Returns
    -------
    rows
        By pair: robust σ of their difference after the last of `AGREEING`, and the share beyond 5σ
        as logged and after each of them, percent.
    """
    rows: dict[str, list[float]] = {}
    for i, j in combinations(range(len(streams)), 2):
        quantity = streams[i].quantity
        if quantity != streams[j].quantity or quantity == "course":
            continue
        one, other = series[i], series[j]
        values = [(one.value, other.value)]
        values += [(METHODS[name](one).value, METHODS[name](other).value) for name in AGREEING]
        apart = [_difference(one, other, *pair) for pair in values]
        last = apart[-1][np.isfinite(apart[-1])]
        if last.size < LEAST:
            continue
        centre = float(np.median(last))
        steps = np.hypot(resolution(one.value), resolution(other.value)) / np.sqrt(12.0)
        sigma = max(MAD_TO_SIGMA * float(np.median(np.abs(last - centre))), float(steps))
        unit, word = unit_of(quantity, latitude)
        row = f"{names[i]} − {names[j]}, {word}"
        rows[row] = [unit * sigma, *(_beyond(each, centre, sigma) for each in apart)]
    return rows


def _difference(one: Series, other: Series, first: FloatArray, second: FloatArray) -> FloatArray:
    """First series less the second, between whose samples it is interpolated linearly."""
    near = np.flatnonzero(np.isfinite(second))
    if near.size < 2:
        return np.full(len(first), np.nan)
    at = other.time[near]
    after = np.searchsorted(at, one.time).clip(1, near.size - 1)
    width = at[after] - at[after - 1]
    share = (one.time - at[after - 1]) / width
    step = second[near[after]] - second[near[after - 1]]
    turn = one.period
    step = wrap(step, turn) if turn else step
    apart = first - (second[near[after - 1]] + share * step)
    apart = wrap(apart, turn) if turn else apart
    usual = 5.0 * float(np.median(np.diff(at)))
    inside = (one.time >= at[0]) & (one.time <= at[-1]) & (width <= usual)
    return np.where(inside, apart, np.nan)


def _beyond(apart: FloatArray, centre: float, sigma: float) -> float:
    known = apart[np.isfinite(apart)]
    return 100.0 * float((np.abs(known - centre) > 5.0 * sigma).mean()) if known.size else np.nan


def seeded(rng: np.random.Generator, series: Sequence[Series]) -> dict[str, list[float]]:
    """Put errors into each series, where it is quiet, and see what each method does with them.

    Returns
    -------
    rows
        By method, the share of the errors brought back within T of what was logged, by `LENGTHS`,
        percent. What is left out counts as brought back.
    """
    removed: dict[str, list[list[BoolArray]]] = {}
    for given in series:
        wild, marks = _with_errors(rng, given)
        for name in (*_SMOOTHERS, *EDITORS):
            error = METHODS[name](given._replace(value=wild)).value - given.value
            error = wrap(error, given.period) if given.period else error
            with np.errstate(invalid="ignore"):
                gone = ~(np.abs(error) > given.threshold)
            by_length = removed.setdefault(name, [[] for _ in LENGTHS])
            for found, length in zip(by_length, LENGTHS, strict=True):
                found.append(gone[marks == length])
    return {
        name: [_percent(np.concatenate(found)) for found in by_length]
        for name, by_length in removed.items()
    }


def _percent(flags: BoolArray) -> float:
    return 100.0 * float(flags.mean()) if flags.size else float("nan")


def _with_errors(rng: np.random.Generator, given: Series) -> tuple[FloatArray, FloatArray]:
    """Put errors of 3 … 20 T where no method edits; gives the length of each sample's run."""
    n = len(given.value)
    wild, marks = given.value.copy(), np.zeros(n)
    noisy = METHODS[PAPER](given).replaced | ~np.isfinite(given.value)
    noisy |= METHODS[OURS](given).replaced
    taken = np.convolve(noisy, np.ones(2 * _QUIET + 1), mode="same") > 0.0
    wanted = max(n // (8 * _APART * len(LENGTHS)), 1)
    highest = 0.45 * given.period if given.period else np.inf
    for length in LENGTHS:
        for start in rng.integers(_QUIET, max(n - length - _QUIET, _QUIET + 1), _CHANCES * wanted):
            run = slice(int(start), int(start) + length)
            if (marks == length).sum() >= length * wanted:
                break
            if run.stop > n or taken[run].any():
                continue
            size = rng.uniform(*_SIZES) * float(np.max(given.threshold[run]))
            wild[run] += rng.choice([-1.0, 1.0]) * min(size, highest)
            marks[run] = length
            taken[max(run.start - _APART, 0) : run.stop + _APART] = True
    return wild, marks
