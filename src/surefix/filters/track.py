"""The robust track filter: one step, and the loop that runs it over a series.

Square-root Kalman filter on a motion model of one to three axes. Every epoch carries an observation
vector ``[position, velocity]`` in which NaN is missing, so a fix, a depth, a velocity or any part
of them is the same thing. Components that share a *group* (both horizontal axes of a fix, say)
share a weight: their Mahalanobis distance from the prediction goes through the loss, and their
variance is divided by the weight (paper 000, eqs 14–19).

A group that has been rejected for ``Recovery.after`` seconds on end is believed after all: the
state of its axes restarts at the median of its last observations. So no loss can lock out for good.
"""

from __future__ import annotations

import numpy as np

from surefix.filters.records import Epochs, Filtered, Motion, Recovery, TrackState
from surefix.filters.track_predict import VAGUE
from surefix.filters.track_step import RECENT, run
from surefix.robust.loss import Loss
from surefix.types import IntArray

__all__ = ["blank", "by_axis", "by_block", "filter_track", "start"]


def by_block(axes: tuple[int, ...]) -> IntArray:
    """Groups in which the horizontal axes share a weight and the vertical has its own.

    Parameters
    ----------
    axes
        Which of x (0), y (1), z (2) the filter runs on.

    >>> by_block((0, 1, 2))
    array([0, 0, 1, 2, 2, 3])
    >>> by_block((2,))
    array([0, 1])
    """
    kinds = [axis == 2 for axis in axes]
    names = list(dict.fromkeys(kinds))
    position = np.array([names.index(kind) for kind in kinds])
    return np.concatenate([position, position + len(names)])


def by_axis(axes: int) -> IntArray:
    """Groups in which every component has its own weight, as in paper 000.

    >>> by_axis(2)
    array([0, 1, 2, 3])
    """
    return np.arange(2 * axes)


def start(motion: Motion, recovery: Recovery) -> TrackState:
    """State of a filter that has seen nothing."""
    n, d, groups = motion.order * motion.axes, motion.axes, motion.groups
    sigma = np.full(n, recovery.sigma_velocity)
    sigma[:d] = VAGUE
    return TrackState(
        np.nan,
        np.zeros(n),
        np.diag(sigma),
        np.zeros(groups, np.int64),
        np.zeros(groups, np.int64),
        np.full(groups, np.nan),
        np.full((RECENT, 2 * d), np.nan),
        np.full((RECENT, groups), np.nan),
    )


def blank(motion: Motion, n: int) -> Filtered:
    """Make an empty record of n epochs."""
    states, m = motion.order * motion.axes, 2 * motion.axes
    return Filtered(
        np.empty((n, states)),
        np.empty((n, states, states)),
        np.full((n, motion.groups), np.nan),
        np.full((n, motion.groups), np.nan),
        np.full((n, m), np.nan),
        np.full((n, motion.groups), np.nan),
        np.full((n, motion.groups), np.nan),
        np.zeros(n, np.int64),
        np.full((n, motion.groups), np.nan),
    )


def filter_track(
    motion: Motion,
    loss: Loss,
    recovery: Recovery,
    epochs: Epochs,
    state: TrackState,
    *,
    until_recovery: bool = False,
) -> tuple[TrackState, Filtered, int]:
    """Run the filter over a series; ``state`` is not modified.

    One call over a series and one call per epoch give the same numbers to the last bit.

    Parameters
    ----------
    motion, loss, recovery
        Model, robust loss, and when to believe what was rejected.
    epochs
        n observations.
    state
        From `start` or from an earlier call.
    until_recovery
        Stop after the first epoch at which a rejected group is believed.

    Returns
    -------
    state, filtered, done
        The state after the series, what was found at each epoch, and how many epochs were done
        (all of them, unless a recovery ended the call).
    """
    out = blank(motion, len(epochs.time))
    after = TrackState(
        state.time,
        state.mean.copy(),
        state.factor.copy(),
        state.settled.copy(),
        state.streak.copy(),
        state.since.copy(),
        state.recent.copy(),
        state.recent_time.copy(),
    )
    done = run(motion, loss, recovery, epochs, after, out, until_recovery)
    last = float(epochs.time[done - 1]) if done else state.time
    return after._replace(time=last), out, done
