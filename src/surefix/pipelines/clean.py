"""Clean a log: rows in one order, one filter, one verdict per fix, in any of the three modes.

`clean_batches` is the only way through; a whole log is one batch, a log larger than memory in real
time many. The numbers do not depend on the batches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from surefix.cleaning.duplicates import (
    Repeats,
    RepeatState,
    find_repeats,
    idle_axes,
    start_repeats,
)
from surefix.errors import InputError
from surefix.filters.health import Health
from surefix.filters.records import Epochs, Estimate, Motion, Recovery
from surefix.pipelines.channels import CHANNEL_HEAD, ChannelState, clean_channel
from surefix.pipelines.events import jump_events, run_events, sensor_events
from surefix.pipelines.joining import join
from surefix.pipelines.judge import (
    FilterState,
    begin,
    estimate,
    join_status,
    unjudged,
    verdicts,
    without_position,
)
from surefix.pipelines.latency import Late, find_late, in_time, late_events
from surefix.pipelines.observe import epochs_of, grid_times, padded, status_of, steady
from surefix.pipelines.options import HEAD, CleanOptions
from surefix.pipelines.present import nothing, pick, settings, track_of
from surefix.pipelines.rows import Chunk, Rows, Source, join_rows, merged, take_rows
from surefix.pipelines.setup import Setup, localise, settle
from surefix.types import (
    BoolArray,
    Channel,
    Cleaned,
    CleanedChannel,
    Event,
    FloatArray,
    Problem,
    Reason,
    Verdict,
    Verdicts,
)

__all__ = [
    "HEAD",
    "Estimator",
    "Session",
    "advance",
    "clean_batches",
    "clean_sources",
    "finish",
]

Estimator = Callable[[Motion, Recovery, Epochs, object], tuple[object, Estimate]]
"""Estimates a series in the place of the method: takes and gives what it remembers, None at first.

