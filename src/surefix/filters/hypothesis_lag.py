"""Filter a series as decided and smooth each epoch over its window, axis by axis.

Once it is decided what belongs to the track, the axes have nothing to do with each other. The
smoother of one epoch is the map ``e_k = G (e_{k+1} + x_{k+1} − F x_k)``, ``P_k = B + G P_{k+1} Gᵀ``
of the deviation e from the filtered state x. Maps that follow each other are one map, so a window
that moves on by an epoch costs two of them however long it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.filters.hypothesis_axis import change_rate, predict_axis, update_axis
from surefix.filters.hypothesis_density import wrapped
from surefix.filters.hypothesis_trail import Decisions
from surefix.filters.records import Epochs, Motion
from surefix.filters.track_predict import VAGUE, VAGUE_RATE
from surefix.jit import lean_helper, lean_kernel
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["Followed", "filter_decided", "not_followed", "smooth_windows"]


class Followed(NamedTuple):
    """What the filter found that follows decisions, at each of n epochs.

    Parameters
    ----------
    mean, covariance
        (n, axes, order) and (n, axes, order, order) after the update.
    standardised
        (n, 2·axes) innovation over its standard deviation; NaN where not observed.
    """

    mean: FloatArray
    covariance: FloatArray
    standardised: FloatArray


class _Map(NamedTuple):
    """Maps of k epochs: ``e = G e' + c``, ``P = B + G P' Gᵀ``; shapes (k, 3, 3) and (k, 3)."""

    G: FloatArray
    B: FloatArray
    c: FloatArray


def not_followed(motion: Motion, n: int) -> Followed:
    """Make an empty record of n epochs."""
    d, m = motion.axes, motion.order
    return Followed(np.empty((n, d, m)), np.empty((n, d, m, m)), np.full((n, 2 * d), np.nan))


def filter_decided(
    motion: Motion,
    sigma_velocity: float,
    epochs: Epochs,
    decisions: Decisions,
    first: int,
    until: int,
    followed: Followed,
) -> None:
    """Filter the epochs ``first`` … ``until`` − 1 as decided.

    Parameters
    ----------
    motion, epochs, decisions
        Model, observations, and what is used of them.
    sigma_velocity
        Standard deviation of a velocity nothing is known about, m/s.
    followed
        Those before ``first`` are read, the others overwritten.
    """
    m = motion.order + 1
    state = np.empty(m), np.empty((m, m))
    _filter(motion, sigma_velocity, epochs, decisions, first, until, *state, followed)


def smooth_windows(
    motion: Motion,
    time: FloatArray,
    jump: IntArray,
    followed: Followed,
    last: IntArray,
    wanted: BoolArray,
    first: int,
    until: int,
    mean: FloatArray,
    sigma: FloatArray,
) -> None:
    """Smooth the epochs ``first`` … ``until`` − 1, each over its window.

    Parameters
    ----------
    motion, time, jump
        Model, times in s, and the jumps that were decided.
    followed
        What the filter found, up to the last epoch of the last window.
    last
        (n,) last epoch of each window, not decreasing.
    wanted
        (n,) the others keep the filter's estimate.
    mean, sigma
        (n, states) overwritten.
    """
    if until <= first:
        return
    longest = int(np.max(last[first:until] - np.arange(first, until))) + 3
    maps = _Map(np.empty((longest, 3, 3)), np.empty((longest, 3, 3)), np.empty((longest, 3)))
    work = np.empty((7, 3, 3))
    _smooth(motion, time, jump, followed, last, wanted, first, until, maps, work, mean, sigma)


@lean_kernel
def _filter(
    motion: Motion,
    sigma_velocity: float,
    epochs: Epochs,
    decisions: Decisions,
    first: int,
    until: int,
    m: FloatArray,
    P: FloatArray,
    out: Followed,
) -> None:
    """Loop of `filter_decided`; m and P are scratch for an axis whose run has no part here."""
    d, order = motion.axes, motion.order
    for a in range(d):
        for i in range(order + 1):
            m[i] = 0.0
            for j in range(order + 1):
                P[i, j] = 0.0
        for i in range(order):
            P[i, i] = sigma_velocity * sigma_velocity if i > 0 else VAGUE * VAGUE
            if first > 0:
                m[i] = out.mean[first - 1, a, i]
                for j in range(order):
                    P[i, j] = out.covariance[first - 1, a, i, j]
        for k in range(first, until):
            jump = decisions.jump[k]
            if (jump >> (d + a)) & 1:
                change_rate(P, order, 0.0, VAGUE_RATE)
            if k > 0:
                predict_axis(m, P, order, epochs.time[k] - epochs.time[k - 1], motion.density[a])
            if (jump >> a) & 1:
                for i in range(order):
                    P[0, i] = P[i, 0] = 0.0
                P[0, 0] = VAGUE * VAGUE
            for s in range(2):
                c = s * d + a
                off = epochs.z[k, c] - m[s]
                S = P[s, s] + epochs.variance[k, c]
                if s == 0:
                    off = wrapped(off, motion.period)
                out.standardised[k, c] = off / math.sqrt(S)
            for s in range(2):
                c = s * d + a
                weight = decisions.fixed[k, c]
                if math.isnan(epochs.z[k, c]) or not weight > 0.0:
                    continue
                nu = epochs.z[k, c] - m[s]
                if s == 0:
                    nu = wrapped(nu, motion.period)
                update_axis(m, P, order + 1, s, False, nu, epochs.variance[k, c] / weight)
            for i in range(order):
                out.mean[k, a, i] = m[i]
                for j in range(order):
                    out.covariance[k, a, i, j] = P[i, j]


@lean_helper
def _step_back(
    motion: Motion,
    time: FloatArray,
    jump: IntArray,
    followed: Followed,
    a: int,
    k: int,
    maps: _Map,
    at: int,
    work: FloatArray,
) -> None:
    """Write to place ``at`` the map from epoch k + 1 to epoch k of axis a.

    With ``M = F P Fᵀ + Q``: ``G = P Fᵀ M⁻¹``, ``B = (I − G F) P (I − G F)ᵀ + G Q Gᵀ``, which is a
    sum of positive parts. Where the position jumps, only the rates tell anything of the past.
    """
    n, d = motion.order, motion.axes
    F, Q, M, W = work[0], work[1], work[2], work[3]
    P, G, B, c = followed.covariance[k, a], maps.G[at], maps.B[at], maps.c[at]
    dt, q = time[k + 1] - time[k], motion.density[a]
    for i in range(n):
        for j in range(n):
            F[i, j] = 0.0 if j < i else 1.0 if j == i else dt if j == i + 1 else 0.5 * dt * dt
    if n == 2:
        Q[1, 1], Q[0, 1], Q[0, 0] = q * dt, q * dt * dt / 2.0, q * dt * dt * dt / 3.0
    else:
        d2, d3 = dt * dt, dt * dt * dt
        Q[0, 0], Q[0, 1], Q[0, 2] = q * d3 * d2 / 20.0, q * d2 * d2 / 8.0, q * d3 / 6.0
        Q[1, 1], Q[1, 2], Q[2, 2] = q * d3 / 3.0, q * d2 / 2.0, q * dt
    change = VAGUE_RATE * VAGUE_RATE if (jump[k + 1] >> (d + a)) & 1 else 0.0
    for i in range(n):
        for j in range(i, n):
            Q[i, j] += change * F[i, n - 1] * F[j, n - 1]
            Q[j, i] = Q[i, j]
    for i in range(n):  # W = P Fᵀ, M = F W + Q
        for j in range(n):
            W[i, j] = 0.0
            for l in range(j, n):
                W[i, j] += P[i, l] * F[j, l]
    for i in range(n):
        for j in range(n):
            M[i, j] = Q[i, j]
            for l in range(i, n):
                M[i, j] += F[i, l] * W[l, j]
    first = 1 if (jump[k + 1] >> a) & 1 else 0
    _divide(W, M, G, n, first)
    for i in range(n):  # W = I − G F
        c[i] = 0.0
        for j in range(n):
            W[i, j] = 1.0 if i == j else 0.0
            for l in range(j + 1):
                W[i, j] -= G[i, l] * F[l, j]
            shift = followed.mean[k + 1, a, j]
            for l in range(j, n):
                shift -= F[j, l] * followed.mean[k, a, l]
            c[i] += G[i, j] * shift
    _congruence(W, P, B, n, M, True)
    _congruence(G, Q, B, n, M, False)


@lean_helper
def _divide(W: FloatArray, M: FloatArray, G: FloatArray, n: int, first: int) -> None:
    """Write ``G = W M⁻¹`` by ``M = L D Lᵀ`` over the states from ``first`` on; nought elsewhere."""
    for j in range(first, n):
        for i in range(j, n):
            for l in range(first, j):
                M[i, j] -= M[i, l] * M[l, l] * M[j, l]
            if i > j:
                M[i, j] = M[i, j] / M[j, j] if M[j, j] > 0.0 else 0.0
    for i in range(n):
        for j in range(n):
            G[i, j] = W[i, j] if j >= first else 0.0
        for j in range(first, n):
            for l in range(first, j):
                G[i, j] -= G[i, l] * M[j, l]
        for j in range(first, n):
            G[i, j] = G[i, j] / M[j, j] if M[j, j] > 0.0 else 0.0
        for j in range(n - 1, first - 1, -1):
            for l in range(j + 1, n):
                G[i, j] -= G[i, l] * M[l, j]


@lean_helper
def _congruence(
    G: FloatArray, P: FloatArray, B: FloatArray, n: int, work: FloatArray, anew: bool
) -> None:
    """Add ``G P Gᵀ`` to the symmetric B, or write it there if ``anew``."""
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
            for l in range(n):
                work[i, j] += G[i, l] * P[l, j]
    for i in range(n):
        for j in range(i, n):
            total = 0.0 if anew else B[i, j]
            for l in range(n):
                total += work[i, l] * G[j, l]
            B[i, j] = total
            B[j, i] = total


@lean_helper
def _chain(maps: _Map, to: int, one: int, two: int, n: int, work: FloatArray) -> None:
    """Write the map one after two, ``e = G₁ (G₂ e' + c₂) + c₁``, to a place of its own."""
    G, B, c = maps.G[to], maps.B[to], maps.c[to]
    for i in range(n):
        c[i] = maps.c[one, i]
        for j in range(n):
            c[i] += maps.G[one, i, j] * maps.c[two, j]
            B[i, j] = maps.B[one, i, j]
            G[i, j] = 0.0
            for l in range(n):
                G[i, j] += maps.G[one, i, l] * maps.G[two, l, j]
    _congruence(maps.G[one], maps.B[two], B, n, work, False)


@lean_helper
def _apply(maps: _Map, at: int, e: FloatArray, P: FloatArray, n: int, work: FloatArray) -> None:
    """Carry deviation and covariance through a map, in place; ``work`` (2, 3, 3) is scratch."""
    for i in range(n):
        work[0, 0, i] = maps.c[at, i]
        for j in range(n):
            work[0, 0, i] += maps.G[at, i, j] * e[j]
    for i in range(n):
        e[i] = work[0, 0, i]
    for i in range(n):
        for j in range(n):
            work[0, i, j] = maps.B[at, i, j]
    _congruence(maps.G[at], P, work[0], n, work[1], False)
    for i in range(n):
        for j in range(n):
            P[i, j] = work[0, i, j]


@lean_kernel
def _smooth(
    motion: Motion,
    time: FloatArray,
    jump: IntArray,
    followed: Followed,
    last: IntArray,
    wanted: BoolArray,
    first: int,
    until: int,
    maps: _Map,
    work: FloatArray,
    mean: FloatArray,
    sigma: FloatArray,
) -> None:
    """Loop of `smooth_windows`.

    The epochs are done in blocks that end where the window of their first one ends. Place i of the
    maps leads from that end back to epoch i of the block; a tail, in one of the last two places,
    from the end of the window at hand to the end of the block.
    """
    d, n = motion.axes, motion.order
    step = maps.c.shape[0] - 3
    e, P = work[6, 0], work[5]
    for a in range(d):
        begin = first
        while begin < until:
            end = last[begin]
            for i in range(end - 1, begin - 1, -1):
                at = i - begin
                if i == end - 1:
                    _step_back(motion, time, jump, followed, a, i, maps, at, work)
                else:
                    _step_back(motion, time, jump, followed, a, i, maps, step, work)
                    _chain(maps, at, step, at + 1, n, work[0])
            head, tail, other = end, step + 1, step + 2
            for k in range(begin, min(max(end, begin + 1), until)):
                while head < last[k]:
                    if head == end:
                        _step_back(motion, time, jump, followed, a, head, maps, tail, work)
                    else:
                        _step_back(motion, time, jump, followed, a, head, maps, step, work)
                        _chain(maps, other, tail, step, n, work[0])
                        tail, other = other, tail
                    head += 1
                ends = last[k] if wanted[k] else k
                for i in range(n):
                    e[i] = 0.0
                    for j in range(n):
                        P[i, j] = followed.covariance[ends, a, i, j]
                if ends > end:
                    _apply(maps, tail, e, P, n, work)
                if ends > k:
                    _apply(maps, k - begin, e, P, n, work)
                for i in range(n):
                    mean[k, i * d + a] = followed.mean[k, a, i] + e[i]
                    sigma[k, i * d + a] = math.sqrt(max(P[i, i], 0.0))
            begin = max(end, begin + 1)
