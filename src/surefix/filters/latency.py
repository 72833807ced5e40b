"""How late the positions of one sensor are against the velocities of another.

A fix stamped t that describes the place at t − δ differs from the displacement s by what the
vehicle travels in δ seconds:

    z_k = c_k + s(t_k − δ) + X_k β + e_k,   e white,   c a random walk

The walk c takes the start, the drift of the integrated noise and, where it starts anew, jumps;
wrong fixes are left out. X holds what looks a little like a delay and is none: a wrong scale and
heading of the velocity (columns s and s turned by 90°) and the lateral arm between the sensors
(the course turned by 90°). δ is found by Gauss–Newton steps over the whitened rows of all axes.

The noise of the velocity must not pass for changes of velocity: its expected part N of the
information I of the column ṡ is taken off, and the variance of the estimate is I/(I − N)². Where
N is the larger part the log cannot tell.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from surefix.cleaning.hampel import MAD_TO_SIGMA
from surefix.filters.dead_reckoning import (
    DeadReckoning,
    dead_reckoning,
    displacement,
    velocity_at,
    velocity_known,
)
from surefix.filters.random_walk import (
    RESTART,
    SKIP,
    USE,
    Level,
    both_ways,
    first_level,
    fit_level,
    whiten,
)
from surefix.robust.loss import block_scale
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["UNKNOWN", "Latency", "latency"]

_LEAST = 30  # fixes
_MOST = 4000  # fixes that are looked at …
_STRETCH = 250  # … in stretches of so many
_RANGE = (10.0, 5.0)  # s, and intervals between fixes: the larger is searched either way
_GRID = 100  # steps of the search either way
_SPANS = (1, 4, 16)  # fixes between the members of the pairs that the search compares
_GATE, _TAIL = 3.5, 0.0005  # σ of one axis, and its tail
_SORTED = 6  # times that rows are sorted out before the first step
_STEPS = 12
_ENOUGH = 0.02  # standard errors: a smaller step is the last
_NEARLY = 0.3  # … and a larger one, after so many, has come to nothing
_PIECE = 10  # rows between breaks that are worth anything
_REAL = 0.6  # share of the information that is not noise, at least
_BLOCK = 20  # rows whose errors may hang together
_ARM = 3.0  # standard errors from which an arm along the course is believed
_SLOW = 0.25  # of the usual speed: below it the course says little


class Latency(NamedTuple):
    """A delay of positions against velocities.

    Parameters
    ----------
    delay, sigma
        s, and its standard error. Positive: the positions describe an earlier time than stamped.
        NaN and infinity where the log cannot tell.
    arm, arm_sigma
        m the position lies ahead along the course, and its standard error; an arm within three
        standard errors is taken as 0 in ``delay``. NaN and infinity where it cannot be told from a
        delay at all.
    speed
        Usual speed, m/s: what an arm along the course would have to be for a delay, per second.
    fixes
        How many were used.
    interval
        Median step between the fixes, s.
    """

    delay: float
    sigma: float
    arm: float
    arm_sigma: float
    speed: float
    fixes: int
    interval: float


UNKNOWN = Latency(math.nan, math.inf, math.nan, math.inf, math.nan, 0, math.nan)
"""What a log says that cannot tell."""


class _Data(NamedTuple):
    """Fixes of one stretch after the other, and the way against which they are held."""

    time: FloatArray
    position: FloatArray
    stretch: IntArray
    way: DeadReckoning
    longest: float
    half: float
    limit: float


class _Fit(NamedTuple):
    step: float
    sigma: float
    arm: float
    arm_sigma: float
    explained: FloatArray
    levels: list[Level]
    used: int


def latency(
    time: FloatArray,
    position: FloatArray,
    velocity_time: FloatArray,
    velocity: FloatArray,
) -> Latency:
    """Estimate the delay of positions against velocities.

    Parameters
    ----------
    time, position
        (n,) s, not decreasing; (n, d) m, d = 1 … 3, NaN is missing. Axes are x, y, z in this order;
        the first two are horizontal. Wrong fixes, also in runs, and jumps may be among them. Of
        more than 4,000 the stretches with most change of velocity are taken.
    velocity_time, velocity
        (m,) s, not decreasing; (m, d) m/s in the same axes, NaN is missing.

    Examples
    --------
    >>> rng, t = np.random.default_rng(1), np.arange(400.0)
    >>> late = 20.0 * np.sin((t - 1.5) / 20.0) + 0.3 * rng.standard_normal(400)
    >>> speed = np.cos(t / 20.0) + 0.01 * rng.standard_normal(400)
    >>> found = latency(t, late[:, None], t, speed[:, None])
    >>> bool(abs(found.delay - 1.5) < 3.0 * found.sigma < 0.2)
    True
    """
    data = _prepare(time, position, velocity_time, velocity)
    if data is None:
        return UNKNOWN
    at, fit = _settle(data, _search(data), arm=False)
    if fit is not None and abs(fit.arm) > _ARM * fit.arm_sigma:
        at, fit = _settle(data, at, arm=True)
    if fit is None:
        return UNKNOWN
    interval = float(np.median(np.diff(data.time)))
    speed = float(np.median(np.linalg.norm(data.way.velocity, axis=1)))
    return Latency(at, fit.sigma, fit.arm, fit.arm_sigma, speed, fit.used, interval)


def _settle(data: _Data, at: float, *, arm: bool) -> tuple[float, _Fit | None]:
    """Step from a delay until it stays, without or with an arm along the course; None if never."""
    explained = np.zeros(_columns(data.position.shape[1]))
    levels: list[Level] = []
    fit, last = None, math.inf
    for _ in range(_STEPS):
        fit = _fit(data, at, explained, levels, arm=arm)
        if fit is None or abs(at + fit.step) > data.limit:
            return at, None
        at, explained, levels = at + fit.step, fit.explained, fit.levels
        last = abs(fit.step) / fit.sigma
        if last < _ENOUGH:
            break
    return at, fit if last < _NEARLY else None


def _prepare(
    time: FloatArray, position: FloatArray, velocity_time: FloatArray, velocity: FloatArray
) -> _Data | None:
    """Axes that both sensors have, stretches that tell most, and velocity fit to integrate."""
    moving = np.isfinite(velocity).any(axis=0) & np.isfinite(position).any(axis=0)
    if not moving.any():
        return None
    fixed = np.isfinite(position[:, moving]).all(axis=1) & np.isfinite(time)
    time, position = time[fixed], position[np.ix_(fixed, moving)]
    if len(time) < _LEAST or np.isfinite(velocity[:, moving]).all(axis=1).sum() < _LEAST:
        return None
    rows, stretch = _chosen(time, velocity_time, velocity[:, moving])
    time, position = time[rows], position[rows]
    interval = float(np.median(np.diff(time)))
    limit = max(_RANGE[0], _RANGE[1] * interval)
    near = _within(time, stretch, velocity_time, 1.5 * limit)
    way = dead_reckoning(velocity_time[near], velocity[np.ix_(near, moving)])
    if len(way.time) < _LEAST:
        return None
    half = max(0.25 * interval, 0.5 * way.interval)
    longest = max(4.0 * way.interval, interval)
    return _Data(time, position, stretch, way, longest, half, limit)


def _chosen(
    time: FloatArray, velocity_time: FloatArray, velocity: FloatArray
) -> tuple[IntArray, IntArray]:
    """Rows of the fixes that are looked at, and the stretch each belongs to."""
    n = len(time)
    stretches = n // _STRETCH
    if n <= _MOST:
        return np.arange(n), np.zeros(n, np.int64)
    edges = np.searchsorted(velocity_time, time[: stretches * _STRETCH : _STRETCH // 5])
    medians = np.array(
        [
            np.nanmedian(velocity[a:b], axis=0) if np.isfinite(velocity[a:b]).any() else lost
            for lost in [np.full(velocity.shape[1], np.nan)]
            for a, b in zip(edges, [*edges[1:], len(velocity)], strict=True)
        ]
    ).reshape(stretches, 5, -1)
    change = np.nansum(np.nan_to_num(np.ptp(medians, axis=1)), axis=1)
    best = np.sort(np.argsort(-change, kind="stable")[: _MOST // _STRETCH])
    rows = (best[:, None] * _STRETCH + np.arange(_STRETCH)).ravel()
    return rows, np.repeat(np.arange(len(best)), _STRETCH)


def _within(
    time: FloatArray, stretch: IntArray, velocity_time: FloatArray, margin: float
) -> BoolArray:
    """Velocities that belong to the stretches."""
    first = np.flatnonzero(np.diff(stretch, prepend=-1))
    last = np.append(first[1:], len(time)) - 1
    begin = np.searchsorted(velocity_time, time[first] - margin)
    end = np.searchsorted(velocity_time, time[last] + margin, side="right")
    count = np.zeros(len(velocity_time) + 1, np.int64)
    np.add.at(count, begin, 1)
    np.add.at(count, end, -1)
    return np.cumsum(count)[:-1] > 0


def _search(data: _Data) -> float:
    """Delay for which differences of the fixes best follow the displacement."""
    tried = np.linspace(-data.limit, data.limit, 2 * _GRID + 1)
    cost = np.zeros(len(tried))
    scales: dict[tuple[int, int], float] = {}
    for i in np.argsort(np.abs(tried), kind="stable"):
        y = data.position - displacement(data.way, data.time - tried[i])
        for span in _SPANS:
            apart = y[span:] - y[:-span]
            for axis in range(y.shape[1]):
                value = np.abs(apart[:, axis])
                key = span, axis
                if key not in scales:
                    scales[key] = max(MAD_TO_SIGMA * float(np.median(value)), 1e-9)
                cost[i] += float(np.log1p((value / scales[key]) ** 2).sum())
    return float(tried[np.argmin(cost)])


def _columns(axes: int) -> int:
    """How many columns there are: the delay, the arm along the course, and the others."""
    return 5 if axes > 1 else 3


def _fit(
    data: _Data, at: float, explained: FloatArray, before: list[Level], *, arm: bool
) -> _Fit | None:
    """One Gauss–Newton step from a delay."""
    when = data.time - at
    known = velocity_known(data.way, when, data.longest)
    if known.sum() < _LEAST:
        return None
    when, stretch = when[known], data.stretch[known]
    way = displacement(data.way, when)
    rate = velocity_at(data.way, when, data.half)
    step = np.diff(when, prepend=when[0])
    broken = np.diff(stretch, prepend=-1) != 0
    skipped = np.diff(np.flatnonzero(known), prepend=0) > 1
    broken |= skipped & (step > data.longest)
    y = data.position[known] - way
    course, others = _design(way, rate)
    stacked = [
        np.column_stack([-rate[:, i], course[:, i], others[i], y[:, i]]) for i in range(y.shape[1])
    ]
    residual = np.stack([each[:, -1] - each[:, :-1] @ explained for each in stacked], axis=1)
    levels = before or [first_level(axis, step) for axis in residual.T]
    gate = _GATE * block_scale(y.shape[1], _TAIL)
    for _ in range(1 if before else _SORTED):
        sigma, ratio = np.array(levels).T
        state = both_ways(residual, step, broken, sigma, ratio, gate)
        levels = [fit_level(columns, step, state) for columns in stacked]
    state = _long_pieces(state)
    used = state == USE
    if used.sum() < _LEAST:
        return None
    rows, spurious = [], 0.0
    for axis, level in enumerate(levels):
        white, _, noise = whiten(stacked[axis], step, state, level.ratio)
        rows.append(white[used] / level.sigma)
        spurious += _velocity_noise(data, axis, level) * float(noise.sum()) / level.sigma**2
    return _solve(rows, spurious, levels, int(used.sum()), arm=arm)


def _long_pieces(state: IntArray) -> IntArray:
    """Leave out the rows between breaks that are close to each other: half of them may be wrong."""
    piece = np.cumsum(state == RESTART)
    few = np.bincount(piece[state != SKIP], minlength=int(piece[-1]) + 1)[piece] < _PIECE
    return np.where(few, SKIP, state)


def _design(way: FloatArray, rate: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
    """Course (n, d), and for every axis the columns (n, c) that a delay is not."""
    n, d = way.shape
    if d == 1:
        return np.zeros((n, 1)), [way]
    flat = np.hypot(rate[:, 0], rate[:, 1])
    slow = _SLOW * float(np.median(flat)) + 1e-9
    course = np.zeros((n, d))
    course[:, :2] = rate[:, :2] / np.sqrt(flat**2 + slow**2)[:, None]
    turned = np.zeros((n, d)), np.zeros((n, d))
    for out, of in zip(turned, (way, course), strict=True):
        out[:, 0], out[:, 1] = -of[:, 1], of[:, 0]
    return course, [
        np.column_stack([way[:, i] * (i < 2), turned[0][:, i], turned[1][:, i]]) for i in range(d)
    ]


def _velocity_noise(data: _Data, axis: int, level: Level) -> float:
    """Variance of the noise in the mean velocity about a fix, (m/s)².

    White noise of the velocity would make the displacement walk and the velocity rough: the
    smaller of what either allows.
    """
    span = max(2.0 * data.half, 1.5 * data.way.interval)
    walk = level.ratio * level.sigma**2
    rough = float(data.way.noise[axis]) ** 2 * data.way.interval
    return min(walk, rough) / span


def _solve(
    rows: list[FloatArray], spurious: float, levels: list[Level], used: int, *, arm: bool
) -> _Fit | None:
    """Least squares over the whitened rows; columns are delay, arm, the others and y."""
    stacked = np.vstack(rows)
    others, y = stacked[:, 2:-1], stacked[:, -1]
    pair = _apart(stacked[:, :2], others)
    delay, along = pair[:, :1], pair[:, 1:]
    found = _one(_apart(delay, along)[:, 0] if arm else delay[:, 0], y, spurious)
    if found is None:
        return None
    step, sigma = found
    length, length_sigma = _one(_apart(along, delay)[:, 0], y, 0.0) or (math.nan, math.inf)
    explained = _coefficients(stacked[:, :-1], y)
    explained[0] -= step
    return _Fit(step, sigma, length, length_sigma, explained, levels, used)


def _coefficients(columns: FloatArray, y: FloatArray) -> FloatArray:
    """Least squares of columns (n, c) of any size."""
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.asarray(np.linalg.lstsq(columns / scale, y, rcond=1e-9)[0] / scale)


def _apart(columns: FloatArray, from_: FloatArray) -> FloatArray:
    """(n, c) columns less what others (n, o) explain of them."""
    scale = np.linalg.norm(from_, axis=0)
    unit = from_ / np.where(scale > 0.0, scale, 1.0)
    return np.asarray(columns - unit @ np.linalg.lstsq(unit, columns, rcond=1e-9)[0])


def _one(column: FloatArray, y: FloatArray, spurious: float) -> tuple[float, float] | None:
    """Coefficient of a column that nothing else explains, and its standard error."""
    whole = float(column @ column)
    real = whole - spurious
    if real <= _REAL * whole or whole <= 0.0:
        return None
    step = float(column @ y) / whole
    pull = column * (y - step * column)
    blocks = np.add.reduceat(pull, np.arange(0, len(pull), _BLOCK))
    excess = float(blocks @ blocks) / whole
    if excess < 1.0 + 2.0 * math.sqrt(2.0 / len(blocks)):
        excess = 1.0
    return step, math.sqrt(whole * excess) / real
