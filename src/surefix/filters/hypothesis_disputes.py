"""Settle what cannot be judged one by one: observations that vouch for each other.

Velocities that are off alike do, on which the forward and the backward filter disagree; so do a few
fixes amid rows of wrong ones that happen to agree. None of them is off by what the others say. So
they are judged together: by which account makes all that was observed about them likelier.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import Prior
from surefix.filters.hypothesis_branches import ROW
from surefix.filters.hypothesis_density import log_wild
from surefix.filters.hypothesis_evidence import evidence
from surefix.filters.hypothesis_review import deleted_residuals
from surefix.filters.hypothesis_trail import Decisions
from surefix.filters.modes import rows_of
from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.rts import smooth
from surefix.filters.track import filter_track, start
from surefix.robust.loss import loss_named
from surefix.types import BoolArray, IntArray

__all__ = ["settle_fixes", "settle_velocities"]

_FEWEST = 2  # on end; a single one is judged by the others


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
            wrong, good = (_likely(motion, prior, epochs, out, rows, w) for w in (0.0, 1.0))
            out[rows] = wrong > good
    return out


def _likely(
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
    return evidence(motion, prior, part)


def settle_fixes(
    motion: Motion, prior: Prior, epochs: Epochs, said: Decisions, recovery: Recovery
) -> BoolArray:
    """Decide together on the few fixes that are used amid rows of wrong ones.

    They are no more than the wrong ones on either side, of which there are at least as many as make
    a row. All of them belong to the track, or one does, or none.

    Parameters
    ----------
    motion, prior, epochs
        As for the filter.
    said
        What is decided so far of each epoch; not modified.
    recovery
        Of the filter that follows decisions.

    Returns
    -------
    out
        (n,) fixes that are wrong after all.
    """
    d = motion.axes
    placed = np.asarray(np.isfinite(epochs.z[:, :d]).any(axis=1) & (said.run == 0))
    used = (said.fixed[:, :d] > 0.0) & np.isfinite(epochs.z[:, :d])
    wrong = np.asarray(placed & ~used.any(axis=1))
    free = np.asarray(np.isnan(epochs.fixed[:, :d]).all(axis=1))
    out = np.zeros(len(wrong), np.bool_)
    sensor = epochs.sensor if len(epochs.sensor) else np.zeros(len(out), np.int64)
    for own in np.unique(sensor[wrong]):
        mine = np.flatnonzero(placed & (sensor == own))
        bounds = np.flatnonzero(np.diff(wrong[mine])) + 1
        parts = np.split(mine, bounds)
        for before, rows, after in zip(parts, parts[1:], parts[2:], strict=False):
            least = max(ROW, len(rows))
            amid = wrong[before[0]] and min(len(before), len(after)) >= least
            if not amid or len(rows) < _FEWEST or not free[rows].all():
                continue
            chain = np.concatenate([before[-ROW:], rows, after[:ROW]])
            accounts = [rows, rows[:0], *rows[:, None]]
            likely = [_account(motion, prior, epochs, said, recovery, chain, a) for a in accounts]
            out[np.setdiff1d(rows, accounts[int(np.argmax(likely))])] = True
    return out


def _account(
    motion: Motion,
    prior: Prior,
    epochs: Epochs,
    said: Decisions,
    recovery: Recovery,
    chain: IntArray,
    good: IntArray,
) -> float:
    """Log-probability of the fixes of ``chain``, if those within it but ``good`` are wrong."""
    d, time, apart = motion.axes, epochs.time, prior.longest
    first = int(np.searchsorted(time, time[chain[0]] - apart))
    until = int(np.searchsorted(time, time[chain[-1]] + apart, side="right"))
    rows = chain[ROW:-ROW]
    bad = np.setdiff1d(rows, good)
    fixed = said.fixed.copy()
    fixed[bad, :d] = 0.0
    part = rows_of(epochs._replace(fixed=fixed, jump=said.jump), first, until)
    begin = start(motion, recovery)
    _, found, _ = filter_track(motion, loss_named("kalman"), recovery, part, begin)
    used = (part.fixed > 0.0) & np.isfinite(found.nis)
    total = -0.5 * float((found.nis + found.logdet + math.log(2.0 * math.pi))[used].sum())
    if len(bad):
        smoothed = smooth(motion, recovery, part.time, found)
        residual, S = deleted_residuals(motion, part, found.weight, smoothed)
        for k in bad - first:
            seen = np.isfinite(residual[k, :d])
            wide = prior.spread[:d][seen] ** 2 + S[k, :d][seen]
            square = float((residual[k, :d][seen] ** 2 / wide).sum())
            total += log_wild(square, 0.5 * float(np.log(wide).sum()), int(seen.sum()))
    wrong = np.isin(chain, good, invert=True)
    for i in range(ROW, len(chain)):
        likely = prior.row if wrong[i - ROW : i].all() else prior.isolated
        total += math.log(likely if wrong[i] else 1.0 - likely)
    return total
