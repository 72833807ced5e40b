"""What is known from all that was received: a value, and the two questions that are asked of it.

`receive` takes the next bytes: what is in order by now is cleaned for good. `latest` ends the
session on trial: it tells what the newest observations say, those included that still wait for late
ones to be put before them. Both go through the very steps of `surefix clean`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from surefix.io.feeds import Feed, again
from surefix.io.feeds import streams as opened
from surefix.io.journal import Received
from surefix.io.nmea_stream import NmeaStream
from surefix.pipelines.session import advance, begin_session, end_on_trial
from surefix.pipelines.snapshot import restored, snapshot
from surefix.pipelines.state import Session
from surefix.service.heard import Heard, hear
from surefix.service.options import LiveOptions
from surefix.service.series import FRESH, series_at, with_few_series
from surefix.types import Cleaned, Fixes, FloatArray, Log, Verdict

__all__ = [
    "Ahead",
    "Latest",
    "Station",
    "begin_station",
    "fixes_begun",
    "latest",
    "look_ahead",
    "receive",
    "resumed",
    "stored",
]

_STALE: Final = 3.0  # s since the last fix used, after which a position says it is dead-reckoned


class Latest(NamedTuple):
    """Where the vehicle is.

    Parameters
    ----------
    time
        s, Unix, of validity.
    position, velocity, sigma_position, sigma_velocity
        (3,) as in `Track`.
    geodetic
        (3,) latitude and longitude, deg, and height, m; None for a metric log.
    observed
        s, Unix, of the last fix that was used at least in part.
    heading
        deg, true; NaN if it is not known.
    depth
        m, positive down: of the vehicle where it has a depth sensor, else of the water; NaN if it
        is not known.
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    sigma_position: FloatArray
    sigma_velocity: FloatArray
    geodetic: FloatArray | None
    observed: float
    heading: float = math.nan
    depth: float = math.nan

    @property
    def dead_reckoned(self) -> bool:
        """Whether no fix was used for so long that who reads the position must know."""
        return not self.time - self.observed <= _STALE


class Ahead(NamedTuple):
    """What all that was received says, were nothing to come any more.

    Parameters
    ----------
    session
        As it would stand; that of the station as long as nothing is settled.
    shown
        Where the vehicle is; None as long as nothing is settled.
    """

    session: Session
    shown: Latest | None


@dataclass(frozen=True)
class Station:
    """What is known.

    Parameters
    ----------
    session
        Of the cleaning.
    streams
        The inputs, as far as they are read; never changed in place.
    after
        Number of the last bytes taken.
    shown
        Where the vehicle was at the last row that is cleaned for good; None before.
    heard
        When something came of each sensor.
    rows
        How many rows are cleaned for good.
    feeds
        What of the inputs goes into the session.
    """

    session: Session
    streams: tuple[NmeaStream, ...]
    after: int = 0
    shown: Latest | None = None
    heard: tuple[Heard, ...] = ()
    rows: int = 0
    feeds: tuple[Feed, ...] = ()


def begin_station(options: LiveOptions) -> Station:
    """Begin with nothing received."""
    given, parts = options.inputs, options.feeds
    inputs = [(given[source].name, role) for source, role in parts]
    checked = [each.require_checksum for each in given]
    streams = opened([each.name for each in given], [each.task for each in given], checked)
    patient = any(each.address.kind == "file" for each in options.inputs)  # a log comes to its end
    session = begin_session(inputs, options.clean, live=not patient)
    return Station(session, streams, feeds=parts)


class _Stored(NamedTuple):
    """A station that is stored."""

    session: Session
    streams: tuple[Mapping[str, object], ...]
    after: int
    shown: Latest | None
    heard: tuple[Heard, ...]
    rows: int


def stored(station: Station) -> bytes:
    """Everything that is known, to be stored."""
    states = tuple(stream.state for stream in station.streams)
    rest = station.after, station.shown, station.heard, station.rows
    return snapshot(_Stored(station.session, states, *rest))


def resumed(options: LiveOptions, content: bytes) -> Station:
    """Stand where a station stood that was stored with the same options.

    Raises
    ------
    InputError
        It is damaged, or of another version.
    """
    known = restored(content, _Stored)
    new = begin_station(options)
    for stream, state in zip(new.streams, known.streams, strict=True):
        stream.resume(state)
    return Station(known.session, new.streams, *known[2:], new.feeds)


