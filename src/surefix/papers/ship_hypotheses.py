"""The multi-hypothesis filter as a cleaner of one series of paper 003.

A series that has frozen says nothing new; the check of the chain leaves that out first. Noise,
process noise, and how often and how far samples are wrong are learnt; the whole series decides.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from surefix.cleaning.plausibility import Bounds, Check, plausibility
from surefix.cleaning.replacement import Replaced
from surefix.filters.learning import Learnt, learn
from surefix.filters.multi_hypothesis_modes import offline_hypotheses
from surefix.filters.noise import NoiseFigures, Observations, estimate_noise, grain, speed_scale
from surefix.filters.records import Epochs, Motion
from surefix.filters.track import by_axis
from surefix.types import FloatArray

__all__ = ["edit_by_hypotheses"]

_FROZEN: Final = 5  # equal samples on end, as in the chain
_LONGEST: Final = 39.5  # samples
_FEW: Final = 10
_WRONG: Final = 0.125  # weight below which a sample does not belong: half that of a poor one
_WITHIN: Final = 2.0  # σ of the estimate that must lie within the threshold, or it is left out


def edit_by_hypotheses(
    value: FloatArray, time: FloatArray, threshold: FloatArray, period: float
) -> Replaced:
    """Edit what several hypotheses say does not belong to the series.

    A wrong sample becomes the estimate where that is good to the threshold, else NaN.

    Parameters
    ----------
    value, time
        (n,) in any unit, NaN is missing, and s.
    threshold
        (n,) how exact an estimate must be to take the place of a sample.
    period
        One turn for angles, else 0.
    """
    frozen = plausibility(value, time, Bounds(frozen=_FROZEN), period=period) == Check.FROZEN
    known = np.flatnonzero(np.isfinite(value) & np.isfinite(time) & ~frozen)
    nothing = np.full(len(value), np.nan)
    if len(known) < _FEW:
        return Replaced(value.copy(), nothing, np.zeros(len(value), np.bool_))
    t, x = time[known] - time[known[0]], value[known]
    unit = float(np.median(np.abs(np.diff(x)[np.diff(x) != 0.0]))) if np.ptp(x) else 1.0
    z = np.column_stack([x / unit, np.full(len(x), np.nan)])
    learnt = _learnt(t, z, period / unit)
    motion = Motion(2, 1, np.array([learnt.figures.process**2]), by_axis(1), 2, period / unit)
    variance = np.tile([learnt.figures.position[0] ** 2, 1.0], (len(t), 1))
    epochs = Epochs(t, z, variance, np.full_like(z, np.nan), np.zeros(len(t), np.int64))
    found = offline_hypotheses(motion, learnt.prior, epochs)
    estimate = nothing.copy()
    estimate[known] = unit * found.mean[:, 0]
    wrong, sure = frozen.copy(), np.zeros(len(value), np.bool_)
    wrong[known] = found.weight[:, 0] < _WRONG
    sure[known] = _WITHIN * unit * found.sigma[:, 0] <= threshold[known]
    turned = np.mod(estimate, period) if period else estimate
    edited = np.where(wrong, np.where(sure, turned, np.nan), value)
    return Replaced(edited, turned, wrong)


def _learnt(time: FloatArray, z: FloatArray, period: float) -> Learnt:
    observations = Observations(time, z, np.zeros(len(time), np.int64), np.full_like(z, np.nan))
    unknown = NoiseFigures(np.array([np.nan]), np.array([np.nan]), np.nan)
    quantum = grain(z[:, 0])
    first = estimate_noise(observations, unknown, order=2, period=period, quantum=quantum)
    turned = np.unwrap(z[:, 0], period=period) if period else z[:, 0]
    steps = np.diff(time)
    return learn(
        observations,
        unknown,
        first,
        order=2,
        period=period,
        speed=max(speed_scale(time, turned), 1e-6),
        longest=_LONGEST * float(np.median(steps[steps > 0.0])),
        floor=(max(quantum / np.sqrt(12.0), 1e-9), 1e-9),
    )