What it gets is prepared as for the method that the options name, and judged in the same way.
"""
_PORTION = 50_000  # rows cleaned at a time in real time; at least those it is settled on


@dataclass
class Session:
    """What is carried from batch to batch: the estimator's state, and rows too few to begin with.

    It holds plain records only and can be stored and gone on from later, as
    `surefix.pipelines.stream` does; ``options`` and ``names`` (of the sources) begin it.
    """

    options: CleanOptions
    estimator: Estimator | None = None
    memory: object = None  # of the estimator
    sensors: list[str] = field(default_factory=list)
    setup: Setup | None = None
    idle: BoolArray | None = None
    repeats: RepeatState | None = None
    filter: FilterState | None = None
    health: Health | None = None
    last_tau: float = -np.inf
    next_grid: int | None = None
    channels: dict[tuple[str, str], ChannelState] = field(default_factory=dict)
    arrived: dict[tuple[str, str], list[Channel]] = field(default_factory=dict)
    names: tuple[str, ...] = ()
    has_depth: bool = False
    held: int = 0
    waiting: list[Chunk] = field(default_factory=list)
    rows: int = 0  # that wait
    problems: list[Problem] = field(default_factory=list)  # as long as there is nothing else
    anything: bool = False


def clean_sources(
    sources: Iterable[Source], options: CleanOptions, estimator: Estimator | None = None
) -> Cleaned:
    """Clean whole sources and give one result; arguments as for `clean_batches`."""
    return join(list(clean_batches(sources, options, estimator)))


def clean_batches(
    sources: Iterable[Source], options: CleanOptions, estimator: Estimator | None = None
) -> Iterator[Cleaned]:
    """Clean sources batch by batch; only real time gives more than one batch.

    Parameters
    ----------
    sources
        The first role is ``fixes``; others support it.
    options
        How to clean.
    estimator
        One that is not among the methods; None for the method of the options.

    Raises
    ------
    InputError
        There is nothing to clean: no fix, no series.
    """
    inputs = list(sources)
    session = Session(options, estimator, names=tuple(source.name for source in inputs))
    for chunk in merged(inputs, session.sensors, options.reorder_s, options.sensor_delay_s):
        yield from advance(session, chunk)
    yield from finish(session)


def advance(session: Session, chunk: Chunk) -> Iterator[Cleaned]:
    """Take what was read next, and clean it if the mode and the number of rows allow it.

    Parameters
    ----------
    session
        What came before; goes on.
    chunk
        Rows in their order, and what came beside them.
    """
    options = session.options
    session.waiting.append(chunk)
    session.rows += len(chunk.rows.tau) if chunk.rows is not None else 0
    session.anything = session.anything or chunk.rows is not None or bool(chunk.channels)
    session.problems = [] if session.anything else [*session.problems, *chunk.problems]
    enough = 1 if session.setup else options.settle_rows
    if options.mode == "realtime" and session.rows >= enough:
        waiting, session.waiting, session.rows = session.waiting, [], 0
        yield from _batches(session, waiting, final=False)


def finish(session: Session) -> Iterator[Cleaned]:
    """Clean what is left when nothing more comes.

    Raises
    ------
    InputError
        There is nothing to clean: no fix, no series.
    """
    if not session.anything:
        raise _nothing_found(session.names, session.problems)
    yield from _batches(session, session.waiting, final=True)


def _nothing_found(names: tuple[str, ...], problems: list[Problem]) -> InputError:
    """Say why there is nothing to clean; the commonest problem is the likeliest reason."""
    worst = max(problems, key=lambda problem: problem.total, default=None)
    reason = f": {worst.total} × {worst.kind} ({worst.example})" if worst is not None else ""
    return InputError(
        f"{', '.join(names)}: no position and no series found{reason}",
        "fixes, headings, depths or speeds",
        worst.remedy if worst is not None else "",
    )


def _batches(session: Session, chunks: list[Chunk], *, final: bool) -> Iterator[Cleaned]:
    """Clean what was read, in real time in portions of bounded size."""
    parts = [chunk.rows for chunk in chunks if chunk.rows is not None]
    rows = join_rows(parts) if parts else None
    portions: list[Rows | None] = [rows]
    most = max(_PORTION, session.options.settle_rows)
    if session.options.mode == "realtime" and rows is not None and len(rows.tau) > most:
        starts = range(0, len(rows.tau), most)
        portions = [take_rows(rows, slice(at, at + most)) for at in starts]
    yield _batch(session, portions[0], chunks, final=final)
    for portion in portions[1:]:
        yield _batch(session, portion, [], final=False)
    if final and session.held:
        text = f"{session.held} fixes were held, the same position polled again; each counted once"
        empty = nothing(tuple(session.sensors), session.options, session.setup)
        yield replace(empty, sources=session.names, events=(Event("held", np.nan, text),))


def _batch(session: Session, rows: Rows | None, chunks: list[Chunk], *, final: bool) -> Cleaned:
    """Clean one portion of rows, and the series that came with ``chunks``."""
    events = [event for chunk in chunks for event in chunk.events]
    series: dict[tuple[str, str], list[Channel]] = {}
    for chunk in chunks:
        session.has_depth |= chunk.has_depth
        for channel in chunk.channels:
            series.setdefault((channel.sensor, channel.name), []).append(channel)
    if rows is not None:
        cleaned = _clean_rows(session, rows, events)
    else:
        cleaned = nothing(tuple(session.sensors), session.options, session.setup)
    return replace(
        cleaned,
        sources=session.names,
        has_depth=session.has_depth,
        channels=_clean_channels(session, series, final=final),
        events=tuple(events),
        problems=tuple(problem for chunk in chunks for problem in chunk.problems),
    )


def _clean_channels(
    session: Session, series: dict[tuple[str, str], list[Channel]], *, final: bool
) -> tuple[CleanedChannel, ...]:
    """Clean the series of a batch; one that just begins waits until there is enough to settle."""
    for key, parts in series.items():
        session.arrived.setdefault(key, []).extend(parts)
    late = [key for key in session.channels if key not in session.arrived] if final else []
    out = []
    for key in [*session.arrived, *late]:
        state = session.channels.get(key, ChannelState())
        parts = session.arrived.get(key) or [state.nothing()]
        whole = parts[0]._replace(
            time=np.concatenate([part.time for part in parts]),
            value=np.concatenate([part.value for part in parts]),
        )
        if key not in session.channels and not final and len(whole.time) < 2 * CHANNEL_HEAD:
            continue
        session.arrived.pop(key, None)
        cleaned, session.channels[key] = clean_channel(whole, state, session.options, final=final)
        out.append(cleaned)
    return tuple(out)


def _clean_rows(session: Session, rows: Rows, events: list[Event]) -> Cleaned:
    """Filter a batch of rows; what is settled with the first batch is added to ``events``."""
    options = session.options
    tau = steady(rows.tau, session.last_tau)
    status = status_of(rows, _repeats(session, rows), held=options.held)
    used = _without_idle(session, rows)
    setup = session.setup
    if setup is None:
        head = _head(options)
        setup = settle(take_rows(used, head), (status.verdict < 0)[head], session.sensors, options)
        session.setup = setup
        delayed = _delayed(session, setup, take_rows(used, head), (status.verdict < 0)[head])
        removed = bool(delayed) and options.latency == "remove"
        events += late_events(delayed, removed=removed)
        if removed:
            rows = in_time(rows, delayed, session.sensors)
            return _clean_rows(_without_delay(session, delayed), rows, events)
        if setup.axes:
            session.filter = begin(options, setup.motion, setup.recovery, setup.prior)
        events += [*setup.events, *_idle_events(session, geographic=rows.fixes.geographic)]
    position, velocity = localise(used, setup.frame, setup.origin)
    offset = padded(setup.height_offset, len(session.sensors))[rows.fixes.sensor]
    position[:, 2] -= np.where(rows.auxiliary, 0.0, offset)
    lost = ~np.isfinite(position).any(axis=1) & ~rows.auxiliary
    status.mark(lost & ~np.isfinite(velocity).any(axis=1), Verdict.MISSING, Reason.NO_POSITION)
    grid = _grid(session, setup, tau)
    order, epochs = epochs_of(
        rows, tau, position, velocity, status, grid, setup, len(session.sensors)
    )
    known = join_status(status, order, len(grid))
    session.last_tau = float(tau[-1])
    auxiliary = np.concatenate([rows.auxiliary, np.zeros(len(grid), np.bool_)])[order]
    found = None
    judged = unjudged(known)
    if session.filter is not None and session.estimator is not None:
        session.memory, found = session.estimator(
            setup.motion, setup.recovery, epochs, session.memory
        )
    elif session.filter is not None:
        session.filter, found = estimate(
            options,
            setup.motion,
            setup.recovery,
            setup.prior,
            setup.lag,
            epochs,
            ~auxiliary,
            session.filter,
        )
    if found is not None:
        several = setup.prior is not None
        judged = verdicts(found, epochs, setup.motion, known, setup.axes, several=several)
        judged = _all_axes(judged, setup.axes)
        judged = without_position(
            judged, np.concatenate([lost, np.zeros(len(grid), np.bool_)])[order]
        )
    track = track_of(setup, found, np.concatenate([rows.time, grid])[order])
    late = np.flatnonzero(known.reason == Reason.LATE)
    for column in track[1:]:
        if column is not None:
            column[late] = np.nan  # the track had passed before they came
    fix = np.flatnonzero((order < len(tau)) & ~auxiliary)
    mine = take_rows(rows, order[fix])
    judged = Verdicts._make(column[fix] for column in judged)
    session.held += int((judged.reason == Reason.HELD).sum())
    events += jump_events(judged)
    scale = np.ones(len(fix)) if found is None else found.scale[fix]
    told = judged, track.time[fix], mine.fixes.sensor, session.sensors
    events += run_events(*told, growing=options.mode == "realtime")
    found_events, session.health = sensor_events(*told, scale, session.health)
    events += found_events
    return replace(
        nothing(tuple(session.sensors), options, setup),
        track=pick(track, fix),
        verdicts=judged,
        raw_position=position[order[fix]] + setup.origin,
        raw_coordinates=mine.fixes.position,
        sensor=mine.fixes.sensor,
        row=mine.fixes.row,
        resampled=pick(track, np.flatnonzero(order >= len(tau))) if options.every_s else None,
        settings=settings(options, setup),
    )


def _delayed(session: Session, setup: Setup, rows: Rows, usable: BoolArray) -> tuple[Late, ...]:
    """Sensors that are late against a velocity, as far as the options ask for it."""
    if session.options.latency == "ignore":
        return ()
    position, velocity = localise(rows, setup.frame, setup.origin)
    return find_late(rows, usable, position, velocity, session.sensors)


def _without_delay(session: Session, late: tuple[Late, ...]) -> Session:
    """Go back to where nothing was settled; the delays are known now."""
    known = dict(session.options.sensor_delay_s)
    for each in late:
        known[each.sensor] = known.get(each.sensor, 0.0) + each.found.delay
    session.options = replace(session.options, sensor_delay_s=known, latency="ignore")
    session.setup, session.repeats, session.idle = None, None, None
    return session


def _all_axes(judged: Verdicts, axes: tuple[int, ...]) -> Verdicts:
    """Verdicts with a column for each of x, y, z."""
    wide, offset = (np.full((len(judged.verdict), 3), np.nan) for _ in range(2))
    wide[:, list(axes)] = judged.standardised
    offset[:, list(axes)] = judged.offset
    return judged._replace(standardised=wide, offset=offset)


def _repeats(session: Session, rows: Rows) -> Repeats:
    fixes = rows.fixes
    if session.repeats is None:
        head, sensors = _head(session.options), len(session.sensors)
        again = np.diff(rows.tau, prepend=np.nan) == 0.0
        positions = np.where(again[:, None], np.nan, fixes.position)
        session.repeats = start_repeats(positions[head], fixes.sensor[head], sensors)
        session.idle = idle_axes(
            fixes.position[head], fixes.sensor[head], sensors, geographic=fixes.geographic
        )
    recorded = np.hstack([fixes.position, fixes.velocity])
    repeats, session.repeats = find_repeats(rows.tau, recorded, fixes.sensor, session.repeats)
    return repeats


def _head(options: CleanOptions) -> slice:
    """The rows of the first batch that a log is settled on."""
    return slice(options.settle_rows if options.mode == "realtime" else None)


def _without_idle(session: Session, rows: Rows) -> Rows:
    """Rows without the axes that carry no information."""
    if session.idle is None or not session.idle.any():
        return rows
    idle = padded(session.idle, len(session.sensors))[rows.fixes.sensor]
    position = np.where(idle, np.nan, rows.fixes.position)
    return rows._replace(fixes=rows.fixes._replace(position=position))


def _idle_events(session: Session, *, geographic: bool) -> list[Event]:
    if session.idle is None:
        return []
    names = ("latitude", "longitude", "height") if geographic else ("axis x", "axis y", "axis z")
    return [
        Event(
            "idle-axis",
            np.nan,
            f"{names[axis]} of {session.sensors[sensor]} never changes; left out",
        )
        for sensor, axis in zip(*np.nonzero(session.idle), strict=True)
    ]


def _grid(session: Session, setup: Setup, tau: FloatArray) -> FloatArray:
    """Regular times that are due in this batch: whole multiples of the step."""
    every = session.options.every_s
    if every is None:
        return np.empty(0)
    if session.next_grid is None:
        session.next_grid = int(np.ceil(tau[0] / every))
    first = session.next_grid
    session.next_grid = max(first, int(np.floor(tau[-1] / every)) + 1)
    return grid_times(tau, every, first, session.last_tau, setup.interval)
