"""Clean a log: rows in one order, one filter, one verdict per fix, in any of the three modes.

`clean_batches` is the only way through; a whole log is one batch, a log larger than memory in real
time many. The numbers do not depend on the batches.
"""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple

import numpy as np

from surefix.cleaning.duplicates import (
    Repeats,
    RepeatState,
    constant_axes,
    find_repeats,
    start_repeats,
)
from surefix.filters.records import Epochs, Estimate, TrackState
from surefix.filters.track import start
from surefix.geo.local_frame import rotate
from surefix.pipelines.channels import ChannelState, clean_channel
from surefix.pipelines.judge import Status, blank_status, estimate, verdicts
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import Chunk, Rows, Source, join_rows, merged, take_rows
from surefix.pipelines.setup import Setup, localise, settle
from surefix.types import (
    Channel,
    Cleaned,
    CleanedChannel,
    Edit,
    Event,
    FloatArray,
    Reason,
    Track,
    Verdict,
    Verdicts,
)

__all__ = ["clean_batches", "clean_sources", "join"]

HEAD = 20_000
"""Fixes that a streaming log is settled on."""
_UNKNOWN = 1e5  # m: a standard deviation from here on means that nothing is known
_LONGEST = 60.0  # s: no resampled rows within longer gaps …
_GAP_INTERVALS = 20.0  # … if they are longer than so many intervals too


@dataclass
class _Session:
    """What is carried from batch to batch."""

    options: CleanOptions
    sensors: list[str] = field(default_factory=list)
    setup: Setup | None = None
    idle: FloatArray | None = None
    repeats: RepeatState | None = None
    filter: TrackState | None = None
    last_tau: float = -np.inf
    next_grid: float = -np.inf
    channels: dict[tuple[str, str], ChannelState] = field(default_factory=dict)
    fixes: int = 0
    has_depth: bool = False


class _Track(NamedTuple):
    """Rows of a batch with the filter's answer."""

    track: Track
    verdicts: Verdicts


def clean_sources(sources: Iterable[Source], options: CleanOptions) -> Cleaned:
    """Clean whole sources and give one result."""
    return join(list(clean_batches(sources, options)))


def clean_batches(sources: Iterable[Source], options: CleanOptions) -> Iterator[Cleaned]:
    """Clean sources batch by batch; only real time gives more than one batch.

    Parameters
    ----------
    sources
        The first role is ``fixes``; others support it.
    options
        How to clean.
    """
    session = _Session(options)
    inputs = list(sources)
    waiting: list[Chunk] = []
    rows_waiting = 0
    for chunk in merged(inputs, session.sensors, options.reorder_s):
        waiting.append(chunk)
        rows_waiting += len(chunk.rows.tau) if chunk.rows is not None else 0
        enough = session.setup is not None or rows_waiting >= HEAD
        if options.mode == "realtime" and enough and rows_waiting:
            yield _batch(session, waiting, final=False)
            waiting, rows_waiting = [], 0
    yield _batch(session, waiting, final=True)


def _batch(session: _Session, chunks: list[Chunk], *, final: bool) -> Cleaned:
    parts = [chunk.rows for chunk in chunks if chunk.rows is not None]
    rows = join_rows(parts) if parts else None
    events = [event for chunk in chunks for event in chunk.events]
    series: dict[tuple[str, str], list[Channel]] = {}
    for chunk in chunks:
        for channel in chunk.channels:
            series.setdefault((channel.sensor, channel.name), []).append(channel)
    channels = _channels(session, series, final=final)
    cleaned = _nothing(session) if rows is None else _rows(session, rows, events, final=final)
    return replace(
        cleaned,
        channels=channels,
        events=tuple(events),
        problems=tuple(problem for chunk in chunks for problem in chunk.problems),
    )


