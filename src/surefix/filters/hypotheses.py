"""Records of the multi-hypothesis filter: what it supposes, what it remembers, what it finds."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from surefix.filters.records import Motion
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = [
    "COMMIT",
    "CONTINUE",
    "DENY",
    "DROP",
    "MANOEUVRE",
    "MOST",
    "MOST_SENSORS",
    "OPEN",
    "POOR",
    "POOR_WEIGHT",
    "RESTART",
    "RESTARTS",
    "VELOCITY_OUT",
    "VELOCITY_POOR",
    "WALK",
    "Bank",
    "Found",
    "Prior",
    "Trail",
    "no_hypotheses",
]

MOST: Final = 32
"""Hypotheses kept after each epoch."""

MOST_SENSORS: Final = 62
"""Sensors that are told apart; any more count as the last one."""

# What a hypothesis says of an epoch: bits 0 … 2 are the axes of the position that are wrong by
# themselves; the others say what became of a run of fixes with a common offset.
OPEN: Final = 8
CONTINUE: Final = 16
DROP: Final = 32
COMMIT: Final = 64
VELOCITY_OUT: Final = 128
POOR: Final = 256
VELOCITY_POOR: Final = 512
DENY: Final = 1024
RESTART: Final = 2048
"""Shifted by the axis: its track begins anew with this fix."""
RESTARTS: Final = 7 * RESTART
"""Any axis."""
MANOEUVRE: Final = 16384
"""The highest rate changed at once, after the last observation before this one that was used."""
WALK: Final = 32768
"""The fix is in a drag, on the axes that are wrong."""

POOR_WEIGHT: Final = 0.25
"""Weight of an observation that belongs to the track but is twice as noisy as usual."""


class Prior(NamedTuple):
    """What is supposed before any observation is seen.

    Parameters
    ----------
    isolated
        Probability that a fix is wrong by itself, on all its axes.
    partial
        Probability that only some of its axes are.
    poor
        Probability that a fix or a velocity is twice as noisy as usual.
    burst
        Probability that a run of fixes with a common offset begins.
    ending
        Probability that such a run ends with the next fix.
    longest
        Longest run, s: what lasts longer is a true jump, dated back to its first fix. No run may
        outlast the track that it contradicts.
    manoeuvre
        Probability that the highest rate of the model changes at once.
    velocity, again
        Probability that a velocity is wrong, and that it is if the last one was; learnt.
    spread
        (2·axes,) scale of the gross errors per component, m and m/s.
    sigma_velocity
        Standard deviation of a velocity nothing is known about, m/s.
    adapt
        (`MOST_SENSORS`,) how fast the noise of the positions of each sensor follows what is
        observed: 1 over the number of observations remembered, 0 for not at all.
    row
        Probability that a fix is wrong by itself if the two before it were; learnt, but a row is
        never surer to go on than a run.
    drag
        Probability that the fixes of a sensor begin to wander off, beside velocities, in a stretch
        of a few; 0: they never do.
    steady
        What wanders off more slowly is taken for a bias of the velocities, m/s.
    small
        How many of the errors of fixes there are of less than 6 σ that a Cauchy density has
        there, at most 1; learnt.
    alike
        Probability that a wrong velocity after a wrong one is off as that one was; learnt.
    """

    isolated: float
    partial: float
    poor: float
    burst: float
    ending: float
    longest: float
    manoeuvre: float
    velocity: float
    again: float
    spread: FloatArray
    sigma_velocity: float
    adapt: FloatArray = np.zeros(MOST_SENSORS)
    row: float = 0.3
    drag: float = 0.0
    steady: float = 0.0
    small: float = 1.0
    alike: float = 0.7


class Bank(NamedTuple):
    """All the filter remembers: k hypotheses, their best one not necessarily first.

    Each holds the state of every axis ``[p, v, (a), b]`` by itself, b the offset of a run; axes do
    not influence each other but through the decisions.

    Parameters
    ----------
    time
        (1,) s; NaN before the first epoch.
    number
        (1,) how many of the k are in use.
    weight
        (k,) logarithms, their exponentials sum to 1.
    mean, covariance
        (k, axes, order + 1) and (k, axes, order + 1, order + 1).
    seen
        (k, axes) whether the position of the axis is known at all.
    began
        (k,) s, when its track began: the first fix, or the last jump.
    run
        (k,) sensor whose fixes run with a common offset or are in a drag, −1 outside of runs.
    walks
        (k,) bits of the axes that are in a drag, and whether it is certain; 0 outside of drags.
    drift
        (k, axes, 4) of the offset of a drag: rate, its covariance with the offset, its variance,
        and when the last fix was seen.
    opened
        (k,) s, when that run began, or when another sensor last denied it.
    length
        (k,) fixes of the run so far.
    faulty
        (k,) bit mask of the sensors whose last velocity was wrong.
    slip
        (k, axes, 3) what wrong velocities that are off alike show, m/s, its variance, and how much
        they are off.
    lost, missed
        (k, axes) how many fixes were left out since the last one used, and the first of them, s,
        which means nothing while there are none.
    touched
        (k, axes) s, when an observation of the axis was last used.
    moved
        (k,) s, when a velocity was last used.
    scale
        (`MOST_SENSORS`,) factor of the variances of positions, as adapted.
    announced
        (1,) s, the beginning of the track as it was last told.
    startled
        (1,) s, when a velocity was last far from what the likeliest hypothesis expected.
    heard
        (`MOST_SENSORS`, 2·axes) s, when each sensor last observed each component.
    """

    time: FloatArray
    number: IntArray
    weight: FloatArray
    mean: FloatArray
    covariance: FloatArray
    seen: BoolArray
    began: FloatArray
    run: IntArray
    walks: IntArray
    drift: FloatArray
    opened: FloatArray
    length: IntArray
    faulty: IntArray
    slip: FloatArray
    lost: FloatArray
    missed: IntArray
    touched: FloatArray
    moved: FloatArray
    scale: FloatArray
    announced: FloatArray
    startled: FloatArray
    heard: FloatArray


class Trail(NamedTuple):
    """Where the hypotheses came from that there were after each of n epochs.

    Parameters
    ----------
    parent, code
        Of each hypothesis its place an epoch before, below 256, and what it says; those of one
        epoch side by side.
    first
        (n + 1,) where those of each epoch begin, and where the last ones end.
    best
        (n,) place of the likeliest.
    """

    parent: IntArray
    code: IntArray
    first: IntArray
    best: IntArray


class Found(NamedTuple):
    """What the mixture of hypotheses says of each of n epochs.

    Parameters
    ----------
    mean, sigma
        (n, states) mean and standard deviations of the mixture; NaN where nothing is known.
    weight
        (n, 2·axes) probability that the component belongs to the track; NaN where not observed.
    standardised
        (n, 2·axes) innovation of the likeliest hypothesis over its standard deviation.
    evidence
        (n,) log-likelihood of the epoch's observations given those before.
    run
        (n,) fixes so far of the run that the epoch's fix belongs to, 0 if to none.
    since
        (n,) s, where the likeliest hypothesis just took a run for a true jump: when that began.
    offset
        (n, axes) offset of the run that the epoch's fix belongs to; NaN if to none.
    drag
        (n,) whether that run is a drag.
    scale
        (n,) factor of the variance of the epoch's position, as adapted.
    """

    mean: FloatArray
    sigma: FloatArray
    weight: FloatArray
    standardised: FloatArray
    evidence: FloatArray
    run: IntArray
    since: FloatArray
    offset: FloatArray
    drag: BoolArray
    scale: FloatArray


def no_hypotheses(motion: Motion, most: int = MOST) -> Bank:
    """State of a filter that has seen nothing; ``most`` hypotheses are kept."""
    d, m = motion.axes, motion.order + 1
    return Bank(
        np.full(1, np.nan),
        np.ones(1, np.int64),
        np.zeros(most),
        np.zeros((most, d, m)),
        np.zeros((most, d, m, m)),
        np.zeros((most, d), np.bool_),
        np.full(most, np.nan),
        np.full(most, -1, np.int64),
        np.zeros(most, np.int64),
        np.zeros((most, d, 4)),
        np.full(most, np.nan),
        np.zeros(most, np.int64),
        np.zeros(most, np.int64),
        np.zeros((most, d, 3)),
        np.full((most, d), np.nan),
        np.zeros((most, d), np.int64),
        np.full((most, d), np.nan),
        np.full(most, np.nan),
        np.ones(MOST_SENSORS),
        np.full(1, np.nan),
        np.full(1, -np.inf),
        np.full((MOST_SENSORS, 2 * d), np.nan),
    )
