"""Fixes of a recorded log that are left out in turn, and the log without them.

A log without truth can still tell what a method is worth: fixes that it does not get are what it
has to predict. Wrong fixes come in bursts and vouch for each other, so that runs of neighbours are
left out together, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from surefix.pipelines.clean import Source
from surefix.types import BoolArray, Cleaned, Fixes, FloatArray, IntArray, Log, Reason

__all__ = [
    "BEGUN",
    "PARTS",
    "Held",
    "Recording",
    "fixes_of",
    "parts_of",
    "recorded",
    "records",
    "without",
]

BEGUN: Final = 20
"""Fixes at the beginning of a log that are never left out: a track must begin somewhere."""
PARTS: Final = 10
"""Into how many parts the fixes are dealt; one of them at a time is left out."""

_JUDGED: Final = (
    Reason.AGREES,
    Reason.OFF,
    Reason.ISOLATED,
    Reason.AXIS_OFF,
    Reason.JUMP,
    Reason.RUN,
    Reason.DRAG,
)


@dataclass(frozen=True)
class Recording:
    """A log as it was read, to be cleaned many times: the logs of each source, its role and name.

    Scalar series beside the fixes are left away.
    """

    parts: tuple[tuple[tuple[Log, ...], str, str], ...]


class Held(NamedTuple):
    """Fixes of a log that can be left out, in the order of time; k of them.

    Parameters
    ----------
    row
        (k,) their rows in the result.
    with_copies
        (n,) of every row of the result the number of the fix that it is a copy of, or is; −1 for
        none. Records that came twice and positions polled again are left out with their fix.
    """

    row: IntArray
    with_copies: IntArray


def recorded(sources: Sequence[Source]) -> Recording:
    """Read sources to their end.

    Raises
    ------
    InputError, ParseError
        As the readers.
    """
    parts = []
    for source in sources:
        plain = source.role == "fixes"
        logs = tuple(replace(log, channels=()) if plain else log for log in source.logs)
        parts.append((logs, source.role, source.name))
    return Recording(tuple(part for part in parts if part[1] not in ("heading", "attitude")))


def fixes_of(cleaned: Cleaned) -> Held:
    """Find the fixes that any method has to judge; the same in the result of each.

    Parameters
    ----------
    cleaned
        The whole log, cleaned.
    """
    judged = np.isin(cleaned.verdicts.reason, _JUDGED)
    judged &= np.isfinite(cleaned.raw_position).any(axis=1)
    copies = np.isin(cleaned.verdicts.reason, (Reason.REPEATED, Reason.HELD))
    owner = np.full(len(judged), -1)
    owner[judged] = np.arange(judged.sum())
    for sensor in np.unique(cleaned.sensor):
        mine = np.flatnonzero((cleaned.sensor == sensor) & (judged | copies))
        latest = np.maximum.accumulate(np.where(judged[mine], owner[mine], -1))
        owner[mine] = latest
    return Held(np.flatnonzero(judged), owner)


def parts_of(fixes: int, length: int, seed: Sequence[int]) -> IntArray:
    """Deal fixes into ``PARTS`` parts, in blocks of neighbours; no two neighbouring blocks in one.

    Parameters
    ----------
    fixes
        How many there are.
    length
        Of a block, at least 1.
    seed
        Of ``numpy.random.default_rng``.

    Returns
    -------
    part
        (fixes,) 0 … ``PARTS`` − 1; −1 for those at the beginning, which are in none.

    >>> np.bincount(parts_of(120, 1, [1]) + 1).tolist()
    [20, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10]
    """
    rng = np.random.default_rng(seed)
    blocks = max(fixes - BEGUN, 0) // length + 1
    dealt: list[int] = []
    while len(dealt) < blocks:
        hand = rng.permutation(PARTS).tolist()
        if dealt and dealt[-1] == hand[0]:
            hand.append(hand.pop(0))
        dealt += hand
    part = np.full(fixes, -1)
    part[BEGUN:] = np.repeat(dealt, length)[: max(fixes - BEGUN, 0)]
    return part


def records(cleaned: Cleaned, rows: BoolArray) -> dict[str, IntArray]:
    """Give by sensor the numbers of the records that (n,) some rows of a result came from."""
    return {
        name: cleaned.row[rows & (cleaned.sensor == number)]
        for number, name in enumerate(cleaned.sensors)
    }


def without(recording: Recording, gone: Mapping[str, IntArray]) -> list[Source]:
    """Give the sources of a log without some of its fixes: they say nothing but their time.

    Parameters
    ----------
    recording
        From `recorded`.
    gone
        Numbers of the records that are left out, by sensor, as from `records`.
    """
    return [
        Source(
            iter([_emptied(log, gone) for log in logs]) if role == "fixes" else iter(logs),
            role,
            name,
        )
        for logs, role, name in recording.parts
    ]


def _emptied(log: Log, rows: Mapping[str, IntArray]) -> Log:
    if log.fixes is None:
        return log
    out = np.zeros(len(log.fixes.time), np.bool_)
    for number, name in enumerate(log.sensors or ("",)):
        mine = log.fixes.sensor == number
        out[mine] = np.isin(log.fixes.row[mine], rows.get(name, np.empty(0)))
    return replace(log, fixes=_blank(log.fixes, out))


def _blank(fixes: Fixes, out: BoolArray) -> Fixes:
    def lost(values: FloatArray) -> FloatArray:
        return np.where(out[:, None], np.nan, values)

    return fixes._replace(position=lost(fixes.position), velocity=lost(fixes.velocity))