def _channels(
    session: _Session, series: dict[tuple[str, str], list[Channel]], *, final: bool
) -> tuple[CleanedChannel, ...]:
    out = []
    keys = [*session.channels, *(key for key in series if key not in session.channels)]
    for key in keys if final else series:
        parts = series.get(key, [])
        sensor, name = key
        period = parts[0].period if parts else _period(session.channels[key])
        time = np.concatenate([p.time for p in parts] or [np.empty(0)])
        value = np.concatenate([p.value for p in parts] or [np.empty(0)])
        channel = Channel(name, sensor, time, value, period)
        state = session.channels.get(key, ChannelState())
        cleaned, session.channels[key] = clean_channel(channel, state, session.options, final=final)
        out.append(cleaned)
    return tuple(out)


def _period(state: ChannelState) -> float:
    return state.motion.period if state.motion is not None else 0.0


def _rows(session: _Session, rows: Rows, events: list[Event], *, final: bool) -> Cleaned:
    """Filter a batch of rows."""
    options = session.options
    tau = _steady(rows.tau, session.last_tau)
    repeats = _repeats(session, rows)
    status = _status(rows, repeats, options)
    if session.setup is None:
        session.setup = settle(
            _without_idle(session, rows), status.verdict < 0, session.sensors, options
        )
        events += session.setup.events
        events += _idle_events(session)
        if session.setup.axes:
            session.filter = start(session.setup.motion, session.setup.recovery)
    setup = session.setup
    position, velocity = localise(_without_idle(session, rows), setup.frame, setup.origin)
    offset = _padded(setup.height_offset, len(session.sensors), 0.0)[rows.fixes.sensor]
    position[:, 2] -= np.where(rows.auxiliary, 0.0, offset)
    lost = ~np.isfinite(position).any(axis=1) & ~rows.auxiliary
    status.mark(lost & ~np.isfinite(velocity).any(axis=1), Verdict.MISSING, Reason.NO_POSITION)
    grid = _grid(session, tau, final=final)
    order, epochs = _epochs(session, rows, tau, position, velocity, status, grid)
    status_all = _spread(status, order, len(grid))
    if session.filter is None or not setup.axes:
        found = _blank(len(order))
        judged = _unjudged(status_all)
    else:
        wanted = np.concatenate([~rows.auxiliary, np.ones(len(grid), np.bool_)])[order]
        session.filter, found = estimate(
            options, setup.motion, setup.recovery, setup.lag, epochs, wanted, session.filter
        )
        judged = verdicts(found, epochs, setup.motion, status_all, options.loss.code)
        lost_row = np.concatenate([lost, np.zeros(len(grid), bool)])[order]
        judged = _missing_position(judged, lost_row)
    session.last_tau = float(tau[-1]) if len(tau) else session.last_tau
    track = _track(setup, found, order, rows, grid)
    fix = np.flatnonzero(order < len(rows.tau))
    fix = fix[~rows.auxiliary[order[fix]]]
    source_row = order[fix]
    session.fixes += len(fix)
    query = np.flatnonzero(order >= len(rows.tau))
    mine = take_rows(rows, source_row)
    return Cleaned(
        sources=(),
        sensors=tuple(session.sensors),
        track=_pick(track, fix),
        verdicts=Verdicts(*(column[fix] for column in judged)),
        raw_position=position[source_row] + setup.origin,
        raw_coordinates=mine.fixes.position,
        sensor=mine.fixes.sensor,
        row=mine.fixes.row,
        has_depth=False,
        resampled=_pick(track, query) if options.every_s is not None else None,
        channels=(),
        noise=setup.noise,
        events=(),
        problems=(),
        settings=settings(options, setup),
    )


def _steady(tau: FloatArray, last: float) -> FloatArray:
    """Filter time of every row: rows without a time, or late ones, take that of the row before."""
    filled = np.maximum.accumulate(np.where(np.isfinite(tau), tau, last))
    finite = filled[np.isfinite(filled)]
    return np.where(np.isfinite(filled), filled, finite[0] if len(finite) else 0.0)


