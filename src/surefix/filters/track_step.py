"""Kernels of the track filter: one epoch, and the loop over them."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.records import Epochs, Filtered, Motion, Recovery, TrackState
from surefix.filters.track_predict import load, predict_factor, store
from surefix.jit import helper, kernel
from surefix.linalg import absorb, cholesky, multiply_transpose, solve_lower, triangularize
from surefix.models.motion import propagate_rows
from surefix.robust.loss import Loss, weight
from surefix.types import FloatArray, IntArray

__all__ = ["RECENT", "run"]

RECENT = 5
"""Rejected observations remembered for a recovery."""
_REJECTED = 0.1  # a weight below it counts as a rejection when waiting for a recovery
_SETTLED = 10  # observations after which a group's track is trusted
_UNSETTLED = 6.0  # how much sooner a track that is not yet trusted recovers
_MIN_STREAK = 3  # rejections a recovery needs at least
_IMPOSSIBLE = 1e-12  # a Student-t weight up to it is 0


@helper
def _distances(
    out: Filtered,
    k: int,
    g: int,
    motion: Motion,
    B: FloatArray,
    variance: FloatArray,
    nu: FloatArray,
    index: IntArray,
    C: FloatArray,
    e: FloatArray,
    loss: Loss,
) -> int:
    """Innovation statistics of group g at epoch k; returns how many components were observed."""
    m = 0
    for c in range(2 * motion.axes):
        if motion.group[c] == g and not math.isnan(nu[c]):
            index[m] = c
            m += 1
    if m == 0:
        return 0
    for i in range(m):
        for j in range(m):
            C[i, j] = B[index[i], index[j]]
        C[i, i] += variance[index[i]]
        e[i] = nu[index[i]]
        out.standardised[k, index[i]] = e[i] / math.sqrt(C[i, i])
    if not cholesky(C, m):
        return 0
    solve_lower(C, e, m)
    nis = 0.0
    logdet = 0.0
    for i in range(m):
        nis += e[i] * e[i]
        logdet += 2.0 * math.log(C[i, i])
    scale = 1.0 if m == 1 else loss.scale2 if m == 2 else loss.scale3
    out.nis[k, g] = nis
    out.logdet[k, g] = logdet
    out.sigma[k, g] = math.sqrt(nis) / scale
    return m


@helper
def _student_weight(
    m: int,
    B: FloatArray,
    variance: FloatArray,
    nu: FloatArray,
    index: IntArray,
    C: FloatArray,
    e: FloatArray,
    y: FloatArray,
    freedom: float,
    nis: float,
) -> float:
    """Expected precision of a Student-t observation by variational iteration.

    ``λ = (ν + m) / (ν + E[(z − Hx)ᵀ R⁻¹ (z − Hx)])``, the expectation under the posterior with R/λ.
    Begun at λ = 1 the iteration would believe anything once P is far larger than R; it begins at
    the distance from the prediction instead, ``(ν + m) / (ν + d²)``.
    Source: Agamennoni, Nieto and Nebot, IEEE Trans. Signal Processing 60(10), 2012.
    """
    scale = (freedom + m) / (freedom + nis)
    for _ in range(5):
        if not scale > _IMPOSSIBLE:
            return 0.0
        for i in range(m):
            for j in range(m):
                C[i, j] = B[index[i], index[j]]
            C[i, i] += variance[index[i]] / scale
            e[i] = nu[index[i]]
        if not cholesky(C, m):
            return scale
        solve_lower(C, e, m)
        total = 0.0
        for i in range(m):
            for j in range(m):
                y[j] = 1.0 if j == i else 0.0
            solve_lower(C, y, m)
            inverse = 0.0
            shift = 0.0
            for j in range(m):
                inverse += y[j] * y[j]
                shift += y[j] * e[j]
            r = variance[index[i]] / scale
            total += (shift * shift * r * r + r - r * r * inverse) / variance[index[i]]
        scale = (freedom + m) / (freedom + total)
    return scale


@helper
def _median(values: FloatArray, count: int) -> float:
    """Median of the first ``count`` values, which are sorted in place."""
    for i in range(1, count):
        v = values[i]
        j = i - 1
        while j >= 0 and values[j] > v:
            values[j + 1] = values[j]
            j -= 1
        values[j + 1] = v
    half = count // 2
    return float(values[half] if count % 2 else 0.5 * (values[half - 1] + values[half]))


@helper
def _recover(
    motion: Motion,
    recovery: Recovery,
    state: TrackState,
    g: int,
    variance: FloatArray,
    A: FloatArray,
    scratch: FloatArray,
) -> None:
    """Restart the state of group g at the median of its last rejected observations.

    Its rate is vague: twice the change among them, at least the usual figure.
    """
    d, n = motion.axes, motion.order * motion.axes
    count = min(state.streak[g], RECENT)
    newest = (state.streak[g] - 1) % RECENT
    oldest = (state.streak[g] - count) % RECENT
    span = state.recent_time[newest, g] - state.recent_time[oldest, g]
    load(A, state.factor, n)
    for c in range(2 * d):
        if motion.group[c] != g:
            continue
        for i in range(count):
            scratch[i] = state.recent[i, c]
        middle = _median(scratch, count)
        for i in range(count):
            scratch[i] = abs(state.recent[i, c] - middle)
        spread = 1.4826 * _median(scratch, count)
        rate = recovery.sigma_velocity
        if span > 0.0:
            change = abs(state.recent[newest, c] - state.recent[oldest, c]) / span
            rate = max(rate, 2.0 * change)
        state.mean[c] = middle
        for s in range(c, n, d):
            for j in range(2 * n):
                A[s, j] = 0.0
            A[s, n + s] = rate
            if s > c:
                state.mean[s] = 0.0
        A[c, n + c] = 3.0 * (spread + math.sqrt(variance[c]))
    triangularize(A, n, 2 * n)
    store(state.factor, A, n)
    state.streak[g] = 0
    state.settled[g] = 0


@helper
def _innovate(
    motion: Motion, state: TrackState, z: FloatArray, nu: FloatArray, B: FloatArray
) -> None:
    """Innovation ``ν = z − Hx`` (wrapped for an angle) and ``B = H P Hᵀ``."""
    m = 2 * motion.axes
    for c in range(m):
        nu[c] = z[c] - state.mean[c]
    if motion.period > 0.0:
        nu[0] -= motion.period * np.rint(nu[0] / motion.period)
    multiply_transpose(state.factor, B, m, state.mean.shape[0])


@helper
def _remember(motion: Motion, state: TrackState, g: int, time: float, nu: FloatArray) -> None:
    """Note a rejected observation of group g."""
    if state.streak[g] == 0:
        state.since[g] = time
    slot = state.streak[g] % RECENT
    state.recent_time[slot, g] = time
    for c in range(2 * motion.axes):
        if motion.group[c] == g:
            lost = math.isnan(nu[c])
            state.recent[slot, c] = state.mean[c] + (0.0 if lost else nu[c])
    state.streak[g] += 1


@helper
def _due(recovery: Recovery, state: TrackState, g: int, time: float) -> bool:
    """Whether group g has been rejected for long enough to be believed."""
    limit = recovery.after
    if state.settled[g] < _SETTLED:
        limit /= _UNSETTLED
    return bool(state.streak[g] >= _MIN_STREAK and time - state.since[g] >= limit)


@kernel
def run(
    motion: Motion,
    loss: Loss,
    recovery: Recovery,
    epochs: Epochs,
    state: TrackState,
    out: Filtered,
    until_recovery: bool,
) -> int:
    """Loop of `filter_track`; advances ``state`` in place and returns how many epochs it did."""
    d, n, m = motion.axes, motion.order * motion.axes, 2 * motion.axes
    A = np.empty((n, 2 * n))
    B = np.empty((m, m))
    C = np.empty((m, m))
    nu = np.empty(m)
    e = np.empty(m)
    y = np.empty(max(m, RECENT))
    phi = np.empty(n)
    gain = np.empty(n)
    index = np.empty(m, np.int64)
    time = state.time
    for k in range(epochs.time.shape[0]):
        dt = 0.0 if math.isnan(time) else epochs.time[k] - time
        time = epochs.time[k]
        jump = epochs.jump[k]
        if dt > 0.0 or jump:
            predict_factor(A, state.factor, motion, dt, jump, recovery)
            triangularize(A, n, 2 * n)
            store(state.factor, A, n)
            propagate_rows(state.mean.reshape(n, 1), motion.order, d, dt, 1)
        out.jump[k] = jump
        z, variance = epochs.z[k], epochs.variance[k]
        _innovate(motion, state, z, nu, B)
        for g in range(motion.groups):
            observed = _distances(out, k, g, motion, B, variance, nu, index, C, e, loss)
            if observed == 0:
                continue
            fixed = epochs.fixed[k, g]
            if not math.isnan(fixed):
                out.weight[k, g] = fixed
                continue
            unknown = True
            for i in range(observed):
                c = index[i]
                if B[c, c] < 100.0 * variance[c]:
                    unknown = False
            if unknown and state.streak[g] == 0:  # dead reckoning through a run does not unsettle
                state.settled[g] = 0
            if loss.code == 6:
                nis = out.nis[k, g]
                w = _student_weight(observed, B, variance, nu, index, C, e, y, loss.k0, nis)
            else:
                v = out.sigma[k, g]
                if loss.by_noise:  # about an unknown prediction it says nothing
                    v = 0.0 if unknown else abs(nu[index[0]]) / math.sqrt(variance[index[0]])
                w = weight(v, loss.code, loss.k0, loss.k1)
            if w < _REJECTED and loss.code != 0:
                _remember(motion, state, g, time, nu)
                if _due(recovery, state, g, time):
                    out.jump[k] |= 1 << g
                    out.since[k, g] = state.since[g]
                    _recover(motion, recovery, state, g, variance, A, y)
                    _innovate(motion, state, z, nu, B)
                    w = 1.0
            else:
                state.streak[g] = 0
                state.settled[g] += 1
            out.weight[k, g] = w
        for c in range(m):
            if math.isnan(nu[c]) or not out.weight[k, motion.group[c]] > 0.0:
                continue
            for j in range(n):
                phi[j] = state.factor[c, j]
            target = z[c] - state.mean[c]
            if motion.period > 0.0 and c == 0:
                target -= motion.period * np.rint(target / motion.period)
            r = variance[c] / out.weight[k, motion.group[c]]
            absorb(state.mean, state.factor, phi, gain, target, r)
        for i in range(n):
            out.mean[k, i] = state.mean[i]
            for j in range(n):
                out.factor[k, i, j] = state.factor[i, j]
        if until_recovery and out.jump[k] != jump:
            return k + 1
    return len(epochs.time)
