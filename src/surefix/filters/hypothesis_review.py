"""Judge every observation again by what all the others say of it.

The deleted residual of an observation takes the place of its innovation in the same probabilities
that the multi-hypothesis filter weighs: it belongs to the track, or it is wrong on some of its
axes, or on all.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.filters.hypotheses import POOR, POOR_WEIGHT, Prior
from surefix.filters.hypothesis_branches import GROSS, ROW
from surefix.filters.hypothesis_density import log_normal, log_wild
from surefix.filters.records import Epochs, Motion
from surefix.filters.rts import Smoothed
from surefix.jit import inner, kernel
from surefix.types import BoolArray, FloatArray

__all__ = ["deleted", "deleted_residuals", "review"]


def deleted_residuals(
    motion: Motion, epochs: Epochs, fixed: FloatArray, smoothed: Smoothed
) -> tuple[FloatArray, FloatArray]:
    """Residual of each component from what all others say, and its variance; NaN if unobserved.

    ``e = (z − Hx) R̄/(R̄ − P)``, ``S = R + P R̄/(R̄ − P)`` for a component that was used with
    ``R̄ = R/w``, with x and P smoothed; without the factors for one that was not.

    Parameters
    ----------
    motion, epochs
        Model and n observations.
    fixed
        (n, m) weight with which the component was used, or 0.
    smoothed
        Smoothed states of the same epochs.

    Returns
    -------
    residual, variance
        (n, m) each.
    """
    m = epochs.z.shape[1]
    P = np.maximum(np.einsum("kii->ki", smoothed.covariance)[:, :m], 0.0)
    e = epochs.z - smoothed.mean[:, :m]
    if motion.period > 0.0:
        e[:, 0] -= motion.period * np.rint(e[:, 0] / motion.period)
    residual, variance = deleted(e, P, epochs.variance, fixed)
    return residual, np.where(np.isnan(epochs.z), np.nan, variance)


def deleted(
    e: FloatArray, P: FloatArray, R: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals and their variances as if each observation had not been used.

    Parameters
    ----------
    e, P
        Residuals ``z − Hx`` and variances ``HPHᵀ`` of the smoothed estimate.
    R, weight
        Variance of the observation, and with what weight it was used; 0: it was not.
    """
    own = R / np.where(weight > 0.0, weight, 1.0)
    gain = np.where(weight > 0.0, own / np.maximum(own - P, 1e-9 * own), 1.0)
    return e * gain, R + P * gain


def review(
    motion: Motion,
    prior: Prior,
    epochs: Epochs,
    fixed: FloatArray,
    smoothed: Smoothed,
    locked: BoolArray,
) -> FloatArray:
    """Decide anew which components belong to the track.

    Parameters
    ----------
    motion, prior, epochs
        As given to the filter.
    fixed
        (n, m) weight with which the component was used, or 0; not modified.
    smoothed
        What the used ones say.
    locked
        (n, 2) epochs whose position, and whose velocity, stays out: they belong to a run.

    Returns
    -------
    fixed
        (n, m) the new decisions; those that ``epochs`` fixes beforehand stay.
    """
    residual, variance = deleted_residuals(motion, epochs, fixed, smoothed)
    out = fixed.copy()
    d = motion.axes
    far = np.nansum(residual[:, :d] ** 2 / variance[:, :d], axis=1) > GROSS
    wrong = (fixed == 0.0) & (far & ~locked[:, 0])[:, None]
    row = _rows_of_wrong(d, prior, epochs.time, epochs.z, wrong)
    _review(d, prior, residual, variance, epochs.variance, locked, row, out)
    return np.where(np.isnan(epochs.fixed), out, epochs.fixed)


