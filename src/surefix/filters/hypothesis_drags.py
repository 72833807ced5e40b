"""Kernels on drags: the fixes of a sensor wander off, beside others that do not.

Nothing shows when a drag begins, so that it is supposed now and then that one does, and what is
supposed is kept however improbable it is. In a drag the track is what velocities and other sensors
say. What the fixes are off by is followed by itself, ``[b, c]`` with c its rate: neither says
anything of the track.
"""

from __future__ import annotations

import math

from surefix.filters.hypotheses import DROP, POOR, RESTARTS, WALK, Bank, Prior
from surefix.filters.hypothesis_density import best_of, log_normal, wrapped
from surefix.filters.records import Motion
from surefix.jit import inner, lean_helper
from surefix.types import FloatArray, IntArray

__all__ = [
    "CERTAIN",
    "cap_drags",
    "drag_axis",
    "drag_candidate",
    "dragged_axes",
    "keep_drags",
    "leans",
    "make_certain",
    "outlasts",
    "predict_drag",
    "startles",
    "supposes",
]

CERTAIN = 8
"""Beside the axes of a drag: the fixes have wandered so far that it is no bias of velocities."""
_FRESH = 8.0  # longest runs are so many times what a velocity may be old that supports an axis
_PACE = 8  # fixes after which the next drag is supposed; ages that differ by less are one class
_CLASSES = 3  # of ages
_HOPELESS = 50.0  # nats below the best, where a drag is given up
_BENDS = 0.05  # probability that the rate of a drag is another from one fix to the next
_FAR_OFF = 16.0  # squared distance from which an offset is no noise
_STARTLES = 25.0  # … and from which a velocity has stepped
_SKEW = 0.02  # share of the speed that a velocity may be wrong by for good: a degree of heading
_LONGEST = 300.0  # s, and …
_RUNS = 8.0  # … longest runs: what lasts longer is no drag, …
_AGES = 5.0  # … nor what lasts so many times as long as the track before it


@inner
def predict_drag(
    m: FloatArray, P: FloatArray, drift: FloatArray, b: int, dt: float, memory: float
) -> None:
    """Advance the offset of one axis; what is older than ``memory``, s, is forgotten.

    Parameters
    ----------
    m, P
        State of the axis and its covariance, the offset their last; overwritten.
    drift
        Rate of the offset, its covariance with the offset, and its variance; overwritten.
    """
    m[b] += drift[0] * dt
    P[b, b] += dt * (2.0 * drift[1] + dt * (drift[2] + P[1, 1]))
    drift[1] += dt * drift[2]
    more = 1.0 + dt / memory
    P[b, b] *= more
    drift[1] *= more
    drift[2] *= more


@inner
def _rate(prior: Prior, a: int) -> float:
    """Scale of the rates of drags: they reach the size of gross errors in a longest run."""
    size: float = prior.spread[a]
    return size / prior.longest


@inner
def _supported(prior: Prior, bank: Bank, a: int, c: int, time: float, sensor: int) -> bool:
    """Whether component c of axis a was observed lately, its position by another ``sensor``."""
    for other in range(bank.heard.shape[0]):
        if (c != a or other != sensor) and time - bank.heard[other, c] <= prior.longest / _FRESH:
            return True
    return False


@lean_helper
def dragged_axes(prior: Prior, bank: Bank, k: int, z: FloatArray, time: float, sensor: int) -> int:
    """Axes of a fix that velocities or another sensor support, as bits."""
    mask, d = 0, bank.seen.shape[1]
    for a in range(d):
        if not bank.seen[k, a] or math.isnan(z[a]):
            continue
        beside = _supported(prior, bank, a, a, time, sensor)
        if beside or _supported(prior, bank, a, d + a, time, sensor):
            mask |= 1 << a
    return mask


@lean_helper
def leans(prior: Prior, bank: Bank, k: int, time: float) -> bool:
    """Whether a drag has nothing but velocities beside it, on one of its axes at least."""
    for a in range(bank.seen.shape[1]):
        if (bank.walks[k] >> a) & 1 and not _supported(prior, bank, a, a, time, bank.run[k]):
            return True
    return False