def _repeats(session: _Session, rows: Rows) -> Repeats:
    fixes = rows.fixes
    if session.repeats is None:
        again = np.diff(rows.tau, prepend=np.nan) == 0.0
        positions = np.where(again[:, None], np.nan, fixes.position)
        session.repeats = start_repeats(positions, fixes.sensor, len(session.sensors))
        session.idle = constant_axes(fixes.position, fixes.sensor, len(session.sensors))
    recorded = np.hstack([fixes.position, fixes.velocity])
    repeats, session.repeats = find_repeats(rows.tau, recorded, fixes.sensor, session.repeats)
    return repeats


def _without_idle(session: _Session, rows: Rows) -> Rows:
    """Rows without the axes that carry no information."""
    assert session.idle is not None
    if not session.idle.any():
        return rows
    idle = np.zeros((len(session.sensors), 3), bool)
    idle[: len(session.idle)] = session.idle
    position = np.where(idle[rows.fixes.sensor], np.nan, rows.fixes.position)
    return rows._replace(fixes=rows.fixes._replace(position=position))


def _idle_events(session: _Session) -> list[Event]:
    assert session.idle is not None
    return [
        Event(
            "idle-axis",
            np.nan,
            f"axis {'xyz'[axis]} of {session.sensors[s]} never changes; left out",
        )
        for s, axis in zip(*np.nonzero(session.idle), strict=True)
    ]


def _status(rows: Rows, repeats: Repeats, options: CleanOptions) -> Status:
    fixes = rows.fixes
    status = blank_status(len(rows.tau))
    status.mark(~np.isfinite(rows.tau), Verdict.MISSING, Reason.NO_TIME)
    status.mark(fixes.edit == Edit.REJECT, Verdict.EDITED, Reason.REJECTED_BY_USER)
    status.mark(rows.late, Verdict.REJECTED, Reason.LATE)
    status.mark(repeats.repeated, Verdict.DUPLICATE, Reason.REPEATED)
    status.mark(~fixes.valid, Verdict.MISSING, Reason.INVALID)
    if options.held:
        status.mark(repeats.held, Verdict.DUPLICATE, Reason.HELD)
    copies = status.verdict == Verdict.DUPLICATE
    status.detail[copies] = repeats.first[copies]
    return status


def _grid(session: _Session, tau: FloatArray, *, final: bool) -> FloatArray:
    """Regular times due in this batch, leaving out long gaps."""
    every = session.options.every_s
    if every is None or not len(tau) or session.setup is None:
        return np.empty(0)
    first = session.next_grid if np.isfinite(session.next_grid) else np.ceil(tau[0] / every) * every
    count = max(0, int(np.floor((tau[-1] - first) / every)) + 1)
    longest = max(_LONGEST, _GAP_INTERVALS * session.setup.interval)
    edges = np.concatenate([[session.last_tau], tau]) if np.isfinite(session.last_tau) else tau
    pieces = []
    breaks = np.flatnonzero(np.diff(edges) > longest)
    starts, ends = [first, *edges[breaks + 1]], [*edges[breaks], edges[-1]]
    for a, b in zip(starts, ends, strict=True):
        low = np.ceil((max(a, first) - first) / every)
        high = np.floor((b - first) / every)
        pieces.append(first + every * np.arange(low, high + 1))
    session.next_grid = first + every * count
    del final
    return np.concatenate(pieces)


