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
    best_of,
    copy_hypothesis,
    keep_best,
    merge,
    report,
)
from surefix.filters.hypothesis_branches import (
    BRANCHES,
    CONFIRMED,
    position_branches,
    velocity_branches,
)
from surefix.filters.hypothesis_noise import adapt, innovate
from surefix.filters.records import Epochs, Motion
from surefix.filters.track_predict import VAGUE_RATE
from surefix.jit import helper, kernel
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["filter_hypotheses"]


@helper
def _apply_velocity(
    motion: Motion,
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
        bank.faulty[i] |= bit
        for a in range(d):
            if not math.isnan(z[d + a]):
                bank.slip[i, a] = z[d + a] - bank.mean[i, a, 1]
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


@helper
def _displace(motion: Motion, bank: Bank, jump: int) -> None:
    """Forget the positions, or the rates, that jump here by a decision made beforehand."""
    for i in range(bank.number[0]):
        for a in range(motion.axes):
            if (jump >> (motion.axes + a)) & 1:
                change_rate(bank.covariance[i, a], motion.order, 0.0, VAGUE_RATE)
            if (jump >> a) & 1:
                bank.seen[i, a] = False


@helper
def _commit_lasting(motion: Motion, prior: Prior, bank: Bank, time: float, said: IntArray) -> None:
    """Take the runs for true jumps that last too long, or longer than the track before them."""
    for i in range(bank.number[0]):
        if bank.run[i] < 0 or bank.length[i] < CONFIRMED:
            continue
        longest = min(prior.longest, bank.opened[i] - bank.began[i])
        if time - bank.opened[i] >= longest:
            for a in range(motion.axes):
                commit(bank.mean[i, a], bank.covariance[i, a], motion.order + 1)
            bank.run[i] = -1
            bank.began[i] = bank.opened[i]
            bank.missed[i] = 0
            said[i] |= COMMIT


@helper
def _close_ranks(
    motion: Motion, bank: Bank, keep: BoolArray, origin: IntArray, said: IntArray
) -> int:
    """Merge what is alike and close the gaps; gives how many hypotheses are left."""
    merge(motion, bank, bank.number[0], keep)
    left = 0
    for i in range(bank.number[0]):
        if not keep[i]:
            continue
        if left != i:
            copy_hypothesis(bank, left, bank, i, motion.axes, motion.order + 1)
            bank.weight[left] = bank.weight[i]
            origin[left] = origin[i]
            said[left] = said[i]
        left += 1
    return left


@helper
def _judge(
    motion: Motion, prior: Prior, bank: Bank, k: int, said: IntArray, fix: bool, out: Found
) -> int:
    """Probabilities of the components of epoch k, and what the best hypothesis says of runs.

    A jump is told with a ``fix``, of which the leading axis is seen, and not with a depth.
    """
    d = motion.axes
    for i in range(bank.number[0]):
        w = math.exp(bank.weight[i])
        running = said[i] & (OPEN | CONTINUE) and not said[i] & COMMIT
        position = w * POOR_WEIGHT if said[i] & POOR else w
        velocity = w * POOR_WEIGHT if said[i] & VELOCITY_POOR else w
        for a in range(d):
            if not (running or (said[i] >> a) & 1):
                out.weight[k, a] += position
            if not said[i] & VELOCITY_OUT:
                out.weight[k, d + a] += velocity
    best = best_of(bank.weight, bank.number[0])
    if said[best] & (OPEN | CONTINUE) and not said[best] & COMMIT:
        out.run[k] = bank.length[best]
        for a in range(d):
            out.offset[k, a] = bank.mean[best, a, motion.order]
    began = bank.began[best]
    if fix and not math.isnan(began):
        if began > bank.announced[0] + 0.5 * prior.longest:
            out.since[k] = began
        if not began <= bank.announced[0]:
            bank.announced[0] = began
    return best


@kernel
def _run(
    motion: Motion,
    prior: Prior,
    epochs: Epochs,
    one: Bank,
    two: Bank,
    found: Found,
    trail: Trail,
) -> int:
    """Loop of `filter_hypotheses`; gives how often the banks changed places."""
    d, n = motion.axes, motion.order + 1
    most, traced = one.weight.shape[0], trail.best.shape[0] > 0
    score = np.empty(most * BRANCHES)
    parent = np.empty(most * BRANCHES, np.int64)
    code = np.empty(most * BRANCHES, np.int64)
    chosen = np.empty(most, np.int64)
    origin, before = np.empty(most, np.int64), np.empty(most, np.int64)
    said, spoken = np.empty(most, np.int64), np.empty(most, np.int64)
    keep = np.empty(most, np.bool_)
    r, share = np.empty(2 * d), np.zeros(d)
    adapting = np.any(prior.adapt > 0.0)
    swaps = 0
    speed = prior.sigma_velocity
    time = one.time[0]
    if math.isnan(time):
        for a in range(d):
            for s in range(1, motion.order):
                one.covariance[0, a, s, s] = speed * speed
    for k in range(len(epochs.time)):
        dt = 0.0 if math.isnan(time) else epochs.time[k] - time
        time = epochs.time[k]
        sensor = epochs.sensor[k] if len(epochs.sensor) else 0
        z, forced = epochs.z[k], epochs.fixed[k]
        found.scale[k] = one.scale[sensor]
        for a in range(d):
            r[a] = epochs.variance[k, a] * one.scale[sensor]
            r[d + a] = epochs.variance[k, d + a]
        if epochs.jump[k]:
            _displace(motion, one, epochs.jump[k])
        for i in range(one.number[0]):
            origin[i], said[i] = i, 0
            if dt > 0.0:
                for a in range(d):
                    predict_axis(
                        one.mean[i, a], one.covariance[i, a], motion.order, dt, motion.density[a]
                    )
        innovate(motion, one, k, z, r, found, share)
        placed = moved = False
        for a in range(d):
            placed = placed or not math.isnan(z[a])
            moved = moved or not math.isnan(z[d + a])
        for stage in range(2):
            if stage == 0 and moved:
                total = velocity_branches(
                    motion, prior, one, z, r, forced, time, sensor, score, parent, code
                )
            elif stage == 1 and placed:
                total = position_branches(
                    motion, prior, one, z, r, forced, time, sensor, score, parent, code
                )
            else:
                continue
            before[:], spoken[:] = origin, said
            count, norm = keep_best(score, total, chosen, two.weight)
            found.evidence[k] += norm
            for i in range(count):
                p, what = parent[chosen[i]], code[chosen[i]]
                copy_hypothesis(two, i, one, p, d, n)
                origin[i] = before[p]
                said[i] = spoken[p] | what
                if stage == 1:
                    apply_position(motion, two, i, z, r, what, time, sensor, speed)
                else:
                    _apply_velocity(motion, two, i, z, r, what, time, sensor)
            one, two = two, one
            one.number[0] = count
            swaps += 1
        _commit_lasting(motion, prior, one, time, said)
        if one.number[0] > 1:
            one.number[0] = _close_ranks(motion, one, keep, origin, said)
        best = _judge(motion, prior, one, k, said, not math.isnan(z[0]), found)
        if adapting:
            adapt(motion, prior, one, k, sensor, share, found)
        if traced:
            trail.best[k] = best
            for i in range(one.number[0]):
                trail.parent[k, i] = origin[i]
                trail.code[k, i] = said[i]
        report(motion, one, said, best, k, found)
    one.time[0] = time
    return swaps


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
    one = _copied(bank)
    shared = {name: getattr(one, name) for name in ("time", "number", "scale", "announced")}
    two = _copied(bank)._replace(**shared)
    found = _blank(motion, n)
    rows = n if traced else 0
    trail = Trail(
        np.zeros((rows, most), np.int8), np.zeros((rows, most), np.uint16), np.zeros(rows, np.int8)
    )
    swaps = _run(motion, prior, epochs, one, two, found, trail)
    return (two if swaps % 2 else one), found, trail


def _copied(bank: Bank) -> Bank:
    return Bank._make(field.copy() for field in bank)


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
        np.ones(n),
    )
