"""Kernels that weigh the accounts which each hypothesis can give of an observation."""

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
    VELOCITY_OUT,
    VELOCITY_POOR,
    Bank,
    Prior,
)
from surefix.filters.hypothesis_axis import agility, reach
from surefix.filters.records import Motion
from surefix.jit import helper
from surefix.types import FloatArray, IntArray

__all__ = [
    "BRANCHES",
    "CONFIRMED",
    "log_normal",
    "log_sum",
    "log_wild",
    "position_branches",
    "velocity_branches",
    "wrapped",
]

BRANCHES = 14
"""Candidates that a hypothesis can have at one epoch, at most."""
CONFIRMED = 3
"""Fixes of a run before it can be called a jump."""
_ALIKE = 0.7  # probability that a wrong velocity is off as the one before was
_POORER = 1.0 / POOR_WEIGHT - 1.0  # what a poor observation adds, in variances
_GROSS = 36.0  # squared distance from which a run can begin: less is noise, however it persists
_STRANGE = 16.0  # … and from which a manoeuvre is thought of
_PREFERS = 3.0  # nats by which another sensor must prefer the offset, or not, to have a say
_PATIENCE = 1.25  # longest runs of unbroken rejection after which the track may begin anew …
_AIDED = 5.0  # … or that many where velocities have supported it meanwhile
_ANEW = 0.1  # … and how probable that is then
_PI = math.pi
_LOG_2PI = math.log(2.0 * math.pi)


@helper
def log_wild(square: float, log_scale: float, count: int) -> float:
    """Log-density of a gross error: Cauchy in ``count`` dimensions, so that no size is impossible.

    Parameters
    ----------
    square
        Sum of squares of the errors over their scales.
    log_scale
        Sum of the logarithms of the scales.
    """
    if count == 1:
        constant = -math.log(_PI)
    elif count == 2:
        constant = -math.log(2.0 * _PI)
    else:
        constant = -2.0 * math.log(_PI)
    return constant - log_scale - 0.5 * (count + 1) * math.log1p(square)


@helper
def wrapped(nu: float, period: float) -> float:
    """Innovation of an angle, within half a turn; unchanged if ``period`` is 0."""
    return nu - period * np.rint(nu / period) if period > 0.0 else nu


@helper
def log_normal(nu: float, S: float) -> float:
    """Log-density of an innovation ν of variance S."""
    return -0.5 * (nu * nu / S + math.log(S) + _LOG_2PI)


@helper
def _since(touched: float, time: float) -> float:
    """Seconds since an axis was last observed; 0 if it never was."""
    return 0.0 if math.isnan(touched) else time - touched


@helper
def _anywhere(square: float) -> float:
    """Log-density of a first fix: that of a gross error of the usual size."""
    return log_wild(1.0, 0.5 * math.log(square), 1)


@helper
def _freed(motion: Motion, a: int, c: int, gap: float, S: float) -> float:
    """Scale, squared, of component c of axis a if the highest rate changed ``gap`` seconds ago."""
    change = agility(motion.density[a], gap) * reach(motion.order, c, gap)
    return change * change + S


@helper
def log_sum(a: float, b: float) -> float:
    """Logarithm of the sum of two exponentials."""
    return max(a, b) + math.log1p(math.exp(-abs(a - b)))


