"""Two modes of the filter of single sights: real time and offline.

Real time gives the mixture of the hypotheses. Offline the likeliest account at the end says what
belongs to the track; that is smoothed, every sight is judged again by all others, and so on until
the decisions stand still.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.sight_fit import POORER
from surefix.filters.sight_hypotheses import filter_sights
from surefix.filters.sight_records import (
    SightBank,
    SightModel,
    SightPrior,
    Sights,
    SightTrail,
    empty_bank,
)
from surefix.filters.sight_review import add_bowl, deleted_sights, review_sights
from surefix.filters.sight_smoothing import settle, smooth_sights
from surefix.filters.sight_starts import begin_around
from surefix.models.sights import COMPONENT, RANGE
from surefix.types import BoolArray, FloatArray

__all__ = ["SightDecisions", "SightEstimate", "decide_sights", "offline_sights", "realtime_sights"]

_SWEEPS = 12
_PREFERS = 5.0  # nats by which the backward account must be the likelier
_WIDER = 10.0  # factor on the deviations of a start that was chosen among several


class SightEstimate(NamedTuple):
    """The track and what was decided of n epochs.

    Parameters
    ----------
    mean, covariance
        (n, 2d) and (n, 2d, 2d), m and m/s.
    weight
        (n, c) real time the probability that a sight belongs to the track; offline 1, 0.25 where it
        is poor, 0 where it is wrong; NaN where there is none.
    standardised
        (n, c) innovation, offline deleted residual, over its standard deviation.
    """

    mean: FloatArray
    covariance: FloatArray
    weight: FloatArray
    standardised: FloatArray


class SightDecisions(NamedTuple):
    """What belongs to the track, and the track that follows.

    Parameters
    ----------
    weight
        (n, c) 1, less where a sight is poor, 0 where it is wrong or there is none.
    restarts
        (n,) epochs before which the track goes on somewhere else.
    about
        (n, 2d) the track at which the sights were linearised.
    start
        Mean and covariance at the first epoch, before its sights.
    mean, covariance
        (n, 2d) and (n, 2d, 2d) smoothed.
    residual, variance
        (n, c) deleted residuals.
    """

    weight: FloatArray
    restarts: BoolArray
    about: FloatArray
    start: tuple[FloatArray, FloatArray]
    mean: FloatArray
    covariance: FloatArray
    residual: FloatArray
    variance: FloatArray


def realtime_sights(
    model: SightModel, prior: SightPrior, sights: Sights, bank: SightBank
) -> tuple[SightBank, SightEstimate]:
    """Estimate every epoch from the past and itself alone; takes and gives the hypotheses."""
    after, found, _ = filter_sights(model, prior, sights, bank, traced=False)
    covariance = add_bowl(found.mean, found.covariance, _poles(model, sights))
    return after, SightEstimate(found.mean, covariance, found.weight, found.standardised)


def offline_sights(
    model: SightModel, prior: SightPrior, sights: Sights, bank: SightBank
) -> SightEstimate:
    """Estimate every epoch from the whole series.

    Parameters
    ----------
    model, prior, sights
        As for the filter; at least one epoch.
    bank
        Hypotheses to begin with.
    """
    said = decide_sights(model, prior, sights, bank)
    covariance = add_bowl(said.mean, said.covariance, _poles(model, sights))
    standardised = said.residual / np.sqrt(said.variance)
    weight = np.where(np.isfinite(sights.z), said.weight, np.nan)
    return SightEstimate(said.mean, covariance, weight, standardised)


def decide_sights(
    model: SightModel, prior: SightPrior, sights: Sights, bank: SightBank
) -> SightDecisions:
    """Decide what belongs to the track by the whole series, and smooth it; see `offline_sights`.

    A track whose beginning is not known is also sought from its end backward; the account under
    which the sights are the likelier counts.
    """
    weight, restarts, mean, start, evidence = _account(model, prior, sights, bank)
    if bank.number[0] > 1 and (np.isfinite(sights.z[-1]) & (model.kind == RANGE)).any():
        turned = _turned(model, sights)
        from_end = begin_around(model, turned, prior.speed, len(bank.weight) - 1)
        back = _account(model, prior, turned, from_end)
        if back.evidence > evidence + _PREFERS:
            flip = np.repeat([1.0, -1.0], model.axes)
            weight, mean = back.weight[::-1], back.mean[::-1] * flip
            restarts = np.concatenate([[False], back.restarts[:0:-1]])
            start = mean[0], start[1]
    for _ in range(_SWEEPS):
        about, P = settle(model, prior, sights, weight, restarts, mean, start)
        mean = about
        residual, variance = deleted_sights(model, sights, weight, mean, P)
        anew = review_sights(prior, sights, residual, variance)
        if np.array_equal(anew, weight):
            break
        weight = anew
    return SightDecisions(weight, restarts, about, start, mean, P, residual, variance)


class _Account(NamedTuple):
    """Decisions of one direction, the track that follows, its start, and the log-likelihood."""

    weight: FloatArray
    restarts: BoolArray
    mean: FloatArray
    start: tuple[FloatArray, FloatArray]
    evidence: float


def _account(model: SightModel, prior: SightPrior, sights: Sights, bank: SightBank) -> _Account:
    """What the likeliest hypothesis at the end says of all, and a first smooth track."""
    _, found, trail = filter_sights(model, prior, sights, bank)
    evidence = float(found.evidence.sum())
    weight, restarts, slot = _followed(trail, sights)
    alone = _alone(model, bank, slot)
    decided = sights._replace(fixed=np.where(np.isfinite(sights.z), weight, np.nan))
    _, found, _ = filter_sights(
        model, prior, decided, alone, restarts=restarts.astype(np.int64), traced=False
    )
    wider = 1.0 if bank.number[0] == 1 else _WIDER
    mean, _ = smooth_sights(model, prior, sights.time, restarts, found.mean, found.covariance)
    start = alone.mean[0], alone.covariance[0] * wider**2
    return _Account(weight, restarts, mean, start, evidence)


def _turned(model: SightModel, sights: Sights) -> Sights:
    """The same sights with time running backward: velocities change their sign."""
    sign = np.where(model.kind >= COMPONENT + model.axes, -1.0, 1.0)
    back = Sights._make(column[::-1] for column in sights)
    return back._replace(time=-back.time, z=back.z * sign)


def _followed(trail: SightTrail, sights: Sights) -> tuple[FloatArray, BoolArray, int]:
    """What the likeliest hypothesis at the end says of all epochs, and where it began."""
    n, channels = sights.z.shape
    bits = np.arange(channels)
    weight, restarts = np.zeros((n, channels)), np.zeros(n, np.bool_)
    slot = int(trail.best[-1])
    for k in range(n - 1, -1, -1):
        used = (trail.used[k, slot] >> bits) & 1
        poor = (trail.poor[k, slot] >> bits) & 1
        weight[k] = np.where(used, np.where(poor, 1.0 / POORER, 1.0), 0.0)
        restarts[k] = trail.restarted[k, slot]
        slot = int(trail.parent[k, slot])
    return weight, restarts, slot


def _alone(model: SightModel, bank: SightBank, slot: int) -> SightBank:
    """Only the hypothesis at one place of a bank."""
    one = empty_bank(model.axes, len(model.kind), 1)
    one.number[0] = 1
    one.time[0] = bank.time[0]
    one.mean[0], one.covariance[0] = bank.mean[slot], bank.covariance[slot]
    one.faulty[0], one.slip[0] = bank.faulty[slot], bank.slip[slot]
    return one


def _poles(model: SightModel, sights: Sights) -> FloatArray:
    """(n, d) middle of the anchors of the ranges of an epoch, of the last one that had any."""
    there = np.isfinite(sights.z) & (model.kind == RANGE)
    count = there.sum(axis=1)
    total = np.where(there[:, :, None], sights.anchor, 0.0).sum(axis=1)
    last = np.maximum.accumulate(np.where(count > 0, np.arange(len(count)), -1))
    pole = total[last] / np.maximum(count[last], 1)[:, None]
    return np.asarray(np.where((last >= 0)[:, None], pole, np.nan))
