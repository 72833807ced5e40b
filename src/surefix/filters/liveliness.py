"""Process noise that follows a stream: what was settled at rest does not hold under way.

A filter whose process noise is too small lags behind, and its innovations lean to one side for a
while: each agrees in sign with the one before. Where the products of neighbouring innovations,
which have no mean if all is well, are far above nought, the process noise is estimated anew on the
last epochs; it is taken over if it is larger and the data clearly prefer it. It never falls: what
has been lively may be so again, and too much costs little where too little costs the track.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar

import numpy as np

from surefix.filters.noise import NoiseFigures, Observations, estimate_noise
from surefix.filters.records import Epochs, Estimate, Motion
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["Change", "Lively", "begin_lively", "follow"]

_STEP: Final = 30  # epochs after which it is looked again
_SCALES: Final = (1, 2, 4, 8)  # steps that are looked back over, each for itself
_FAR: Final = 5.0  # standard deviations of the sum of products that call for an estimate
_WINDOW: Final = 120  # epochs it is made on
_LARGEST: Final = 3.0  # no standardised innovation counts for more
_LARGER: Final = 1.5  # factor of the standard deviation that is worth a change …
_GAIN: Final = 6.0  # … with so much log-likelihood gained
_PAUSE: Final = 20_000  # epochs between two looks that found nothing, at most
_BELONGS: Final = 0.5  # an observation of less weight is not looked at

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
    recent, used
        The last epochs, their variances as adapted, and (n, m) whether a component belonged to the
        track.
    last
        (m,) the last standardised innovation of each component; NaN before the first.
    products
        (n, blocks, 2) sums of products of neighbouring innovations, and how many, at the epochs of
        the step that is not complete.
    steps
        (8, blocks, 2) the same of the steps before, whole.
    rest, pause
        (blocks,) steps until it is looked again, and how long that was the last time.
    """

    density: FloatArray
    recent: Epochs
    used: BoolArray
    last: FloatArray
    products: FloatArray
    steps: FloatArray
    rest: IntArray
    pause: IntArray


