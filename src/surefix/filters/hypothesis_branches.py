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
    WALK,
    Bank,
    Prior,
)
from surefix.filters.hypothesis_density import (
    first_fix,
    log_normal,
    log_sum,
    usual_or_poor,
    wild_product,
    wrapped,
)
from surefix.filters.hypothesis_drags import (
    drag_candidate,
    dragged_axes,
    leans,
    outlasts,
    supposes,
)
from surefix.filters.hypothesis_manoeuvres import belied, slipped, swift
from surefix.filters.records import Motion
from surefix.jit import inner, lean_helper
from surefix.types import FloatArray, IntArray

__all__ = [
    "BRANCHES",
    "CONFIRMED",
    "GROSS",
    "ROW",
    "position_branches",
    "velocity_branches",
]

BRANCHES = 14
"""Candidates that a hypothesis can have at one epoch, at most."""
GROSS = 36.0
"""Squared distance from which a run can begin: less is noise, however it persists."""
CONFIRMED = 3
"""Fixes of a run before it can be called a jump."""
ROW = 2
"""Fixes on end that are wrong by themselves, after which the next is likely to be."""
_STEPS = 40.0  # nats that a drag loses by a step of the velocities beside it
_POORER = 1.0 / POOR_WEIGHT - 1.0  # what a poor observation adds, in variances
_STRANGE = 16.0  # squared distance from which a manoeuvre is thought of
_PREFERS = 3.0  # nats by which another sensor must prefer the offset, or not, to have a say
_PATIENCE = 1.25  # longest runs of unbroken rejection after which the track may begin anew …
_AIDED = 5.0  # … or that many where velocities have supported it meanwhile
_ANEW = 0.1  # … and how probable that is then
_PI = math.pi
_LOG_2PI = math.log(2.0 * math.pi)


