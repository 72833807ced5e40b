"""Rauch–Tung–Striebel smoothing of a filtered track, over the whole series or a fixed lag.

The gain and the part of the covariance that the future cannot reduce come from one orthogonal
reduction of the filter's factors, so that every smoothed covariance is a sum of positive
semi-definite terms (Park and Kailath, Int. J. Control 62, 1995).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.records import Filtered, Motion, Recovery
from surefix.filters.track_predict import predict_factor
from surefix.jit import helper, inlined, kernel
from surefix.linalg import triangularize_rows
from surefix.models.motion import propagate_rows
from surefix.rows import ONE, Size, add_row, clear_row, copy_row, part, scratch, size_of, width
from surefix.types import FloatArray, IntArray

__all__ = ["Smoothed", "leave_one_out", "smooth", "smooth_lag"]

_BLOCK = 4096  # epochs of which more than the smoothed states is kept at one time


class Smoothed(NamedTuple):
    """Smoothed states: ``mean`` (n, states) and ``covariance`` (n, states, states)."""

    mean: FloatArray
    covariance: FloatArray


class _Backward(NamedTuple):
    """Per epoch k: ``x_k = x_f + G (x_{k+1} − F x_f)``, ``P_k = floor + G P_{k+1} Gᵀ``.

    ``gain_T`` holds Gᵀ.
    """

    gain_T: FloatArray
    floor: FloatArray
    predicted: FloatArray


def smooth(
    motion: Motion,
    recovery: Recovery,
    time: FloatArray,
    filtered: Filtered,
    *,
    in_place: bool = False,
) -> Smoothed:
    """Smooth a whole filtered series.

    Parameters
    ----------
    motion, recovery
        As given to the filter.
    time
        (n,) s, the epochs.
    filtered
        What the filter found; its jumps cut the series for the groups they concern.
    in_place
        Whether the smoothed states take the memory of those of the filter, which are then lost.
    """
    n, states = filtered.mean.shape
    out = Smoothed(filtered.mean, filtered.factor) if in_place else _room(n, states)
    then = _room(1, states)
    for end in range(n, 0, -_BLOCK):
        here = slice(max(end - _BLOCK, 0), end)
        ahead = slice(here.start, end + 1)
        back = _backward(motion, recovery, time[ahead], _rows(filtered, ahead))
        found = Smoothed(out.mean[here], out.covariance[here])
        last = np.full(len(found.mean), len(found.mean) - 1)
        _smooth(
            _rows(filtered, here), back, last, last, True, end < n, then, found, size_of(states)
        )
    return out


def _room(n: int, states: int) -> Smoothed:
    return Smoothed(np.empty((n, states)), np.empty((n, states, states)))


def _rows(filtered: Filtered, some: slice) -> Filtered:
    return Filtered._make(column[some] for column in filtered)


def smooth_lag(
    motion: Motion,
    recovery: Recovery,
    time: FloatArray,
    filtered: Filtered,
    rows: IntArray,
    last: IntArray,
) -> Smoothed:
    """Smooth some epochs of a filtered series, each with its own stretch of the future.

    Parameters
    ----------
    motion, recovery, time, filtered
        As for `smooth`.
    rows
        (k,) the epochs to smooth.
    last
        (k,) the last epoch that counts for each of them.
    """
    states = filtered.mean.shape[1]
    out = _room(len(last), states)
    if len(last):
        back, none = _backward(motion, recovery, time, filtered), _room(1, states)
        _smooth(filtered, back, rows, last, False, False, none, out, size_of(states))
    return out


def _backward(
    motion: Motion, recovery: Recovery, time: FloatArray, filtered: Filtered
) -> _Backward:
    n, states = filtered.mean.shape
    back = _Backward(
        np.empty((n, states, states)), np.empty((n, states, states)), np.empty((n, states))
    )
    _reduce(motion, recovery, time, filtered, back, size_of(states), size_of(2 * states))
    return back


@kernel
def _reduce(
    motion: Motion,
    recovery: Recovery,
    time: FloatArray,
    filtered: Filtered,
    back: _Backward,
    states: Size,
    both: Size,
) -> None:
    """Reduce ``[[F S, G], [S, 0]]`` to ``[[L, 0], [Y, D]]``: gain ``Y L⁻¹``, floor ``D Dᵀ``."""
    n = width(states)
    A, v = scratch(both, both), scratch(ONE, both)
    y, D_T = scratch(ONE, states), scratch(states, states)
    for k in range(time.shape[0] - 1):
        dt, at = time[k + 1] - time[k], k * n * n
        S = part(filtered.factor, at, states, states)
        gain_T = part(back.gain_T, at, states, states)
        floor = part(back.floor, at, states, states)
        predict_factor(A, S, motion, dt, filtered.jump[k + 1], recovery)
        mean, predicted = (
            part(filtered.mean, k * n, states, ONE),
            part(back.predicted, k * n, states, ONE),
        )
        for i in range(n):
            predicted[i, 0] = mean[i, 0]
            clear_row(A, n + i, both)
            for j in range(n):
                A[n + i, j] = S[i, j]
        propagate_rows(predicted, motion.order, motion.axes, dt, 1)
        triangularize_rows(A, v, both)
        for j in range(n - 1, -1, -1):
            for i in range(n):
                y[0, i] = A[n + i, j]
                D_T[j, i] = A[n + i, n + j]
            for l in range(j + 1, n):
                add_row(y, 0, -A[l, j], gain_T, l, states)
            clear_row(gain_T, j, states)
            add_row(gain_T, j, 1.0 / A[j, j] if A[j, j] != 0.0 else 0.0, y, 0, states)
        for i in range(n):
            clear_row(floor, i, states)
            for l in range(i + 1):
                add_row(floor, i, D_T[l, i], D_T, l, states)


@inlined
def _step_back(
    k: int,
    filtered: Filtered,
    back: _Backward,
    x: FloatArray,
    P: FloatArray,
    W: FloatArray,
    y: FloatArray,
    states: Size,
) -> None:
    """Carry the smoothed state (x, P) of epoch k + 1 back to epoch k, in place."""
    n, at = width(states), k * width(states) * width(states)
    gain_T = part(back.gain_T, at, states, states)
    floor = part(back.floor, at, states, states)
    mean = part(filtered.mean, k * n, ONE, states)
    predicted = part(back.predicted, k * n, ONE, states)
    copy_row(y, 0, mean, 0, states)
    for l in range(n):
        add_row(y, 0, x[0, l] - predicted[0, l], gain_T, l, states)
    copy_row(x, 0, y, 0, states)
    for i in range(n):
        clear_row(W, i, states)
        for l in range(n):
            add_row(W, i, gain_T[l, i], P, l, states)
    for i in range(n):
        copy_row(P, i, floor, i, states)
        for l in range(n):
            add_row(P, i, W[i, l], gain_T, l, states)


@inlined
def _begin(
    k: int, filtered: Filtered, x: FloatArray, P: FloatArray, W: FloatArray, states: Size
) -> None:
    """Set (x, P) to the filtered state of epoch k."""
    n = width(states)
    S = part(filtered.factor, k * n * n, states, states)
    copy_row(x, 0, part(filtered.mean, k * n, ONE, states), 0, states)
    for i in range(n):
        for l in range(n):
            W[l, i] = S[i, l]
    for i in range(n):
        clear_row(P, i, states)
        for l in range(n):
            add_row(P, i, S[i, l], W, l, states)


@kernel
def _smooth(
    filtered: Filtered,
    back: _Backward,
    rows: IntArray,
    last: IntArray,
    whole: bool,
    goes_on: bool,
    then: Smoothed,
    out: Smoothed,
    states: Size,
) -> None:
    """Smooth epoch ``rows[i]`` with the data up to ``last[i]``; all in one sweep if ``whole``.

    ``then`` is the state where that sweep ends, and, if it ``goes_on``, from where it comes.
    """
    epochs, n = out.mean.shape[0], width(states)
    x, y = scratch(ONE, states), scratch(ONE, states)
    P, W = scratch(states, states), scratch(states, states)
    x_then, P_then = part(then.mean, 0, ONE, states), part(then.covariance, 0, states, states)
    if goes_on:
        copy_row(x, 0, x_then, 0, states)
        for i in range(n):
            copy_row(P, i, P_then, i, states)
    for k in range(epochs - 1, -1, -1):
        if whole and (goes_on or k < epochs - 1):
            _step_back(k, filtered, back, x, P, W, y, states)
        else:
            _begin(last[k], filtered, x, P, W, states)
            for j in range(last[k] - 1, rows[k] - 1, -1):
                _step_back(j, filtered, back, x, P, W, y, states)
        copy_row(part(out.mean, k * n, ONE, states), 0, x, 0, states)
        found = part(out.covariance, k * n * n, states, states)
        for i in range(n):
            copy_row(found, i, P, i, states)
            for j in range(i):
                found[j, i] = found[i, j]
    copy_row(x_then, 0, x, 0, states)
    for i in range(n):
        copy_row(P_then, i, P, i, states)


def leave_one_out(
    motion: Motion,
    z: FloatArray,
    variance: FloatArray,
    weight: FloatArray,
    smoothed: Smoothed,
) -> tuple[FloatArray, FloatArray]:
    """How far each observation lies from what all the others say of it.

    The observation's own share is taken out of the smoothed state in closed form:
    ``e = R̄ D⁻¹ (z − Hx)``, ``P = R̄ D⁻¹ R̄ − R̄`` with ``D = R̄ − H P Hᵀ`` and ``R̄ = R/w``.

    Parameters
    ----------
    motion
        Model and groups.
    z, variance
        (n, m) observations and their variances.
    weight
        (n, groups) weights with which they were used.
    smoothed
        Smoothed states of the same epochs.

    Returns
    -------
    nis, standardised
        (n, groups) squared Mahalanobis distance of the deleted residual, and (n, m) the residual
        over its standard deviation; NaN where not observed or where nothing else is known.
    """
    n, m = z.shape
    nis = np.full((n, motion.groups), np.nan)
    standardised = np.full((n, m), np.nan)
    _delete_residuals(motion, z, variance, weight, smoothed, nis, standardised)
    return nis, standardised


@kernel
def _delete_residuals(
    motion: Motion,
    z: FloatArray,
    variance: FloatArray,
    weight: FloatArray,
    smoothed: Smoothed,
    nis: FloatArray,
    standardised: FloatArray,
) -> None:
    m = z.shape[1]
    index = np.empty(m, np.int64)
    residual, e_out = np.empty(m), np.empty(m)
    total, D = np.empty((m, m)), np.empty((m, m))
    for k in range(z.shape[0]):
        for g in range(motion.groups):
            count = 0
            for c in range(m):
                if motion.group[c] == g and not np.isnan(z[k, c]):
                    index[count] = c
                    e = z[k, c] - smoothed.mean[k, c]
                    if motion.period > 0.0 and c == 0:
                        e -= motion.period * np.rint(e / motion.period)
                    residual[count] = e
                    count += 1
            if count == 0:
                continue
            w = weight[k, g]
            for i in range(count):
                for j in range(count):
                    total[i, j] = smoothed.covariance[k, index[i], index[j]]
                e_out[i] = residual[i]
            if w > 0.0:
                for i in range(count):
                    for j in range(count):
                        D[i, j] = -total[i, j]
                    D[i, i] += variance[k, index[i]] / w
                if not _invert(D, count):
                    continue
                for i in range(count):
                    ri = variance[k, index[i]] / w
                    shift = 0.0
                    for j in range(count):
                        rj = variance[k, index[j]] / w
                        shift += D[i, j] * residual[j]
                        total[i, j] = ri * D[i, j] * rj
                    total[i, i] -= ri
                    e_out[i] = ri * shift
            for i in range(count):
                total[i, i] += variance[k, index[i]]
                standardised[k, index[i]] = e_out[i] / np.sqrt(total[i, i])
            if not _invert(total, count):
                continue
            d2 = 0.0
            for i in range(count):
                for j in range(count):
                    d2 += e_out[i] * total[i, j] * e_out[j]
            nis[k, g] = d2


@helper
def _invert(A: FloatArray, n: int) -> bool:
    """Overwrite a symmetric positive definite matrix by its inverse (Gauss–Jordan)."""
    for p in range(n):
        pivot = A[p, p]
        if not pivot > 0.0:
            return False
        A[p, p] = 1.0
        for j in range(n):
            A[p, j] /= pivot
        for i in range(n):
            if i == p:
                continue
            f = A[i, p]
            A[i, p] = 0.0
            for j in range(n):
                A[i, j] -= f * A[p, j]
    return True