def _epochs(
    session: _Session,
    rows: Rows,
    tau: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    status: Status,
    grid: FloatArray,
) -> tuple[FloatArray, Epochs]:
    """Epochs of rows and grid times together; ``order`` indexes rows, then grid times."""
    setup = session.setup
    assert setup is not None
    axes, motion = list(setup.axes), setup.motion
    n = len(tau)
    z = np.hstack([position[:, axes], velocity[:, axes]])
    sensors = len(session.sensors)
    sigma = np.hstack(
        [
            _sigma(rows.fixes.sigma_position, setup.position, sensors, rows)[:, axes],
            _sigma(rows.fixes.sigma_velocity, setup.velocity, sensors, rows)[:, axes],
        ]
    )
    z[status.verdict >= 0] = np.nan
    fixed = np.full((n, motion.groups), np.nan)
    positions = int(motion.group[: len(axes)].max(initial=-1)) + 1
    accepted = (rows.fixes.edit == Edit.ACCEPT) & (status.verdict < 0)
    fixed[accepted, :positions] = 1.0
    status.mark(accepted, Verdict.EDITED, Reason.ACCEPTED_BY_USER)
    if len(grid):
        blank = np.full((len(grid), z.shape[1]), np.nan)
        tau, z = np.concatenate([tau, grid]), np.vstack([z, blank])
        sigma = np.vstack([sigma, np.ones_like(blank)])
        fixed = np.vstack([fixed, np.full((len(grid), motion.groups), np.nan)])
    order = np.argsort(tau, kind="stable") if len(grid) else np.arange(n)
    epochs = Epochs(
        tau[order], z[order], sigma[order] ** 2, fixed[order], np.zeros(len(order), np.int64)
    )
    return order, epochs


def _sigma(declared: FloatArray, figures: FloatArray, sensors: int, rows: Rows) -> FloatArray:
    """Standard deviation of every component: declared, else its sensor's, else the others'."""
    by_sensor = np.full((sensors, 3), np.nan)
    by_sensor[: len(figures)] = figures
    for axis in range(3):
        known = by_sensor[np.isfinite(by_sensor[:, axis]), axis]
        by_sensor[np.isnan(by_sensor[:, axis]), axis] = np.median(known) if len(known) else 1.0
    return np.where(np.isfinite(declared), declared, by_sensor[rows.fixes.sensor])


def _padded(values: FloatArray, count: int, filler: float) -> FloatArray:
    return np.concatenate([values, np.full(count - len(values), filler)])


def _spread(status: Status, order: FloatArray, extra: int) -> Status:
    """Status in the order of the epochs, grid times among them."""
    more = blank_status(extra)
    return Status(*(np.concatenate([a, b])[order] for a, b in zip(status, more, strict=True)))


def _missing_position(judged: Verdicts, lost: FloatArray) -> Verdicts:
    """A fix that brought a velocity but no position is missing as a position."""
    where = lost & (judged.verdict != Verdict.EDITED) & (judged.verdict != Verdict.DUPLICATE)
    where &= judged.reason != Reason.NO_TIME
    invalid = judged.reason == Reason.INVALID
    return judged._replace(
        verdict=np.where(where, int(Verdict.MISSING), judged.verdict),
        reason=np.where(where & ~invalid, int(Reason.NO_POSITION), judged.reason),
    )


def _unjudged(status: Status) -> Verdicts:
    n = len(status.verdict)
    return Verdicts(
        np.where(status.verdict < 0, int(Verdict.MISSING), status.verdict),
        np.zeros(n),
        np.full(n, np.nan),
        np.full((n, 0), np.nan),
        np.where(status.verdict < 0, int(Reason.NO_POSITION), status.reason),
        status.detail,
    )


def _blank(n: int) -> Estimate:
    empty = np.full((n, 0), np.nan)
    return Estimate(empty, empty, empty, empty, empty, np.zeros(n, np.int64), empty)


def _track(setup: Setup, found: Estimate, order: FloatArray, rows: Rows, grid: FloatArray) -> Track:
    """The filter's states in the axes and coordinates of the input."""
    n, d = len(order), len(setup.axes)
    columns = [np.full((n, 3), np.nan) for _ in range(4)]
    for i, axis in enumerate(setup.axes):
        known = found.sigma[:, i] < _UNKNOWN
        for column, values in zip(
            columns,
            (found.mean[:, i], found.mean[:, d + i], found.sigma[:, i], found.sigma[:, d + i]),
            strict=True,
        ):
            column[:, axis] = np.where(known, values, np.nan)
    position, velocity, sigma_position, sigma_velocity = columns
    geodetic = None
    if setup.frame is not None:
        latitude, longitude, convergence = setup.frame.to_geographic(position[:, 0], position[:, 1])
        geodetic = np.column_stack([latitude, longitude, position[:, 2]])
        velocity[:, 0], velocity[:, 1] = rotate(velocity[:, 0], velocity[:, 1], -convergence)
    time = np.concatenate([rows.time, grid])[order]
    return Track(time, position + setup.origin, velocity, sigma_position, sigma_velocity, geodetic)


