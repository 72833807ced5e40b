"""The multi-hypothesis robust filter: several accounts of the past, weighed by the data.

A gross error, a run of fixes with a common offset and a true jump look alike for a while. A filter
that must guess at once either locks itself out or follows. This one keeps several hypotheses: that
a fix belongs to the track, that it is wrong by itself (on all or some of its axes), that it opens,
continues or ends a run of its sensor with a common offset. Each is a Kalman filter of its own, and
its probability follows from how well it predicts. A run that lasts longer than ``Prior.longest``
is a true jump, dated back to its first fix.

The output is the mean and the covariance of the mixture, so that doubt is part of σ.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import (
    COMMIT,
    CONTINUE,
    MANOEUVRE,
    OPEN,
    POOR,
    POOR_WEIGHT,
    VELOCITY_OUT,
    VELOCITY_POOR,
    WALK,
    Bank,
    Found,
    Prior,
    Trail,
)
from surefix.filters.hypothesis_axis import (
    HASTE,
    agility,
    change_rate,
    commit,
    predict_axis,
    reach,
    update_axis,
)
from surefix.filters.hypothesis_bank import (
    apply_position,
    give_rows,
    keep_best,
    merge,
    report,
)
from surefix.filters.hypothesis_branches import (
    CONFIRMED,
    position_branches,
    velocity_branches,
)
from surefix.filters.hypothesis_density import best_of
from surefix.filters.hypothesis_drags import cap_drags, keep_drags, predict_drag, startles
from surefix.filters.hypothesis_manoeuvres import learn_slip
from surefix.filters.hypothesis_noise import adapt, innovate
from surefix.filters.hypothesis_scratch import Scratch, rows_of, scratch_for
from surefix.filters.records import Epochs, Motion
from surefix.filters.track_predict import VAGUE_RATE
from surefix.jit import inner, lean_helper, lean_kernel
from surefix.types import FloatArray, IntArray

__all__ = ["filter_hypotheses"]

_WHOLE = {"time", "number", "weight", "scale", "announced", "startled", "heard"}
_BY_ROW = tuple(set(Bank._fields) - _WHOLE)


@inner
def _apply_velocity(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    i: int,
    z: FloatArray,
    r: FloatArray,
    code: int,
    time: float,
    sensor: int,
) -> None:
    """Do to hypothesis i what its candidate said."""
    d, bit = motion.axes, 1 << sensor
    if code & VELOCITY_OUT:
        learn_slip(motion, prior, bank, i, z, r, time, sensor)
        bank.faulty[i] |= bit
        return
    bank.faulty[i] &= ~bit
    weight = POOR_WEIGHT if code & VELOCITY_POOR else 1.0
    for a in range(d):
        if not math.isnan(z[d + a]):
            m, P = bank.mean[i, a], bank.covariance[i, a]
            nu = z[d + a] - m[1]
            gap = time - bank.touched[i, a]
            bank.touched[i, a] = time
            if code & MANOEUVRE and gap > 0.0:
                rate = abs(nu) / reach(motion.order, 1, gap)
                rate = max(agility(motion.density[a], gap), HASTE * rate)
                change_rate(P, motion.order, gap, rate)
            update_axis(m, P, motion.order + 1, 1, False, nu, r[d + a] / weight)
    bank.moved[i] = time


@lean_helper
def _displace(motion: Motion, bank: Bank, place: IntArray, jump: int) -> None:
    """Forget the positions, or the rates, that jump here by a decision made beforehand."""
    for i in place[: bank.number[0]]:
        for a in range(motion.axes):
            if (jump >> (motion.axes + a)) & 1:
                change_rate(bank.covariance[i, a], motion.order, 0.0, VAGUE_RATE)
            if (jump >> a) & 1:
                bank.seen[i, a] = False


@lean_helper
def _commit_lasting(
    motion: Motion, prior: Prior, bank: Bank, place: IntArray, time: float, said: IntArray
) -> None:
    """Take the runs for true jumps that last too long, or longer than the track before them."""
    for i in range(bank.number[0]):
        k = place[i]
        if bank.run[k] < 0 or bank.length[k] < CONFIRMED or bank.walks[k]:
            continue
        longest = min(prior.longest, bank.opened[k] - bank.began[k])
        if time - bank.opened[k] >= longest:
            for a in range(motion.axes):
                commit(bank.mean[k, a], bank.covariance[k, a], motion.order + 1)
                bank.missed[k, a] = 0
            bank.run[k] = -1
            bank.began[k] = bank.opened[k]
            said[i] |= COMMIT


@inner
def _close_ranks(
    motion: Motion, bank: Bank, place: IntArray, work: Scratch, origin: IntArray, said: IntArray
) -> None:
    """Merge what is alike and close the gaps."""
    merge(motion, bank, place, work)
    left = 0
    for i in range(bank.number[0]):
        if not work.keep[i]:
            continue
        place[left], place[i] = place[i], place[left]
        bank.weight[left] = bank.weight[i]
        origin[left] = origin[i]
        said[left] = said[i]
        left += 1
    bank.number[0] = left


@inner
def _judge(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    place: IntArray,
    k: int,
    said: IntArray,
    fix: bool,
    share: FloatArray,
    out: Found,
) -> int:
    """Probabilities of the components of epoch k, and what the best hypothesis says of runs.

    A jump is told with a ``fix``, of which the leading axis is seen, and not with a depth.
    ``share`` becomes the probabilities of the hypotheses.
    """
    d = motion.axes
    for i in range(bank.number[0]):
        w = math.exp(bank.weight[i])
        share[i] = w
        running = said[i] & (OPEN | CONTINUE) and not said[i] & COMMIT
        position = w * POOR_WEIGHT if said[i] & POOR else w
        velocity = w * POOR_WEIGHT if said[i] & VELOCITY_POOR else w
        for a in range(d):
            if not (running or (said[i] >> a) & 1):
                out.weight[k, a] += position
            if not said[i] & VELOCITY_OUT:
                out.weight[k, d + a] += velocity
    best = best_of(bank.weight, bank.number[0])
    row = place[best]
    out.drag[k] = said[best] & WALK != 0
    if said[best] & (OPEN | CONTINUE | WALK) and not said[best] & COMMIT:
        out.run[k] = bank.length[row]
        for a in range(d):
            out.offset[k, a] = bank.mean[row, a, motion.order]
    began = bank.began[row]
    if fix and not math.isnan(began):
        if began > bank.announced[0] + 0.5 * prior.longest:
            out.since[k] = began
        if not began <= bank.announced[0]:
            bank.announced[0] = began
    return best


@lean_kernel
def _run(
    motion: Motion,
    prior: Prior,
    epochs: Epochs,
    bank: Bank,
    place: IntArray,
    work: Scratch,
    adapting: bool,
    found: Found,
    trail: Trail,
) -> None:
    """Loop of `filter_hypotheses`: predict, weigh velocity and position, merge, report.

    The i-th hypothesis, best first, is in row ``place[i]`` of the bank, but for its weight, which
    is the i-th: what a hypothesis knows is moved only where several come from it.
    """
    d, r, said = motion.axes, work.r, work.said
    speed = prior.sigma_velocity
    if math.isnan(bank.time[0]):
        for a in range(d):
            for s in range(1, motion.order):
                bank.covariance[place[0], a, s, s] = speed * speed
    for k in range(len(epochs.time)):
        time = epochs.time[k]
        dt = 0.0 if math.isnan(bank.time[0]) else time - bank.time[0]
        sensor = epochs.sensor[k] if len(epochs.sensor) else 0
        z, forced = epochs.z[k], epochs.fixed[k]
        found.scale[k] = bank.scale[sensor]
        placed = moved = False
        for a in range(d):
            r[a] = epochs.variance[k, a] * bank.scale[sensor]
            r[d + a] = epochs.variance[k, d + a]
            placed = placed or not math.isnan(z[a])
            moved = moved or not math.isnan(z[d + a])
        if epochs.jump[k]:
            _displace(motion, bank, place, epochs.jump[k])
        for i in range(bank.number[0]):
            work.origin[i], said[i] = i, 0
            if dt > 0.0:
                for a in range(d):
                    m, P = bank.mean[place[i], a], bank.covariance[place[i], a]
                    predict_axis(m, P, motion.order, dt, motion.density[a])
                    if (bank.walks[place[i]] >> a) & 1:
                        drift = bank.drift[place[i], a]
                        predict_drag(m, P, drift, motion.order, dt, prior.longest)
        innovate(motion, bank, place, k, z, r, found, work.noise)
        if moved and startles(motion, found.standardised[k]):
            bank.startled[0] = time
        for stage in range(2):
            if stage == 0 and moved:
                total = velocity_branches(
                    motion,
                    prior,
                    bank,
                    place,
                    z,
                    r,
                    forced,
                    time,
                    sensor,
                    work.score,
                    work.parent,
                    work.code,
                )
            elif stage == 1 and placed:
                total = position_branches(
                    motion,
                    prior,
                    bank,
                    place,
                    z,
                    r,
                    forced,
                    time,
                    sensor,
                    work.score,
                    work.parent,
                    work.code,
                    work.parts,
                )
            else:
                continue
            if stage == 1 and prior.drag > 0.0:
                cap_drags(prior, bank, place, work.score, work.parent, work.code, total)
            count, norm = keep_best(work.score, total, work.chosen, bank.weight)
            found.evidence[k] += norm
            if prior.drag > 0.0:
                count = keep_drags(
                    bank,
                    place,
                    work.score,
                    work.parent,
                    work.code,
                    total,
                    sensor,
                    work.chosen,
                    count,
                    bank.weight,
                    work.claims,
                )
            for i in range(bank.number[0]):
                work.before[i], work.spoken[i] = work.origin[i], said[i]
            give_rows(
                bank, place, work.parent, work.chosen, count, work.claims, work.spare, work.row
            )
            for i in range(count):
                p, what = work.parent[work.chosen[i]], work.code[work.chosen[i]]
                work.origin[i] = work.before[p]
                said[i] = work.spoken[p] | what
                if stage == 1:
                    apply_position(motion, prior, bank, place[i], z, r, what, time, sensor, speed)
                else:
                    _apply_velocity(motion, prior, bank, place[i], z, r, what, time, sensor)
        _commit_lasting(motion, prior, bank, place, time, said)
        if bank.number[0] > 1:
            _close_ranks(motion, bank, place, work, work.origin, said)
        fix = not math.isnan(z[0])
        best = _judge(motion, prior, bank, place, k, said, fix, work.share, found)
        if adapting:
            adapt(motion, prior, bank, k, sensor, work.noise, found)
        if len(trail.best):
            trail.best[k] = best
            begin = trail.first[k]
            for i in range(bank.number[0]):
                trail.parent[begin + i] = work.origin[i]
                trail.code[begin + i] = said[i]
            trail.first[k + 1] = begin + bank.number[0]
        report(motion, bank, place, work.share, said, best, k, found)
        for c in range(2 * d):
            if not math.isnan(z[c]):
                bank.heard[sensor, c] = time
        bank.time[0] = time


def filter_hypotheses(
    motion: Motion, prior: Prior, epochs: Epochs, bank: Bank, *, traced: bool = True
) -> tuple[Bank, Found, Trail]:
    """Run the filter over a series; ``bank`` is not modified.

    One call over a series and one call per epoch give the same numbers to the last bit.

    Parameters
    ----------
    motion, prior
        Model, whose groups are single components, and what is supposed.
    epochs
        n observations; weights and jumps that they fix beforehand stay.
    bank
        From `no_hypotheses` or from an earlier call.
    traced
        Whether to keep the trail.

    Returns
    -------
    bank, found, trail
        The hypotheses after the series, what their mixture says, and how they came about.
    """
    n, most = len(epochs.time), len(bank.weight)
    epochs = Epochs._make(np.ascontiguousarray(field) for field in epochs)  # one compiled form
    after = Bank._make(field.copy() for field in bank)
    place = rows_of(most)
    found = _blank(motion, n)
    rows = n if traced else 0
    trail = Trail(  # room for all, of which only what is written takes memory
        np.empty(rows * most, np.uint8),
        np.empty(rows * most, np.uint16),
        np.zeros(rows + 1, np.int64),
        np.zeros(rows, np.uint8),
    )
    adapting = bool(np.any(prior.adapt > 0.0))
    work = scratch_for(motion.axes, most)
    _run(motion, prior, epochs, after, place, work, adapting, found, trail)
    moved = {name: getattr(after, name)[place] for name in _BY_ROW}
    end = trail.first[-1]
    trail = trail._replace(parent=trail.parent[:end], code=trail.code[:end])
    return after._replace(**moved), found, trail


def _blank(motion: Motion, n: int) -> Found:
    states, m = motion.order * motion.axes, 2 * motion.axes
    return Found(
        np.full((n, states), np.nan),
        np.full((n, states), np.nan),
        np.full((n, m), np.nan),
        np.full((n, m), np.nan),
        np.zeros(n),
        np.zeros(n, np.int64),
        np.full(n, np.nan),
        np.full((n, motion.axes), np.nan),
        np.zeros(n, np.bool_),
        np.ones(n),
    )
