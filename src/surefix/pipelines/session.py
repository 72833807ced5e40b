"""Take the parts of a log, as they come, through the steps of its cleaning.

`advance` is the only way through, for logs and live streams alike: a log is settled on its head, in
real time on a part of it, and then goes row by row. The numbers do not depend on the parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from surefix.errors import InputError
from surefix.pipelines.channels import ChannelState, channel_head, clean_channel
from surefix.pipelines.clean_rows import clean_rows
from surefix.pipelines.merging import Chunk, begin_merging, merge
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.present import nothing
from surefix.pipelines.rows import Rows, join_rows, take_rows
from surefix.pipelines.state import Estimator, Session
from surefix.types import Channel, Cleaned, CleanedChannel, Event, Log

__all__ = ["advance", "begin_session", "end_on_trial"]

_SEVERAL, _SPAN = 20, 1.0  # values of a series, or s that they span, before they are taken on
_PORTION = 50_000  # rows cleaned at a time in real time; or as many as it is settled on


def begin_session(
    inputs: Sequence[tuple[str, str]],
    options: CleanOptions,
    estimator: Estimator | None = None,
    *,
    live: bool = False,
) -> Session:
    """Begin to clean a log.

    Parameters
    ----------
    inputs
        Name and role of each, as for `surefix.pipelines.merging.begin_merging`.
    options
        How to clean.
    estimator
        One that is not among the methods; None for the method of the options.
    live
        Whether an input may fall silent: one that is ``reorder_s`` behind is waited for no longer.
    """
    names = [name for name, _ in inputs]
    merging = begin_merging(inputs, options.reorder_s if live else np.inf)
    return Session(options=options, names=tuple(names), merging=merging, estimator=estimator)


def advance(session: Session, source: int, log: Log | None) -> tuple[Session, tuple[Cleaned, ...]]:
    """Take in the next part of an input.

    Parameters
    ----------
    session
        From the call before.
    source
        Number of the input.
    log
        The part; None: the input has come to its end.

    Returns
    -------
    session, batches
        Where the cleaning stands now, and what is done: in real time as soon as the log is settled,
        in the other modes once all inputs have ended.

    Raises
    ------
    InputError
        All inputs have ended, and there was nothing to clean: no fix, no series.
    """
    merging, chunk = merge(session.merging, source, log, session.options)
    waiting = (*session.waiting, chunk)
    session = replace(session, merging=merging, waiting=waiting)
    if not merging.ended:
        there = sum(len(part.rows.tau) for part in waiting if part.rows is not None)
        enough = 1 if session.setup is not None else session.options.settle_rows
        if session.options.mode != "realtime" or there < enough:
            return session, ()
    elif not any(part.rows is not None or part.channels for part in waiting) and not (
        session.setup is not None or session.channels
    ):
        raise _nothing_found(session)
    session = replace(session, waiting=())
    chunks, rows = _rows_of(waiting)
    del waiting, chunk  # their rows are there once more
    return _batches(session, rows, chunks, final=merging.ended)


def end_on_trial(session: Session, logs: Sequence[Log]) -> tuple[Session, tuple[Cleaned, ...]]:
    """Tell what is known of the newest rows, which still wait for late ones to be put before them.

    It is what `advance` would give if all inputs ended here, but for series that are not settled.

    Parameters
    ----------
    session
        In real time and settled; it goes on from where it is.
    logs
        What is left of each input.

    Returns
    -------
    session, batches
        How it would stand then, and what would be done.
    """
    waiting = [*session.waiting]
    merging = session.merging
    for source, log in enumerate(logs):
        for part in (log, None):
            if not merging.inflows[source].ended:
                merging, chunk = merge(merging, source, part, session.options)
                waiting.append(chunk)
    begun = {key: parts for key, parts in session.arrived.items() if key in session.channels}
    session = replace(session, merging=merging, waiting=(), arrived=begun)
    chunks, rows = _rows_of(waiting)
    return _batches(session, rows, chunks, final=True, begins=False)


def _nothing_found(session: Session) -> InputError:
    """Say why there is nothing to clean; the commonest problem is the likeliest reason."""
    problems = [problem for chunk in session.waiting for problem in chunk.problems]
    worst = max(problems, key=lambda problem: problem.total, default=None)
    reason = f": {worst.total} × {worst.kind} ({worst.example})" if worst is not None else ""
    return InputError(
        f"{', '.join(session.names)}: no position and no series found{reason}",
        "fixes, headings, depths or speeds",
        worst.remedy if worst is not None else "",
    )


def _rows_of(waiting: Sequence[Chunk]) -> tuple[list[Chunk], Rows | None]:
    """Take the rows out of what was read, and put them one after the other."""
    parts = [chunk.rows for chunk in waiting if chunk.rows is not None]
    rows = join_rows(parts) if parts else None
    return [chunk._replace(rows=None) for chunk in waiting], rows


def _batches(
    session: Session,
    rows: Rows | None,
    chunks: Sequence[Chunk],
    *,
    final: bool,
    begins: bool = True,
) -> tuple[Session, tuple[Cleaned, ...]]:
    """Clean what was read, in real time in portions of bounded size."""
    portions: list[Rows | None] = [rows]
    size = max(_PORTION, session.options.settle_rows)
    if session.options.mode == "realtime" and rows is not None and len(rows.tau) > size:
        starts = range(0, len(rows.tau), size)
        portions = [take_rows(rows, slice(at, at + size)) for at in starts]
    session, first = _batch(session, portions[0], chunks, final=final, begins=begins)
    batches = [first]
    for portion in portions[1:]:
        session, batch = _batch(session, portion, (), final=False, begins=begins)
        batches.append(batch)
    if final and session.held:
        text = f"{session.held} fixes were held, the same position polled again; each counted once"
        empty = nothing(session.sensors, session.options, session.setup)
        told = (Event("held", np.nan, text),)
        batches.append(replace(empty, sources=session.sources, events=told))
    return session, tuple(batches)


def _batch(
    session: Session, rows: Rows | None, chunks: Sequence[Chunk], *, final: bool, begins: bool
) -> tuple[Session, Cleaned]:
    """Clean one portion of rows, and the series that came with ``chunks``."""
    events = [event for chunk in chunks for event in chunk.events]
    has_depth = session.has_depth or any(chunk.has_depth for chunk in chunks)
    session = replace(session, has_depth=has_depth)
    if rows is not None:
        session, cleaned = clean_rows(session, rows)
    else:
        cleaned = nothing(session.sensors, session.options, session.setup)
    session, channels = _clean_channels(session, chunks, final=final, begins=begins)
    return session, replace(
        cleaned,
        sources=session.sources,
        has_depth=has_depth,
        channels=channels,
        events=(*events, *cleaned.events),
        problems=tuple(problem for chunk in chunks for problem in chunk.problems),
    )


def _enough(series: Channel, options: CleanOptions) -> bool:
    """Whether a series can be settled, however its values are put in order."""
    head = channel_head(options)
    ordered = series.time <= np.nanmax(series.time, initial=-np.inf) - options.reorder_s
    return len(ordered) >= 2 * head and int(ordered.sum()) >= head


def _worth_while(parts: Sequence[Channel]) -> bool:
    """Whether what has come of a series that is begun is taken on: not value by value."""
    times = [part.time for part in parts if len(part.time)]
    several = sum(map(len, times)) >= _SEVERAL
    return several or (len(times) > 0 and bool(times[-1][-1] - times[0][0] >= _SPAN))


def _clean_channels(
    session: Session, chunks: Sequence[Chunk], *, final: bool, begins: bool
) -> tuple[Session, tuple[CleanedChannel, ...]]:
    """Clean the series of a batch; one that just begins waits until there is enough to settle.

    Without ``begins`` it waits in any case. One that is begun waits for some more values.
    """
    states, arrived = {**session.channels}, {**session.arrived}
    for chunk in chunks:
        for channel in chunk.channels:
            key = channel.sensor, channel.name
            arrived[key] = (*arrived.get(key, ()), channel)
    late = [key for key in states if key not in arrived] if final else []
    out = []
    for key in [*arrived, *late]:
        state = states.get(key, ChannelState())
        parts: tuple[Channel, ...] = arrived.get(key) or (state.nothing(),)
        if key in states and not final and not _worth_while(parts):
            continue
        whole = parts[0]._replace(
            time=np.concatenate([part.time for part in parts]),
            value=np.concatenate([part.value for part in parts]),
        )
        ready = begins and (final or _enough(whole, session.options))
        if key not in states and not ready:
            continue
        arrived.pop(key, None)
        cleaned, states[key] = clean_channel(whole, state, session.options, final=final)
        out.append(cleaned)
    return replace(session, channels=states, arrived=arrived), tuple(out)
