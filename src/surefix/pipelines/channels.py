"""Scalar series beside the position, cleaned by the same filter on one axis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.cleaning.clock import ClockState, repair
from surefix.cleaning.duplicates import RepeatState, find_repeats, start_repeats
from surefix.filters.health import Health, no_health, watch
from surefix.filters.learning import supposed
from surefix.filters.liveliness import Lively, begin_lively, follow
from surefix.filters.noise import (
    NoiseFigures,
    Observations,
    estimate_noise,
    grain,
    speed_scale,
    typical_step,
)
from surefix.filters.records import Epochs, Estimate, Motion, Recovery
from surefix.filters.track import by_axis
from surefix.geo.angle import wrap
from surefix.models.motion import MODELS
from surefix.pipelines.judge import FilterState, begin, blank_status, estimate, verdicts
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.present import UNKNOWN
from surefix.pipelines.setup import FARTHEST
from surefix.types import (
    Channel,
    CleanedChannel,
    FloatArray,
    Noise,
    Reason,
    Verdict,
    Verdicts,
)

__all__ = ["ChannelState", "channel_head", "clean_channel"]

_HEAD = 2000
_LAG_VALUES = 20
_JUDGED = (Verdict.USED, Verdict.DOWNWEIGHTED, Verdict.REJECTED)
_LITTLE = 0.1  # a value of less weight does not count as support of the clean series …
_LOST = 20.0  # … which is left open there once its σ exceeds so many σ of the noise


class ChannelState(NamedTuple):
    """Where the cleaning of one series stands; ``ChannelState()`` begins it."""

    clock: ClockState = ClockState()
    held: Channel | None = None
    repeats: RepeatState | None = None
    motion: Motion | None = None
    recovery: Recovery = Recovery(np.inf, 1.0)
    lag: float = 0.0
    sigma: float = 1.0
    noise: tuple[Noise, ...] = ()
    filter: FilterState | None = None
    lively: Lively | None = None
    health: Health = no_health(1)

    def nothing(self) -> Channel:
        """An empty part of the series that was begun."""
        assert self.held is not None
        return self.held._replace(time=np.empty(0), value=np.empty(0))


def channel_head(options: CleanOptions) -> int:
    """Values that a series is settled on in real time; the other modes see it whole."""
    return min(_HEAD, options.settle_rows)


def clean_channel(
    new: Channel, state: ChannelState, options: CleanOptions, *, final: bool
) -> tuple[CleanedChannel, ChannelState]:
    """Clean the next part of a series.

    Parameters
    ----------
    new
        The part, in the order of arrival; may be empty.
    state
        From the part before. Noise is estimated on the head of the first part, in real time on its
        first `channel_head` values: twice as many should come before it is begun.
    options
        Mode and method; noise figures of positions do not apply, and ``auto`` is the ``cv`` model,
        which runs away least where a series has lost its sensor.
    final
        True with the last part.
    """
    options = options.for_series
    time, value = new.time, new.value
    if state.held is not None:
        time = np.concatenate([state.held.time, time])
        value = np.concatenate([state.held.value, value])
    place = np.full((len(new.time), 2), np.nan)
    row = np.zeros(len(new.time), np.int64)
    repaired, clock, _ = repair(
        new.time, place, row, state.clock, final=final, window=options.reorder_s
    )
    held = new._replace(time=time[repaired.held], value=value[repaired.held])
    raw, tau = value[repaired.order], _filled(repaired.tau)
    state = state._replace(clock=clock, held=held)
    sensor = np.zeros(len(raw), np.int64)
    head = slice(channel_head(options) if options.mode == "realtime" else None)
    if state.repeats is None:
        state = state._replace(repeats=start_repeats(raw[head, None], sensor[head], 1))
    assert state.repeats is not None
    found, repeats = find_repeats(repaired.tau, raw[:, None], sensor, state.repeats)
    state = state._replace(repeats=repeats)
    status = blank_status(len(raw))
    status.mark(np.isnan(repaired.tau), Verdict.MISSING, Reason.NO_TIME)
    status.mark(repaired.late, Verdict.REJECTED, Reason.LATE)
    status.mark(~np.isfinite(raw), Verdict.MISSING, Reason.NO_VALUE)
    status.mark(found.repeated, Verdict.DUPLICATE, Reason.REPEATED)
    status.detail[status.verdict == Verdict.DUPLICATE] = found.first[
        status.verdict == Verdict.DUPLICATE
    ]
    z = np.clip(np.where(status.verdict < 0, raw, np.nan), -FARTHEST, FARTHEST)
    if state.motion is None:
        state = _settle(state, new, tau[head], z[head], options)
    motion = state.motion
    assert motion is not None
    assert state.filter is not None
    n = len(raw)
    epochs = Epochs(
        tau,
        np.column_stack([z, np.full(n, np.nan)]),
        np.full((n, 2), state.sigma**2),
        np.full((n, 2), np.nan),
        np.zeros(n, np.int64),
    )
    state, estimated = _estimated(state, motion, state.filter, epochs, options)
    judged = verdicts(estimated, epochs, motion, status, (0,), several=False)
    lost = (judged.weight < _LITTLE) & (estimated.sigma[:, 0] > _LOST * state.sigma)
    known = (estimated.sigma[:, 0] < UNKNOWN) & ~lost
    mean = np.where(known, estimated.mean[:, 0], np.nan)
    cleaned = CleanedChannel(
        name=new.name,
        sensor=new.sensor,
        time=repaired.time,
        raw=raw,
        value=wrap(mean - 180.0) + 180.0 if new.period == 360.0 else mean,
        rate=np.where(known, estimated.mean[:, 1], np.nan),
        sigma=np.where(known, estimated.sigma[:, 0], np.nan),
        period=new.period,
        verdicts=judged,
        noise=state.noise,
    )
    return cleaned, state._replace(health=_watched(state.health, judged))


def _estimated(
    state: ChannelState,
    motion: Motion,
    before: FilterState,
    epochs: Epochs,
    options: CleanOptions,
) -> tuple[ChannelState, Estimate]:
    """Let the filter take the epochs; in real time its process noise follows the series."""

    def run(motion: Motion, epochs: Epochs, before: FilterState) -> tuple[FilterState, Estimate]:
        wanted = np.ones(len(epochs.time), np.bool_)
        return estimate(options, motion, state.recovery, None, state.lag, epochs, wanted, before)

    if options.mode != "realtime":
        after, found = run(motion, epochs, before)
        return state._replace(filter=after), found
    lively = state.lively or begin_lively(motion, 1)
    speed, longest = state.recovery.sigma_velocity, state.recovery.after
    prior = supposed(1, state.sigma, 1.0, speed, longest)
    after, lively, found, _ = follow(run, motion, ((0,),), lively, epochs, before, prior)
    return state._replace(filter=after, lively=lively), found


def _watched(health: Health, judged: Verdicts) -> Health:
    """The record of the sensor after these values."""
    rows = np.flatnonzero(np.isin(judged.verdict, _JUDGED))
    square = judged.standardised[rows, 0] ** 2
    out = judged.verdict[rows] == Verdict.REJECTED
    return watch(health, np.zeros(len(rows), np.int64), out, square)[0]


def _filled(tau: FloatArray) -> FloatArray:
    """``tau`` without gaps and never falling, for rows that only take a prediction."""
    filled = np.maximum.accumulate(np.where(np.isfinite(tau), tau, -np.inf))
    finite = filled[np.isfinite(filled)]
    return np.where(np.isfinite(filled), filled, finite[0] if len(finite) else 0.0)


def _settle(
    state: ChannelState, new: Channel, tau: FloatArray, z: FloatArray, options: CleanOptions
) -> ChannelState:
    """Estimate the noise of a series on its head and start its filter."""
    seen = np.isfinite(z)
    values = np.column_stack([z[seen], np.full(seen.sum(), np.nan)])
    observations = Observations(
        tau[seen], values, np.zeros(seen.sum(), np.int64), np.full_like(values, np.nan)
    )
    unknown = NoiseFigures(np.array([np.nan]), np.array([np.nan]), np.nan)
    order = MODELS["cv" if options.model == "auto" else options.model]
    quantum = grain(z[seen])
    figures = estimate_noise(observations, unknown, order=order, period=new.period, quantum=quantum)
    interval = typical_step(tau[seen])
    turned = np.unwrap(z[seen], period=new.period) if new.period else z[seen]
    speed = max(speed_scale(tau[seen], turned), 1e-6)
    recovery = Recovery(options.patience(interval), speed)
    motion = Motion(order, 1, np.array([figures.process**2]), by_axis(1), 2, new.period)
    unit = new.name.rsplit("_", 1)[-1]
    sigma = float(figures.position[0]) if np.isfinite(figures.position[0]) else 1.0
    noise = (
        Noise(new.sensor, new.name, sigma, unit, "estimated"),
        Noise(
            "motion",
            f"{new.name} change",
            figures.process,
            f"{unit}/s^{order - 0.5:g}",
            "estimated",
        ),
    )
    return state._replace(
        motion=motion,
        recovery=recovery,
        lag=float(options.lag_s or _LAG_VALUES * interval),
        sigma=sigma,
        noise=noise,
        filter=begin(options, motion, recovery, None),
    )
