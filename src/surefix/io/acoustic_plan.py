"""What an acoustic log is about: whose fixes it gives, and in which axes.

A log of a ship at sea holds the positions of several bodies: the ship itself and each transponder.
A track is that of one of them. The log is looked through once before it is read, so that the
answer depends neither on the mode nor on where the log is cut.
"""

from __future__ import annotations

from collections import Counter
from math import isnan
from pathlib import Path
from typing import NamedTuple

import numpy as np

from surefix.errors import OptionsError
from surefix.io.acoustic_line import read_line
from surefix.io.acoustic_record import NOT_MEASURED, Attitude, Place, Sighting
from surefix.io.acoustic_ship import HEADINGS
from surefix.io.nmea import parse
from surefix.io.nmea_epoch import source
from surefix.io.nmea_frame import START, Frame, finish, frame
from surefix.io.nmea_record import Heading, Position

__all__ = ["SHIP", "Plan", "described", "is_acoustic", "plan_of"]

SHIP = "ship"
"""Target that means the ship's own positions."""

_MARKS = (b"$PSIMS", b"$PTSA", b"$PSONLLD,", b"$PSONALL,", b"+++AT:", b"velocity_valid")
_LONGEST = max(map(len, _MARKS))
_BLOCK = 1 << 20
_NO_RANK = 9
_DOLLAR_P = int.from_bytes(b"$P", "little")


class Plan(NamedTuple):
    """How the sightings of a log become fixes.

    Parameters
    ----------
    target
        Whose they are.
    place
        What the fixes are in; geographic if ``globe``.
    source
        Name of the source of the ship's own positions, empty if there is none.
    heading
        Rank in `surefix.io.acoustic_ship.HEADINGS` of the headings that turn positions.
    others
        Other targets in the log.
    """

    target: str
    place: Place
    source: str
    heading: int
    others: tuple[str, ...]


_AXES: dict[Place, str] = {
    "globe": "on the Earth, relative ones from the ship's position and heading at their time",
    "grid": "x and y are easting and northing on a grid whose zone the log does not tell",
    "north": "x and y are east and north of the ship: the log has no position of the ship",
    "ship": "x is to starboard, y ahead of the ship: the log has no heading",
}


def described(plan: Plan) -> str:
    """Say in one sentence whose fixes these are, and in which axes."""
    others = f"; also seen: {', '.join(plan.others)} (--target)" if plan.others else ""
    return f"fixes of {plan.target}, {_AXES[plan.place]}{others}"


def is_acoustic(path: Path) -> bool:
    """Whether a file holds messages of acoustic instruments; a quick search of all its bytes.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    tail = b""
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            seen = tail + block
            if _suspect(seen) and any(mark in seen for mark in _MARKS):
                return True
            tail = seen[-_LONGEST:]
    return False


def _suspect(block: bytes) -> bool:
    """Whether a block may hold one of the marks; told by a byte or two, which is quick."""
    if b"{" in block or b"+" in block:
        return True
    even, odd = len(block) // 2, (len(block) - 1) // 2
    pairs = (np.frombuffer(block, "<u2", count, at) for count, at in ((even, 0), (odd, 1)))
    return any(bool((pair == _DOLLAR_P).any()) for pair in pairs)


def plan_of(path: Path, *, require_checksum: bool, target: str | None) -> Plan | None:
    """Look an acoustic log through; None if its fixes are the ship's own.

    Without a target it is the one that is seen most often, a ship only where nothing else is;
    measured positions come before those that the system filtered.

    Parameters
    ----------
    path
        The log.
    require_checksum
        As in reading it.
    target
        Whose fixes are wanted, or None.

    Raises
    ------
    OSError
        The file cannot be read.
    OptionsError
        The log has no such target.
    """
    seen = _Seen(require_checksum)
    state = START
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            state, frames = frame(state, block)
            seen.add(frames)
    seen.add(finish(state))
    return seen.plan(path, target)


class _Seen:
    """What has been met, and how often."""

    def __init__(self, require_checksum: bool) -> None:
        self._require_checksum = require_checksum
        self._targets: dict[str, Counter[Place]] = {}
        self._sources: Counter[str] = Counter()
        self._headings: set[int] = set()

    def add(self, frames: list[Frame]) -> None:
        for _, _, text, problem in frames:
            if problem is None:
                record = parse(text, require_checksum=self._require_checksum)
            elif problem == "not-nmea" and (told := read_line(text)) is not None:
                record = told[1]
            else:
                continue
            if isinstance(record, Sighting):
                self._targets.setdefault(record.target, Counter())[record.place] += record.valid
            elif isinstance(record, Position):
                self._sources[source(record.talker)] += record.valid
            elif isinstance(record, Heading | Attitude):
                heading = record.true if isinstance(record, Heading) else record.heading
                if not isnan(heading):
                    self._headings.add(HEADINGS[record.type])

    def plan(self, path: Path, target: str | None) -> Plan | None:
        names = sorted(self._targets, key=lambda name: -self._worth(name))
        if target is not None and target not in names and target != SHIP:
            known = ", ".join([*names, *([SHIP] if self._sources else [])])
            raise OptionsError(
                f"target {target!r} for {path}", f"one of {known}" if known else "no target"
            )
        below = [name for name in names if not name.lower().startswith(SHIP)] or names
        chosen = target or (below[0] if below else SHIP)
        if chosen not in names:
            return None
        ship = next((name for name, total in self._sources.most_common() if total), "")
        heading = min(self._headings, default=_NO_RANK)
        place = _place(self._targets[chosen], bool(ship), heading < _NO_RANK)
        others = tuple(name for name in names if name != chosen)
        return Plan(chosen, place, ship, heading, others)

    def _worth(self, name: str) -> float:
        """Valid sightings of a target; one that was filtered counts as half a measured one."""
        return self._targets[name].total() / (2 if name.endswith(NOT_MEASURED) else 1)


def _place(seen: Counter[Place], ship: bool, heading: bool) -> Place:
    """The most that can be said of where a target is, from how it was seen."""
    turned = seen["north"] or (seen["ship"] and heading)
    if seen["globe"] or (turned and ship):
        return "globe"
    if seen["grid"]:
        return "grid"
    return "north" if turned else "ship"
