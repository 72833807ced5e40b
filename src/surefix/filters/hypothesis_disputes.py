"""Settle what the forward and the backward filter disagree on: rows of velocities.

Velocities that are off alike vouch for each other: none of them is off by what the others say. So
they are judged together: by which of the two accounts makes all that was observed about them
likelier.
"""

from __future__ import annotations

import numpy as np

from surefix.filters.hypotheses import Prior, no_hypotheses
from surefix.filters.modes import rows_of
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.records import Epochs, Motion
from surefix.types import BoolArray, IntArray

__all__ = ["settle_velocities"]

_FEWEST = 2  # velocities on end; a single one is judged by the others
_BRIEFLY = 16  # hypotheses kept


def settle_velocities(
    motion: Motion, prior: Prior, epochs: Epochs, ahead: BoolArray, back: BoolArray
) -> BoolArray:
    """Decide together on velocities of a sensor on end that only one direction leaves out.

    Parameters
    ----------
    motion, prior, epochs
        As for the filter.
    ahead, back
        (n,) velocities that each direction leaves out.

    Returns
    -------
    out
        (n,) those that are out for good: both directions say so, or the likelier account. Others in
        dispute are judged one by one: fixes may have been doubted for their sake.
    """
    moving = np.isfinite(epochs.z[:, motion.axes :]).any(axis=1)
    out = ahead & back & moving
    sensor = epochs.sensor if len(epochs.sensor) else np.zeros(len(ahead), np.int64)
    for own in np.unique(sensor[(ahead ^ back) & moving]):
        mine = np.flatnonzero(moving & (sensor == own))
        edges = np.diff((ahead ^ back)[mine].astype(np.int64), prepend=0, append=0)
        for first, end in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
            rows = mine[first:end]
            if end - first < _FEWEST:
                continue
            wrong, good = (_evidence(motion, prior, epochs, out, rows, w) for w in (0.0, 1.0))
            out[rows] = wrong > good
    return out


def _evidence(
    motion: Motion, prior: Prior, epochs: Epochs, out: BoolArray, rows: IntArray, weight: float
) -> float:
    """Log-likelihood of what was observed about some velocities if they have a weight, 0 or 1."""
    time, apart = epochs.time, prior.longest
    first = int(np.searchsorted(time, time[rows[0]] - apart))
    until = int(np.searchsorted(time, time[rows[-1]] + apart, side="right"))
    fixed = epochs.fixed[first:until].copy()
    said = np.where(out[first:until], 0.0, 1.0)
    said[rows - first] = weight
    free = np.isnan(fixed[:, motion.axes :])
    fixed[:, motion.axes :] = np.where(free, said[:, None], fixed[:, motion.axes :])
    part = rows_of(epochs, first, until)._replace(fixed=fixed)
    bank = no_hypotheses(motion, _BRIEFLY)
    _, found, _ = filter_hypotheses(motion, prior, part, bank, traced=False)
    return float(found.evidence.sum())
