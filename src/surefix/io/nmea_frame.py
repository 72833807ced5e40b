"""From bytes to sentences: lines found in a stream that may be cut anywhere and hold anything.

`frame` is a pure step, state in, state out: feeding a stream in any pieces gives the same frames.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from surefix.io.nmea_record import ProblemKind

__all__ = ["MAX_LINE", "START", "Frame", "Framing", "finish", "foreign", "frame"]

MAX_LINE = 4096
"""Longest line kept whole, bytes: instruments that speak JSON write more than 1024."""

_SENTENCE = re.compile(rb"[$!](?:[Pp][A-Za-z0-9]{2,}|[A-Za-z][A-Za-z0-9]{4})[,*]")
_CHECKED = re.compile(rb"\*[0-9A-Fa-f]{2}")
_BEGIN = re.compile(rb"[$!\r\n]")
_TEXT = bytes(range(0x20, 0x7F)) + b"\t"
_BLANK = b" \t\r\n\0"


class Framing(NamedTuple):
    """What is left of a stream between two pieces of it.

    Parameters
    ----------
    rest
        Bytes of the unfinished line, at most `MAX_LINE`.
    line
        Number of that line, from 1.
    skipping
        True after a line that was too long, until a new start.
    returned
        True if the last byte was a carriage return, whose line feed may follow.
    """

    rest: bytes = b""
    line: int = 1
    skipping: bool = False
    returned: bool = False


class Frame(NamedTuple):
    """A sentence, or bytes that are none.

    Parameters
    ----------
    line
        Number of its line, from 1.
    prefix
        What stood before the sentence on the line; a time of reception, if it is one.
    text
        From ``$`` or ``!`` to the checksum or the end of the line.
    problem
        Empty for a sentence, which may still be refused by `surefix.io.nmea.parse`.
    """

    line: int
    prefix: bytes
    text: bytes
    problem: ProblemKind | None


START = Framing()
"""State at the start of a stream."""


def frame(state: Framing, data: bytes) -> tuple[Framing, list[Frame]]:
    r"""Frames that the next bytes of a stream complete, and the state to go on with.

    >>> state, frames = frame(START, b"$HEHDT,218.53,T*12\r\n$HEH")
    >>> frames
    [Frame(line=1, prefix=b'', text=b'$HEHDT,218.53,T*12', problem=None)]
    >>> state.rest
    b'$HEH'
    """
    rest, number, skipping, returned = state
    if not data:
        return state, []
    if returned and data[:1] == b"\n":
        data = data[1:]
    returned = data[-1:] == b"\r" if data else False
    frames: list[Frame] = []
    if skipping:
        begin = _BEGIN.search(data)
        if begin is None:
            return Framing(b"", number, True, returned), frames
        data = data[begin.start() :]
    lines = (rest + data).splitlines()
    if not lines:
        return Framing(b"", number, False, returned), frames
    rest = b"" if data[-1:] in (b"\r", b"\n") else lines.pop()
    for line in lines:
        whole = len(line) <= MAX_LINE
        _add(frames, number, line if whole else _shorten(frames, number, line)[0])
        number += 1
    skipping = False
    if len(rest) > MAX_LINE:
        rest, skipping = _shorten(frames, number, rest)
    return Framing(rest, number, skipping, returned), frames


def finish(state: Framing) -> list[Frame]:
    """Frames of a last line that has no end."""
    return frame(state, b"\n")[1]


def _shorten(frames: list[Frame], number: int, line: bytes) -> tuple[bytes, bool]:
    """Cut an overlong line at starts of sentences; its last piece, and whether to skip on.

    Every cut follows from the first `MAX_LINE` + 1 bytes after the one before it, never from how
    much of the line has already come: so the pieces do not depend on how the stream was split.
    """
    at = 0
    while len(line) - at > MAX_LINE:
        end = at + MAX_LINE
        cut = max(line.rfind(b"$", at + 1, end), line.rfind(b"!", at + 1, end))
        if cut >= 0:
            _add(frames, number, line[at:cut])
            at = cut
            continue
        frames.append(Frame(number, b"", line[at:end], "too-long"))
        begin = _BEGIN.search(line, end)
        if begin is None:
            return b"", True
        at = begin.start()
    return line[at:], False


def _add(frames: list[Frame], number: int, line: bytes) -> None:
    """Frames of one line, at once if it ends with its only sentence, else piece by piece."""
    if line.find(b"*") == len(line) - 3 >= 0:
        at = line.rfind(b"$")
        if at == line.find(b"$") >= 0 and line.find(b"!") < 0 and _SENTENCE.match(line, at):
            frames.append(Frame(number, line[:at].strip(_BLANK) if at else b"", line[at:], None))
            return
    line = line.strip(_BLANK)
    if not line:
        return
    found = [match.start() for match in _SENTENCE.finditer(line)]
    if not found:
        bare = line[:1] in (b"$", b"!") and not line.translate(None, _TEXT)
        frames.append(Frame(number, b"", line, None if bare else foreign(line)))
        return
    _dissect(frames, number, line, found)


def _dissect(frames: list[Frame], number: int, line: bytes, found: list[int]) -> None:
    """Frames of a line with sentences at the places found."""
    prefix = line[: found[0]].strip(_BLANK)
    for begin, end in zip(found, [*found[1:], len(line)], strict=True):
        text, tail = line[begin:end], b""
        check = _CHECKED.search(text)
        if check is not None:
            text, tail = text[: check.end()], text[check.end() :].strip(_BLANK)
        lost = check is None and end < len(line)
        frames.append(Frame(number, prefix, text, "truncated" if lost else None))
        prefix = tail
    if prefix:
        frames.append(Frame(number, b"", prefix, foreign(prefix)))


def foreign(line: bytes) -> ProblemKind:
    """Kind of a line without a sentence: binary, or text of another sort."""
    return "binary" if line.translate(None, _TEXT) else "not-nmea"
