"""The three modes of the multi-hypothesis filter: real time, fixed lag, offline.

Real time gives the mixture of all hypotheses. With a lag each epoch follows the account of the past
that is likeliest when its window ends, and is smoothed over the window. Offline the filter runs
forward and backward; what either doubts is left out at first and comes back if all others agree.
"""

from __future__ import annotations

import numpy as np

from surefix.filters.hypotheses import MOST, Bank, Prior, no_hypotheses
from surefix.filters.hypothesis_disputes import settle_fixes, settle_velocities
from surefix.filters.hypothesis_lag import (
    filter_decided,
    not_followed,
    smooth_windows,
)
from surefix.filters.hypothesis_review import deleted_residuals, review
from surefix.filters.hypothesis_trail import (
    DRAGGED,
    Decisions,
    decide,
    follow,
    runs,
    undecided,
)
from surefix.filters.modes import (
    from_filtered,
    rows_of,
)
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.offline import backward, needed_jumps
from surefix.filters.records import Epochs, Estimate, Filtered, Motion, Recovery, TrackState
from surefix.filters.rts import Smoothed, smooth
from surefix.filters.track import blank, filter_track, start
from surefix.robust.loss import loss_named
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["decide_offline", "lagged_hypotheses", "offline_hypotheses", "realtime_hypotheses"]

_SWEEPS = 6
_DENIED = 2  # times that a review sends away what another called back, until it stays out


def realtime_hypotheses(
    motion: Motion, prior: Prior, epochs: Epochs, bank: Bank
) -> tuple[Bank, Estimate]:
    """Estimate every epoch from the past and itself alone; takes and gives the hypotheses."""
    after, found, _ = filter_hypotheses(motion, prior, epochs, bank, traced=False)
    known = np.isfinite(found.weight)
    standardised = np.where(known, found.standardised, np.nan)
    since = np.full((len(epochs.time), motion.groups), np.nan)
    since[:, : motion.axes] = found.since[:, None]
    jump = np.where(np.isfinite(found.since), (1 << motion.axes) - 1, 0)
    return after, Estimate(
        found.mean,
        np.where(np.isnan(found.sigma), np.inf, found.sigma),
        found.weight,
        np.abs(standardised),
        standardised,
        jump,
        since,
        found.run,
        found.offset,
        found.drag,
        found.scale,
    )


def lagged_hypotheses(
    motion: Motion,
    prior: Prior,
    epochs: Epochs,
    lag: float,
    wanted: BoolArray,
    most: int = MOST,
) -> Estimate:
    """Estimate every epoch from the past and the ``lag`` seconds that follow it.

    Parameters
    ----------
    motion, prior, epochs
        As for the filter.
    lag
        Seconds ≥ 0.
    wanted
        (n,) epochs that are smoothed; the others keep the filter's estimate.
    most
        Hypotheses kept.
    """
    time, n, states = epochs.time, len(epochs.time), motion.order * motion.axes
    _, _, trail = filter_hypotheses(motion, prior, epochs, no_hypotheses(motion, most))
    last = np.searchsorted(time, time + lag, side="right") - 1
    kept, said = not_followed(motion, n), undecided(motion, n)
    mean, sigma = np.empty((n, states)), np.empty((n, states))
    seen, head, done = np.isfinite(epochs.z), 0, 0
    while head < n:
        slot = int(trail.best[head - 1]) if head else 0
        until = follow(motion, trail, head, slot, said)
        filter_decided(motion, prior.sigma_velocity, epochs, said, head, until, kept)
        ready = max(int(np.searchsorted(last, until)), done) if until < n else n
        smooth_windows(motion, time, said.jump, kept, last, wanted, done, ready, mean, sigma)
        if until == n:
            break
        done = ready
        first = min(decide(motion, seen, trail, until, done, said), until)
        head = until + 1
        filter_decided(motion, prior.sigma_velocity, epochs, said, first, head, kept)
        if head == n:
            smooth_windows(motion, time, said.jump, kept, last, wanted, done, n, mean, sigma)
    standardised = np.where(seen, kept.standardised, np.nan)
    del trail, kept, last  # what is made now is as large
    return _named(motion, epochs, said, _lagged(motion, said, seen, standardised, mean, sigma))


def _lagged(
    motion: Motion,
    said: Decisions,
    seen: BoolArray,
    standardised: FloatArray,
    mean: FloatArray,
    sigma: FloatArray,
) -> Estimate:
    """Read what was followed as an estimate, the jumps and runs not yet named."""
    n = len(mean)
    return Estimate(
        mean,
        sigma,
        np.where(seen, said.fixed, np.nan),
        np.abs(standardised),
        standardised,
        said.jump,
        np.full((n, motion.groups), np.nan),
        said.run,
        np.full((n, motion.axes), np.nan),
        said.run == DRAGGED,
        np.ones(n),
    )


