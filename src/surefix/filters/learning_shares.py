"""How often fixes are wrong, and how: what is counted among those that were decided."""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import POOR_WEIGHT, Prior
from surefix.filters.hypothesis_branches import GROSS
from surefix.filters.hypothesis_trail import Decisions
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["counted"]

_SHARES = {
    "isolated": (2.0, 50.0),
    "partial": (0.2, 50.0),
    "poor": (0.5, 50.0),
    "manoeuvre": (0.02, 100.0),
    "row": (1.0, 3.0),
    "velocity": (2.0, 100.0),
    "again": (9.0, 10.0),
    "alike": (7.0, 10.0),
}  # prior counts: wrong, and all
_FEW = 5  # gross errors whose scale is believed
_LEAST_WILD = 5.0  # scale of gross errors at least, in standard deviations
_ONE = 1.0  # small error that is counted beforehand
_TURNS = 20  # in which the share of small errors stands still
_WILD_AT_ZERO = (1.0 / math.pi, 0.5 / math.pi, 1.0 / math.pi**2)  # Cauchy density, 1 … 3 axes


def counted(
    prior: Prior,
    said: Decisions,
    residual: FloatArray,
    variance: FloatArray,
    noise: FloatArray,
    sensor: IntArray,
) -> Prior:
    """Shares and sizes of the gross errors among what was decided.

    Parameters
    ----------
    prior
        What was supposed.
    said
        The decisions about n epochs.
    residual, variance
        (n, 2·axes) deleted residuals, and their variances; NaN where not observed.
    noise
        (n, 2·axes) variances of the observations themselves.
    sensor
        (n,) whose they are.
    """
    axes = residual.shape[1] // 2
    prior = _with_slips(prior, said, residual, variance, sensor)
    residual, variance, noise = (part[:, :axes] for part in (residual, variance, noise))
    seen = np.isfinite(residual)
    if not seen.any():
        return prior
    told = _with_shares(prior, said, residual, math.sqrt(float(np.median(noise[seen]))))
    whole = seen.any(axis=1) & ~((said.fixed[:, :axes] > 0.0) & seen).any(axis=1)
    return _with_small(told, whole & (said.run == 0), residual, variance, noise)


def _share(name: str, count: int, among: int) -> float:
    wrong, every = _SHARES[name]
    return float((count + wrong) / (among + every))


def _with_slips(
    prior: Prior, said: Decisions, residual: FloatArray, variance: FloatArray, sensor: IntArray
) -> Prior:
    """How often velocities begin to be wrong, go on so, and are then off as the one before was."""
    axes = residual.shape[1] // 2
    e, S = residual[:, axes:], variance[:, axes:]
    moving = np.isfinite(e).any(axis=1)
    begin = after = again = alike = 0
    for own in np.unique(sensor[moving]):
        rows = np.flatnonzero(moving & (sensor == own))
        slips = (said.fixed[rows, axes:] == 0.0).all(axis=1)
        both = slips[1:] & slips[:-1]
        pairs = rows[1:][both], rows[:-1][both]
        change = (e[pairs[0]] - e[pairs[1]]) ** 2 / (S[pairs[0]] + S[pairs[1]])
        begin += int((np.diff(slips.astype(np.int64), prepend=0) > 0).sum())
        after += int(slips[:-1].sum())
        again += len(change)
        alike += int((np.nansum(change, axis=1) < GROSS).sum())
    return prior._replace(
        velocity=_share("velocity", begin, int(moving.sum())),
        again=_share("again", again, after),
        alike=_share("alike", alike, again),
    )


def _with_shares(prior: Prior, said: Decisions, residual: FloatArray, sigma: float) -> Prior:
    """How many fixes are wrong in each way, and by how much in the median."""
    axes = residual.shape[1]
    fixed, seen = said.fixed, np.isfinite(residual)
    out = seen & (fixed[:, :axes] == 0.0)
    whole = out.any(axis=1) & (out == seen).all(axis=1)
    poor = (fixed[:, :axes] == POOR_WEIGHT).any(axis=1) & seen.any(axis=1)
    some = out.any(axis=1) & ~whole
    turns = (said.jump >> axes > 0).sum()
    total = seen.any(axis=1).sum()

    placed = seen.any(axis=1)
    alone = whole[placed] & (said.run[placed] == 0)
    after = alone[:-2] & alone[1:-1]
    spread = prior.spread.copy()
    if out.sum() >= _FEW:
        size = float(np.median(np.abs(residual[out])))
        spread[:axes] = max(size, _LEAST_WILD * sigma)
    return prior._replace(
        isolated=_share("isolated", alone.sum(), total),
        partial=_share("partial", some.sum(), total),
        poor=_share("poor", poor.sum(), total),
        manoeuvre=_share("manoeuvre", turns, total),
        row=min(_share("row", (after & alone[2:]).sum(), after.sum()), 1.0 - prior.ending),
        spread=spread,
    )


def _with_small(
    prior: Prior,
    alone: BoolArray,
    residual: FloatArray,
    variance: FloatArray,
    noise: FloatArray,
) -> Prior:
    """How many of the fixes that are wrong by themselves, ``alone`` (n,), are so by less than 6 σ.

    Which these are is not known, as noise may be as large: each fix counts for the probability that
    it is, in turns. How many a Cauchy density has there follows from all that were left out.
    """
    axes = residual.shape[1]
    near = residual**2 + variance < (GROSS + 1.0) * noise
    e, S, R = (part[near.all(axis=1)] for part in (residual, variance, noise))
    wide = prior.spread[:axes] ** 2 + S
    square = (e**2 / wide).sum(axis=1)
    wild = prior.isolated * _WILD_AT_ZERO[axes - 1] * (1.0 + square) ** (-0.5 * (axes + 1))
    wild /= np.sqrt(wide.prod(axis=1))
    usual = (1.0 - prior.isolated - prior.partial - prior.poor) * _normal(e, S)
    usual += prior.poor * _normal(e, S + R * (1.0 / POOR_WEIGHT - 1.0))
    size = math.sqrt(GROSS * float(np.median(noise[np.isfinite(residual)])))
    expected = float(alone.sum()) * _cauchy_within(size / float(prior.spread[0]), axes)
    small = 1.0
    for _ in range(_TURNS):
        found = float((small * wild / (small * wild + usual)).sum())
        small = min((found + _ONE) / (expected + _ONE), 1.0)
    return prior._replace(small=small)


def _normal(e: FloatArray, S: FloatArray) -> FloatArray:
    """(n,) density of n residuals (n, axes)."""
    density: FloatArray = np.exp(-0.5 * e**2 / S) / np.sqrt(2.0 * np.pi * S)
    return np.asarray(density.prod(axis=1))


def _cauchy_within(reach: float, axes: int) -> float:
    """Probability that a Cauchy vector of scale 1 is no longer than ``reach``.

    >>> [round(_cauchy_within(1.0, axes), 3) for axes in (1, 2, 3)]
    [0.5, 0.293, 0.182]
    """
    if axes == 1:
        return 2.0 / math.pi * math.atan(reach)
    if axes == 2:
        return 1.0 - 1.0 / math.hypot(1.0, reach)
    return 2.0 / math.pi * (math.atan(reach) - reach / (1.0 + reach**2))