@inner
def velocity_branches(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    place: IntArray,
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
    alike_too, fresh = math.log(prior.alike), math.log1p(-prior.alike)
    turned = math.log(prior.manoeuvre) if prior.manoeuvre > 0.0 else -np.inf
    rarely = math.log(prior.velocity)
    mostly = math.log1p(-prior.velocity)
    again = math.log(prior.again)
    over = math.log1p(-prior.again)
    for i in range(bank.number[0]):
        k, base = place[i], bank.weight[i]
        distance = near = square = 0.0
        volume = wider = wide = 1.0
        seen = 0
        for a in range(d):
            c = d + a
            if math.isnan(z[c]):
                continue
            nu = z[c] - bank.mean[k, a, 1]
            S = bank.covariance[k, a, 1, 1] + variance[c]
            distance += nu * nu / S
            volume *= S
            Sp = S + variance[c] * _POORER
            near += nu * nu / Sp
            wider *= Sp
            w = prior.spread[c] * prior.spread[c] + S
            square += nu * nu / w
            wide *= w
            seen += 1
        outside = wild_product(square, wide, seen)
        bad, good = rarely, mostly
        # A drag beside velocities that are wrong, too, explains everything: none steps meanwhile.
        leaning = bank.walks[k] != 0 and forced[d] != 0.0 and leans(prior, bank, k, time)
        stepped = leaning and distance > _STRANGE
        leaning = leaning and (bank.faulty[k] >> sensor) & 1 != 0
        if (bank.faulty[k] >> sensor) & 1:
            bad, good = again, over
            alike = 0.0
            for a in range(d):
                c = d + a
                if not math.isnan(z[c]):
                    level, P = slipped(motion, prior, bank, k, a, time, sensor)
                    alike += log_normal(z[c] - level, P + variance[c])
            outside = log_sum(outside + fresh, alike + alike_too)
        if forced[d] != 0.0:
            inside, poorer = usual_or_poor(distance, volume, near, wider, seen, prior.poor)
            score[total] = base + inside + good - (_STEPS if stepped else 0.0)
            fair = poorer and math.isnan(forced[d])
            parent[total], code[total] = i, VELOCITY_POOR if fair else 0
            total += 1
        if not forced[d] > 0.0 and not leaning:
            score[total] = base + outside + bad
            parent[total], code[total] = i, VELOCITY_OUT
            total += 1
        strange = math.isnan(forced[d]) and distance > _STRANGE and bank.walks[k] == 0
        if strange and prior.manoeuvre > 0.0:
            turns = swift(motion, bank, k, 1, z[d:], variance[d:], time)
            if not math.isnan(turns):
                score[total] = base + turns + turned + good
                parent[total], code[total] = i, MANOEUVRE
                total += 1
    return total


@inner
def position_branches(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    place: IntArray,
    z: FloatArray,
    variance: FloatArray,
    forced: FloatArray,
    time: float,
    sensor: int,
    score: FloatArray,
    parent: IntArray,
    code: IntArray,
    parts: FloatArray,
) -> int:
    """Candidates of an observed position at ``time``; ``parts`` (4, 3) is scratch."""
    d, b = motion.axes, motion.order
    close, S = parts[0], parts[1]  # ν²/S, and S
    wild, wide = parts[2], parts[3]  # ν²/W, and the variance W of a wild fix
    parts[:, :] = 1.0
    total = 0
    observed = 0
    mask = 0
    lead = -1
    for a in range(d):
        if not math.isnan(z[a]):
            lead = a if lead < 0 else lead
            observed += 1
            mask |= 1 << a
    given = 0  # what is decided beforehand
    decided = False
    for a in range(d):
        if not math.isnan(z[a]) and not math.isnan(forced[a]):
            decided = True
            given |= (1 << a) if forced[a] == 0.0 else 0
    staying = math.log(1.0 - prior.isolated - prior.partial - prior.burst)
    turned = math.log(prior.manoeuvre) if prior.manoeuvre > 0.0 else -np.inf
    lasting = math.log(1.0 - prior.isolated - prior.ending)
    ending, isolated, burst = (
        math.log(prior.ending),
        math.log(prior.isolated),
        math.log(prior.burst),
    )
    partial = math.log(prior.partial / (observed + 1))
    rare = math.log(prior.small)
    drags = -1  # a depth alone does not wander off
    if lead == 0 and not decided:
        drags = supposes(prior, bank, place, time, sensor)
    in_row, rarer = math.log(prior.row), math.log1p(-prior.row) - math.log1p(-prior.isolated)
    for i in range(bank.number[0]):
        k, base = place[i], bank.weight[i]
        running, own = bank.run[k] >= 0, bank.run[k] == sensor
        walks = own and bank.walks[k] != 0
        distance = near = square = offset = stray = 0.0
        volume = wider = whole = 1.0
        unknown = due = False
        small = not decided
        for a in range(d):
            if math.isnan(z[a]):
                continue
            s2 = prior.spread[a] * prior.spread[a]
            if not bank.seen[k, a]:
                wide[a] = s2 + variance[a]
                wild[a] = 1.0
                small = False
                close[a] = 0.0
                S[a] = first_fix(wide[a])
                unknown = True
            else:
                nu = wrapped(z[a] - bank.mean[k, a, 0], motion.period)
                S[a] = bank.covariance[k, a, 0, 0] + variance[a]
                wide[a] = s2 + S[a]
                poorer = S[a] + variance[a] * _POORER
                small = small and nu * nu + S[a] < (GROSS + 1.0) * variance[a]
                close[a], wild[a] = nu * nu / S[a], nu * nu / wide[a]
                near += nu * nu / poorer
                wider *= poorer
                due = due or bank.missed[k, a] >= CONFIRMED
                if running:
                    more = 2.0 * bank.covariance[k, a, 0, b] + bank.covariance[k, a, b, b]
                    nu = wrapped(nu - bank.mean[k, a, b], motion.period)
                    offset += log_normal(nu, S[a] + more)
                    stray += nu * nu / (S[a] + more)
            distance += close[a]
            volume *= S[a]
            square += wild[a]
            whole *= wide[a]
        usual, wrong = base, isolated
        if not running and bank.missed[k, lead] >= ROW and not decided:
            wrong = in_row
            base += rarer
        if decided:
            score[total] = base
            for a in range(d):
                if (given >> a) & 1:
                    score[total] += wild_product(wild[a], wide[a], 1)
                elif not math.isnan(z[a]):
                    score[total] -= 0.5 * (close[a] + math.log(S[a]) + _LOG_2PI)
            parent[total], code[total] = i, given
            total += 1
            continue
        belongs = 0.0
        if running or unknown:
            belongs = -0.5 * (distance + math.log(volume) + observed * _LOG_2PI)
        if own:
            score[total] = base + belongs + ending
            code[total] = DROP
        elif unknown:
            score[total] = base + belongs + staying
            code[total] = 0
        else:
            agrees, poor = usual_or_poor(distance, volume, near, wider, observed, prior.poor)
            score[total] = base + agrees + staying
            code[total] = POOR if poor else 0
            if running and belongs - offset > _PREFERS:
                code[total] |= DENY
            if i == drags:
                dragged = dragged_axes(prior, bank, k, z, time, sensor)
                if dragged:
                    parent[total] = i
                    score[total + 1] = base + agrees + math.log(prior.drag)
                    code[total + 1] = WALK | dragged
                    total += 1
        parent[total] = i
        total += 1
        outside = wild_product(square, whole, observed)
        score[total] = usual + outside + wrong + (rare if small else 0.0)
        parent[total], code[total] = i, mask
        total += 1
        if walks and not outlasts(prior, bank, k, time):
            goes_on, says = drag_candidate(motion, prior, bank, k, z, variance, time)
            score[total] = base + goes_on + staying
            parent[total], code[total] = i, says
            total += 1
        strange = stray > _STRANGE and own and not walks and prior.drag > 0.0
        strange = strange and time - bank.startled[0] > prior.longest
        if strange and not unknown and bank.length[k] >= CONFIRMED:
            dragged = dragged_axes(prior, bank, k, z, time, sensor)
            if dragged:
                score[total] = base + outside + burst
                parent[total], code[total] = i, WALK | dragged
                total += 1
        strange = distance > GROSS and not unknown and not walks
        if strange and (own or not running):
            score[total] = base + outside + burst
            parent[total], code[total] = i, OPEN
            total += 1
        strange = distance > _STRANGE and not unknown
        if strange and not own and prior.manoeuvre > 0.0:
            turns = swift(motion, bank, k, 0, z, variance, time)
            if not math.isnan(turns):
                turns += belied(motion, prior, bank, k, z, time, sensor)
                score[total] = base + turns + turned
                parent[total], code[total] = i, MANOEUVRE
                total += 1
        if own and not unknown and not walks:
            score[total] = base + offset + lasting
            parent[total], code[total] = i, CONTINUE
            total += 1
        confirms = running and not own and not unknown and bank.length[k] >= CONFIRMED
        confirms = confirms and bank.walks[k] == 0
        if confirms and offset - belongs > _PREFERS:
            score[total] = base + offset + burst
            parent[total], code[total] = i, COMMIT
            total += 1
        if observed > 1 and not own:
            for a in range(d):
                if math.isnan(z[a]):
                    continue
                rest, product = (observed - 1) * _LOG_2PI, wide[a]
                for o in range(d):
                    if o != a and not math.isnan(z[o]):
                        rest += close[o]
                        product *= S[o]
                score[total] = base + partial - 0.5 * rest + wild_product(wild[a], product, 1)
                parent[total], code[total] = i, 1 << a
                total += 1
            if observed == 3:
                both = wild_product(wild[0] + wild[1], wide[0] * wide[1] * S[2], 2)
                score[total] = base + partial + both - 0.5 * (close[2] + _LOG_2PI)
                parent[total], code[total] = i, 3
                total += 1
        if due:
            fresh, anew, every = _anew(prior, bank, k, z, variance, time, close, S)
            if anew and (every or not own) and (not walks or outlasts(prior, bank, k, time)):
                score[total] = base + fresh
                parent[total], code[total] = i, anew
                total += 1
    return total


@lean_helper
def _anew(
    prior: Prior,
    bank: Bank,
    k: int,
    z: FloatArray,
    variance: FloatArray,
    time: float,
    close: FloatArray,
    S: FloatArray,
) -> tuple[float, int, bool]:
    """Log-density of a fix with which axes begin anew that have been left out for too long.

    Returns
    -------
    density, code, every
        Which axes these are, and whether all that are observed.
    """
    fresh, anew, every = math.log(_ANEW), 0, True
    for a in range(bank.seen.shape[1]):
        if math.isnan(z[a]):
            continue
        due = bank.seen[k, a] and bank.missed[k, a] >= CONFIRMED
        aided = bank.moved[k] > bank.lost[k, a]
        patience = (_AIDED if aided else _PATIENCE) * prior.longest
        if due and time - bank.lost[k, a] >= patience:
            anew |= RESTART << a
            free = first_fix(prior.spread[a] * prior.spread[a] + variance[a])
            fresh -= 0.5 * (math.log(free) + _LOG_2PI)
        else:
            every = False
            fresh -= 0.5 * (close[a] + math.log(S[a]) + _LOG_2PI)
    return fresh, anew, every
