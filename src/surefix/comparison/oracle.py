"""The best that can be had: a Kalman filter and smoother that are told what nobody can know.

The oracle knows the true noise of every sensor, which components are gross errors (they are left
out, and nothing else), and at which fix the track truly jumps. Where the motion is that of the
model it knows its density too; where it is not, it takes the model and the density that bring it
nearest to the truth on each axis.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from surefix.filters.modes import from_filtered, from_smoothed
from surefix.filters.records import Epochs, Filtered, Motion, Recovery
from surefix.filters.rts import smooth, smooth_lag
from surefix.filters.track import by_axis, filter_track, start
from surefix.pipelines.options import Mode
from surefix.robust.loss import loss_named
from surefix.simulate.contamination import Trial
from surefix.types import FloatArray

__all__ = ["LAG_INTERVALS", "Oracle", "lag_of", "oracle"]

LAG_INTERVALS: Final = 40
"""Future seen in the lagged mode, intervals between fixes."""

_NOTHING: Final = 1e3  # σ per interval: a velocity nothing is known about
_COARSE: Final = tuple(range(-6, 7))  # logarithms of √q over the world's that are tried, and …
_FINE: Final = (-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75)  # … about the best of them
_BEGUN: Final = 20  # rows from which its own error counts in the choice of the motion
_STEP: Final = 1e-9  # share of the lag by which it is longer, for rounding


class Oracle(NamedTuple):
    """(n, d) positions in m, and their standard deviations."""

    position: FloatArray
    sigma: FloatArray


def lag_of(trial: Trial) -> float:
    """Lag of a trial in the lagged mode, s."""
    return LAG_INTERVALS * trial.world.interval_s * (1.0 + _STEP)


def oracle(trial: Trial, mode: Mode) -> Oracle:
    """Estimate a trial with all that is known about it.

    Parameters
    ----------
    trial
        From `surefix.simulate.contamination.draw`.
    mode
        How much of the future may be used.
    """
    if trial.scenario.vehicle == "model":
        return _estimate(trial, _motion(trial, 2, np.full(trial.world.axes, 1.0)), mode)
    even, steady = (_best(trial, order, mode) for order in (2, 3))
    better = _rms(trial, even) <= _rms(trial, steady)
    return Oracle(*(np.where(better, one, two) for one, two in zip(even, steady, strict=True)))


def _best(trial: Trial, order: int, mode: Mode) -> Oracle:
    """Estimate with the density that gives the smallest error, on each axis its own."""

    def of(logarithm: FloatArray) -> Oracle:
        return _estimate(trial, _motion(trial, order, np.exp(logarithm)), mode)

    best = np.zeros(trial.world.axes)
    for steps in (_COARSE, _FINE):
        errors = [_rms(trial, of(best + step)) for step in steps]
        best = best + np.array(steps)[np.argmin(errors, axis=0)]
    return of(best)


def _rms(trial: Trial, found: Oracle) -> FloatArray:
    return np.asarray(np.sqrt(((found.position - trial.position)[_BEGUN:] ** 2).mean(axis=0)))


def _estimate(trial: Trial, motion: Motion, mode: Mode) -> Oracle:
    epochs, d = _epochs(trial), trial.world.axes
    recovery = Recovery(np.inf, _rate_at_jump(trial, motion, epochs))
    filtered = _filter(trial, motion, recovery, epochs)
    found = from_filtered(filtered)
    if mode == "offline":
        found = from_smoothed(smooth(motion, recovery, epochs.time, filtered), found)
    elif mode == "lagged":
        last = np.searchsorted(epochs.time, epochs.time + lag_of(trial), side="right") - 1
        rows = np.arange(len(last))
        found = from_smoothed(
            smooth_lag(motion, recovery, epochs.time, filtered, rows, last), found
        )
    return Oracle(found.mean[:, :d], found.sigma[:, :d])


def _motion(trial: Trial, order: int, factor: FloatArray) -> Motion:
    """Motion whose √q is the world's, on each axis times a factor of its own."""
    d, world = trial.world.axes, trial.world
    root = factor * world.process / world.interval_s ** (order - 2)
    return Motion(order, d, root**2, by_axis(d), 2 * d, 0.0)


def _epochs(trial: Trial) -> Epochs:
    """Observations with their true variances; bad ones left out, all others used.

    Of two positions that are good the mean is taken.
    """
    n, d = trial.fixes.shape
    positions = np.stack([np.where(trial.bad_fix, np.nan, trial.fixes), trial.beside])
    known = np.isfinite(positions).sum(axis=0)
    fixes = np.where(known > 0, np.nansum(positions, axis=0) / np.maximum(known, 1), trial.fixes)
    variance = np.empty((n, 2 * d))
    variance[:, :d] = trial.world.sigma_m**2 / np.maximum(known, 1)
    variance[:, d:] = trial.world.sigma_mps**2
    bad = np.hstack([known == 0, trial.bad_velocity])
    jump = np.zeros(n, np.int64)
    if trial.jump >= 0:
        jump[trial.jump] = (1 << d) - 1
    return Epochs(
        trial.time,
        np.hstack([fixes, trial.velocities]),
        variance,
        np.where(bad, 0.0, 1.0),
        jump,
    )


def _filter(trial: Trial, motion: Motion, recovery: Recovery, epochs: Epochs) -> Filtered:
    nothing = Recovery(np.inf, _NOTHING * trial.world.sigma_m / trial.world.interval_s)
    state = start(motion, nothing)
    return filter_track(motion, loss_named("kalman"), recovery, epochs, state)[1]


def _rate_at_jump(trial: Trial, motion: Motion, epochs: Epochs) -> float:
    """Uncertainty of the velocity when the jump comes: it is kept, only the position is lost."""
    if trial.jump < 1:
        return 1.0
    d, k = trial.world.axes, trial.jump
    before = Epochs(*(column[:k] for column in epochs))  # type: ignore[arg-type]
    factor = _filter(trial, motion, Recovery(np.inf, 1.0), before).factor[-1]
    step = float(trial.time[k] - trial.time[k - 1])
    variance = float((factor[d] ** 2).sum()) + float(motion.density[0]) * step
    return float(np.sqrt(variance))
