"""White noise on a random walk: what stands beside it is whitened, wild values left out.

    y_k = c_k + e_k,   e_k ~ N(0, σ²),   c_{k+1} = c_k + N(0, q (t_{k+1} − t_k))

The Kalman filter of this model turns y, and any column that goes with it, into innovations of unit
variance over σ: generalised least squares become ordinary ones (Harvey, Forecasting, Structural
Time Series Models and the Kalman Filter, 1989, 3.4).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.cleaning.hampel import MAD_TO_SIGMA
from surefix.jit import kernel
from surefix.robust.loss import block_scale
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = [
    "RESTART",
    "SKIP",
    "USE",
    "Level",
    "both_ways",
    "first_level",
    "fit_level",
    "gather",
    "outliers",
    "sort_out",
    "whiten",
]

USE, SKIP, RESTART = 0, 1, 2
"""States of a row: used, left out, or the first after which the walk is unknown."""

_RUN = 5  # rows left out on end after which the walk starts anew at the first of them
_SAMPLE = 2000  # rows that the figures of a series are found on
_SORTED = 4
_TAIL = 0.0005  # of the gate
_REACH = 16  # rows between the members of the widest pairs the first guess is made of
_LOGARITHMS = np.arange(-16.0, 5.5, 1.5)  # of q Δt/σ², that are tried
_RIDGE = 1e-9  # columns that depend on others harm no more than that


class Level(NamedTuple):
    """The figures of the model: ``sigma`` in m, and ``ratio`` q/σ² in 1/s."""

    sigma: float
    ratio: float


def first_level(y: FloatArray, step: FloatArray) -> Level:
    """Guess the figures from the medians of differences over 1 and 16 rows.

    Parameters
    ----------
    y
        (n,) m.
    step
        (n,) s since the row before.
    """
    near, far = (
        float((MAD_TO_SIGMA * np.median(np.abs(y[k:] - y[:-k]))) ** 2) for k in (1, _REACH)
    )
    usual = max(float(np.median(step)), 1e-6)
    walk = max(far - near, 0.0) / ((_REACH - 1) * usual)
    white = max(0.5 * (near - walk * usual), 0.05 * near, 1e-12)
    return Level(float(np.sqrt(white)), max(walk / white, math.exp(_LOGARITHMS[0]) / usual))


def fit_level(columns: FloatArray, step: FloatArray, state: IntArray) -> Level:
    """Give the figures of a series whose rows have been sorted out.

    The likelihood is the restricted one: the freedom that the other columns take is counted. Where
    the series is short it says little about q, and its maximum is often 0; σ and q are therefore
    means over the likelihood, log q being anything as likely as anything else at first.

    Parameters
    ----------
    columns
        (n, c) what explains the series, and last the series itself, m.
    step, state
        As `whiten`.
    """
    usual = max(float(np.median(step)), 1e-6)
    scale = np.abs(columns).max(axis=0)
    kept = scale > 0.0
    kept[-1] = True
    scaled = columns.compress(kept, axis=1) / np.where(scale[kept] > 0.0, scale[kept], 1.0)
    ratios = np.exp(_LOGARITHMS) / usual
    cost, variance = np.empty(len(ratios)), np.empty(len(ratios))
    for i, ratio in enumerate(ratios):
        gram, logarithms, count = gather(scaled, step, state, ratio)
        cost[i], variance[i] = _restricted(gram, logarithms, count)
    share = np.exp(0.5 * (cost.min() - cost))
    share /= share.sum()
    unit = max(float(scale[-1]), 1e-300) ** 2
    white, walk = float(share @ variance), float(share @ (variance * ratios))
    return Level(math.sqrt(max(white * unit, 1e-24)), walk / max(white, 1e-300))


def _restricted(gram: FloatArray, logarithms: float, count: int) -> tuple[float, float]:
    """Minus twice the restricted log-likelihood, and the variance σ² that goes with it."""
    inner = gram[:-1, :-1]
    size = np.sqrt(np.diag(inner))
    size = np.where(size > 0.0, size, 1.0)
    unit = inner / np.outer(size, size) + _RIDGE * np.eye(len(size))
    right = gram[:-1, -1] / size
    left = float(gram[-1, -1] - right @ np.linalg.solve(unit, right)) if len(size) else gram[-1, -1]
    free = max(count - len(size), 1)
    variance = max(left, 1e-300) / free
    spread = float(np.linalg.slogdet(unit)[1] + 2.0 * np.log(size).sum())
    return free * math.log(variance) + logarithms + spread, variance


def both_ways(
    residual: FloatArray,
    step: FloatArray,
    broken: BoolArray,
    sigma: FloatArray,
    ratio: FloatArray,
    gate: float,
) -> IntArray:
    """Sort rows out forward and backward in time; what either leaves out is left out.

    One direction alone would keep the beginning of a ramp and leave out its end: the rows kept
    would tell of a delay that is none. Arguments as of `sort_out`.
    """
    forward = sort_out(residual, step, broken, sigma, ratio, gate)
    back_step = np.append(step[1:], 0.0)[::-1].copy()
    back_broken = np.append(broken[1:], True)[::-1].copy()
    backward = sort_out(residual[::-1].copy(), back_step, back_broken, sigma, ratio, gate)[::-1]
    kept = (forward != SKIP) & (backward != SKIP)
    breaks = forward == RESTART
    breaks[1:] |= backward[:-1] == RESTART
    piece = np.cumsum(breaks)
    state = np.where(kept, USE, SKIP)
    piece = piece[kept]
    state[np.flatnonzero(kept)[np.diff(piece, prepend=-1) != 0]] = RESTART
    return state


def outliers(values: FloatArray, step: FloatArray, broken: BoolArray, gate: float) -> IntArray:
    """Sort out a series (n, d) of unknown figures, n > 16; the other arguments as of `sort_out`.

    The gate is in standard deviations of one axis.
    """
    part = slice(max(len(step) - _SAMPLE, 0) // 2, None)
    few, apart, cut = values[part][:_SAMPLE], step[part][:_SAMPLE], broken[part][:_SAMPLE]
    gate *= block_scale(values.shape[1], _TAIL)
    levels = [first_level(axis, apart) for axis in few.T]
    for _ in range(_SORTED):
        sigma, ratio = np.array(levels).T
        state = both_ways(few, apart, cut, sigma, ratio, gate)
        levels = [fit_level(axis[:, None], apart, state) for axis in few.T]
    sigma, ratio = np.array(levels).T
    return both_ways(values, step, broken, sigma, ratio, gate)


@kernel
def sort_out(
    residual: FloatArray,
    step: FloatArray,
    broken: BoolArray,
    sigma: FloatArray,
    ratio: FloatArray,
    gate: float,
) -> IntArray:
    """Tell which rows are used, left out, or start the walk anew; all axes of a row together.

    Parameters
    ----------
    residual, step
        (n, d) m, and (n,) s since the row before.
    broken
        (n,) rows before which the walk is unknown.
    sigma, ratio
        (d,) figures of the model.
    gate
        Rows whose innovation is longer than so many standard deviations are left out.
    """
    n, d = residual.shape
    state = np.zeros(n, np.int64)
    mean, p = np.zeros(d), np.ones(d)
    k, count = 0, 0
    while k < n:
        if k == 0 or broken[k] or state[k] == RESTART:
            state[k] = RESTART
            mean[:], p[:], count = residual[k], 1.0, 0
            k += 1
            continue
        distance = 0.0
        for i in range(d):
            p[i] += ratio[i] * step[k]
            distance += (residual[k, i] - mean[i]) ** 2 / (sigma[i] ** 2 * (p[i] + 1.0))
        if distance > gate * gate:
            state[k] = SKIP
            count += 1
            if count == _RUN:
                k -= _RUN - 1
                state[k : k + _RUN] = USE
                state[k] = RESTART
                continue
        else:
            for i in range(d):
                gain = p[i] / (p[i] + 1.0)
                mean[i] += gain * (residual[k, i] - mean[i])
                p[i] *= 1.0 - gain
            state[k] = USE
            count = 0
        k += 1
    return state


@kernel
def whiten(
    columns: FloatArray, step: FloatArray, state: IntArray, ratio: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Innovations of columns under the model, over their standard deviation in units of σ.

    Parameters
    ----------
    columns
        (n, c) in any unit.
    step, state
        (n,) s since the row before, and what `sort_out` says.
    ratio
        q/σ², 1/s.

    Returns
    -------
    rows, size, noise
        (n, c), zero where a row is not used; (n,) variance of the innovation over σ², NaN there;
        and (n,) the mean square that white noise of variance 1 has as a row.
    """
    n, c = columns.shape
    rows = np.zeros((n, c))
    size = np.full(n, np.nan)
    noise = np.zeros(n)
    mean = np.zeros(c)
    p, own = 1.0, 1.0
    for k in range(n):
        if state[k] == RESTART:
            mean[:] = columns[k]
            p, own = 1.0, 1.0
            continue
        p += ratio * step[k]
        if state[k] == SKIP:
            continue
        size[k] = p + 1.0
        gain = p / size[k]
        for i in range(c):
            innovation = columns[k, i] - mean[i]
            rows[k, i] = innovation / np.sqrt(size[k])
            mean[i] += gain * innovation
        noise[k] = (1.0 + own) / size[k]
        own = (1.0 - gain) ** 2 * own + gain**2
        p *= 1.0 - gain
    return rows, size, noise


@kernel
def gather(
    columns: FloatArray, step: FloatArray, state: IntArray, ratio: float
) -> tuple[FloatArray, float, int]:
    """Products of the rows that `whiten` makes: their sum (c, c), Σ log of the sizes, and how many.

    Arguments as of `whiten`.
    """
    n, c = columns.shape
    total = np.zeros((c, c))
    mean, row = np.zeros(c), np.zeros(c)
    p, product, logarithms, count = 1.0, 1.0, 0.0, 0
    for k in range(n):
        if state[k] == RESTART:
            mean[:] = columns[k]
            p = 1.0
            continue
        p += ratio * step[k]
        if state[k] == SKIP:
            continue
        size = p + 1.0
        gain = p / size
        for i in range(c):
            row[i] = columns[k, i] - mean[i]
            mean[i] += gain * row[i]
        for i in range(c):
            part = row[i] / size
            for j in range(i + 1):
                total[i, j] += part * row[j]
        product *= size
        if product > 1e200:
            logarithms += np.log(product)
            product = 1.0
        count += 1
        p *= 1.0 - gain
    for i in range(c):
        for j in range(i):
            total[j, i] = total[i, j]
    return total, logarithms + np.log(product), count
