"""Several hypotheses on single sights: ranges, bearings, elevations, components.

The filter of `multi_hypothesis` works axis by axis on positions. A range couples the axes, so here
a hypothesis is an extended Kalman filter of the full state ``[p, v]``, and what is right or wrong
is every single sight. Each hypothesis either takes a sight or calls it wrong; a channel that was
wrong once is likely to be wrong again, and likely by the same amount. The best hypotheses are kept;
their mixture is the output.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypothesis_bank import keep_best
from surefix.filters.hypothesis_density import best_of, log_normal, log_sum, log_wild
from surefix.filters.sight_fit import finish, fit, innovation, prepare
from surefix.filters.sight_records import (
    MATURE_SIGHTS,
    YOUNG_SIGHTS,
    SightBank,
    SightFound,
    SightModel,
    SightPrior,
    Sights,
    SightTrail,
)
from surefix.jit import helper, kernel
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["filter_sights", "predict_sight"]

_ALIKE = 0.7  # probability that a wrong sight is off as the one before it was
_MERGED = 0.01  # squared distance in standard deviations below which two hypotheses are one
_DOUBTFUL = 2.0  # squared distance from which a sight may be poor
_OUTSIDE = 3.0  # standard deviations that a hypothesis may be outside of its bounds


@helper
def predict_sight(m: FloatArray, P: FloatArray, d: int, dt: float, q: FloatArray) -> None:
    """Advance mean (2d,) and covariance (2d, 2d) by ``dt`` s under white acceleration."""
    n = 2 * d
    for i in range(d):
        m[i] += dt * m[d + i]
        for j in range(n):
            P[i, j] += dt * P[d + i, j]
    for j in range(d):
        for i in range(n):
            P[i, j] += dt * P[i, d + j]
    for i in range(d):
        P[i, i] += q[i] * dt * dt * dt / 3.0
        P[i, d + i] += 0.5 * q[i] * dt * dt
        P[d + i, i] = P[i, d + i]
        P[d + i, d + i] += q[i] * dt


@helper
def _copy(to: SightBank, i: int, source: SightBank, k: int) -> None:
    """Copy hypothesis k of one bank to place i of another; the weight is left."""
    to.mean[i] = source.mean[k]
    to.covariance[i] = source.covariance[k]
    to.faulty[i] = source.faulty[k]
    to.slip[i] = source.slip[k]
    to.base[i] = source.base[k]
    to.root[i] = source.root[k]
    to.step[i] = source.step[k]
    to.normal[i] = source.normal[k]
    to.evidence[i] = source.evidence[k]
    to.used[i] = source.used[k]
    to.poor[i] = source.poor[k]
    to.curved[i] = source.curved[k]


@helper
def _restart(model: SightModel, prior: SightPrior, bank: SightBank) -> None:
    """Add the likeliest hypothesis once more, going on somewhere else."""
    count = bank.number[0]
    best = best_of(bank.weight, count)
    _copy(bank, count, bank, best)
    bank.weight[count] = bank.weight[best] + math.log(prior.restart)
    bank.faulty[count] = 0
    for a in range(model.axes):
        bank.covariance[count, a, a] += prior.reach * prior.reach
        bank.covariance[count, model.axes + a, model.axes + a] += prior.speed * prior.speed
    bank.number[0] = count + 1


@helper
def _branches(
    model: SightModel,
    prior: SightPrior,
    bank: SightBank,
    c: int,
    sights: Sights,
    k: int,
    score: FloatArray,
    parent: IntArray,
    taken: IntArray,
    step: FloatArray,
    normal: FloatArray,
    evidence: FloatArray,
) -> int:
    """Candidates of channel c: every hypothesis takes it (1, or 2 as poor) or not (0)."""
    total, bit = 0, 1 << c
    z, r, anchor = sights.z[k], sights.variance[k], sights.anchor[k]
    fixed = sights.fixed[k, c]
    for i in range(bank.number[0]):
        nu, S = innovation(model, bank, i, c, z, r, anchor)
        wide = prior.spread[c] * prior.spread[c] + S
        outside = log_wild(nu * nu / wide, 0.5 * math.log(wide), 1)
        out = prior.wrong[c]
        if bank.faulty[i] & bit:
            out = prior.again[c]
            alike = log_normal(nu - bank.slip[i, c], S + r[c]) + math.log(_ALIKE)
            outside += math.log(1.0 - _ALIKE)
            outside = log_sum(alike, outside)
        if math.isnan(fixed) or fixed > 0.0:
            used = bank.used[i] | bit
            poor = bank.poor[i]
            how = 1
            if fixed > 0.0 and fixed < 1.0:
                poor |= bit
                how = 2
            step[i] = bank.step[i]
            said = fit(model, bank, i, z, r, anchor, used, poor, step[i], normal[i])
            inside = said
            far = nu * nu > _DOUBTFUL * S
            if math.isnan(fixed) and far:
                other = bank.step[i].copy()
                shape = np.empty_like(normal[i])
                worse = fit(model, bank, i, z, r, anchor, used, poor | bit, other, shape)
                usual, noisy = said + math.log1p(-prior.poor), worse + math.log(prior.poor)
                inside = log_sum(usual, noisy)
                if noisy > usual:
                    step[i] = other
                    normal[i] = shape
                    said = worse
                    how = 2
            evidence[i] = said
            score[total] = bank.weight[i] + inside - bank.evidence[i] + math.log1p(-out)
            parent[total], taken[total] = i, how
            total += 1
        if not fixed > 0.0:
            score[total] = bank.weight[i] + outside + math.log(out)
            parent[total], taken[total] = i, 0
            total += 1
    return total


@helper
def _remember(bank: SightBank, i: int, c: int, nu: float, wrong: bool) -> None:
    bit = 1 << c
    if wrong:
        bank.faulty[i] |= bit
        bank.slip[i, c] = nu
    else:
        bank.faulty[i] &= ~bit


@helper
def _close(model: SightModel, bank: SightBank, sights: Sights, k: int) -> None:
    """End the epoch: states of all hypotheses, and what each thinks of the channels."""
    z, r, anchor = sights.z[k], sights.variance[k], sights.anchor[k]
    for i in range(bank.number[0]):
        for c in range(z.shape[0]):
            if not math.isnan(z[c]):
                wrong = not (bank.used[i] >> c) & 1
                nu, _ = innovation(model, bank, i, c, z, r, anchor)
                _remember(bank, i, c, nu, wrong)
        finish(model, bank, i, z, anchor)


@helper
def _inside(model: SightModel, bank: SightBank, i: int) -> bool:
    """Whether hypothesis i is within the bounds, as far as its uncertainty tells."""
    for a in range(model.axes):
        margin = _OUTSIDE * math.sqrt(bank.covariance[i, a, a])
        if bank.mean[i, a] < model.within[a, 0] - margin:
            return False
        if bank.mean[i, a] > model.within[a, 1] + margin:
            return False
    return True


@helper
def _alike(bank: SightBank, i: int, j: int) -> bool:
    """Whether two hypotheses say the same."""
    if bank.faulty[i] != bank.faulty[j]:
        return False
    distance = 0.0
    for s in range(bank.mean.shape[1]):
        P = bank.covariance[i, s, s]
        if abs(bank.covariance[j, s, s] - P) > 0.05 * P:
            return False
        gap = bank.mean[i, s] - bank.mean[j, s]
        distance += gap * gap / P if P > 0.0 else 0.0
    return distance < _MERGED


@helper
def _thin(model: SightModel, bank: SightBank, origin: IntArray, again: BoolArray) -> None:
    """Drop hypotheses out of bounds, let like ones add up, and close the gaps."""
    count, left, bounded = bank.number[0], 0, False
    for i in range(count):
        bounded = bounded or _inside(model, bank, i)
    for i in range(count):
        keep = not bounded or _inside(model, bank, i)
        for j in range(left):
            if keep and _alike(bank, j, i):
                keep = False
                bank.weight[j] = log_sum(bank.weight[j], bank.weight[i])
        if keep:
            if left != i:
                _copy(bank, left, bank, i)
                bank.weight[left] = bank.weight[i]
                origin[left], again[left] = origin[i], again[i]
            left += 1
    bank.number[0] = left
    best = best_of(bank.weight, left)
    total = 0.0
    for i in range(left):
        total += math.exp(bank.weight[i] - bank.weight[best])
    shift = bank.weight[best] + math.log(total)
    for i in range(left):
        bank.weight[i] -= shift


@helper
def _report(bank: SightBank, k: int, z: FloatArray, found: SightFound) -> None:
    """Mean, covariance and probabilities of the mixture."""
    n = bank.mean.shape[1]
    for s in range(n):
        found.mean[k, s] = 0.0
        for t in range(n):
            found.covariance[k, s, t] = 0.0
    for i in range(bank.number[0]):
        w = math.exp(bank.weight[i])
        for s in range(n):
            found.mean[k, s] += w * bank.mean[i, s]
        for c in range(z.shape[0]):
            if (bank.used[i] >> c) & 1:
                found.weight[k, c] += w
    for i in range(bank.number[0]):
        w = math.exp(bank.weight[i])
        for s in range(n):
            for t in range(n):
                gap = (bank.mean[i, s] - found.mean[k, s]) * (bank.mean[i, t] - found.mean[k, t])
                found.covariance[k, s, t] += w * (bank.covariance[i, s, t] + gap)


@kernel
def _run(
    model: SightModel,
    prior: SightPrior,
    sights: Sights,
    restarts: IntArray,
    one: SightBank,
    two: SightBank,
    found: SightFound,
    trail: SightTrail,
) -> int:
    """Loop of `filter_sights`; gives how often the banks changed places."""
    most, n = one.weight.shape[0] - 1, 2 * model.axes
    room = most + 1
    traced = trail.best.shape[0] > 0
    score = np.empty(2 * room)
    parent, taken = np.empty(2 * room, np.int64), np.empty(2 * room, np.int64)
    chosen = np.empty(most, np.int64)
    step, normal, evidence = np.empty((room, n)), np.empty((room, n, n)), np.empty(room)
    origin, before = np.empty(room, np.int64), np.empty(room, np.int64)
    again, repeated = np.empty(room, np.bool_), np.empty(room, np.bool_)
    swaps = 0
    time = one.time[0]
    for k in range(len(sights.time)):
        dt = 0.0 if math.isnan(time) else sights.time[k] - time
        time = sights.time[k]
        z, r, anchor = sights.z[k], sights.variance[k], sights.anchor[k]
        kept = most if one.age[0] < YOUNG_SIGHTS else min(most, MATURE_SIGHTS)
        if dt > 0.0:
            for i in range(one.number[0]):
                predict_sight(one.mean[i], one.covariance[i], model.axes, dt, model.density)
        forced = restarts.shape[0] > 0
        open_ = not forced and prior.restart > 0.0 and dt > 0.0 and not np.isnan(z).all()
        if forced and restarts[k]:
            _restart(model, prior, one)
            _copy(one, 0, one, one.number[0] - 1)
            one.number[0] = 1
        elif open_:
            _restart(model, prior, one)
        for i in range(one.number[0]):
            prepare(model, one, i, z, anchor)
            origin[i], again[i] = i, False
        if open_:
            last = one.number[0] - 1
            again[last] = True
            origin[last] = best_of(one.weight, last)
        best = best_of(one.weight, one.number[0])
        for c in range(z.shape[0]):
            if math.isnan(z[c]):
                continue
            nu, S = innovation(model, one, best, c, z, r, anchor)
            found.weight[k, c] = 0.0
            found.standardised[k, c] = nu / math.sqrt(S)
        for c in range(z.shape[0]):
            if math.isnan(z[c]):
                continue
            total = _branches(
                model, prior, one, c, sights, k, score, parent, taken, step, normal, evidence
            )
            before[:], repeated[:] = origin, again
            count, norm = keep_best(score, total, chosen, two.weight[:kept])
            found.evidence[k] += norm
            for i in range(count):
                p, how = parent[chosen[i]], taken[chosen[i]]
                _copy(two, i, one, p)
                origin[i], again[i] = before[p], repeated[p]
                if how > 0:
                    two.step[i], two.normal[i] = step[p], normal[p]
                    two.evidence[i] = evidence[p]
                    two.used[i] |= 1 << c
                    if how == 2:
                        two.poor[i] |= 1 << c
            one, two = two, one
            one.number[0] = count
            swaps += 1
        _close(model, one, sights, k)
        _thin(model, one, origin, again)
        one.age[0] += 1
        _report(one, k, z, found)
        if traced:
            trail.best[k] = best_of(one.weight, one.number[0])
            for i in range(one.number[0]):
                trail.parent[k, i], trail.restarted[k, i] = origin[i], again[i]
                trail.used[k, i], trail.poor[k, i] = one.used[i], one.poor[i]
    one.time[0] = time
    return swaps


def filter_sights(
    model: SightModel,
    prior: SightPrior,
    sights: Sights,
    bank: SightBank,
    *,
    restarts: IntArray | None = None,
    traced: bool = True,
) -> tuple[SightBank, SightFound, SightTrail]:
    """Run the filter over a series; ``bank`` is not modified.

    Parameters
    ----------
    model, prior
        What moves, what is seen, and what is supposed of errors.
    sights
        n epochs.
    bank
        At least one hypothesis; from `surefix.filters.sight_starts` or an earlier call.
    restarts
        (n,) 1 where the track is known to go on somewhere else; None where that is open.
    traced
        Whether to keep the trail.

    Returns
    -------
    bank, found, trail
        The hypotheses after the series, what their mixture says, and how they came about.
    """
    n, c = sights.z.shape
    most, s = len(bank.weight) - 1, 2 * model.axes
    one = SightBank._make(field.copy() for field in bank)
    two = SightBank._make(field.copy() for field in bank)
    two = two._replace(time=one.time, number=one.number, age=one.age)
    found = SightFound(
        np.full((n, s), np.nan),
        np.full((n, s, s), np.nan),
        np.full((n, c), np.nan),
        np.full((n, c), np.nan),
        np.zeros(n),
    )
    rows = n if traced else 0
    trail = SightTrail(
        np.zeros((rows, most), np.int64),
        np.zeros((rows, most), np.int64),
        np.zeros((rows, most), np.int64),
        np.zeros((rows, most), np.bool_),
        np.zeros(rows, np.int64),
    )
    known = np.zeros(0, np.int64) if restarts is None else restarts
    sights = Sights._make(np.ascontiguousarray(column) for column in sights)  # one compiled form
    swaps = _run(model, prior, sights, known, one, two, found, trail)
    return (two if swaps % 2 else one), found, trail
