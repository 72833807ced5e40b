"""White noise on a random walk: what stands beside it is whitened, wild values left out.

    y_k = c_k + e_k,   e_k ~ N(0, σ²),   c_{k+1} = c_k + N(0, q (t_{k+1} − t_k))

The Kalman filter of this model turns y, and any column that goes with it, into innovations of unit
variance over σ: generalised least squares become ordinary ones (Harvey, Forecasting, Structural
Time Series Models and the Kalman Filter, 1989, 3.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from surefix.cleaning.hampel import MAD_TO_SIGMA
from surefix.jit import kernel
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["RESTART", "SKIP", "USE", "Level", "first_level", "fit_level", "sort_out", "whiten"]

USE, SKIP, RESTART = 0, 1, 2
"""States of a row: used, left out, or the first after which the walk is unknown."""

_RUN = 5  # rows left out on end after which the walk starts anew at the first of them
_REACH = 16  # rows between the members of the widest pairs the first guess is made of
_SLOWEST, _FASTEST = -16.0, 5.0  # logarithms of q Δt/σ² that are tried


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
    return Level(float(np.sqrt(white)), max(walk / white, np.exp(_SLOWEST) / usual))


def fit_level(residual: FloatArray, step: FloatArray, state: IntArray) -> Level:
    """Give the likeliest figures of a residual (n,) m whose rows have been sorted out."""
    usual = max(float(np.median(step)), 1e-6)
    column = residual[:, None]

    def cost(logarithm: float) -> float:
        rows, size, _ = whiten(column, step, state, float(np.exp(logarithm)) / usual)
        inner = rows[np.isfinite(size), 0]
        return float(
            len(inner) * np.log(max(np.mean(inner**2), 1e-300)) + np.nansum(np.log(size))
        )

    best = minimize_scalar(
        cost, bounds=(_SLOWEST, _FASTEST), method="bounded", options={"xatol": 0.05}
    )
    ratio = float(np.exp(best.x)) / usual
    rows, size, _ = whiten(column, step, state, ratio)
    return Level(float(np.sqrt(max(np.mean(rows[np.isfinite(size)] ** 2), 1e-24))), ratio)


@kernel
def sort_out(
    residual: FloatArray, step: FloatArray, broken: BoolArray, level: Level, gate: float
) -> IntArray:
    """Tell which rows are used, left out, or start the walk anew.

    Parameters
    ----------
    residual, step
        (n,) m, and s since the row before.
    broken
        (n,) rows before which the walk is unknown.
    level
        Figures of the model.
    gate
        Innovations beyond so many standard deviations are left out.
    """
    n = len(residual)
    state = np.zeros(n, np.int64)
    k, count, mean, p = 0, 0, 0.0, 1.0
    while k < n:
        if k == 0 or broken[k] or state[k] == RESTART:
            state[k] = RESTART
            mean, p, count = residual[k], 1.0, 0
            k += 1
            continue
        p += level.ratio * step[k]
        innovation = residual[k] - mean
        if abs(innovation) > gate * level.sigma * np.sqrt(p + 1.0):
            state[k] = SKIP
            count += 1
            if count == _RUN:
                k -= _RUN - 1
                state[k : k + _RUN] = USE
                state[k] = RESTART
                continue
        else:
            gain = p / (p + 1.0)
            mean += gain * innovation
            p *= 1.0 - gain
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
