"""One log in real time, pushed part by part, that can be stored between any two parts.

The steps are those of `surefix.pipelines.clean`; the numbers are those of one call with all parts.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version

from surefix.errors import InputError, OptionsError
from surefix.pipelines.clean import Session, advance, finish
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import Source, pushed
from surefix.types import Cleaned, Log

__all__ = ["Stream", "begin_stream", "end", "push", "restored", "snapshot"]

_FORM = 1  # of a snapshot; to be raised whenever an older one could no longer be gone on from


@dataclass
class Stream:
    """Where the cleaning of one log stands; `push` and `end` go on from it and change it.

    Parameters
    ----------
    session
        The estimator's state, and rows that wait to be settled on.
    source
        The clock's state, and rows that wait to be put in order.
    records
        Records that were pushed; their numbers run on.
    """

    session: Session
    source: Source
    records: int = 0


def begin_stream(options: CleanOptions, name: str = "stream") -> Stream:
    """Begin a log.

    Raises
    ------
    OptionsError
        The mode is not real time: the others need the future.
    """
    if options.mode != "realtime":
        raise OptionsError(
            f"mode {options.mode} for a stream", "mode realtime", "the others look ahead"
        )
    return Stream(Session(options, names=(name,)), Source(iter(()), "fixes", name))


def push(stream: Stream, log: Log) -> Iterator[Cleaned]:
    """Take the next part of the log and give what can be told by now, perhaps nothing.

    Parameters
    ----------
    stream
        What came before; goes on.
    log
        The part, its rows numbered from 0.
    """
    fixes = log.fixes
    if fixes is not None:
        log = replace(log, fixes=fixes._replace(row=fixes.row + stream.records))
        stream.records += len(fixes.time)
    yield from _advance(stream, log)


def end(stream: Stream) -> Iterator[Cleaned]:
    """Give what is left when nothing more comes.

    Raises
    ------
    InputError
        There was nothing to clean.
    """
    yield from _advance(stream, None)
    yield from finish(stream.session)


def _advance(stream: Stream, log: Log | None) -> Iterator[Cleaned]:
    session, options = stream.session, stream.session.options
    chunk = pushed(stream.source, log, session.sensors, options.reorder_s, options.sensor_delay_s)
    yield from advance(session, chunk)


def snapshot(stream: Stream) -> bytes:
    """Everything that is remembered, to be stored; only to be read by those who wrote it."""
    return pickle.dumps((_FORM, version("surefix"), stream), protocol=5)


def restored(stored: bytes) -> Stream:
    """Go on from a snapshot, which must come from a trusted place: it is a pickle.

    Raises
    ------
    InputError
        Another version of surefix wrote it.
    """
    form, written, stream = pickle.loads(stored)
    if form != _FORM or written != version("surefix") or not isinstance(stream, Stream):
        raise InputError(
            f"a snapshot of surefix {written}",
            f"one of surefix {version('surefix')}",
            "go on with the version that wrote it, or begin the stream anew",
        )
    return stream