@inner
def startles(motion: Motion, standardised: FloatArray) -> bool:
    """Whether a velocity is far from what the likeliest hypothesis expects."""
    total = 0.0
    for a in range(motion.axes):
        off = standardised[motion.axes + a]
        total += 0.0 if math.isnan(off) else off * off
    return total > _STARTLES


@lean_helper
def supposes(prior: Prior, bank: Bank, place: IntArray, time: float, sensor: int) -> int:
    """Which hypothesis it is supposed of that a drag of a sensor begins, by its place; or −1.

    None is after velocities that stepped: they may be wrong, and the fixes right.
    """
    calm = time - bank.startled[0] > prior.longest
    if not prior.drag > 0.0 or len(place) < _PACE or not calm:
        return -1
    for i in range(bank.number[0]):
        k = place[i]
        if bank.walks[k] and bank.run[k] == sensor and bank.length[k] < _PACE:
            return -1
    best = best_of(bank.weight, bank.number[0])
    return best if bank.run[place[best]] < 0 and bank.faulty[place[best]] == 0 else -1


@lean_helper
def outlasts(prior: Prior, bank: Bank, k: int, time: float) -> bool:
    """Whether a drag has lasted longer than any may."""
    longest = max(_RUNS * prior.longest, _LONGEST)
    lasted: float = time - bank.opened[k]
    age: float = bank.opened[k] - bank.began[k]
    return lasted >= min(longest, _AGES * age)


@inner
def _bend(prior: Prior, bank: Bank, k: int, a: int, time: float) -> float:
    """How far, squared, the offset may be off if its rate changed about the last fix."""
    far: float = 2.0 * _rate(prior, a) * (time - bank.drift[k, a, 3])
    return far * far


@lean_helper
def drag_candidate(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    k: int,
    z: FloatArray,
    variance: FloatArray,
    time: float,
) -> tuple[float, int]:
    """Log-density of a fix that goes on with a drag, and what is said of it."""
    steady = bent = 0.0
    mask, b = bank.walks[k] & ~CERTAIN, motion.order
    for a in range(motion.axes):
        if math.isnan(z[a]):
            mask &= ~(1 << a)
            continue
        nu = wrapped(z[a] - bank.mean[k, a, 0], motion.period)
        if not (mask >> a) & 1:
            part = log_normal(nu, bank.covariance[k, a, 0, 0] + variance[a])
            steady += part
            bent += part
            continue
        nu = wrapped(nu - bank.mean[k, a, b], motion.period)
        S = bank.covariance[k, a, b, b] + variance[a]
        steady += log_normal(nu, S)
        bent += log_normal(nu, S + _bend(prior, bank, k, a, time))
    steady += math.log(1.0 - _BENDS)
    bent += math.log(_BENDS)
    return max(steady, bent), WALK | mask | (POOR if bent > steady else 0)


@lean_helper
def drag_axis(
    motion: Motion,
    prior: Prior,
    bank: Bank,
    k: int,
    a: int,
    nu: float,
    r: float,
    begins: int,
    bends: bool,
    time: float,
) -> None:
    """Follow the offset of one axis.

    Parameters
    ----------
    nu, r
        How far the fix is from the track, and its variance.
    begins
        1: the drag begins here, from nought; 2: it was a run with a common offset before; else 0.
    bends
        Its rate is another from here on.
    """
    m, P, drift = bank.mean[k, a], bank.covariance[k, a], bank.drift[k, a]
    b, rate = motion.order, _rate(prior, a)
    if begins:
        for j in range(b):
            P[b, j] = P[j, b] = 0.0
        m[b] = nu if begins == 2 else 0.0
        P[b, b] = r if begins == 2 else P[0, 0]
        drift[0] = drift[1] = 0.0
        drift[2] = rate * rate
    elif bends:
        P[b, b] += _bend(prior, bank, k, a, time)
        drift[2] += rate * rate
    drift[3] = time
    S = P[b, b] + r
    off = wrapped(nu - m[b], motion.period)
    gain, turn = P[b, b] / S, drift[1] / S
    m[b] += gain * off
    drift[0] += turn * off
    drift[2] -= turn * drift[1]
    drift[1] *= 1.0 - gain
    P[b, b] *= 1.0 - gain


