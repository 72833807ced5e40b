"""One account of a short series, by least squares.

Given the account all is linear and normal: the states of all epochs and the offsets of all runs are
one joint vector, of which motion and observations give the information matrix. Positions at the
beginning and offsets have no prior information at all. Axes are apart.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import gammaln

from surefix.models.motion import noise_factor, transition

NAMES = {2: "cv", 3: "ca"}


class Account(NamedTuple):
    """One way it may have been.

    Per axis: ``rows`` the used observations (step, component, offsets, value, variance),
    ``offsets`` how many there are, ``lasting`` those that became jumps, ``open`` that of the run.
    ``lost`` is when fixes began to be left out and how many were; ``rate`` what a velocity had been
    before anything was seen; ``turns`` after which steps it changed at once, and by how much.
    ``said`` is a word or two per epoch.
    """

    weight: float
    rows: tuple
    offsets: tuple
    lasting: tuple
    open: tuple
    seen: tuple
    began: float = np.nan
    run: int = -1
    opened: float = np.nan
    length: int = 0
    faulty: frozenset = frozenset()
    slip: tuple = ()
    heard: dict = {}  # noqa: RUF012
    lost: tuple = ()
    rate: tuple = ()
    turns: tuple = ()
    touched: tuple = ()
    moved: float = np.nan
    said: tuple = ()


def normal(nu, S):
    """Log-density of a normal innovation."""
    return -0.5 * (nu**2 / S + np.log(2.0 * np.pi * S))


def cauchy(squares, scales):
    """Log-density of a multivariate Cauchy: Student's t of one degree of freedom."""
    d = len(squares)
    constant = gammaln(0.5 * (1 + d)) - gammaln(0.5) - 0.5 * d * np.log(np.pi)
    return constant - 0.5 * np.sum(np.log(scales)) - 0.5 * (1 + d) * np.log1p(np.sum(squares))


def _joint(motion, prior, steps, account, a):
    """Mean and covariance of the states of all steps and all offsets of one axis."""
    n, count = motion.order, len(steps)
    size = n * count + account.offsets[a]
    information, vector = np.zeros((size, size)), np.zeros(size)
    begun, speed = account.rate[a]
    first = n * begun + np.arange(1, n)
    information[first, first] = 1.0 / speed**2
    if not account.seen[a]:
        information[n * begun, n * begun] = 1.0  # anything: nothing that is asked for depends on it
    before = np.arange(n * begun)
    information[before, before] = 1.0  # likewise, of what was before the track began anew
    for k in range(begun + 1, count):
        dt = steps[k] - steps[k - 1]
        G = noise_factor(NAMES[n], 1, dt, motion.density[a])
        F = transition(NAMES[n], 1, dt)
        turn = F[:, n - 1] * sum(sigma for step, sigma in account.turns[a] if step == k - 1)
        Q = G @ G.T + np.outer(turn, turn)
        rows = np.hstack([-F, np.eye(n)])
        at = slice(n * (k - 1), n * (k + 1))
        information[at, at] += rows.T @ np.linalg.solve(Q, rows)
    for k, component, offsets, value, variance in account.rows[a]:
        h = np.zeros(size)
        h[n * k + component] = 1.0
        h[[n * count + b for b in offsets]] = 1.0
        information += np.outer(h, h) / variance
        vector += h * value / variance
    covariance = np.linalg.inv(information)
    return covariance @ vector, covariance


def moments(motion, prior, steps, account, a):
    """Mean and covariance of [p, v, (a), b] at the last step; b is nought outside of runs."""
    n, count = motion.order, len(steps)
    mean, covariance = _joint(motion, prior, steps, account, a)
    T = np.zeros((n + 1, len(mean)))
    T[np.arange(n), n * (count - 1) + np.arange(n)] = 1.0
    T[0, [n * count + b for b in account.lasting[a]]] = 1.0
    if account.open[a] is not None:
        T[n, n * count + account.open[a]] = 1.0
    return T @ mean, T @ covariance @ T.T


def wrap(nu, period):
    return (nu + 0.5 * period) % period - 0.5 * period if period > 0.0 else nu


def told(account, gain, word, **changes):
    said = (*account.said[:-1], (account.said[-1] + " " + word).strip())
    return account._replace(weight=account.weight + gain, said=said, **changes)


def put(values, a, value):
    return (*values[:a], value, *values[a + 1 :])


def reach(order, component, gap):
    """What a unit of the highest rate does to a component in a time."""
    return transition(NAMES[order], 1, gap)[component, order - 1]


def agility(motion, a, gap):
    """Scale of a change of the highest rate."""
    return 30.0 * np.sqrt(motion.density[a] * gap)


def slipped(motion, account, known, a, time, sensor):
    """What velocities that are off alike would show by now, and its variance."""
    gap = time - account.heard.get((sensor, a), time)
    level, variance = account.slip[a]
    variance += motion.density[a] * gap * reach(motion.order, 1, gap) ** 2
    if motion.order > 2:
        m, P = known[a]
        return level + gap * m[2], variance + gap**2 * P[2, 2]
    return level, variance


def belied(motion, prior, account, known, z, gaps, off, time, sensor):
    """How much less likely a manoeuvre makes the velocities left out since the axis was used."""
    told_by = dict.fromkeys(account.faulty, ())
    for (s, a), when in account.heard.items():
        told_by |= {s: (*told_by[s], a)} if s in told_by and when > time - gaps.get(a, 0.0) else {}
    now = [a for a in gaps if sensor in account.faulty and not np.isnan(z[motion.axes + a])]
    axes = sorted({a for each in told_by.values() for a in each if a in gaps}.union(now))
    axes = [a for a in axes if gaps[a] > 0.0]
    before = after = 0.0
    for a in axes:
        (level, more), (m, P) = account.slip[a], known[a]
        rate = off[a] * reach(motion.order, 1, gaps[a]) / reach(motion.order, 0, gaps[a])
        w = prior.spread[motion.axes + a] ** 2 + more + P[1, 1]
        before += (level - m[1]) ** 2 / w
        after += (level - m[1] - rate) ** 2 / w
    return min(0.5 * (len(axes) + 1) * np.log((1.0 + before) / (1.0 + after)), 0.0)
