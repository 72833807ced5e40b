"""Kernels on the bank of hypotheses: choose, copy, apply, merge, and report the mixture."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import (
    COMMIT,
    CONTINUE,
    DENY,
    DROP,
    MANOEUVRE,
    OPEN,
    POOR,
    POOR_WEIGHT,
    RESTART,
    RESTARTS,
    WALK,
    Bank,
    Found,
    Prior,
)
from surefix.filters.hypothesis_axis import (
    HASTE,
    agility,
    begin_anew,
    change_rate,
    commit,
    forget,
    open_run,
    reach,
    update_axis,
)
from surefix.filters.hypothesis_density import log_sum, wrapped
from surefix.filters.hypothesis_drags import CERTAIN, drag_axis, make_certain
from surefix.filters.hypothesis_scratch import Scratch
from surefix.filters.records import Motion
from surefix.jit import inner, lean_helper
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["apply_position", "give_rows", "keep_best", "merge", "report"]

_FAR = 10.0  # nats below the best at which a hypothesis is dropped
_NOUGHT = -37.0  # nats: what is less likely than the best by that adds nothing to a sum
_AXES = 7  # bits of a code
_ALIKE = 0.01  # squared distance in standard deviations below which two hypotheses are one
_NARROW, _WIDE = 0.95, 1.05  # factors between which their variances are the same
_SURELY = 1.0 + 1e-9  # what is larger by that is so after any rounding


@inner
def _copy(bank: Bank, to: int, k: int, d: int, n: int) -> None:
    """Copy what row k of the bank holds to another row; the weight is left."""
    for a in range(d):
        for j in range(n):
            bank.mean[to, a, j] = bank.mean[k, a, j]
            for l in range(n):
                bank.covariance[to, a, j, l] = bank.covariance[k, a, j, l]
        bank.seen[to, a] = bank.seen[k, a]
        for j in range(3):
            bank.slip[to, a, j] = bank.slip[k, a, j]
        bank.lost[to, a] = bank.lost[k, a]
        bank.missed[to, a] = bank.missed[k, a]
        bank.touched[to, a] = bank.touched[k, a]
        if bank.walks[k]:
            for j in range(4):
                bank.drift[to, a, j] = bank.drift[k, a, j]
    bank.began[to] = bank.began[k]
    bank.run[to] = bank.run[k]
    bank.walks[to] = bank.walks[k]
    bank.opened[to] = bank.opened[k]
    bank.length[to] = bank.length[k]
    bank.faulty[to] = bank.faulty[k]
    bank.moved[to] = bank.moved[k]


@inner
def give_rows(
    bank: Bank,
    place: IntArray,
    parent: IntArray,
    chosen: IntArray,
    count: int,
    claims: IntArray,
    spare: IntArray,
    row: IntArray,
) -> None:
    """Give each chosen candidate a row: that of its parent, or a copy while others come from it.

    Parameters
    ----------
    place
        (k,) rows of the hypotheses, the free ones last; overwritten.
    parent, chosen, count
        Parents of the candidates, and which of these are chosen.
    claims, spare, row
        (k,) scratch.
    """
    d, n = bank.mean.shape[1], bank.mean.shape[2]
    before, free = bank.number[0], 0
    for i in range(before):
        claims[i] = 0
    for i in range(count):
        claims[parent[chosen[i]]] += 1
    for i in range(len(place)):
        if i >= before or claims[i] == 0:
            spare[free] = place[i]
            free += 1
    for i in range(count):
        p = parent[chosen[i]]
        row[i] = place[p]
        claims[p] -= 1
        if claims[p] > 0:
            free -= 1
            row[i] = spare[free]
            _copy(bank, row[i], place[p], d, n)
    for i in range(count):
        place[i] = row[i]
    for i in range(free):
        place[count + i] = spare[i]
    bank.number[0] = count


@inner
def keep_best(
    score: FloatArray, total: int, chosen: IntArray, weight: FloatArray
) -> tuple[int, float]:
    """Choose the best candidates, best first; their normalised log-weights go to ``weight``.

    Returns
    -------
    count, norm
        How many were kept, and the logarithm of the sum over all candidates.
    """
    most = weight.shape[0]
    top = -np.inf
    for i in range(total):
        top = max(top, score[i])
    norm = kept = 0.0
    crowded = False
    count = 0
    for i in range(total):
        gap = score[i] - top
        part = math.exp(gap) if gap > _NOUGHT else 0.0
        norm += part
        if gap < -_FAR:
            continue
        kept += part
        j = min(count, most - 1)
        if count == most:
            crowded = True
            if score[i] <= score[chosen[most - 1]]:
                continue
        while j > 0 and score[chosen[j - 1]] < score[i]:
            chosen[j] = chosen[j - 1]
            j -= 1
        chosen[j] = i
        count = min(count + 1, most)
    if crowded:
        kept = 0.0
        for i in range(count):
            kept += math.exp(score[chosen[i]] - top)
    kept = top + math.log(kept)
    for i in range(count):
        weight[i] = score[chosen[i]] - kept
    return count, top + math.log(norm)


@inner
def apply_position(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    k: int,
    z: FloatArray,
    variance: FloatArray,
    code: int,
    time: float,
    sensor: int,
    speed: float,
) -> None:
    """Do to hypothesis k what its candidate said; ``speed`` is that of a vehicle unknown."""
    n = motion.order + 1
    b = n - 1
    running = code & (OPEN | CONTINUE) != 0
    begins = 0
    if bank.walks[k] and bank.run[k] == sensor:
        bank.length[k] += 1
    if code & WALK:
        if bank.walks[k] == 0:
            begins = 1 if bank.run[k] < 0 else 2
            bank.walks[k] = code & _AXES
            if begins == 1:
                bank.run[k], bank.opened[k], bank.length[k] = sensor, time, 1
    elif code & OPEN:
        bank.run[k] = sensor
        bank.opened[k] = time
        bank.length[k] = 1
    elif code & CONTINUE:
        bank.length[k] += 1
    elif code & (DROP | RESTARTS):
        bank.run[k], bank.walks[k] = -1, 0
    elif code & COMMIT:
        bank.run[k] = -1
        bank.began[k] = bank.opened[k]
        bank.missed[k] = 0
    elif code & DENY:
        bank.opened[k] = time
    for a in range(motion.axes):
        m = bank.mean[k, a]
        P = bank.covariance[k, a]
        if code & (DROP | RESTARTS):
            forget(m, P, n)
        elif code & COMMIT:
            commit(m, P, n)
        elif code & OPEN:
            forget(m, P, n)
        if math.isnan(z[a]):
            continue
        if code & (RESTART << a):
            far = abs(wrapped(z[a] - m[0], motion.period)) / (time - bank.lost[k, a])
            begin_anew(m, P, n, max(speed, HASTE * far))
            bank.seen[k, a] = False
            bank.began[k] = time
        if running or (code >> a) & 1:
            if bank.missed[k, a] == 0:
                bank.lost[k, a] = time
            bank.missed[k, a] += 1
        else:
            bank.missed[k, a] = 0
        if (code >> a) & 1:
            if code & WALK:
                nu = wrapped(z[a] - m[0], motion.period)
                bends = code & POOR != 0
                drag_axis(motion, prior, bank, k, a, nu, variance[a], begins, bends, time)
            continue
        gap = time - bank.touched[k, a]
        bank.touched[k, a] = time
        if not bank.seen[k, a]:
            bank.seen[k, a] = True
            if math.isnan(bank.began[k]):
                bank.began[k] = time
            m[0] = z[a]
            for j in range(n):
                P[0, j] = 0.0
                P[j, 0] = 0.0
            P[0, 0] = variance[a]
            continue
        nu = wrapped(z[a] - m[0], motion.period)
        if code & MANOEUVRE and gap > 0.0:
            rate = abs(nu) / reach(motion.order, 0, gap)
            rate = max(agility(motion.density[a], gap), HASTE * rate)
            change_rate(P, motion.order, gap, rate)
        if code & OPEN:
            open_run(m, P, n, nu, variance[a])
            continue
        shifted = code & CONTINUE != 0
        if shifted:
            nu = wrapped(nu - m[b], motion.period)
        r = variance[a] / POOR_WEIGHT if code & POOR else variance[a]
        update_axis(m, P, n, 0, shifted, nu, r)
    if code & WALK:
        make_certain(prior, bank, k, b, time)
        if begins == 2:
            bank.walks[k] |= CERTAIN


@inner
def merge(motion: Motion, bank: Bank, place: IntArray, work: Scratch) -> None:
    """Let the lesser of two hypotheses that say the same add its weight to the greater.

    ``work.keep`` becomes which are left. Most pairs are far apart on some axis. That is found for
    all at once, free rows too, as the machine compares several numbers in one step.
    """
    keep, apart = work.keep, work.apart
    count = bank.number[0]
    for i in range(len(keep)):
        keep[i] = i < count
        for a in range(motion.axes):
            work.middle[a, i] = bank.mean[place[i], a, 0]
            work.width[a, i] = bank.covariance[place[i], a, 0, 0]
    for first in range(count):
        if not keep[first]:
            continue
        for i in range(len(keep)):
            apart[i] = not keep[i]
        for a in range(motion.axes):
            _part(work.middle[a], work.width[a], first, apart)
        for second in range(first + 1, count):
            if not apart[second] and _alike(motion, bank, place[first], place[second]):
                keep[second] = False
                bank.weight[first] = log_sum(bank.weight[first], bank.weight[second])


@inner
def _part(middle: FloatArray, width: FloatArray, first: int, apart: BoolArray) -> None:
    """Mark the hypotheses whose positions (k,) on an axis, or their variances, are not alike."""
    m, P = middle[first], width[first]
    limit, low, high = _ALIKE * _SURELY * P, _NARROW * P, _WIDE * P
    if not P > 0.0:
        limit, low, high = np.inf, -np.inf, np.inf
    for i in range(len(apart)):
        gap = m - middle[i]
        apart[i] |= (gap * gap > limit) | (width[i] > high) | (width[i] < low)


@lean_helper
def _alike(motion: Motion, bank: Bank, i: int, j: int) -> bool:
    """Whether rows i and j of the bank say the same of the present and of the runs."""
    if bank.run[i] != bank.run[j] or bank.faulty[i] != bank.faulty[j]:
        return False
    running = bank.run[i] >= 0
    if running and (bank.opened[i] != bank.opened[j] or bank.walks[i] != bank.walks[j]):
        return False
    b = motion.order
    distance = 0.0
    for a in range(motion.axes):
        if bank.seen[i, a] != bank.seen[j, a]:
            return False
        for s in range(2):
            gap = bank.mean[i, a, s] - bank.mean[j, a, s]
            P = bank.covariance[i, a, s, s]
            if P > 0.0:
                other = bank.covariance[j, a, s, s]
                if other > _WIDE * P or other < _NARROW * P:
                    return False
                distance += gap * gap / P
        if running:
            gap = bank.mean[i, a, b] - bank.mean[j, a, b]
            P = bank.covariance[i, a, b, b]
            distance += gap * gap / P if P > 0.0 else 0.0
        if distance > _ALIKE:
            return False
    return True


@inner
def report(
    motion: Motion,
    bank: Bank,
    place: IntArray,
    share: FloatArray,
    said: IntArray,
    best: int,
    k: int,
    found: Found,
) -> None:
    """Mean and standard deviations of the mixture over the hypotheses that know the axis.

    A manoeuvre that just began counts from the next observation on, unless it is the likeliest: a
    wild fix would leave the mixture no mean, however improbable it makes that account. ``share``
    (k,) are the probabilities of the hypotheses; those that do not count become 0.
    """
    d, order = motion.axes, motion.order
    for i in range(bank.number[0]):
        if i != best and said[i] & MANOEUVRE:
            share[i] = 0.0
    for a in range(d):
        for s in range(order):
            reference = total = square = within = whole = 0.0
            for i in range(bank.number[0]):
                row, w = place[i], share[i]
                if w == 0.0 or (s == 0 and not bank.seen[row, a]):
                    continue
                if whole == 0.0:
                    reference = bank.mean[row, a, s]
                gap = bank.mean[row, a, s] - reference
                if s == 0:
                    gap = wrapped(gap, motion.period)
                whole += w
                total += w * gap
                square += w * gap * gap
                within += w * bank.covariance[row, a, s, s]
            c = s * d + a
            if not whole > 0.0:
                found.mean[k, c] = np.nan
                found.sigma[k, c] = np.nan
                continue
            total /= whole
            found.mean[k, c] = reference + total
            found.sigma[k, c] = math.sqrt(max(within / whole + square / whole - total * total, 0.0))