@lean_helper
def make_certain(prior: Prior, bank: Bank, k: int, b: int, time: float) -> None:
    """Call a drag certain once its offset is more than noise, and than biased velocities do."""
    distance = square = speed = 0.0
    for a in range(bank.seen.shape[1]):
        if not (bank.walks[k] >> a) & 1:
            continue
        off = bank.mean[k, a, b]
        distance += off * off / (bank.covariance[k, a, 0, 0] + bank.covariance[k, a, b, b])
        square += off * off
        speed += bank.mean[k, a, 1] * bank.mean[k, a, 1]
    age = time - bank.opened[k] if leans(prior, bank, k, time) else 0.0
    bias = prior.steady * prior.steady + _SKEW * _SKEW * speed
    if distance > _FAR_OFF and square > bias * age * age:
        bank.walks[k] |= CERTAIN


@inner
def _uncertain(bank: Bank, k: int, code: int) -> bool:
    """Whether a candidate comes from a drag, or begins one, that may be none."""
    if bank.walks[k]:
        return int(bank.walks[k]) & CERTAIN == 0
    return code & WALK != 0 and int(bank.run[k]) < 0


@inner
def cap_drags(
    prior: Prior,
    bank: Bank,
    place: IntArray,
    score: FloatArray,
    parent: IntArray,
    code: IntArray,
    total: int,
) -> None:
    """Believe no drag more than at its beginning until it is certain."""
    top, some = -math.inf, False
    for i in range(total):
        if _uncertain(bank, place[parent[i]], code[i]):
            some = True
        else:
            top = max(top, score[i])
    if not some or top == -math.inf:
        return
    top += math.log(prior.drag)
    for i in range(total):
        if _uncertain(bank, place[parent[i]], code[i]):
            score[i] = min(score[i], top)


@inner
def keep_drags(
    bank: Bank,
    place: IntArray,
    score: FloatArray,
    parent: IntArray,
    code: IntArray,
    total: int,
    sensor: int,
    chosen: IntArray,
    count: int,
    weight: FloatArray,
    best: IntArray,
) -> int:
    """Keep the likeliest drag of each class of ages, too, however improbable it is.

    Parameters
    ----------
    sensor
        Whose drag may begin; where there are many, some share their classes.
    chosen, count, weight
        From `keep_best`; what is kept beside gets its place and its weight.
    best
        (k,) scratch.

    Returns
    -------
    count
        How many are kept.
    """
    some = False
    classes = len(best) // _CLASSES
    for j in range(classes * _CLASSES):
        best[j] = -1
    for i in range(total):
        k = place[parent[i]]
        if not (bank.walks[k] or code[i] & WALK) or code[i] & (DROP | RESTARTS):
            continue
        length, j = bank.length[k] if bank.walks[k] else 0, 0
        while length >= _PACE:
            length //= _PACE
            j += 1
        if j >= _CLASSES or score[i] < score[chosen[0]] - _HOPELESS:
            continue
        j += _CLASSES * ((bank.run[k] if bank.walks[k] else sensor) % classes)
        if best[j] < 0 or score[i] > score[best[j]]:
            best[j] = i
            some = True
    if not some:
        return count
    kept = score[chosen[0]] - weight[0]
    end = count
    for j in range(classes * _CLASSES):
        known = best[j] < 0
        for i in range(count):
            known = known or chosen[i] == best[j]
        if known:
            continue
        at = end
        if end < len(chosen):
            end += 1
        else:
            count -= 1
            at = count
        chosen[at] = best[j]
        weight[at] = score[best[j]] - kept
    whole = 0.0
    for i in range(end):
        whole += math.exp(weight[i])
    for i in range(end):
        weight[i] -= math.log(whole)
    return end
