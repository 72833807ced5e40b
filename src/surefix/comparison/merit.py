"""Figures of merit of one method on one trial."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from surefix.comparison.oracle import Oracle
from surefix.pipelines.options import Mode
from surefix.simulate.contamination import Trial
from surefix.types import BoolArray, Cleaned, FloatArray, Reason, Verdict, Verdicts

__all__ = ["GROSS_SIGMA", "ORACLE", "Merit", "Outcome", "Outcomes", "judge", "judge_oracle"]

GROSS_SIGMA: Final = 8.0
"""Errors of an axis that exceed it are to be rejected without exception."""

ORACLE: Final = "oracle"
"""What the oracle is called among the methods."""

_BEGUN: Final = 20  # rows from which a filter in real time is judged
_ALLOWED: Final = 60  # rows after a true jump that it is not judged on: believing takes time
_BACK_SIGMA: Final = 3.0  # from the oracle, within which a track has followed a jump …
_BACK_ROWS: Final = 10  # … if it stays there for as many rows
_REJECTED: Final = 0.02  # a weight up to it counts as rejected


class Merit(NamedTuple):
    """How well a method did; NaN where there is no such figure.

    Parameters
    ----------
    rmse_ratio
        RMSE of the position, of all axes, over that of the oracle.
    nees
        Mean of the squared errors of the position over the variances claimed; 1 is honest.
    rejected_gross_pct
        Share of the fixes with errors above ``GROSS_SIGMA`` that were rejected, on every axis that
        is so wrong, %.
    rejected_good_pct
        Share of the good fixes that were rejected, in whole or in part, %.
    noise_position, noise_velocity, noise_motion
        Estimated over true noise, mean over horizontal and vertical; the motion's where the true
        one is the model's.
    back_fixes
        In real time, intervals between fixes from a true jump until the track is back beside the
        oracle.
    """

    rmse_ratio: float
    nees: float
    rejected_gross_pct: float
    rejected_good_pct: float
    noise_position: float
    noise_velocity: float
    noise_motion: float
    back_fixes: float


class Outcome(NamedTuple):
    """What became of one trial: its figures, and (n,) the error of every row, m."""

    merit: Merit
    error: FloatArray


Outcomes = Mapping[tuple[str, Mode, str], Outcome]
"""Of one scenario and run: ``aided`` by velocities or ``alone``, the mode, the method → outcome."""


def judge(trial: Trial, cleaned: Cleaned, best: Oracle, mode: Mode) -> Outcome:
    """Hold a result against truth and oracle.

    Parameters
    ----------
    trial
        What was cleaned.
    cleaned
        One row for each of the trial's, and those of a source beside its fixes.
    best
        The oracle in the same mode.
    mode
        In real time the first rows and those just after a jump are not judged: nothing can know.
    """
    d = trial.world.axes
    rows = _judged(trial, mode)
    own = cleaned.sensor == cleaned.sensors.index("fix")
    position, sigma = cleaned.track.position[own, :d], cleaned.track.sigma_position[own, :d]
    error = position - trial.position
    least = best.position - trial.position
    squares = error[rows] ** 2
    gross, good = _rejected(trial, Verdicts(*(each[own] for each in cleaned.verdicts)), rows)
    noise = _noise_ratios(trial, cleaned)
    merit = Merit(
        float(np.sqrt(squares.mean() / (least[rows] ** 2).mean())),
        float((squares / sigma[rows] ** 2).mean()),
        gross,
        good,
        *noise,
        _back(trial, position, best) if mode == "realtime" else np.nan,
    )
    return Outcome(merit, np.sqrt((error**2).sum(axis=1)))


def judge_oracle(trial: Trial, best: Oracle, mode: Mode) -> Outcome:
    """Hold the oracle against the truth: ratio 1, and how honest it is itself."""
    rows = _judged(trial, mode)
    error = best.position - trial.position
    nees = float(((error[rows] / best.sigma[rows]) ** 2).mean())
    nothing = Merit(*[np.nan] * len(Merit._fields))
    return Outcome(nothing._replace(rmse_ratio=1.0, nees=nees), np.sqrt((error**2).sum(axis=1)))


def _judged(trial: Trial, mode: Mode) -> BoolArray:
    """(n,) rows that a mode is judged on."""
    rows = np.ones(len(trial.time), np.bool_)
    if mode == "realtime":
        rows[:_BEGUN] = False
        if trial.jump >= 0:
            rows[trial.jump : trial.jump + _ALLOWED] = False
    return rows


def _rejected(trial: Trial, judged: Verdicts, rows: BoolArray) -> tuple[float, float]:
    """Percentages of gross errors and of good fixes that were rejected."""
    some = judged.reason == Reason.AXIS_OFF  # detail says which, the others were used
    rejected = (judged.verdict == Verdict.REJECTED) | (judged.weight <= _REJECTED)
    axes = np.where(some, np.nan_to_num(judged.detail), 7.0).astype(np.int64)
    bits = 1 << np.arange(trial.world.axes)
    wrong = np.where(np.abs(trial.error) > GROSS_SIGMA * trial.world.sigma_m, bits, 0)
    every = rejected & ((wrong & ~axes[:, None]) == 0).all(axis=1)
    gross = (wrong > 0).any(axis=1)
    good = ~trial.bad_fix.any(axis=1) & np.isfinite(trial.fixes).any(axis=1)
    return _percent(every[gross & rows]), _percent(rejected[good & rows])


def _percent(flags: BoolArray) -> float:
    return 100.0 * float(flags.mean()) if flags.size else float("nan")


def _noise_ratios(trial: Trial, cleaned: Cleaned) -> tuple[float, float, float]:
    """Estimated over true noise of position, velocity and motion."""
    process = trial.world.process if trial.scenario.vehicle == "model" else np.nan
    truth = {
        "position": trial.world.sigma_m,
        "velocity": trial.world.sigma_mps,
        "acceleration": process,
    }
    ratios: dict[str, list[float]] = {name: [] for name in truth}
    for noise in cleaned.noise:
        name = {"height": "position"}.get(noise.quantity, noise.quantity.removeprefix("vertical "))
        if name in truth and noise.source == "estimated":
            ratios[name].append(noise.value / truth[name])
    position, velocity, motion = (
        float(np.mean(each)) if each else float("nan") for each in ratios.values()
    )
    return position, velocity, motion


def _back(trial: Trial, position: FloatArray, best: Oracle) -> float:
    """Intervals from the jump until the track stays near the oracle; NaN if it never does."""
    if trial.jump < 0:
        return float("nan")
    off = np.abs(position - best.position) / best.sigma
    near = (off[trial.jump :] <= _BACK_SIGMA).all(axis=1)
    stays = np.convolve(near, np.ones(_BACK_ROWS), mode="valid") > _BACK_ROWS - 0.5
    if not stays.any():
        return float("nan")
    first = trial.jump + int(np.argmax(stays))
    return float(trial.time[first] - trial.time[trial.jump]) / trial.world.interval_s
