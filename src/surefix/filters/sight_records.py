"""Records of the filter of single sights: what it supposes, what it remembers, what it finds."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from surefix.types import BoolArray, FloatArray, IntArray

__all__ = [
    "MATURE_SIGHTS",
    "MOST_CHANNELS",
    "MOST_SIGHTS",
    "YOUNG_SIGHTS",
    "SightBank",
    "SightFound",
    "SightModel",
    "SightPrior",
    "SightTrail",
    "Sights",
    "empty_bank",
]

MOST_SIGHTS: Final = 64
"""Hypotheses kept after each sight, as long as it is open where the track is."""

MATURE_SIGHTS: Final = 24
"""Hypotheses kept later."""

YOUNG_SIGHTS: Final = 50
"""Epochs until then."""

MOST_CHANNELS: Final = 30
"""Channels that fit into the bits of a decision."""


class SightModel(NamedTuple):
    """How the target moves and what is seen of it.

    Parameters
    ----------
    axes
        d, 1 … 3; the state is ``[p, v]``.
    density
        (d,) spectral density of the white acceleration, m²/s³.
    kind
        (c,) codes of `surefix.models.sights`, one per channel.
    within
        (d, 2) lowest and highest position, m; infinite where nothing is known.
    """

    axes: int
    density: FloatArray
    kind: IntArray
    within: FloatArray


class SightPrior(NamedTuple):
    """What is supposed of errors before any observation is seen.

    Parameters
    ----------
    wrong, again
        (c,) probability that a sight is wrong by itself, and that it is if the last one of its
        channel was.
    spread
        (c,) scale of the gross errors, m and rad.
    poor
        Probability that a sight is twice as noisy as usual.
    restart
        Probability that the track goes on somewhere else.
    reach, speed
        Standard deviations of the position, m, and the velocity, m/s, where it does.
    """

    wrong: FloatArray
    again: FloatArray
    spread: FloatArray
    poor: float
    restart: float
    reach: float
    speed: float


class Sights(NamedTuple):
    """Single observations of n epochs by c channels.

    Parameters
    ----------
    time
        (n,) s, not decreasing.
    z, variance
        (n, c) m, rad or m/s, and squared; NaN is missing.
    anchor
        (n, c, d) m, where each is taken from.
    fixed
        (n, c) weight decided beforehand, 0 for wrong; NaN where it is open.
    """

    time: FloatArray
    z: FloatArray
    variance: FloatArray
    anchor: FloatArray
    fixed: FloatArray


class SightBank(NamedTuple):
    """All the filter remembers: k hypotheses, each an extended Kalman filter of its own.

    Within an epoch a hypothesis holds its prediction and the sights taken so far; its state is the
    most likely one given both, ``x = chart(base + root · step)``.

    Parameters
    ----------
    time
        (1,) s; NaN before the first epoch.
    number, age
        (1,) how many of the k are in use, and how many epochs they have seen.
    weight
        (k,) logarithms, their exponentials sum to 1.
    mean, covariance
        (k, 2d) and (k, 2d, 2d).
    faulty
        (k,) bit mask of the channels whose last sight was wrong.
    slip
        (k, c) how much it was off: the next is often off alike.
    base, root
        (k, 2d) prediction and (k, 2d, 2d) the Cholesky factor of its covariance.
    step
        (k, 2d) distance from the prediction in its own standard deviations.
    normal
        (k, 2d, 2d) Cholesky factor of the information on ``step``.
    evidence
        (k,) log-likelihood of the epoch's sights taken so far.
    used, poor
        (k,) bit masks of them.
    curved
        (k,) whether positions follow the sphere about the anchors; see `sight_fit`.
    """

    time: FloatArray
    number: IntArray
    age: IntArray
    weight: FloatArray
    mean: FloatArray
    covariance: FloatArray
    faulty: IntArray
    slip: FloatArray
    base: FloatArray
    root: FloatArray
    step: FloatArray
    normal: FloatArray
    evidence: FloatArray
    used: IntArray
    poor: IntArray
    curved: BoolArray


class SightTrail(NamedTuple):
    """Where hypotheses came from.

    Parameters
    ----------
    parent
        (n, k) place in the bank before the epoch.
    used, poor
        (n, k) bit masks of the sights taken.
    restarted
        (n, k) whether the track went on somewhere else.
    best
        (n,) place of the likeliest.
    """

    parent: IntArray
    used: IntArray
    poor: IntArray
    restarted: BoolArray
    best: IntArray


class SightFound(NamedTuple):
    """What the mixture of hypotheses says of each of n epochs.

    Parameters
    ----------
    mean, covariance
        (n, 2d) and (n, 2d, 2d) of the mixture.
    weight
        (n, c) probability that the sight belongs to the track; NaN where there is none.
    standardised
        (n, c) innovation of the likeliest hypothesis over its standard deviation.
    evidence
        (n,) log-likelihood of the epoch's sights given those before.
    """

    mean: FloatArray
    covariance: FloatArray
    weight: FloatArray
    standardised: FloatArray
    evidence: FloatArray


def empty_bank(axes: int, channels: int, most: int) -> SightBank:
    """Make a bank without hypotheses, with room for ``most`` and one more."""
    k, s = most + 1, 2 * axes
    return SightBank(
        np.full(1, np.nan),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        np.zeros(k),
        np.zeros((k, s)),
        np.zeros((k, s, s)),
        np.zeros(k, np.int64),
        np.zeros((k, channels)),
        np.zeros((k, s)),
        np.zeros((k, s, s)),
        np.zeros((k, s)),
        np.zeros((k, s, s)),
        np.zeros(k),
        np.zeros(k, np.int64),
        np.zeros(k, np.int64),
        np.zeros(k, np.bool_),
    )
