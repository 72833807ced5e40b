"""How long a burst does each filter of paper 004 survive? A straight flight, one burst, many times.

Survived means: from the first wild sample to 78 samples after the last, twice the window of the
paper, the estimate is never off by more than 3 σ, no more than a good measurement; or, as a milder
criterion, by more than 5 σ. In one kind of
burst all errors share one offset of 10 … 30 σ either way, in the other each has its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, Literal

import numpy as np

from surefix.filters.current_statistical import filter_current
from surefix.filters.median_recursion import filter_medians, median_recursion
from surefix.models.singer import singer
from surefix.papers.radar_hypotheses import filter_several
from surefix.papers.radar_methods import (
    CURRENT,
    OURS,
    PRINTED,
    ROBUST,
    SEVERAL_ONE,
    cv_names,
    filter_cv,
)
from surefix.papers.radar_series import Cartesian
from surefix.types import FloatArray

__all__ = [
    "BOUND",
    "KINDS",
    "LENGTHS",
    "MILD",
    "REPEATED",
    "burst_methods",
    "greatest",
    "longest",
    "settings",
]

REPEATED: Final = "medians, repeated"
LENGTHS: Final = (1, 3, 6, 10, 15, 19, 25, 39, 50, 60)
"""Lengths of the bursts, samples."""

Kind = Literal["common", "own"]
BOUND, MILD = 3.0, 5.0
"""A burst is survived that throws the estimate off by no more than so many σ."""
KINDS: Final[tuple[Kind, ...]] = ("common", "own")

_SIGMA, _SPEED, _DT = 25.0, 200.0, 0.05  # m, m/s, s: as the flight of the experiment
_SETTLE, _AFTER = 400, 78
_LEAST, _LARGEST = 10.0, 30.0
_WINDOWS = 3

Method = Callable[[FloatArray, Any], tuple[Any, FloatArray]]
"""Filter (n, trials) in m on from a state, None to begin; gives the state and the estimates."""


def burst_methods(density: float, window: int) -> dict[str, Method]:
    """Each filter as a function on several independent series."""
    model = singer(1.0 / 20.0, _DT)

    def cv(factor: int, robust: bool = False) -> Method:
        def run(z: FloatArray, states: Any) -> tuple[Any, FloatArray]:
            groups = [z[:, i : i + 3] for i in range(0, z.shape[1], 3)]
            done = [
                filter_cv(
                    Cartesian(g, np.full(g.shape, _SIGMA**2)),
                    _DT,
                    factor * density,
                    state,
                    robust=robust,
                )
                for g, state in zip(groups, states or [None] * len(groups), strict=True)
            ]
            return [each[0] for each in done], np.hstack([each[1] for each in done])

        return run

    def several(z: FloatArray, banks: Any) -> tuple[Any, FloatArray]:
        noise = np.full((len(z), 1), _SIGMA**2)
        done = [
            filter_several(Cartesian(one[:, None], noise), _DT, 20 * density, bank)
            for one, bank in zip(z.T, banks or [None] * z.shape[1], strict=True)
        ]
        return [each[0] for each in done], np.hstack([each[1] for each in done])

    def current(z: FloatArray, state: Any) -> tuple[Any, FloatArray]:
        after, mean, _ = filter_current(model, 10.0, z, _SIGMA**2, state)
        return after, np.ascontiguousarray(mean[..., 0])

    found = {name: cv(factor) for name, factor in zip(cv_names(), (1, 9, 20), strict=True)}
    forms = ((PRINTED, "printed"), (REPEATED, "repeated-median"), (OURS, "feedback"))
    medians = {name: _medians(form, window=window) for name, form in forms}
    return (
        found | {CURRENT: current} | medians | {ROBUST: cv(20, robust=True), SEVERAL_ONE: several}
    )


def greatest(
    seed: Sequence[int], methods: dict[str, Method], kind: Kind, trials: int, lengths: Sequence[int]
) -> dict[str, FloatArray]:
    """Greatest error of each method through each burst: name → (lengths, trials) in σ.

    All methods and lengths see the same noise, and a longer burst begins like a shorter one.

    Parameters
    ----------
    seed
        Of ``numpy.random.default_rng``.
    methods
        From `burst_methods`.
    kind
        One offset for the whole burst, or each sample its own.
    trials
        Independent series.
    lengths
        Of the burst, samples.
    """
    rng = np.random.default_rng([*seed, KINDS.index(kind)])
    total = _SETTLE + max(lengths) + _AFTER
    truth = _SPEED * _DT * np.arange(total)[:, None]
    clean = truth + _SIGMA * rng.standard_normal((total, trials))
    error = rng.uniform(_LEAST, _LARGEST, (total, trials)) * rng.choice([-1, 1], (total, trials))
    if kind == "common":
        error[:] = error[0]
    found = {}
    for name, method in methods.items():
        state, _ = method(clean[:_SETTLE], None)
        rows = []
        for length in lengths:
            end = _SETTLE + length
            z = clean[_SETTLE : end + _AFTER].copy()
            z[:length] += _SIGMA * error[_SETTLE:end]
            off = method(z, state)[1] - truth[_SETTLE : end + _AFTER]
            rows.append(np.abs(off).max(axis=0) / _SIGMA)
        found[name] = np.array(rows, dtype=np.float64)
    return found


def longest(off: FloatArray, lengths: Sequence[int]) -> float:
    """Longest burst survived in every trial, and so were all shorter ones; 0 for none.

    Parameters
    ----------
    off
        (lengths, trials) from `greatest`, σ.
    lengths
        In increasing order.
    """
    good = np.cumprod((off <= BOUND).all(axis=1)).astype(bool)
    return float(np.asarray(lengths)[good].max(initial=0))


def settings(
    seed: Sequence[int], trials: int, gains: Sequence[float], gates: Sequence[float]
) -> dict[str, FloatArray]:
    """The printed form under other constants: gain → noise RMSE/σ, then % of bursts of 15 survived.

    One percentage for each gate; bursts of a common offset.
    """
    rng = np.random.default_rng([*seed, len(KINDS)])
    noise = rng.standard_normal((_SETTLE, trials))
    rows = {}
    for gain in gains:
        methods = {str(gate): _medians("printed", gain=gain, gate=gate) for gate in gates}
        quiet = methods[str(gates[0])](noise, None)[1][39:]
        off = greatest(seed, methods, "common", trials, (15,))
        share = [100.0 * float((off[str(gate)] <= BOUND).mean()) for gate in gates]
        rows[f"K = {gain:g}"] = np.array([np.sqrt(np.mean(quiet**2)), *share])
    return rows


def _medians(form: str, **constants: Any) -> Method:
    options = median_recursion(form, **constants)

    def run(z: FloatArray, states: Any) -> tuple[Any, FloatArray]:
        recent = z if states else z[-_WINDOWS * options.window :]  # enough to settle on
        after, found = filter_medians(options, recent, states)
        return after, found.estimate

    return run
