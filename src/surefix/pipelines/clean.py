"""Clean a log: read its sources, and take their parts through one session."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.session import advance, begin_session
from surefix.pipelines.state import Estimator
from surefix.types import Cleaned, Log

__all__ = ["Source", "clean_batches", "clean_sources"]


class Source(NamedTuple):
    """One input.

    Parameters
    ----------
    logs
        Parts of the input, in its order.
    role
        What it is for, as in `surefix.pipelines.merging.begin_merging`.
    name
        What to call it.
    """

    logs: Iterator[Log]
    role: str = "fixes"
    name: str = ""


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
    session = begin_session([(source.name, source.role) for source in inputs], options, estimator)
    while not session.merging.ended:
        source = session.merging.behind
        log, last = next(inputs[source].logs, None), [session]
        del session  # what waits in it is not held on to while it is cleaned
        session, batches = advance(last.pop(), source, log)
        yield from batches