@helper
def velocity_branches(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    z: FloatArray,
    variance: FloatArray,
    forced: FloatArray,
    time: float,
    sensor: int,
    score: FloatArray,
    parent: IntArray,
    code: IntArray,
) -> int:
    """Candidates of an observed velocity at ``time``: it belongs to the track, or not."""
    d, total = motion.axes, 0
    for k in range(bank.number[0]):
        inside = 0.0
        poor = 0.0
        square = 0.0
        scale = 0.0
        alike = 0.0
        distance = 0.0
        swift = 0.0
        quick = 0.0
        longest = 0.0
        seen = 0
        for a in range(d):
            c = d + a
            if math.isnan(z[c]):
                continue
            nu = z[c] - bank.mean[k, a, 1]
            S = bank.covariance[k, a, 1, 1] + variance[c]
            inside += log_normal(nu, S)
            poor += log_normal(nu, S + variance[c] * _POORER)
            wide = prior.spread[c] * prior.spread[c] + S
            square += nu * nu / wide
            scale += 0.5 * math.log(wide)
            distance += nu * nu / S
            gap = _since(bank.touched[k, a], time)
            longest = max(longest, gap)
            free = _freed(motion, a, 1, gap, S)
            swift += nu * nu / free
            quick += 0.5 * math.log(free)
            change = nu - bank.slip[k, a]
            alike += log_normal(change, S + variance[c])
            seen += 1
        outside = log_wild(square, scale, seen)
        out = prior.velocity
        if (bank.faulty[k] >> sensor) & 1:
            out = prior.again
            outside = log_sum(outside + math.log(1.0 - _ALIKE), alike + math.log(_ALIKE))
        if forced[d] != 0.0:
            usual, noisy = inside + math.log(1.0 - prior.poor), poor + math.log(prior.poor)
            score[total] = bank.weight[k] + log_sum(usual, noisy) + math.log1p(-out)
            fair = noisy > usual and math.isnan(forced[d])
            parent[total], code[total] = k, VELOCITY_POOR if fair else 0
            total += 1
        if not forced[d] > 0.0:
            score[total] = bank.weight[k] + outside + math.log(out)
            parent[total], code[total] = k, VELOCITY_OUT
            total += 1
        strange = math.isnan(forced[d]) and distance > _STRANGE
        if strange and longest > 0.0 and prior.manoeuvre > 0.0:
            score[total] = bank.weight[k] + log_wild(swift, quick, seen)
            score[total] += math.log(prior.manoeuvre) + math.log1p(-out)
            parent[total], code[total] = k, MANOEUVRE
            total += 1
    return total


