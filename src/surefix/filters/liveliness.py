"""Process noise that follows a stream: what was settled at rest does not hold under way.

A filter whose process noise is too small lags behind, and its innovations lean to one side for a
while: each agrees in sign with the one before. Where the products of neighbouring innovations,
which have no mean if all is well, are far above nought, larger figures are tried on the last epochs
under several hypotheses, so that a run of wrong fixes is not taken for motion. One that the data
clearly prefer is taken over. It never falls: what has been lively may be so again, and too much
costs little where too little costs the track.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar

import numpy as np

from surefix.filters.hypotheses import Prior
from surefix.filters.hypothesis_evidence import BEGIN, evidence
from surefix.filters.modes import rows_of
from surefix.filters.noise import typical_step
from surefix.filters.records import Epochs, Estimate, Motion
from surefix.filters.track import by_axis
from surefix.types import FloatArray, IntArray

__all__ = ["Change", "Lively", "begin_lively", "follow"]

_STEP: Final = 30  # epochs after which it is looked again
_SCALES: Final = (1, 2, 4, 8)  # steps that are looked back over, each for itself
_FAR: Final = 4.0  # standard deviations of the sum of products that call for an estimate
_WINDOW: Final = 120  # epochs it is made on
_LARGEST: Final = 3.0  # no standardised innovation counts for more
_DOWN, _UP = 1e-8, 100.0  # far below and far above, as variances
_COARSE: Final = 16.0  # factor between two densities that are tried …
_FINE: Final = 1.5 ** np.array([-4.0, -2.0, 2.0, 4.0])  # … and those about the best of them
_GAIN: Final = 10.0  # log-likelihood that is worth a change
_LOUDER: Final = 1.25  # after an estimate that changed nothing, factor on what calls for the next …
_PAUSE: Final = 20_000  # … for so many epochs at most

State = TypeVar("State")


class Change(NamedTuple):
    """A larger process noise.

    Parameters
    ----------
    after
        Epoch after which it holds, counted from the first of the part.
    block
        Number of the block of axes.
    before, process
        Root of the density before and after, as in `surefix.filters.noise.NoiseFigures`.
    """

    after: int
    block: int
    before: float
    process: float


class Lively(NamedTuple):
    """What is remembered; begun by `begin_lively`.

    Parameters
    ----------
    density
        (axes,) of the process noise, at present.
    recent
        The last epochs, their variances as adapted.
    last
        (m,) the last standardised innovation of each component; NaN before the first.
    products
        (n, blocks, 2, 3) sums of products of neighbouring innovations, of positions and of
        velocities, of their squares, and how many, at the epochs of the step not complete.
    steps
        (8, blocks, 2, 3) the same of the steps before, whole.
    level, rest, pause
        (blocks,) standard deviations of the sum of products that call for an estimate, for how
        many steps they are more than usual, and for how many they will be the next time.
    """

    density: FloatArray
    recent: Epochs
    last: FloatArray
    products: FloatArray
    steps: FloatArray
    level: FloatArray
    rest: IntArray
    pause: IntArray


def begin_lively(motion: Motion, blocks: int) -> Lively:
    """Begin with the process noise of a motion, for so many blocks of axes that share it."""
    m = 2 * motion.axes
    none, whole = np.empty((0, m)), np.empty(0, np.int64)
    return Lively(
        motion.density.copy(),
        Epochs(np.empty(0), none, none, np.empty((0, motion.groups)), whole),
        np.full(m, np.nan),
        np.zeros((0, blocks, 2, 3)),
        np.zeros((_SCALES[-1], blocks, 2, 3)),
        np.full(blocks, _FAR),
        np.zeros(blocks, np.int64),
        np.full(blocks, _WINDOW // _STEP),
    )


def follow(
    run: Callable[[Motion, Epochs, State], tuple[State, Estimate]],
    motion: Motion,
    blocks: Sequence[Sequence[int]],
    lively: Lively,
    epochs: Epochs,
    state: State,
    prior: Prior,
) -> tuple[State, Lively, Estimate, tuple[Change, ...]]:
    """Estimate a part of a series in real time, with more process noise wherever it is called for.

    Parameters
    ----------
    run
        Estimates epochs under a motion, from a state on that it does not modify.
    motion
        As it was settled.
    blocks
        Axes that share their process noise.
    lively
        From the part before.
    epochs, state
        The part, and the state of the filter before it.
    prior
        What is supposed of wrong fixes, which are no motion.

    Returns
    -------
    state, lively, estimate, changes
        After the part, what is said of its epochs, and what changed. They do not depend on how a
        series is cut into parts.
    """
    found: list[Estimate] = []
    changes: list[Change] = []
    at, whole = 0, len(epochs.time)
    while True:
        current = motion._replace(density=lively.density)
        part = rows_of(epochs, at, whole)
        after, estimate = run(current, part, state)
        end, lively, larger = _watched(lively, current, blocks, part, estimate, prior)
        if end < len(part.time):
            after, estimate = run(current, rows_of(part, 0, end), state)
        state, at = after, at + end
        found.append(estimate)
        for block in larger:
            before, process = (
                float(density[blocks[block][0]]) ** 0.5
                for density in (current.density, lively.density)
            )
            changes.append(Change(at - 1, block, before, process))
        if at >= whole:
            return state, lively, _joined(found), tuple(changes)


def _joined(parts: list[Estimate]) -> Estimate:
    if len(parts) == 1:
        return parts[0]
    return Estimate._make(np.concatenate(each) for each in zip(*parts, strict=True))


def _watched(
    lively: Lively,
    motion: Motion,
    blocks: Sequence[Sequence[int]],
    epochs: Epochs,
    found: Estimate,
    prior: Prior,
) -> tuple[int, Lively, list[int]]:
    """Watch a part step by step, until some block calls for more process noise.

    Returns after how many epochs that is, or all of them, what is remembered then, and the blocks.
    """
    products = _products(lively, blocks, found)
    steps = _steps(lively, products)
    far = _loudness(steps)
    density, level = lively.density.copy(), lively.level.copy()
    rest, pause = lively.rest.copy(), lively.pause.copy()
    end, done, larger = len(epochs.time), len(far), []
    for step in np.flatnonzero((far > _FAR).any(axis=1)).tolist():
        until = (step + 1) * _STEP - len(lively.products)
        called = far[step] > np.where(step < rest, level, _FAR)
        for block in np.flatnonzero(called).tolist():
            axes = list(blocks[block])
            best = _likeliest(_recent(lively, epochs, found, until), motion, prior, axes)
            rest[block] = step + 1
            if best > motion.density[axes[0]]:
                density[axes], pause[block] = best, _WINDOW // _STEP
                larger.append(block)
            else:
                level[block] = _LOUDER * far[step, block]
                rest[block] += pause[block]
                pause[block] = min(2 * pause[block], _PAUSE // _STEP)
        if larger:
            end, done = until, step + 1
            break
    steps = steps[done : done + _SCALES[-1]].copy()
    steps[:, larger] = 0.0  # what went before was judged by less
    after = Lively(
        density,
        _recent(lively, epochs, found, end),
        _last(lively, found, end),
        products[done * _STEP : len(lively.products) + end].copy(),
        steps,
        level,
        np.maximum(rest - done, 0),
        pause,
    )
    return end, after, larger


def _products(lively: Lively, blocks: Sequence[Sequence[int]], found: Estimate) -> FloatArray:
    """(n, blocks, 2, 3) sums and counts at each epoch, those of the open step first."""
    used, d = np.isfinite(found.standardised), found.standardised.shape[1] // 2
    out = np.zeros((len(used), len(blocks), 2, 3))
    for b, axes in enumerate(blocks):
        for c in (*axes, *(d + a for a in axes)):
            rows = np.flatnonzero(used[:, c])
            values = np.clip(found.standardised[rows, c], -_LARGEST, _LARGEST)
            before = np.concatenate([[lively.last[c]], values])[:-1]
            known = np.isfinite(before)
            product = (values * before)[known]
            out[rows[known], b, c // d] += np.column_stack((product, product**2, known[known]))
    return np.concatenate([lively.products, out])


def _last(lively: Lively, found: Estimate, end: int) -> FloatArray:
    """(m,) the last standardised innovation of each component before an epoch."""
    last = lively.last.copy()
    for c in range(len(last)):
        seen = np.flatnonzero(np.isfinite(found.standardised[:end, c]))
        if len(seen):
            last[c] = np.clip(found.standardised[seen[-1], c], -_LARGEST, _LARGEST)
    return last


def _recent(lively: Lively, epochs: Epochs, found: Estimate, end: int) -> Epochs:
    """The last epochs before one of a part, their variances as adapted."""
    first, axes = max(0, end - _WINDOW), epochs.z.shape[1] // 2
    part = rows_of(epochs, first, end)
    variance = part.variance.copy()
    variance[:, :axes] *= found.scale[first:end, None]
    pairs = zip(lively.recent, part._replace(variance=variance), strict=True)
    return Epochs._make(np.concatenate(pair)[-_WINDOW:] for pair in pairs)


def _steps(lively: Lively, products: FloatArray) -> FloatArray:
    """(8 + n, blocks, 2, 3) sums over the steps before, and over those now whole."""
    whole = len(products) // _STEP
    each = products[: whole * _STEP].reshape(whole, _STEP, *products.shape[1:])
    total = np.zeros((whole, *products.shape[1:]))
    for k in range(_STEP):  # in this order, however many there are
        total += each[:, k]
    return np.concatenate([lively.steps, total])


def _loudness(steps: FloatArray) -> FloatArray:
    """(n, blocks) standard deviations above nought of what (8 + n, blocks, 2, 3) steps sum up to.

    The largest over what is looked back over.
    """
    number = len(steps) - _SCALES[-1]
    far = np.zeros((number, steps.shape[1]))
    total = np.zeros((number, *steps.shape[1:]))
    for k in range(_SCALES[-1]):
        total += steps[_SCALES[-1] - k : len(steps) - k]
        if k + 1 in _SCALES:
            np.maximum(far, _far(total), out=far)
    return far


def _far(total: FloatArray) -> FloatArray:
    """(n, blocks) standard deviations that sums (n, blocks, 2, 3) lie above nought.

    They are those of the products themselves: wild fixes make them large, but of any sign. Beside
    velocities these are asked alone: fixes that wander off from them are no motion.
    """
    positions, velocities = total[..., 0, :], total[..., 1, :]
    aided = 2.0 * velocities[..., 2:] >= np.maximum(positions[..., 2:], 1.0)
    asked = np.where(aided, velocities, positions + velocities)
    return np.asarray(asked[..., 0] / np.sqrt(np.maximum(asked[..., 1], 1.0)))


def _likeliest(recent: Epochs, motion: Motion, prior: Prior, axes: list[int]) -> float:
    """Density of the process noise of some axes: a larger one if clearly likelier, else as now."""
    now = float(motion.density[axes[0]])

    def likely(density: float) -> float:
        return _evidence(recent, motion, prior, axes, density)

    low, high = _bounds(recent, motion, axes)
    coarse = [
        q for q in low * _COARSE ** np.arange(np.log(high / low) / np.log(_COARSE)) if q > now
    ]
    reached = {q: likely(q) for q in (now, *coarse)}
    best = max(reached, key=lambda q: reached[q])
    reached |= {q: likely(q) for q in best * _FINE if q > now}
    best = max(reached, key=lambda q: reached[q])
    return best if reached[best] - reached[now] >= _GAIN else now


def _bounds(recent: Epochs, motion: Motion, axes: list[int]) -> tuple[float, float]:
    """Densities whose noise over a step is far below that of a fix, and far above what changes."""
    step = typical_step(recent.time)
    least, most = np.inf, 0.0
    for c in (*axes, *(motion.axes + a for a in axes)):
        z = recent.z[:, c]
        z = z[np.isfinite(z)]
        if motion.period and c < motion.axes:
            z = np.unwrap(z, period=motion.period)
        if len(z) < 2:
            continue
        scale = step ** (2 * (motion.order - (c >= motion.axes)) - 1)
        variance = float(np.nanmedian(recent.variance[:, c]))
        least = min(least, variance / scale)
        most = max(most, (variance + float(np.quantile(np.diff(z) ** 2, 0.9))) / scale)
    if not most > 0.0:
        return 1.0, 1.0
    return least * _DOWN, most * _UP


def _evidence(
    recent: Epochs, motion: Motion, prior: Prior, axes: list[int], density: float
) -> float:
    """Log-likelihood of the last epochs of some axes, whose fixes may be wrong for a while."""
    d = len(axes)
    columns = [*axes, *(motion.axes + a for a in axes)]
    moving = Motion(motion.order, d, np.full(d, density), by_axis(d), 2 * d, motion.period)
    epochs = recent._replace(
        z=recent.z.take(columns, axis=1),  # C-contiguous, for which the filter is compiled
        variance=recent.variance.take(columns, axis=1),
        fixed=np.full((len(recent.time), 2 * d), np.nan),
    )
    alike = prior._replace(spread=prior.spread[columns])
    return evidence(moving, alike, epochs, begin=BEGIN)