def offline_hypotheses(motion: Motion, prior: Prior, epochs: Epochs) -> Estimate:
    """Estimate every epoch from the whole series.

    Parameters
    ----------
    motion, prior, epochs
        As for the filter; weights that ``epochs`` fixes beforehand stay.

    Returns
    -------
    Estimate
        ``distance`` and ``standardised`` are deleted residuals; ``since`` marks the jumps.
    """
    if not len(epochs.time):
        return from_filtered(blank(motion, 0))
    said, weight, smoothed = decide_offline(motion, prior, epochs)
    residual, variance = deleted_residuals(motion, epochs, weight, smoothed)
    residual /= np.sqrt(variance)
    whole = Estimate(
        smoothed.mean,
        np.sqrt(np.maximum(np.einsum("kii->ki", smoothed.covariance), 0.0)),
        weight,
        np.abs(residual),
        residual,
        said.jump,
        np.full((len(weight), motion.groups), np.nan),
        said.run,
        np.full((len(weight), motion.axes), np.nan),
        said.run == DRAGGED,
        np.ones(len(weight)),
    )
    del smoothed, variance
    return _named(motion, epochs, said, whole)


def decide_offline(
    motion: Motion, prior: Prior, epochs: Epochs
) -> tuple[Decisions, FloatArray, Smoothed]:
    """Decide what belongs to the track by the whole series, and filter and smooth it.

    Parameters
    ----------
    motion, prior, epochs
        As for the filter; at least one epoch.

    Returns
    -------
    said, weight, smoothed
        The decisions, (n, m) with what weight each component was used, and the smoothed states.
    """
    recovery, n = _steady(prior), len(epochs.time)
    said, locked = _in_both_directions(motion, prior, epochs)
    back, denied = np.zeros_like(said.fixed, dtype=np.bool_), np.zeros_like(said.fixed)
    for left in reversed(range(_SWEEPS)):
        _, filtered, _ = _filter(motion, recovery, epochs, said, 0, n, start(motion, recovery))
        smoothed = smooth(motion, recovery, epochs.time, filtered, in_place=True)
        weight = filtered.weight
        del filtered
        jump = needed_jumps(motion, epochs, said.jump, smoothed)
        fixed = review(motion, prior, epochs, said.fixed, smoothed, locked)
        amid = settle_fixes(motion, prior, epochs, said._replace(fixed=fixed, jump=jump), recovery)
        fixed[amid, : motion.axes] = 0.0
        locked[:, 0] |= amid
        if np.array_equal(fixed, said.fixed) and np.array_equal(jump, said.jump):
            break
        if left:
            denied += back & (said.fixed > 0.0) & (fixed == 0.0)  # called back on and on …
            back |= (said.fixed == 0.0) & (fixed > 0.0)
            for part, axes in enumerate((slice(motion.axes), slice(motion.axes, None))):
                gone = (denied[:, axes] >= _DENIED).any(axis=1)
                locked[:, part] |= gone  # … and denied: it stays out
            said = Decisions(fixed, _at_fixes(motion, epochs, jump, fixed), said.run)
            del weight, smoothed  # their memory is for the next
    return said, weight, smoothed


def _in_both_directions(
    motion: Motion, prior: Prior, epochs: Epochs
) -> tuple[Decisions, BoolArray]:
    """What both directions agree on, and (n, 2) whose position, and whose velocity, stays out."""
    ahead, evidence = _decided(motion, prior, epochs)
    turned, reverse = _decided(motion, prior, backward(motion, epochs))
    back = Decisions(turned.fixed[::-1], turned.jump[::-1], turned.run[::-1])
    jump = _in_both(epochs.time, ahead.jump, back.jump, prior.longest)
    ahead, back = _settled(epochs.time, ahead, back, evidence - reverse[::-1], prior.longest)
    d = motion.axes
    slips = ahead.fixed[:, d] == 0.0, back.fixed[:, d] == 0.0
    slipped = settle_velocities(motion, prior, epochs, *slips)
    said = Decisions(np.minimum(ahead.fixed, back.fixed), jump, ahead.run & back.run)
    return said, np.column_stack([said.run > 0, slipped])


def _at_fixes(motion: Motion, epochs: Epochs, jump: IntArray, fixed: FloatArray) -> IntArray:
    """Jumps of positions put to the next fix that is used: between, the track before it goes on."""
    moved = jump & ~((1 << motion.axes) - 1)
    for a in range(motion.axes):
        used = np.flatnonzero(np.isfinite(epochs.z[:, a]) & (fixed[:, a] > 0.0))
        if not len(used):
            continue
        for k in np.flatnonzero((jump >> a) & 1):
            later = np.searchsorted(used, k)
            moved[used[later] if later < len(used) else k] |= 1 << a
    return moved


def _steady(prior: Prior) -> Recovery:
    """The filter that follows decisions: it never recovers by itself."""
    return Recovery(np.inf, prior.sigma_velocity, keeps_rate=True)


def _filter(
    motion: Motion,
    recovery: Recovery,
    epochs: Epochs,
    said: Decisions,
    first: int,
    until: int,
    state: TrackState,
) -> tuple[TrackState, Filtered, int]:
    """Filter the epochs ``first`` … ``until`` − 1 as decided."""
    decided = epochs._replace(fixed=said.fixed, jump=said.jump)
    return filter_track(
        motion, loss_named("kalman"), recovery, rows_of(decided, first, until), state
    )


