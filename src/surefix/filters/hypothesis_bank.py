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
    Bank,
    Found,
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
from surefix.filters.hypothesis_branches import log_sum, wrapped
from surefix.filters.records import Motion
from surefix.jit import helper
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["apply_position", "best_of", "copy_hypothesis", "keep_best", "merge", "report"]

_FAR = 10.0  # nats below the best at which a hypothesis is dropped
_ALIKE = 0.01  # squared distance in standard deviations below which two hypotheses are one


@helper
def copy_hypothesis(to: Bank, i: int, source: Bank, k: int, d: int, n: int) -> None:
    """Copy hypothesis k of one bank to place i of another; the weight is left."""
    for a in range(d):
        for j in range(n):
            to.mean[i, a, j] = source.mean[k, a, j]
            for l in range(n):
                to.covariance[i, a, j, l] = source.covariance[k, a, j, l]
        to.seen[i, a] = source.seen[k, a]
        to.slip[i, a] = source.slip[k, a]
        to.lost[i, a] = source.lost[k, a]
        to.missed[i, a] = source.missed[k, a]
        to.touched[i, a] = source.touched[k, a]
    to.began[i] = source.began[k]
    to.run[i] = source.run[k]
    to.opened[i] = source.opened[k]
    to.length[i] = source.length[k]
    to.faulty[i] = source.faulty[k]
    to.moved[i] = source.moved[k]


@helper
def best_of(weight: FloatArray, count: int) -> int:
    """Place of the greatest of the first ``count`` weights."""
    best = 0
    for k in range(1, count):
        if weight[k] > weight[best]:
            best = k
    return best


@helper
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
    norm = 0.0
    for i in range(total):
        norm += math.exp(score[i] - top)
    norm = top + math.log(norm)
    count = 0
    for i in range(total):
        if score[i] < top - _FAR:
            continue
        j = min(count, most - 1)
        if count == most and score[i] <= score[chosen[most - 1]]:
            continue
        while j > 0 and score[chosen[j - 1]] < score[i]:
            chosen[j] = chosen[j - 1]
            j -= 1
        chosen[j] = i
        count = min(count + 1, most)
    kept = 0.0
    for i in range(count):
        kept += math.exp(score[chosen[i]] - top)
    for i in range(count):
        weight[i] = score[chosen[i]] - top - math.log(kept)
    return count, norm


@helper
def apply_position(
    motion: Motion,
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
    if code & OPEN:
        bank.run[k] = sensor
        bank.opened[k] = time
        bank.length[k] = 1
    elif code & CONTINUE:
        bank.length[k] += 1
    elif code & (DROP | RESTARTS):
        bank.run[k] = -1
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
        if code & POOR:
            update_axis(m, P, n, 0, False, nu, variance[a] / POOR_WEIGHT)
        elif code & OPEN:
            open_run(m, P, n, nu, variance[a])
        elif code & CONTINUE:
            nu = wrapped(nu - m[b], motion.period)
            update_axis(m, P, n, 0, True, nu, variance[a])
        else:
            update_axis(m, P, n, 0, False, nu, variance[a])


@helper
def merge(motion: Motion, bank: Bank, count: int, keep: BoolArray) -> None:
    """Let the lesser of two hypotheses that say the same add its weight to the greater."""
    b = motion.order
    for i in range(count):
        keep[i] = True
    for i in range(count):
        if not keep[i]:
            continue
        for j in range(i + 1, count):
            if not keep[j] or bank.run[i] != bank.run[j]:
                continue
            if bank.run[i] >= 0 and bank.opened[i] != bank.opened[j]:
                continue
            alike = bank.faulty[i] == bank.faulty[j]
            distance = 0.0
            for a in range(motion.axes):
                if bank.seen[i, a] != bank.seen[j, a]:
                    alike = False
                    break
                if bank.run[i] >= 0:
                    gap = bank.mean[i, a, b] - bank.mean[j, a, b]
                    P = bank.covariance[i, a, b, b]
                    distance += gap * gap / P if P > 0.0 else 0.0
                for s in range(2):
                    gap = bank.mean[i, a, s] - bank.mean[j, a, s]
                    P = bank.covariance[i, a, s, s]
                    distance += gap * gap / P if P > 0.0 else 0.0
                    ratio = bank.covariance[j, a, s, s] / P if P > 0.0 else 1.0
                    if ratio > 1.05 or ratio < 0.95:
                        alike = False
                if not alike or distance > _ALIKE:
                    alike = False
                    break
            if alike:
                keep[j] = False
                bank.weight[i] = log_sum(bank.weight[i], bank.weight[j])


@helper
def report(motion: Motion, bank: Bank, said: IntArray, best: int, k: int, found: Found) -> None:
    """Mean and standard deviations of the mixture over the hypotheses that know the axis.

    A manoeuvre that just began counts from the next observation on, unless it is the likeliest: a
    wild fix would leave the mixture no mean, however improbable it makes that account.
    """
    d, order = motion.axes, motion.order
    for a in range(d):
        mass = 0.0
        for i in range(bank.number[0]):
            if bank.seen[i, a] and (i == best or not said[i] & MANOEUVRE):
                mass += math.exp(bank.weight[i])
        for s in range(order):
            c = s * d + a
            if not mass > 0.0 and s == 0:
                found.mean[k, c] = np.nan
                found.sigma[k, c] = np.nan
                continue
            reference = 0.0
            first = True
            total = 0.0
            square = 0.0
            within = 0.0
            whole = 0.0
            for i in range(bank.number[0]):
                if s == 0 and not bank.seen[i, a]:
                    continue
                if i != best and said[i] & MANOEUVRE:
                    continue
                if first:
                    reference = bank.mean[i, a, s]
                    first = False
                w = math.exp(bank.weight[i])
                gap = bank.mean[i, a, s] - reference
                if s == 0:
                    gap = wrapped(gap, motion.period)
                whole += w
                total += w * gap
                square += w * gap * gap
                within += w * bank.covariance[i, a, s, s]
            total /= whole
            found.mean[k, c] = reference + total
            found.sigma[k, c] = math.sqrt(max(within / whole + square / whole - total * total, 0.0))