def receive(station: Station, received: Sequence[Received]) -> tuple[Station, tuple[Cleaned, ...]]:
    """Take the next bytes, in the order of arrival; empty ones end their input.

    Returns
    -------
    station, batches
        What is known now, and what is cleaned for good.
    """
    session, streams, heard = station.session, [*station.streams], station.heard
    batches: list[Cleaned] = []
    fresh: set[int] = set()
    for piece in received:
        if session.merging.inflows[piece.source].ended:
            continue
        if piece.source not in fresh:
            streams[piece.source] = streams[piece.source].copy()
            fresh.add(piece.source)
        stream = streams[piece.source]
        log = stream.read(piece.data, piece.time) if piece.data else stream.rest()
        heard = hear(heard, piece.source, log, [*stream.begun, *stream.waiting], piece.time)
        session = _take(session, station.feeds, piece.source, log, batches)
        behind = max((each.latest for each in heard), default=-math.inf) - session.merging.patience
        for i, other in enumerate(streams):
            begun = other.begun
            if i != piece.source and begun and begun[0][2] < behind:
                streams[i] = other.copy()
                session = _take(session, station.feeds, i, streams[i].settle(behind), batches)
        if not piece.data:
            session = _take(session, station.feeds, piece.source, None, batches)
    after = received[-1].number if received else station.after
    shown = _last(batches, station.shown)
    rows = station.rows + sum(len(batch.track.time) for batch in batches)
    known = Station(session, tuple(streams), after, shown, heard, rows, station.feeds)
    return known, tuple(batches)


def _take(
    session: Session, feeds: Sequence[Feed], source: int, log: Log | None, batches: list[Cleaned]
) -> Session:
    """Take in the next part of an input, for each of its tasks; None: it has come to its end."""
    for number, feed in enumerate(feeds):
        if feed.source == source:
            part = log if log is None or number == source else again(log)
            session, done = advance(session, number, part)
            batches += done
    return session


def fixes_begun(station: Station) -> int:
    """How many fixes were begun to be read, of all inputs: more of them make a newer position."""
    sources = [feed.source for feed in station.feeds if feed.role == "fixes"]
    return sum(station.streams[source].count for source in sources)


def latest(station: Station, time: float = math.nan) -> Latest | None:
    """Where the vehicle is by all that was received; None as long as nothing is settled.

    Parameters
    ----------
    station
        What is known.
    time
        s, Unix: later than all that was received, the track is carried on to it by dead reckoning.
        NaN: at the last fix.
    """
    return look_ahead(station, time).shown


def look_ahead(station: Station, time: float = math.nan) -> Ahead:
    """Tell what all that was received says; arguments as for `latest`."""
    if station.session.setup is None:
        return Ahead(station.session, None)
    logs = [stream.copy().rest() for stream in station.streams]
    roles = [feed.role for feed in station.feeds]
    logs += [again(logs[feed.source]) for feed in station.feeds[len(logs) :]]
    first = roles.index("fixes")
    logs[first] = _with(logs[first], time)
    session, batches = end_on_trial(with_few_series(station.session), logs)
    known = _last(batches, station.shown)
    if known is None:
        return Ahead(session, None)
    told = series_at(known.time, batches, station.session.names, roles)
    depth = told["depth_m"]
    if _dives(station, known.time):
        depth = -float(known.position[2] if known.geodetic is None else known.geodetic[2])
    return Ahead(session, known._replace(heading=told["heading_deg"], depth=depth))


def _dives(station: Station, time: float) -> bool:
    """Whether the height of the track is that of a depth sensor which is still heard."""
    heard = [
        station.streams[source].newest
        for source, role in station.feeds
        if role == "depth" or (station.session.has_depth and role == "fixes")
    ]
    return any(time - newest <= FRESH for newest in heard)


def _with(log: Log, time: float) -> Log:
    """Add a fix that says nothing but its time, after all that is known."""
    if math.isnan(time):
        return log
    known = log.fixes
    if known is not None and len(known.time) and not time > np.nanmax(known.time):
        return log
    empty = np.full((1, 3), np.nan)
    zero = np.zeros(1, np.int64)
    tick = Fixes(
        np.array([time]), empty, empty, empty, empty, zero, zero, np.ones(1, np.bool_), zero, True
    )
    if known is None:
        return replace(log, fixes=tick, sensors=log.sensors or ("clock",))
    joined = [np.concatenate(pair) for pair in zip(known[:-1], tick[:-1], strict=True)]
    return replace(log, fixes=Fixes._make([*joined, known.geographic]))


def _observed(batches: Sequence[Cleaned], before: float) -> float:
    """Time of the last fix that was used; of a sighting that has no place the depth may be."""
    for batch in batches:
        used = np.isin(batch.verdicts.verdict, (Verdict.USED, Verdict.DOWNWEIGHTED))
        used &= np.isfinite(batch.raw_position[:, :2]).any(axis=1)
        before = float(np.fmax.reduce(batch.track.time[used], initial=before))
    return before


def _last(batches: Sequence[Cleaned], before: Latest | None) -> Latest | None:
    """The last row of the track that has a position; that of ``before`` if there is none."""
    observed = _observed(batches, math.nan if before is None else before.observed)
    for batch in reversed(batches):
        track = batch.track
        known = np.flatnonzero(np.isfinite(track.position[:, :2]).all(axis=1))
        if len(known):
            k = int(known[-1])
            return Latest(
                float(track.time[k]),
                track.position[k],
                track.velocity[k],
                track.sigma_position[k],
                track.sigma_velocity[k],
                None if track.geodetic is None else track.geodetic[k],
                observed,
            )
    return before