@helper
def position_branches(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    z: FloatArray,
    variance: FloatArray,
    forced: FloatArray,
    time: float,
    sensor: int,
    score: FloatArray,
    parent: IntArray,
    code: IntArray,
) -> int:
    """Candidates of an observed position at ``time``."""
    d, n = motion.axes, motion.order + 1
    b = n - 1
    inside = np.empty(3)
    wild = np.empty(3)
    wide = np.empty(3)
    total = 0
    observed = 0
    mask = 0
    for a in range(d):
        if not math.isnan(z[a]):
            observed += 1
            mask |= 1 << a
    given = 0  # what is decided beforehand
    decided = False
    for a in range(d):
        if not math.isnan(z[a]) and not math.isnan(forced[a]):
            decided = True
            given |= (1 << a) if forced[a] == 0.0 else 0
    for k in range(bank.number[0]):
        belongs = 0.0
        square = 0.0
        scale = 0.0
        offset = 0.0
        poor = 0.0
        distance = 0.0
        swift = 0.0
        quick = 0.0
        longest = 0.0
        unknown = False
        for a in range(d):
            if math.isnan(z[a]):
                continue
            s2 = prior.spread[a] * prior.spread[a]
            if not bank.seen[k, a]:
                wild[a], wide[a] = 1.0, s2 + variance[a]
                inside[a] = _anywhere(wide[a])
                unknown = True
            else:
                nu = wrapped(z[a] - bank.mean[k, a, 0], motion.period)
                S = bank.covariance[k, a, 0, 0] + variance[a]
                inside[a] = log_normal(nu, S)
                poor += log_normal(nu, S + variance[a] * _POORER)
                distance += nu * nu / S
                gap = _since(bank.touched[k, a], time)
                longest = max(longest, gap)
                free = _freed(motion, a, 0, gap, S)
                swift += nu * nu / free
                quick += 0.5 * math.log(free)
                wide[a] = s2 + S
                wild[a] = nu * nu / wide[a]
                if bank.run[k] >= 0:
                    S += 2.0 * bank.covariance[k, a, 0, b] + bank.covariance[k, a, b, b]
                    nu = wrapped(nu - bank.mean[k, a, b], motion.period)
                    offset += log_normal(nu, S)
            belongs += inside[a]
            square += wild[a]
            scale += 0.5 * math.log(wide[a])
        outside = log_wild(square, scale, observed)
        base = bank.weight[k]
        own = bank.run[k] == sensor
        if decided:
            score[total] = base
            for a in range(d):
                if (given >> a) & 1:
                    score[total] += log_wild(wild[a], 0.5 * math.log(wide[a]), 1)
                elif not math.isnan(z[a]):
                    score[total] += inside[a]
            parent[total], code[total] = k, given
            total += 1
            continue
        staying = 1.0 - prior.isolated - prior.partial - prior.burst
        usual, noisy = belongs + math.log(1.0 - prior.poor), poor + math.log(prior.poor)
        if own:
            score[total] = base + belongs + math.log(prior.ending)
            code[total] = DROP
        else:
            score[total] = base + math.log(staying)
            score[total] += belongs if unknown else log_sum(usual, noisy)
            code[total] = POOR if noisy > usual and not unknown else 0
            if bank.run[k] >= 0 and not unknown and belongs - offset > _PREFERS:
                code[total] |= DENY
        parent[total] = k
        total += 1
        score[total] = base + outside + math.log(prior.isolated)
        parent[total], code[total] = k, mask
        total += 1
        strange = distance > _GROSS and not unknown
        if strange and (bank.run[k] < 0 or own):
            score[total] = base + outside + math.log(prior.burst)
            parent[total], code[total] = k, OPEN
            total += 1
        strange = distance > _STRANGE and not unknown
        if strange and longest > 0.0 and not own and prior.manoeuvre > 0.0:
            score[total] = base + log_wild(swift, quick, observed) + math.log(prior.manoeuvre)
            parent[total], code[total] = k, MANOEUVRE
            total += 1
        if own and not unknown:
            staying = 1.0 - prior.isolated - prior.ending
            score[total] = base + offset + math.log(staying)
            parent[total], code[total] = k, CONTINUE
            total += 1
        confirms = bank.run[k] >= 0 and not own and not unknown and bank.length[k] >= CONFIRMED
        if confirms and offset - belongs > _PREFERS:
            score[total] = base + offset + math.log(prior.burst)
            parent[total], code[total] = k, COMMIT
            total += 1
        if observed > 1 and not own:
            for a in range(d):
                if math.isnan(z[a]):
                    continue
                alone = log_wild(wild[a], 0.5 * math.log(wide[a]), 1)
                score[total] = base + belongs - inside[a] + alone
                score[total] += math.log(prior.partial / (observed + 1))
                parent[total], code[total] = k, 1 << a
                total += 1
            if observed == 3:
                pair = wild[0] + wild[1]
                both = log_wild(pair, 0.5 * math.log(wide[0] * wide[1]), 2)
                score[total] = base + inside[2] + both + math.log(prior.partial / (observed + 1))
                parent[total], code[total] = k, 3
                total += 1
        anew = 0
        every = True
        fresh = math.log(_ANEW)
        for a in range(d):
            if math.isnan(z[a]):
                continue
            due = bank.seen[k, a] and bank.missed[k, a] >= CONFIRMED
            aided = bank.moved[k] > bank.lost[k, a]
            patience = (_AIDED if aided else _PATIENCE) * prior.longest
            if due and time - bank.lost[k, a] >= patience:
                anew |= RESTART << a
                fresh += _anywhere(prior.spread[a] * prior.spread[a] + variance[a])
            else:
                every = False
                fresh += inside[a]
        if anew and (every or not own):
            score[total] = base + fresh
            parent[total], code[total] = k, anew
            total += 1
    return total