def begin_lively(motion: Motion, blocks: int) -> Lively:
    """Begin with the process noise of a motion, for so many blocks of axes that share it."""
    m = 2 * motion.axes
    none, whole = np.empty((0, m)), np.empty(0, np.int64)
    return Lively(
        motion.density.copy(),
        Epochs(np.empty(0), none, none, np.empty((0, motion.groups)), whole, whole),
        np.empty((0, m), np.bool_),
        np.full(m, np.nan),
        np.zeros((0, blocks, 2)),
        np.zeros((_SCALES[-1], blocks, 2)),
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
    *,
    whole: bool,
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
    whole
        Whether what the filter left out is looked at as well: one of a single hypothesis that lags
        behind locks itself out.

    Returns
    -------
    state, lively, estimate, changes
        After the part, what is said of its epochs, and what changed. They do not depend on how a
        series is cut into parts.
    """
    found: list[Estimate] = []
    changes: list[Change] = []
    at = 0
    while True:
        current = motion._replace(density=lively.density)
        part = _part(epochs, slice(at, None))
        after, estimate = run(current, part, state)
        end, asked = _asked(lively, current, blocks, estimate, whole)
        if end < len(part.time):
            part = _part(part, slice(0, end))
            after, estimate = run(current, part, state)
        lively = _noted(lively, current, blocks, part, estimate, whole)
        state, at = after, at + end
        found.append(estimate)
        for block in asked:
            lively, change = _estimated(lively, current, block, blocks[block], at - 1)
            changes += change
        if at >= len(epochs.time):
            return state, lively, _joined(found), tuple(changes)


def _part(epochs: Epochs, part: slice) -> Epochs:
    return Epochs._make(each[part] for each in epochs)


def _joined(parts: list[Estimate]) -> Estimate:
    if len(parts) == 1:
        return parts[0]
    return Estimate._make(np.concatenate(each) for each in zip(*parts, strict=True))


def _counts(motion: Motion, found: Estimate, whole: bool) -> BoolArray:
    """(n, m) whether a component is looked at."""
    seen = np.isfinite(found.standardised)
    if whole:
        return seen
    weight = found.weight[:, motion.group[: seen.shape[1]]]
    return np.asarray((weight > _BELONGS) & seen)


def _products(
    lively: Lively, motion: Motion, blocks: Sequence[Sequence[int]], found: Estimate, whole: bool
) -> tuple[FloatArray, FloatArray]:
    """(n, blocks, 2) sums and counts at each epoch, those of the open step first; and (m,) last."""
    used, d = _counts(motion, found, whole), motion.axes
    out = np.zeros((len(used), len(blocks), 2))
    last = lively.last.copy()
    for b, axes in enumerate(blocks):
        for c in (*axes, *(d + a for a in axes)):
            rows = np.flatnonzero(used[:, c])
            values = np.clip(found.standardised[rows, c], -_LARGEST, _LARGEST)
            before = np.concatenate([[last[c]], values])[:-1]
            known = np.isfinite(before)
            out[rows[known], b, 0] += (values * before)[known]
            out[rows[known], b, 1] += 1.0
            last[c] = values[-1] if len(values) else last[c]
    return np.concatenate([lively.products, out]), last


def _steps(lively: Lively, products: FloatArray) -> FloatArray:
    """(8 + n, blocks, 2) sums over the steps before, and over those now whole."""
    whole = len(products) // _STEP
    each = products[: whole * _STEP].reshape(whole, _STEP, *products.shape[1:])
    total = np.zeros((whole, *products.shape[1:]))
    for k in range(_STEP):  # in this order, however many there are
        total += each[:, k]
    return np.concatenate([lively.steps, total])


def _asked(
    lively: Lively, motion: Motion, blocks: Sequence[Sequence[int]], found: Estimate, whole: bool
) -> tuple[int, list[int]]:
    """Tell after how many epochs an estimate is called for, and of which blocks.

    All epochs, and of none, where it is not.
    """
    products, _ = _products(lively, motion, blocks, found, whole)
    steps, most = _steps(lively, products), _SCALES[-1]
    number = len(steps) - most
    far = np.zeros((number, len(blocks)), np.bool_)
    total = np.zeros((number, len(blocks), 2))
    for k in range(most):
        total += steps[most - k : most - k + number]
        if k + 1 in _SCALES:
            far |= total[..., 0] > _FAR * np.sqrt(total[..., 1])
    far &= np.arange(number)[:, None] >= lively.rest
    if not far.any():
        return len(found.mean), []
    step = int(np.argmax(far.any(axis=1)))
    end = (step + 1) * _STEP - len(lively.products)
    return end, np.flatnonzero(far[step]).tolist()


def _noted(
    lively: Lively,
    motion: Motion,
    blocks: Sequence[Sequence[int]],
    epochs: Epochs,
    found: Estimate,
    whole: bool,
) -> Lively:
    """Remember what a part brought."""
    products, last = _products(lively, motion, blocks, found, whole)
    steps = _steps(lively, products)
    number = len(products) // _STEP
    variance = epochs.variance.copy()
    variance[:, : motion.axes] *= found.scale[:, None]
    epochs = epochs._replace(variance=variance)
    pairs = zip(lively.recent, epochs, strict=True)
    recent = Epochs._make(np.concatenate(pair)[-_WINDOW:] for pair in pairs)
    return lively._replace(
        recent=recent,
        used=np.concatenate([lively.used, _counts(motion, found, whole)])[-_WINDOW:],
        last=last,
        products=products[number * _STEP :],
        steps=steps[-_SCALES[-1] :],
        rest=np.maximum(lively.rest - number, 0),
    )


def _estimated(
    lively: Lively, motion: Motion, block: int, axes: Sequence[int], after: int
) -> tuple[Lively, tuple[Change, ...]]:
    """Estimate the process noise of a block anew, and take it over if it is clearly larger."""
    columns = [*axes, *(motion.axes + a for a in axes)]
    recent = lively.recent
    z = np.where(lively.used, recent.z, np.nan)[:, columns]
    seen = np.isfinite(z).any(axis=1)
    sigma = np.sqrt(recent.variance[seen][:, columns])
    observations = Observations(recent.time[seen], z[seen], np.zeros(seen.sum(), np.int64), sigma)
    place, speed = (np.array([np.nanmedian(part)]) for part in np.split(sigma, 2, axis=1))
    before = float(np.sqrt(lively.density[axes[0]]))

    def fit(process: float) -> NoiseFigures:
        given = NoiseFigures(place, speed, process)
        return estimate_noise(observations, given, order=motion.order, period=motion.period)

    found = fit(np.nan)
    pause, rest = lively.pause.copy(), lively.rest.copy()
    if found.process < _LARGER * before or fit(before).cost - found.cost < _GAIN:
        rest[block] = pause[block]
        pause[block] = min(2 * pause[block], _PAUSE // _STEP)
        return lively._replace(rest=rest, pause=pause), ()
    pause[block] = _WINDOW // _STEP
    rest[block] = 1
    density, steps = lively.density.copy(), lively.steps.copy()
    density[list(axes)] = found.process**2
    steps[:, block] = 0.0  # what went before was judged by less
    change = Change(after, block, before, found.process)
    return lively._replace(density=density, steps=steps, rest=rest, pause=pause), (change,)
