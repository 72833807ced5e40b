"""Three adaptive filters of the literature: WoLF, IMM and Sage–Husa, for comparison in real time.

Each takes what the methods of `surefix clean` take and gives what they give; see
`surefix.pipelines.clean.Estimator`.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from surefix.comparison.online import (
    Belief,
    Found,
    Observation,
    predicted,
    run_online,
    updated,
    vague,
)
from surefix.filters.records import Epochs, Estimate, Motion, Recovery
from surefix.robust.loss import block_scale
from surefix.types import FloatArray

__all__ = ["imm", "sage_husa", "wolf"]

_SOFT: Final = 2.385  # standard deviations at which WoLF halves the information of a fix
_INFLATED: Final = 30.0  # times larger noise of the IMM's second mode
_CHANGE: Final = np.array([[0.95, 0.05], [0.5, 0.5]])  # probabilities between its modes
_FADING: Final = 0.97  # forgetting factor of Sage and Husa
_LEAST: Final = 0.01  # share of the first variance below which theirs cannot fall
_TAIL: Final = 0.0027


def wolf(
    motion: Motion, recovery: Recovery, epochs: Epochs, state: object
) -> tuple[object, Estimate]:
    """Weighted observation likelihood filter with the inverse multiquadric weight.

    The likelihood is raised to a power, so that a Kalman update with ``R / w²`` remains,
    ``w² = 1 / (1 + d²/c²)``, where d is the distance of the observation from its prediction in
    standard deviations of its noise R. c = 2.385: w² is the weight of Cauchy's loss, which is 95 %
    efficient there. Over several axes d is made comparable with that of one. About a prediction
    that knows nothing, as at the beginning, it says nothing: w = 1.

    Source: Duran-Martin, Altamirano, Shestopaloff, Sánchez-Betancourt, Knoblauch, Jones, Briol and
    Murphy, Outlier-robust Kalman filtering through generalised Bayes, ICML 2024.

    Parameters
    ----------
    motion, recovery, epochs, state
        Of `surefix.pipelines.clean.Estimator`.
    """
    return run_online(motion, recovery, epochs, state, lambda belief, _: belief, _wolf_step)


def _wolf_step(
    motion: Motion, belief: Belief, dt: float, observation: Observation
) -> tuple[Belief, Found]:
    before = predicted(motion, belief, dt)
    weight = np.ones(len(observation.z))
    off = (observation.z - before.mean[: len(weight)]) ** 2 / observation.variance
    unsure = vague(before, observation)
    for g in range(motion.groups):
        mine = (motion.group == g) & observation.seen
        if mine.any() and not unsure[mine].any():
            d2 = float(off[mine].sum()) / block_scale(int(mine.sum()), _TAIL) ** 2
            weight[mine] = 1.0 / (1.0 + d2 / _SOFT**2)
    after = updated(before, observation, observation.variance / weight)
    return after, Found(after, before, weight)


class _Modes(NamedTuple):
    """One belief a mode, and (2,) probabilities."""

    beliefs: tuple[Belief, Belief]
    probability: FloatArray


def imm(
    motion: Motion, recovery: Recovery, epochs: Epochs, state: object
) -> tuple[object, Estimate]:
    """Interacting multiple models: the noise of an epoch is as estimated, or 30 times as large.

    Mixing, filters of both modes, mode probabilities by likelihood, combination. The modes follow
    each other as a Markov chain: 5 % of the epochs turn bad, half of the bad ones are followed by
    another.

    Source: Blom and Bar-Shalom, IEEE Trans. Automatic Control 33(8), 1988.

    Parameters
    ----------
    motion, recovery, epochs, state
        Of `surefix.pipelines.clean.Estimator`.
    """
    return run_online(motion, recovery, epochs, state, _both_modes, _imm_step)


def _both_modes(belief: Belief, _: FloatArray) -> _Modes:
    usual = _CHANGE[1, 0] / (_CHANGE[1, 0] + _CHANGE[0, 1])
    return _Modes((belief, belief), np.array([usual, 1.0 - usual]))


def _imm_step(
    motion: Motion, modes: _Modes, dt: float, observation: Observation
) -> tuple[_Modes, Found]:
    coming = modes.probability @ _CHANGE
    share = _CHANGE * modes.probability[:, None] / coming  # [from, to]
    before = [predicted(motion, _combined(modes.beliefs, share[:, mode]), dt) for mode in range(2)]
    after, logarithm = [], np.log(coming)
    for mode, factor in enumerate((1.0, _INFLATED**2)):
        variance = factor * observation.variance
        after.append(updated(before[mode], observation, variance))
        logarithm[mode] += _log_likelihood(before[mode], observation, variance)
    probability = np.exp(logarithm - np.logaddexp(*logarithm))
    weight = probability[0] + probability[1] / _INFLATED**2
    both = (after[0], after[1])
    return _Modes(both, probability), Found(
        _combined(both, probability),
        _combined((before[0], before[1]), coming),
        np.full(len(observation.z), weight),
    )


def _combined(beliefs: tuple[Belief, Belief], share: FloatArray) -> Belief:
    """Mean and covariance of a mixture."""
    mean = share[0] * beliefs[0].mean + share[1] * beliefs[1].mean
    covariance = np.zeros_like(beliefs[0].covariance)
    for part, belief in zip(share, beliefs, strict=True):
        off = belief.mean - mean
        covariance += part * (belief.covariance + np.outer(off, off))
    return Belief(mean, covariance)


def _log_likelihood(before: Belief, observation: Observation, variance: FloatArray) -> float:
    i = np.flatnonzero(observation.seen)
    off = observation.z[i] - before.mean[i]
    S = before.covariance[np.ix_(i, i)] + np.diag(variance[i])
    return float(-0.5 * (off @ np.linalg.solve(S, off) + np.linalg.slogdet(2.0 * np.pi * S)[1]))


class _Adapted(NamedTuple):
    """A belief, and (m,) the factors on the variances that were found by now."""

    belief: Belief
    factor: FloatArray


def sage_husa(
    motion: Motion, recovery: Recovery, epochs: Epochs, state: object
) -> tuple[object, Estimate]:
    """Adapt the noise of the observations by the innovations, with fading memory.

    ``R_k = (1 − d) R_{k−1} + d (ν_k² − H P_k⁻ Hᵀ)`` for each component, d = 1 − b with b = 0.97,
    before the update of the same epoch. R begins with the estimated figure, so that d need not
    begin at 1, and what is added is at least a hundredth of that figure, so that it stays positive.

    Source: Sage and Husa, Adaptive filtering with unknown prior statistics, Joint Automatic Control
    Conference, 1969; the lower limit as is usual since.

    Parameters
    ----------
    motion, recovery, epochs, state
        Of `surefix.pipelines.clean.Estimator`.
    """
    return run_online(motion, recovery, epochs, state, _as_told, _sage_husa_step)


def _as_told(belief: Belief, variance: FloatArray) -> _Adapted:
    return _Adapted(belief, np.ones(len(variance)))


def _sage_husa_step(
    motion: Motion, memory: _Adapted, dt: float, observation: Observation
) -> tuple[_Adapted, Found]:
    before = predicted(motion, memory.belief, dt)
    m = len(observation.z)
    own = np.diagonal(before.covariance)[:m]
    news = ((observation.z - before.mean[:m]) ** 2 - own) / observation.variance
    learnt = _FADING * memory.factor + (1.0 - _FADING) * np.maximum(news, _LEAST)
    learns = observation.seen & ~vague(before, observation)
    factor = np.where(learns, learnt, memory.factor)
    after = updated(before, observation, factor * observation.variance)
    return _Adapted(after, factor), Found(after, before, np.minimum(1.0 / factor, 1.0))