def _rows_of_wrong(
    axes: int, prior: Prior, time: FloatArray, z: FloatArray, out: BoolArray
) -> FloatArray:
    """(n,) logarithm of how much likelier than usual a fix is wrong, by the fixes beside it.

    Of these only gross errors count, ``out`` (n, m): a sensor that wanders would confirm itself.
    Those of a run with a common offset are another matter, and what lasts longer than a run may is
    no row of errors.
    """
    odds: FloatArray = np.zeros(len(z))
    rows = np.flatnonzero(np.isfinite(z[:, :axes]).any(axis=1))
    lead = np.isfinite(z[rows, :axes]).argmax(axis=1)
    wrong = np.zeros(len(rows) + 2 * ROW, np.bool_)
    inside = out[rows, lead]
    edges = np.diff(inside.astype(np.int64), prepend=0, append=0)
    for first, end in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        if time[rows[end - 1]] - time[rows[first]] >= prior.longest:
            inside[first:end] = False
    wrong[ROW:-ROW] = inside
    more = math.log(prior.row / prior.isolated)
    less = math.log1p(-prior.row) - math.log1p(-prior.isolated)
    n = len(rows)
    for ahead in range(ROW + 1):  # what being wrong says of oneself, of the next, …
        row = np.arange(n) < n - ahead
        for j in range(ahead - ROW, ahead):
            row &= wrong[ROW + j : ROW + j + n] | (j == 0)
        also = wrong[ROW + ahead : ROW + ahead + n] | (ahead == 0)
        gain = np.where(also, more, less) - (less if ahead == 0 else 0.0)
        odds[rows] += np.where(row, gain, 0.0)
    return odds


@inner
def _patterns(
    axes: int,
    prior: Prior,
    inside: FloatArray,
    poor: float,
    wild: FloatArray,
    wide: FloatArray,
    seen: int,
    row: float,
) -> int:
    """Axes that are wrong under the likeliest account of one fix, as a code of the filter.

    ``row`` is the logarithm of how much likelier than usual it is that all are wrong.
    """
    belongs = 0.0
    square = 0.0
    scale = 0.0
    mask = 0
    for a in range(axes):
        if not math.isnan(wild[a]):
            belongs += inside[a]
            square += wild[a]
            scale += 0.5 * math.log(wide[a])
            mask |= 1 << a
    best = belongs + math.log(1.0 - prior.isolated - prior.partial - prior.poor)
    chosen = 0
    if poor + math.log(prior.poor) > best:
        best, chosen = poor + math.log(prior.poor), POOR
    score = math.log(prior.isolated) + row + log_wild(square, scale, seen)
    if score > best:
        best, chosen = score, mask
    if seen > 1:
        each = math.log(prior.partial / (seen + 1))
        for a in range(axes):
            if math.isnan(wild[a]):
                continue
            score = each + belongs - inside[a] + log_wild(wild[a], 0.5 * math.log(wide[a]), 1)
            if score > best:
                best, chosen = score, 1 << a
        if seen == 3:
            pair = log_wild(wild[0] + wild[1], 0.5 * math.log(wide[0] * wide[1]), 2)
            score = each + inside[2] + pair
            if score > best:
                chosen = 3
    return chosen


@kernel
def _review(
    axes: int,
    prior: Prior,
    residual: FloatArray,
    variance: FloatArray,
    noise: FloatArray,
    locked: BoolArray,
    row: FloatArray,
    out: FloatArray,
) -> None:
    inside = np.empty(axes)
    wild = np.empty(axes)
    wide = np.empty(axes)
    for k in range(out.shape[0]):
        for part in range(2):
            seen = 0
            belongs = 0.0
            poor = 0.0
            square = 0.0
            scale = 0.0
            small = True
            for a in range(axes):
                c = part * axes + a
                wild[a] = np.nan
                e, S = residual[k, c], variance[k, c]
                if math.isnan(e):
                    continue
                seen += 1
                small = small and e * e + S < (GROSS + 1.0) * noise[k, c]
                inside[a] = log_normal(e, S)
                poor += log_normal(e, S + noise[k, c] * (1.0 / POOR_WEIGHT - 1.0))
                wide[a] = prior.spread[c] * prior.spread[c] + S
                wild[a] = e * e / wide[a]
                belongs += inside[a]
                square += wild[a]
                scale += 0.5 * math.log(wide[a])
            if seen == 0:
                continue
            if locked[k, part]:
                continue
            if part == 1:
                outside = log_wild(square, scale, seen) + math.log(prior.velocity)
                good = belongs + math.log((1.0 - prior.velocity) * (1.0 - prior.poor))
                fair = poor + math.log((1.0 - prior.velocity) * prior.poor)
                w = 1.0 if good >= fair else POOR_WEIGHT
                for a in range(axes):
                    out[k, axes + a] = w if max(good, fair) >= outside else 0.0
                continue
            odds = row[k] + (math.log(prior.small) if small else 0.0)
            mask = _patterns(axes, prior, inside, poor, wild, wide, seen, odds)
            for a in range(axes):
                w = POOR_WEIGHT if mask & POOR else 1.0
                out[k, a] = 0.0 if (mask >> a) & 1 else w