def _pick(track: Track, index: FloatArray) -> Track:
    return Track(*(None if column is None else column[index] for column in track))  # type: ignore[arg-type]


def _nothing(session: _Session) -> Cleaned:
    """An empty result, for inputs or batches without fixes."""
    none, wide = np.empty(0), np.empty((0, 3))
    whole = np.empty(0, np.int64)
    geodetic = wide if session.setup is not None and session.setup.frame is not None else None
    return Cleaned(
        sources=(),
        sensors=tuple(session.sensors),
        track=Track(none, wide, wide, wide, wide, geodetic),
        verdicts=Verdicts(whole, none, none, wide, whole, none),
        raw_position=wide,
        raw_coordinates=wide,
        sensor=whole,
        row=whole,
        has_depth=False,
        resampled=None,
        channels=(),
        noise=session.setup.noise if session.setup is not None else (),
        events=(),
        problems=(),
        settings=settings(session.options, session.setup),
    )


def settings(options: CleanOptions, setup: Setup | None) -> dict[str, str]:
    """Every option as it was used, in words; figures taken from the data are filled in."""
    used = {f.name: getattr(options, f.name) for f in fields(options)}
    if setup is not None:
        used["recovery_s"] = setup.recovery.after
        if options.mode == "lagged":
            used["lag_s"] = setup.lag
        used["interval_s"] = setup.interval
        if setup.frame is not None:
            used["origin"] = f"{setup.frame.latitude_deg:.7f}, {setup.frame.longitude_deg:.7f}"
    out = {
        name: f"{value:.6g}" if isinstance(value, float) else str(value)
        for name, value in used.items()
        if value is not None and value != {}
    }
    out["python"] = platform.python_version()
    return out


def join(parts: list[Cleaned]) -> Cleaned:
    """Put the batches of one log together."""
    full = [part for part in parts if len(part.track.time)] or parts[-1:]
    width = max(part.verdicts.standardised.shape[1] for part in full)
    same = [part for part in full if part.verdicts.standardised.shape[1] == width]
    series: dict[tuple[str, str], list[CleanedChannel]] = {}
    for part in parts:
        for channel in part.channels:
            series.setdefault((channel.sensor, channel.name), []).append(channel)
    return replace(
        parts[-1],
        sensors=parts[-1].sensors,
        track=_join_tracks([part.track for part in same]),
        verdicts=_join_verdicts([part.verdicts for part in same]),
        raw_position=np.concatenate([part.raw_position for part in same]),
        raw_coordinates=np.concatenate([part.raw_coordinates for part in same]),
        sensor=np.concatenate([part.sensor for part in same]),
        row=np.concatenate([part.row for part in same]),
        resampled=_join_tracks([p.resampled for p in parts if p.resampled is not None]),
        channels=tuple(_join_channel(pieces) for pieces in series.values()),
        noise=parts[-1].noise,
        events=tuple(event for part in parts for event in part.events),
        problems=_join_problems(parts),
    )


def _join_tracks(tracks: list[Track]) -> Track | None:
    if not tracks:
        return None
    columns = zip(*tracks, strict=True)
    return Track(*(None if c[0] is None else np.concatenate(c) for c in columns))  # type: ignore[arg-type]


def _join_verdicts(parts: list[Verdicts]) -> Verdicts:
    return Verdicts(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _join_channel(parts: list[CleanedChannel]) -> CleanedChannel:
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("time", "raw", "value", "rate", "sigma")
    }
    return parts[0]._replace(**joined, verdicts=_join_verdicts([p.verdicts for p in parts]))


def _join_problems(parts: list[Cleaned]) -> tuple:
    return tuple(problem for part in parts for problem in part.problems)
