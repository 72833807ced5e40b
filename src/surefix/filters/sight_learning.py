"""What the filter of single sights learns: noise, motion, and how often sights are wrong.

In turns: decide which sights belong to the track under the present figures; take the figures that
make these likeliest; count what was left out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from surefix.filters.sight_fit import POORER
from surefix.filters.sight_hypotheses import filter_sights
from surefix.filters.sight_modes import SightDecisions, decide_sights
from surefix.filters.sight_records import SightBank, SightModel, SightPrior, Sights
from surefix.filters.sight_smoothing import smooth_pass
from surefix.models.sights import COMPONENT, RANGE
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["SightFigures", "learn_sights", "suppose_sights", "with_figures"]

_ROUNDS = 4
_ENOUGH = 0.02  # relative change of the figures that ends the rounds
_EPOCHS = 2000  # of a log that are learnt from
_FEW_EPOCHS = 300  # … and that choose the figures to begin with
_DENSITIES = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)  # roots of, m/s^1.5, tried at first
_QUANTILE, _NORMAL = 0.2, 0.2533  # most neighbours may be wrong; the same of |N(0, 1)|
_WILD = 30.0  # scale of gross errors to begin with, in standard deviations
_LEAST_WILD = 5.0  # … and at least
_FEW = 5  # gross errors whose scale is believed
_COUNTS = {"wrong": (1.0, 20.0), "again": (2.5, 5.0), "poor": (0.5, 50.0)}  # prior: yes, and all
_BY_KIND = {"m": 0.1, "rad": 0.02}  # noise where a series is too short to tell
_WIDEST = 3.0  # logarithm of the factor that a round may change a figure by


class SightFigures(NamedTuple):
    """Noise and motion.

    Parameters
    ----------
    sigma
        (g,) standard deviation per group of channels, m, rad or m/s; NaN is to be learnt.
    process
        Root of the spectral density of the acceleration, m/s^1.5; NaN is to be learnt.
    """

    sigma: FloatArray
    process: float


def suppose_sights(sigma: FloatArray, speed: float) -> SightPrior:
    """What is supposed of a log that nothing is known of.

    Parameters
    ----------
    sigma
        (c,) noise of the channels.
    speed
        Standard deviation of a velocity nothing is known about, m/s.
    """
    c = len(sigma)
    return SightPrior(
        wrong=np.full(c, 0.05),
        again=np.full(c, 0.5),
        spread=_WILD * sigma,
        poor=0.02,
        restart=1e-4,
        reach=30.0 * speed,
        speed=speed,
    )


def with_figures(
    model: SightModel, sights: Sights, group: IntArray, figures: SightFigures
) -> tuple[SightModel, Sights]:
    """Put figures into a model and into the variances of the sights.

    Parameters
    ----------
    model, sights
        Whose density and variances are replaced.
    group
        (c,) of each channel.
    figures
        Without NaN.
    """
    variance = np.broadcast_to(np.square(figures.sigma[group]), sights.z.shape)
    density = np.full(model.axes, figures.process**2)
    return model._replace(density=density), sights._replace(variance=np.array(variance, order="C"))


def learn_sights(
    model: SightModel,
    sights: Sights,
    group: IntArray,
    given: SightFigures,
    bank: SightBank,
    speed: float,
) -> tuple[SightFigures, SightPrior]:
    """Learn the figures that ``given`` leaves NaN, and the prior.

    Parameters
    ----------
    model, sights
        Density and variances in them do not count; the first few thousand epochs are used.
    group
        (c,) of each channel: channels of a group share their noise and their shares of errors.
    given
        Figures that are known.
    bank
        Hypotheses to begin with.
    speed
        Standard deviation of a velocity nothing is known about, m/s.
    """
    part = _first(sights, _EPOCHS)
    least = _resolution(part.z, group, len(given.sigma)) / math.sqrt(12.0)
    figures, prior = _begun(model, part, group, given, bank, speed, least)
    for _ in range(_ROUNDS):
        moving, known = with_figures(model, part, group, figures)
        said = decide_sights(moving, prior, known, bank)
        before = figures
        figures = _likeliest(model, part, group, given, figures, said, prior, least)
        prior = _counted(prior, said, known, group, figures)
        if _change(before, figures) < _ENOUGH:
            break
    return figures, prior


def _first(sights: Sights, count: int) -> Sights:
    return Sights._make(field[:count] for field in sights)


def _resolution(z: FloatArray, group: IntArray, groups: int) -> FloatArray:
    """(g,) step of the values of a group: the median distance of neighbouring distinct values."""
    step = np.zeros(groups)
    for g in range(groups):
        for c in np.flatnonzero(group == g):
            change = np.abs(np.diff(z[np.isfinite(z[:, c]), c]))
            change = change[change > 1e-6 * max(float(np.nanmax(np.abs(z[:, c]))), 1.0)]
            if len(change):
                step[g] = max(step[g], float(change.min()))
    return step


def _scales(
    model: SightModel, sights: Sights, group: IntArray, groups: int, least: FloatArray
) -> FloatArray:
    """(g,) noise by how far a sight lies from the line between its neighbours."""
    out = np.zeros(groups)
    for g in range(groups):
        found = []
        for c in np.flatnonzero(group == g):
            k = np.flatnonzero(np.isfinite(sights.z[:, c]))
            t, z = sights.time[k], sights.z[k, c]
            if len(k) < 3:
                continue
            share = (t[1:-1] - t[:-2]) / np.maximum(t[2:] - t[:-2], 1e-9)
            off = z[1:-1] - z[:-2] - share * (z[2:] - z[:-2])
            if model.kind[c] not in (RANGE,) and model.kind[c] < COMPONENT:
                off = np.angle(np.exp(1j * off))
            off /= np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
            found.append(float(np.quantile(np.abs(off), _QUANTILE)) / _NORMAL)
        angle = model.kind[group == g].min() in range(RANGE + 1, COMPONENT)
        out[g] = max(found, default=_BY_KIND["rad" if angle else "m"])
    return np.maximum(out, np.maximum(least, 1e-6))


def _begun(
    model: SightModel,
    sights: Sights,
    group: IntArray,
    given: SightFigures,
    bank: SightBank,
    speed: float,
    least: FloatArray,
) -> tuple[SightFigures, SightPrior]:
    """Figures to begin with: differences of neighbours, and the likeliest of a few motions."""
    rough = _scales(model, sights, group, len(given.sigma), least)
    sigma = np.where(np.isnan(given.sigma), rough, given.sigma)
    prior = suppose_sights(sigma[group], speed)
    tried = _DENSITIES if math.isnan(given.process) else (given.process,)
    few = _first(sights, _FEW_EPOCHS)
    best, figures = -np.inf, SightFigures(sigma, tried[0])
    for process in tried if len(tried) > 1 else ():
        moving, known = with_figures(model, few, group, SightFigures(sigma, process))
        _, found, _ = filter_sights(moving, prior, known, bank, traced=False)
        evidence = float(found.evidence.sum())
        if evidence > best:
            best, figures = evidence, SightFigures(sigma, process)
    return figures, prior


def _likeliest(
    model: SightModel,
    sights: Sights,
    group: IntArray,
    given: SightFigures,
    first: SightFigures,
    said: SightDecisions,
    prior: SightPrior,
    least: FloatArray,
) -> SightFigures:
    """Figures that maximise the likelihood of what was decided to belong to the track."""
    seen = np.array([said.weight[:, group == g].any() for g in range(len(first.sigma))])
    free = np.isnan(given.sigma) & seen
    j = int(free.sum())
    size = j + int(math.isnan(given.process))
    if size == 0:
        return first

    def figures(theta: FloatArray) -> SightFigures:
        factor = np.exp(np.clip(theta, -_WIDEST, _WIDEST))
        sigma = first.sigma.copy()
        sigma[free] = np.maximum(sigma[free] * factor[:j], least[free])
        return SightFigures(sigma, float(first.process * factor[j]) if size > j else first.process)

    def cost(theta: FloatArray) -> float:
        moving, known = with_figures(model, sights, group, figures(theta))
        _, _, evidence = smooth_pass(
            moving, prior, known, said.weight, said.restarts, said.about, said.start
        )
        return -evidence

    found = minimize(
        cost,
        np.zeros(size),
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([np.zeros(size), 0.3 * np.eye(size)]),
            "xatol": 0.01,
            "fatol": 0.1,
            "maxiter": 40 * size,
        },
    )
    return figures(found.x)


def _counted(
    prior: SightPrior, said: SightDecisions, sights: Sights, group: IntArray, figures: SightFigures
) -> SightPrior:
    """Shares, persistence and size of the gross errors of each group."""
    wrong, again, spread = prior.wrong.copy(), prior.again.copy(), prior.spread.copy()
    poor, all_ = _COUNTS["poor"]
    for g in range(len(figures.sigma)):
        channels = np.flatnonzero(group == g)
        begun, good, kept, bad = 0, 0, 0, 0
        sizes = []
        for c in channels:
            seen = np.isfinite(sights.z[:, c])
            out: BoolArray = said.weight[seen, c] == 0.0
            begun += int((out[1:] & ~out[:-1]).sum())
            good += int((~out[:-1]).sum())
            kept += int((out[1:] & out[:-1]).sum())
            bad += int(out[:-1].sum())
            sizes.append(np.abs(said.residual[seen, c][out]))
            poor += float((said.weight[seen, c] == 1.0 / POORER).sum())
            all_ += float((~out).sum())
        size = np.concatenate(sizes) if sizes else np.empty(0)
        wrong[channels] = (begun + _COUNTS["wrong"][0]) / (good + _COUNTS["wrong"][1])
        again[channels] = (kept + _COUNTS["again"][0]) / (bad + _COUNTS["again"][1])
        if len(size) >= _FEW:
            spread[channels] = max(float(np.median(size)), _LEAST_WILD * figures.sigma[g])
    return prior._replace(wrong=wrong, again=again, spread=spread, poor=poor / all_)


def _change(before: SightFigures, after: SightFigures) -> float:
    """Largest relative change of a figure."""
    pairs = [*zip(before.sigma, after.sigma, strict=True), (before.process, after.process)]
    return max(abs(math.log(b / a)) for a, b in pairs)