def _decided(motion: Motion, prior: Prior, epochs: Epochs) -> tuple[Decisions, FloatArray]:
    """What the likeliest hypothesis at the end of the series says of all of it, and the evidence.

    That is how likely all hypotheses together made each epoch.
    """
    _, found, trail = filter_hypotheses(motion, prior, epochs, no_hypotheses(motion))
    said = undecided(motion, len(epochs.time))
    decide(motion, np.isfinite(epochs.z), trail, len(epochs.time) - 1, 0, said)
    return said, found.evidence


def _settled(
    time: FloatArray, ahead: Decisions, back: Decisions, better: FloatArray, margin: float
) -> tuple[Decisions, Decisions]:
    """Let the direction that has the likelier account decide where both differ about a drag.

    Parameters
    ----------
    better
        (n,) by how much the evidence of each epoch is greater ahead.
    margin
        What lies so close about a drag belongs to it, s.
    """
    either = (ahead.run == DRAGGED) | (back.run == DRAGGED)
    rows = np.flatnonzero(either)
    cuts = np.flatnonzero(np.diff(time[rows]) > 2.0 * margin) + 1
    for part in np.split(rows, cuts) if len(rows) else []:
        both = ((ahead.run[part] == DRAGGED) & (back.run[part] == DRAGGED)).sum()
        if 2 * both > len(part):
            continue
        first = int(np.searchsorted(time, time[part[0]] - margin))
        last = int(np.searchsorted(time, time[part[-1]] + margin, side="right"))
        here = slice(first, last)
        one, other = (ahead, back) if better[here].sum() >= 0.0 else (back, ahead)
        for field, loser in zip(one[::2], other[::2], strict=True):
            loser[here] = field[here]
    return ahead, back


def _in_both(time: FloatArray, ahead: IntArray, back: IntArray, apart: float) -> IntArray:
    """Jumps that both directions see, where the forward one dates them.

    One that only one direction sees belongs to a run at an end of the log, which is too short to be
    believed against the rest.
    """
    jump = np.zeros_like(ahead)
    for bit in range(int(np.bitwise_or.reduce(ahead, initial=0)).bit_length()):
        told = np.flatnonzero((back >> bit) & 1)
        known = time[np.minimum(told + 1, len(time) - 1)]
        for k in np.flatnonzero((ahead >> bit) & 1):
            if len(known) and np.abs(known - time[k]).min() <= apart:
                jump[k] |= 1 << bit
    return jump


def _named(motion: Motion, epochs: Epochs, said: Decisions, whole: Estimate) -> Estimate:
    """Add when jumps happened, how long the runs were, and how far off in the mean."""
    seen = np.isfinite(epochs.z[:, : motion.axes])
    used = np.where(seen, said.fixed[:, : motion.axes], np.nan)
    bits = ((said.jump[:, None] >> np.arange(motion.groups)) & 1).astype(np.bool_)
    since = _with_fixes(np.where(bits, epochs.time[:, None], np.nan), seen[:, 0])
    length, run = _runs(np.where(seen.any(axis=1), said.run, 0), used, epochs.sensor)
    off = epochs.z[:, : motion.axes] - whole.mean[:, : motion.axes]
    if motion.period > 0.0:
        off -= motion.period * np.rint(off / motion.period)
    offset = np.full_like(off, np.nan)
    for a in range(motion.axes):
        known = (run >= 0) & seen[:, a]
        total = np.bincount(run[known], off[known, a], minlength=len(run))
        count = np.bincount(run[known], minlength=len(run))
        inside = known & (count[run] > 0)
        offset[inside, a] = total[run[inside]] / count[run[inside]]
    drag = said.run == DRAGGED
    offset[drag] = off[drag]
    return whole._replace(jump=said.jump, since=since, run=length, offset=offset, drag=drag)


def _with_fixes(since: FloatArray, fix: BoolArray) -> FloatArray:
    """Let a jump that was found with a depth or a velocity be told with the next fix."""
    fixes = np.flatnonzero(fix)
    for k in np.flatnonzero(np.isfinite(since).any(axis=1) & ~fix):
        after = fixes[np.searchsorted(fixes, k) :][:1]
        since[after] = np.fmin(since[after], since[k])
        since[k] = np.where(len(after), np.nan, since[k])
    return since


def _runs(run: IntArray, used: FloatArray, sensor: IntArray) -> tuple[IntArray, IntArray]:
    """Length and number of the runs sensor by sensor: another one does not end a run."""
    if not len(sensor):
        return runs(run, used)
    length, number = np.zeros_like(run), np.full_like(run, -1)
    for own in np.unique(sensor[run > 0]):
        mine = np.flatnonzero(sensor == own)
        length[mine], told = runs(run[mine], used[mine])
        number[mine[told >= 0]] = told[told >= 0] + number.max() + 1
    return length, number
