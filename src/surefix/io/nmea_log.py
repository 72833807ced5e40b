"""NMEA 0183 logs: files of sentences, bare or each behind its time of reception."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from surefix.errors import InputError
from surefix.io.acoustic_line import read_line
from surefix.io.acoustic_plan import Plan, is_acoustic, plan_of
from surefix.io.nmea import parse
from surefix.io.nmea_frame import START, finish, frame
from surefix.io.nmea_lines import pieces
from surefix.io.nmea_record import (
    Refused,
)
from surefix.io.nmea_stream import NmeaStream
from surefix.types import Log

__all__ = ["read_nmea", "sniff"]

_BLOCK = 1 << 18
_STEP = 256  # frames between two looks at the size of a chunk
_SHARE = 0.3


def sniff(head: bytes) -> bool:
    """Whether a file that begins like this is an NMEA log.

    It is if at least three in ten of its lines of text hold a sentence, with a right checksum or of
    a known type without one. Lines that are binary or begin with ``#`` do not count.

    >>> sniff(b"2014-08-01T00:00:00Z $HEHDT,218.53,T*12"), sniff(b"time,lat,lon")
    (True, False)
    """
    end = max(head.rfind(b"\n"), head.rfind(b"\r"))
    state, frames = frame(START, head[: end + 1] if end > 0 else head)
    good = other = 0
    for _, _, text, problem in [*frames, *finish(state)]:
        if problem in ("binary", "too-long") or text.startswith(b"#"):
            continue
        known = _plausible(text) if problem is None else read_line(text) is not None
        good += known
        other += not known
    return good > 0 and good >= _SHARE * (good + other)


def _plausible(sentence: bytes) -> bool:
    record = parse(sentence, require_checksum=False)
    if not isinstance(record, Refused):
        return True
    return record.kind == "unknown-type" and b"*" in sentence


def read_nmea(
    path: Path,
    *,
    require_checksum: bool = True,
    target: str | None = None,
    apart: bool = False,
    chunk_fixes: int = 50_000,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Log]:
    """Read a log in chunks, in the order of arrival, with bounded memory; at least one chunk.

    Each sentence counts at its own UTC time of day, with the date nearest to its time of reception
    or, in a bare log, to the last date met. Sentences without a time get the time of reception, or
    that of the latest sentence with one. A log without any date counts from midnight of its first
    day. In a log of an acoustic positioning system the fixes are those of one transponder, see
    `surefix.io.acoustic_plan`. Clock steps and repeated epochs are left as they are: to judge them
    is not reading.

    Parameters
    ----------
    path
        The log.
    require_checksum
        False accepts sentences without a checksum. A wrong one is never accepted.
    target
        Which transponder, or ``ship``; default the one that is seen most often.
    apart
        Whether sightings are placed later, as in `surefix.io.nmea_stream.NmeaStream`.
    chunk_fixes
        Rows of fixes per chunk, about.
    progress
        Told how many bytes have been read so far.

    Raises
    ------
    InputError
        If the file cannot be read.
    OptionsError
        If the log has no such target.
    """
    plan = _plan(path, require_checksum, target, apart)
    reader = NmeaStream(path, require_checksum, plan, apart)
    state, done, given = START, 0, 0
    step = min(max(chunk_fixes, 1), _STEP)
    try:
        with path.open("rb") as file:
            while block := file.read(_BLOCK):
                for after, found in pieces(state, block):
                    state = after
                    for _ in range(0, reader.begin(found), step):
                        reader.add(step)
                        if reader.size >= chunk_fixes:
                            yield reader.chunk()
                            given += 1
                done += len(block)
                if progress is not None:
                    progress(done)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}", "a readable file") from error
    reader.add(reader.begin(finish(state)))
    rest = reader.chunk(last=True)
    if not given or rest.fixes or rest.channels or rest.problems or rest.counts:
        yield rest


def _plan(path: Path, require_checksum: bool, target: str | None, apart: bool) -> Plan | None:
    try:
        if target is None and not is_acoustic(path):
            return None
        return plan_of(path, require_checksum=require_checksum, target=target, apart=apart)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}", "a readable file") from error
