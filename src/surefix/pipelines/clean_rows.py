"""Clean rows: mark what says nothing new, let the filter take the rest, give each its verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from surefix.cleaning.duplicates import find_repeats
from surefix.filters.hypotheses import Bank
from surefix.filters.liveliness import Change, begin_lively, follow
from surefix.filters.multi_hypothesis_modes import realtime_hypotheses
from surefix.filters.records import Epochs, Estimate, Motion
from surefix.pipelines.events import jump_events, motion_events, run_events, sensor_events
from surefix.pipelines.judge import (
    Status,
    by_velocity,
    estimate,
    join_status,
    unjudged,
    verdicts,
    without_position,
)
from surefix.pipelines.latency import in_time
from surefix.pipelines.observe import epochs_of, grid_times, padded, status_of, steady
from surefix.pipelines.present import nothing, pick, settings, track_of
from surefix.pipelines.rows import Rows, take_rows
from surefix.pipelines.settling import begin_rows, settle_session
from surefix.pipelines.setup import Setup, localise
from surefix.pipelines.state import Session
from surefix.types import BoolArray, Cleaned, FloatArray, IntArray, Reason, Track, Verdict, Verdicts

__all__ = ["clean_rows"]


def clean_rows(session: Session, rows: Rows) -> tuple[Session, Cleaned]:
    """Filter the next rows of a log; on the first ones the log is settled.

    Parameters
    ----------
    session
        Where the cleaning stands; not modified.
    rows
        In the order of time, at least one.
    """
    first = session if session.repeats is not None else begin_rows(session, rows)
    assert first.repeats is not None
    fixes = rows.fixes
    repeats, known = find_repeats(
        rows.tau, np.hstack([fixes.position, fixes.velocity]), fixes.sensor, first.repeats
    )
    tau = steady(rows.tau, session.last_tau)
    status = status_of(rows, repeats, held=session.options.held)
    used = _without_idle(first, rows)
    session = replace(first, repeats=known)
    if session.setup is not None:
        return _clean(session, session.setup, rows, used, tau, status)
    session, events, late = settle_session(session, used, status.verdict < 0)
    if session.setup is None:
        session, cleaned = clean_rows(session, in_time(rows, late, list(session.sensors)))
    else:
        session, cleaned = _clean(session, session.setup, rows, used, tau, status)
    return session, replace(cleaned, events=(*events, *cleaned.events))


class _Epochs(NamedTuple):
    """Epochs of rows and regular times: which row each is, and those that are not of the output."""

    order: IntArray
    epochs: Epochs
    status: Status
    auxiliary: BoolArray
    lost: BoolArray
    time: FloatArray


def _clean(
    session: Session, setup: Setup, rows: Rows, used: Rows, tau: FloatArray, status: Status
) -> tuple[Session, Cleaned]:
    """Clean rows of a log that is settled; ``used`` are those without idle axes."""
    options, sensors = session.options, session.sensors
    position, velocity = localise(used, setup.frame, setup.origin)
    offset = padded(setup.height_offset, len(sensors))[rows.fixes.sensor]
    position[:, 2] -= np.where(rows.auxiliary, 0.0, offset)
    lost = ~np.isfinite(position).any(axis=1) & ~rows.auxiliary
    status.mark(lost & ~np.isfinite(velocity).any(axis=1), Verdict.MISSING, Reason.NO_POSITION)
    session, grid = _grid(session, setup, tau)
    order, epochs = epochs_of(rows, tau, position, velocity, status, grid, setup, len(sensors))
    none = np.zeros(len(grid), np.bool_)
    all_rows = _Epochs(
        order,
        epochs,
        join_status(status, order, len(grid)),
        np.concatenate([rows.auxiliary, none])[order],
        np.concatenate([lost, none])[order],
        np.concatenate([rows.time, grid])[order],
    )
    session = replace(session, last_tau=float(tau[-1]))
    session, found, changes = _estimated(session, setup, all_rows)
    judged = _judged(setup, all_rows, found)
    track = _track(setup, all_rows, found)
    auxiliary, scale = all_rows.auxiliary, 1.0 if found is None else found.scale
    del epochs, all_rows, found  # what is made now is as large
    own = order < len(tau)
    row = _where(own)
    input_row = order[row] if len(grid) else row
    health_events, health = sensor_events(
        Verdicts._make(column[row] for column in judged),
        track.time[row],
        rows.fixes.sensor[input_row],
        list(sensors),
        np.broadcast_to(scale, order.shape)[row],
        auxiliary[row],
        session.health,
    )

    fix = _where(own & ~auxiliary)
    input_fix = order[fix] if len(grid) else fix
    mine = take_rows(rows, input_fix)
    judged = Verdicts._make(column[fix] for column in judged)
    told = judged, track.time[fix], mine.fixes.sensor, list(sensors)
    session = replace(
        session, health=health, held=session.held + int((judged.reason == Reason.HELD).sum())
    )
    return session, replace(
        nothing(sensors, options, setup),
        track=pick(track, fix),
        verdicts=judged,
        raw_position=position[input_fix] + setup.origin,
        raw_coordinates=mine.fixes.position,
        sensor=mine.fixes.sensor,
        row=mine.fixes.row,
        resampled=pick(track, np.flatnonzero(~own)) if options.every_s else None,
        events=(
            *jump_events(judged),
            *run_events(*told, growing=options.mode == "realtime"),
            *health_events,
            *motion_events(changes, track.time, setup.model),
        ),
        settings=settings(options, setup),
    )


def _where(mask: BoolArray) -> IntArray | slice:
    """Where a mask holds; everywhere is a slice, which copies nothing."""
    return slice(None) if mask.all() else np.flatnonzero(mask)


def _estimated(
    session: Session, setup: Setup, all_rows: _Epochs
) -> tuple[Session, Estimate | None, tuple[Change, ...]]:
    """Let the filter, or an estimator in its place, take the epochs; none without any axis."""
    if session.filter is None:
        return session, None, ()
    if session.estimator is not None:
        memory, found = session.estimator(
            setup.motion, setup.recovery, all_rows.epochs, session.memory
        )
        return replace(session, memory=memory), found, ()

    prior, given = setup.prior, session.options.process is not None
    if session.options.mode != "realtime" or prior is None or given:
        after, found = estimate(
            session.options,
            setup.motion,
            setup.recovery,
            prior,
            setup.lag,
            all_rows.epochs,
            ~all_rows.auxiliary,
            session.filter,
        )
        return replace(session, filter=after), found, ()

    def run(motion: Motion, epochs: Epochs, bank: Bank) -> tuple[Bank, Estimate]:
        return realtime_hypotheses(motion, prior, epochs, bank)

    assert isinstance(session.filter, Bank)
    lively = session.lively or begin_lively(setup.motion, len(setup.blocks))
    bank, lively, found, changes = follow(
        run, setup.motion, setup.blocks, lively, all_rows.epochs, session.filter, prior
    )
    return replace(session, filter=bank, lively=lively), found, changes


def _judged(setup: Setup, all_rows: _Epochs, found: Estimate | None) -> Verdicts:
    """Verdict of every epoch, with a column for each of x, y, z."""
    if found is None:
        return unjudged(all_rows.status)
    several = setup.prior is not None
    judged = verdicts(
        found, all_rows.epochs, setup.motion, all_rows.status, setup.axes, several=several
    )
    wide, offset = (np.full((len(judged.verdict), 3), np.nan) for _ in range(2))
    supporting = all_rows.auxiliary & (all_rows.status.verdict < 0)
    judged = by_velocity(judged, found, setup.motion, supporting, several=several)
    wide[:, list(setup.axes)] = judged.standardised
    offset[:, list(setup.axes)] = judged.offset
    return without_position(judged._replace(standardised=wide, offset=offset), all_rows.lost)


def _track(setup: Setup, all_rows: _Epochs, found: Estimate | None) -> Track:
    """The track at all epochs; where a row came too late, it had passed before."""
    track = track_of(setup, found, all_rows.time)
    late = np.flatnonzero(all_rows.status.reason == Reason.LATE)
    for column in track[1:]:
        if column is not None:
            column[late] = np.nan
    return track


def _without_idle(session: Session, rows: Rows) -> Rows:
    """Rows without the axes that carry no information."""
    if session.idle is None or not session.idle.any():
        return rows
    idle = padded(session.idle, len(session.sensors))[rows.fixes.sensor]
    position = np.where(idle, np.nan, rows.fixes.position)
    return rows._replace(fixes=rows.fixes._replace(position=position))


def _grid(session: Session, setup: Setup, tau: FloatArray) -> tuple[Session, FloatArray]:
    """Regular times that are due in this batch: whole multiples of the step."""
    every = session.options.every_s
    if every is None:
        return session, np.empty(0)
    first = int(np.ceil(tau[0] / every)) if session.next_grid is None else session.next_grid
    following = max(first, int(np.floor(tau[-1] / every)) + 1)
    grid = grid_times(tau, every, first, session.last_tau, setup.interval)
    return replace(session, next_grid=following), grid
