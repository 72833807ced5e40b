"""From a log of single sights to positions, and a verdict for every sight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from surefix.errors import InputError, OptionsError
from surefix.filters.sight_learning import SightFigures, learn_sights, with_figures
from surefix.filters.sight_modes import SightEstimate, offline_sights, realtime_sights
from surefix.filters.sight_records import SightBank, SightModel, SightPrior, Sights
from surefix.filters.sight_starts import begin_around, begin_at, first_epoch
from surefix.io.named_columns import read_columns
from surefix.models.sights import BEARING, COMPONENT, ELEVATION, RANGE
from surefix.pipelines.survey import KINDS, SightSource, Survey
from surefix.types import BoolArray, FloatArray, IntArray, Noise, Problem, Reason, Verdict, Verdicts

__all__ = ["LocateMode", "Located", "locate_sights"]

LocateMode = Literal["offline", "realtime"]

_ABSURD = 1e9  # m, from which on a value is damage


@dataclass(frozen=True, kw_only=True)
class Located:
    """Positions from single sights; one row per record of the log, in its order.

    Parameters
    ----------
    time, row
        (n,) s, and number of the record, from 0.
    position, velocity
        (n, 3) m and m/s in the axes of the survey; NaN where nothing was seen at this record.
    covariance
        (n, 3, 3) m², of the position.
    sights
        Names of the c columns.
    value
        (n, c) as they stand in the log; NaN is missing.
    verdicts
        Of all sights, (n·c,), record by record.
    noise, problems
        Figures used, and bad input counted.
    """

    time: FloatArray
    row: IntArray
    position: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    sights: tuple[str, ...]
    value: FloatArray
    verdicts: Verdicts
    noise: tuple[Noise, ...]
    problems: tuple[Problem, ...]


class _Read(NamedTuple):
    """What was read: sights in SI units, values as they stand, and which records count."""

    sights: Sights
    value: FloatArray
    late: BoolArray
    held: BoolArray
    problems: tuple[Problem, ...]


def locate_sights(data: Any, survey: Survey, mode: LocateMode = "offline") -> Located:
    """Estimate positions from single sights.

    Parameters
    ----------
    data
        Path of a CSV or Parquet file, a data frame, or a mapping of names to arrays.
    survey
        What its columns mean.
    mode
        ``offline``: every sight is judged by the whole log. ``realtime``: by the past alone; noise
        that the survey does not give is still learnt from the log.

    Raises
    ------
    InputError, ParseError, OptionsError
        What was given, what was expected, and the remedy.
    """
    if mode not in ("offline", "realtime"):
        raise OptionsError(f"mode {mode!r}", "offline or realtime")
    read = _read(data, survey)
    model, group, given = _model(survey)
    usable = ~read.late & ~read.held & np.isfinite(read.sights.z).any(axis=1)
    epochs = np.flatnonzero(usable & np.isfinite(read.sights.time))
    parts = _stretches(read.sights, model, survey, epochs)
    if not parts:
        raise InputError(
            "the log has no range to begin with", "at least one", "say start and start_sigma"
        )
    figures, prior = _learnt(read.sights, model, group, given, survey, parts)
    model, sights = with_figures(model, read.sights, group, figures)
    whole = _blank(len(sights.time), model)
    for i, part in enumerate(parts):
        here = _rows(sights, part)
        bank = _bank(model, here, survey, first=i == 0)
        found = _estimate(model, prior, here, bank, mode)
        for to, values in zip(whole, found, strict=True):
            to[part] = values
    return _located(read, survey, whole, figures)


def _read(data: Any, survey: Survey) -> _Read:
    anchors = [a for source in survey.sights for a in source.at if isinstance(a, str)]
    names = [source.column for source in survey.sights]
    time, columns, problems = read_columns(data, survey.time, [*names, *anchors])
    n, d = len(time), survey.axes
    value = np.column_stack([columns[name] for name in names])
    anchor = np.zeros((n, len(names), d))
    z = np.empty_like(value)
    for c, source in enumerate(survey.sights):
        z[:, c] = _si(source, value[:, c])
        for a, place in enumerate(source.at):
            anchor[:, c, a] = columns[place] if isinstance(place, str) else place
    z[~np.isfinite(anchor).all(axis=2)] = np.nan
    z[~(np.abs(z) < _ABSURD)] = np.nan
    known = np.isfinite(time)
    before = np.fmax.accumulate(np.concatenate([[-np.inf], np.where(known, time, -np.inf)]))[:-1]
    late = ~(time >= before) & known
    held = np.zeros(n, np.bool_)
    if survey.polled:
        same = (z[1:] == z[:-1]) | (np.isnan(z[1:]) & np.isnan(z[:-1]))
        held[1:] = same.all(axis=1) & np.isfinite(z[1:]).any(axis=1)
    empty = np.full_like(z, np.nan)
    return _Read(Sights(time, z, empty, anchor, empty.copy()), value, late, held, problems)


def _si(source: SightSource, value: FloatArray) -> FloatArray:
    """Metres and radians, z up; a range that is not positive is none."""
    if source.kind in ("bearing", "elevation"):
        return np.radians(value)
    if source.kind == "depth":
        return -value
    return np.where(value > 0.0, value, np.nan) if source.kind == "range" else value.copy()


def _model(survey: Survey) -> tuple[SightModel, IntArray, SightFigures]:
    """Model without noise, group of each channel, and the figures that are given."""
    d = survey.axes
    codes = [KINDS[source.kind] for source in survey.sights]
    kind = np.array([COMPONENT + d - 1 - code if code < 0 else code for code in codes], np.int64)
    groups = survey.groups()
    group = np.array([groups.index(s.group or s.kind) for s in survey.sights], np.int64)
    sigma = np.full(len(groups), np.nan)
    for c, source in enumerate(survey.sights):
        if source.sigma is not None:
            angle = source.kind in ("bearing", "elevation")
            sigma[group[c]] = np.radians(source.sigma) if angle else source.sigma
    free = np.tile([-np.inf, np.inf], (d, 1))
    within = free if survey.within is None else np.array(survey.within, dtype=np.float64)
    process = np.nan if survey.process is None else survey.process
    return SightModel(d, np.ones(d), kind, within), group, SightFigures(sigma, process)


def _rows(sights: Sights, index: IntArray) -> Sights:
    return Sights._make(column[index] for column in sights)


def _stretches(
    sights: Sights, model: SightModel, survey: Survey, epochs: IntArray
) -> list[IntArray]:
    """Epochs of each track: a new one after a gap, from its first range on."""
    if not len(epochs):
        return []
    if (model.kind == RANGE).any():
        cut = np.flatnonzero(np.diff(sights.time[epochs]) > survey.gap_s) + 1
        parts = np.split(epochs, cut)
    else:
        parts = [epochs]
    known = survey.start is not None
    return [
        rest
        for i, part in enumerate(parts)
        if len(
            rest := part if known and i == 0 else part[first_epoch(model, _rows(sights, part)) :]
        )
    ]


def _bank(model: SightModel, sights: Sights, survey: Survey, *, first: bool) -> SightBank:
    if first and survey.start is not None and survey.start_sigma is not None:
        place, sigma = np.array(survey.start), np.array(survey.start_sigma)
        return begin_at(model, place, sigma, survey.speed)
    return begin_around(model, sights, survey.speed)


def _learnt(
    sights: Sights,
    model: SightModel,
    group: IntArray,
    given: SightFigures,
    survey: Survey,
    parts: list[IntArray],
) -> tuple[SightFigures, SightPrior]:
    """Figures and prior from the longest track."""
    longest = max(range(len(parts)), key=lambda i: len(parts[i]))
    here = _rows(sights, parts[longest])
    bank = _bank(model, here, survey, first=longest == 0)
    return learn_sights(model, here, group, given, bank, survey.speed)


def _estimate(
    model: SightModel, prior: SightPrior, sights: Sights, bank: SightBank, mode: LocateMode
) -> SightEstimate:
    if mode == "offline":
        return offline_sights(model, prior, sights, bank)
    return realtime_sights(model, prior, sights, bank)[1]


def _blank(n: int, model: SightModel) -> SightEstimate:
    s, c = 2 * model.axes, len(model.kind)
    return SightEstimate(
        np.full((n, s), np.nan),
        np.full((n, s, s), np.nan),
        np.full((n, c), np.nan),
        np.full((n, c), np.nan),
    )


def _located(read: _Read, survey: Survey, whole: SightEstimate, figures: SightFigures) -> Located:
    n, d = len(read.value), survey.axes
    position, velocity = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    covariance = np.full((n, 3, 3), np.nan)
    position[:, :d], velocity[:, :d] = whole.mean[:, :d], whole.mean[:, d:]
    covariance[:, :d, :d] = whole.covariance[:, :d, :d]
    return Located(
        time=read.sights.time,
        row=np.arange(n),
        position=position,
        velocity=velocity,
        covariance=covariance,
        sights=tuple(source.column for source in survey.sights),
        value=read.value,
        verdicts=_verdicts(read, whole),
        noise=_noise(survey, figures),
        problems=read.problems,
    )


def _verdicts(read: _Read, whole: SightEstimate) -> Verdicts:
    """One verdict per sight, record by record."""
    time, z = read.sights.time, read.sights.z
    shape = z.shape
    weight = np.nan_to_num(whole.weight, nan=0.0)
    known = np.isfinite(whole.weight)
    wrong = known & ~(weight >= 0.25)
    verdict = np.full(shape, Verdict.MISSING, np.int64)
    reason = np.full(shape, Reason.NO_VALUE, np.int64)
    detail = np.full(shape, np.nan)
    verdict[known] = np.where(weight[known] > 0.5, Verdict.USED, Verdict.DOWNWEIGHTED)
    reason[known] = np.where(weight[known] > 0.5, Reason.AGREES, Reason.OFF)
    verdict[wrong], reason[wrong] = Verdict.REJECTED, Reason.OFF
    length = np.column_stack([_runs(wrong[:, c], known[:, c]) for c in range(shape[1])])
    reason[length > 1] = Reason.RUN
    detail[length > 1] = length[length > 1]
    there = np.isfinite(z)
    before = np.fmax.accumulate(np.where(np.isfinite(time), time, -np.inf))
    fresh = np.maximum.accumulate(np.where(read.held, 0, np.arange(len(time))))
    for rows, code, why, figure in (
        (read.held, Verdict.DUPLICATE, Reason.HELD, time[fresh]),
        (read.late, Verdict.REJECTED, Reason.LATE, before),
        (np.isnan(time), Verdict.MISSING, Reason.NO_TIME, time),
    ):
        mask = rows[:, None] & there
        verdict[mask], reason[mask] = code, why
        detail[mask] = np.broadcast_to(figure[:, None], shape)[mask]
    flat = whole.standardised.ravel()
    standardised = np.column_stack([flat, np.full((flat.size, 2), np.nan)])
    return Verdicts(
        verdict.ravel(),
        np.where(wrong, 0.0, weight).ravel(),
        np.abs(flat),
        standardised,
        reason.ravel(),
        detail.ravel(),
        np.full((flat.size, 3), np.nan),
    )


def _runs(wrong: BoolArray, known: BoolArray) -> IntArray:
    """(n,) sights of the unbroken run of wrong ones that each belongs to, 0 if to none."""
    out = np.zeros(len(wrong), np.int64)
    k = np.flatnonzero(known)
    bad = wrong[k]
    if len(k):
        label = np.cumsum(np.concatenate([[True], bad[1:] != bad[:-1]]))
        out[k] = np.where(bad, np.bincount(label)[label], 0)
    return out


def _noise(survey: Survey, figures: SightFigures) -> tuple[Noise, ...]:
    found = []
    for name, sigma in zip(survey.groups(), figures.sigma.tolist(), strict=True):
        sources = [s for s in survey.sights if (s.group or s.kind) == name]
        kind = KINDS[sources[0].kind]
        given = any(s.sigma is not None for s in sources)
        unit = "deg" if kind in (BEARING, ELEVATION) else "m/s" if kind < 0 else "m"
        value = float(np.degrees(sigma)) if unit == "deg" else sigma
        found.append(Noise(name, sources[0].kind, value, unit, "given" if given else "estimated"))
    source = "estimated" if survey.process is None else "given"
    return (*found, Noise("motion", "acceleration", figures.process, "m/s^1.5", source))
