"""What an acoustic log is about: whose fixes it gives, and in which axes.

A log of a ship at sea holds the positions of several bodies: the ship itself and each transponder.
A track is that of one of them. The log is looked through once before it is read, so that the
answer depends neither on the mode nor on where the log is cut.
"""

from __future__ import annotations

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

__all__ = ["FIRST", "SHIP", "Plan", "Seen", "described", "is_acoustic", "plan_of"]

SHIP = "ship"
"""Target that means the ship's own positions."""
FIRST = "first"
"""Target of a stream that means the transponder that is heard first."""

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
    apart
        Whether another log tells where the ship was; what is in its axes is then placed by that.
    """

    target: str
    place: Place
    source: str
    heading: int
    others: tuple[str, ...]
    apart: bool = False


_APART = "on the Earth, from the ship's position and heading in a log of their own"
_AXES: dict[Place, str] = {
    "globe": "on the Earth, relative ones from the ship's position and heading at their time",
    "grid": "x and y are easting and northing on a grid whose zone the log does not tell",
    "north": "x and y are east and north of the ship: the log has no position of the ship",
    "ship": "x is to starboard, y ahead of the ship: the log has no heading",
}


def described(plan: Plan) -> str:
    """Say in one sentence whose fixes these are, and in which axes."""
    others = f"; also seen: {', '.join(plan.others)} (--target)" if plan.others else ""
    apart = plan.apart and plan.place in ("ship", "north")
    return f"fixes of {plan.target}, {_APART if apart else _AXES[plan.place]}{others}"


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


def plan_of(
    path: Path, *, require_checksum: bool, target: str | None, apart: bool = False
) -> Plan | None:
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
    apart
        Whether another log tells where the ship was.

    Raises
    ------
    OSError
        The file cannot be read.
    OptionsError
        The log has no such target.
    """
    seen = Seen()
    state = START
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            state, frames = frame(state, block)
            _look(seen, frames, require_checksum)
    _look(seen, finish(state), require_checksum)
    if target is not None and target != SHIP and target not in seen.targets:
        known = ", ".join([*seen.ranked(), *([SHIP] if seen.sources else [])])
        raise OptionsError(
            f"target {target!r} for {path}", f"one of {known}" if known else "no target"
        )
    return seen.plan(target, apart=apart)


def _look(seen: Seen, frames: list[Frame], require_checksum: bool) -> None:
    for _, _, text, problem in frames:
        if problem is None:
            record = parse(text, require_checksum=require_checksum)
        elif problem == "not-nmea" and (told := read_line(text)) is not None:
            record = told[1]
        else:
            continue
        if isinstance(record, Sighting):
            seen.sighted(record)
        elif isinstance(record, Position):
            seen.fixed(record)
        elif isinstance(record, Heading):
            seen.turned(record.type, record.true)
        elif isinstance(record, Attitude) and record.heading is not None:
            seen.turned(record.type, record.heading)


class Seen:
    """What has been met of a log, and how often; plain data.

    Attributes
    ----------
    targets
        How many valid sightings there are of each target, by what they are in.
    sources
        How many valid positions of the ship, by their source.
    headings
        Ranks of the true headings.
    """

    def __init__(self) -> None:
        self.targets: dict[str, dict[Place, int]] = {}
        self.sources: dict[str, int] = {}
        self.headings: set[int] = set()

    def sighted(self, record: Sighting) -> None:
        """Count a sighting."""
        places = self.targets.setdefault(record.target, {})
        places[record.place] = places.get(record.place, 0) + record.valid

    def fixed(self, record: Position) -> None:
        """Count a position of the ship."""
        name = source(record.talker)
        self.sources[name] = self.sources.get(name, 0) + record.valid

    def turned(self, kind: str, heading: float) -> None:
        """Note that a kind of sentence tells the true heading, degrees."""
        if not isnan(heading):
            self.headings.add(HEADINGS[kind])

    def ranked(self) -> list[str]:
        """Targets, the one that is seen most often first."""
        return sorted(self.targets, key=lambda name: -self._worth(name))

    def plan(self, target: str | None, *, apart: bool = False) -> Plan | None:
        """How the sightings of a target, None: of the likeliest, become fixes; None: the ship's."""
        names = self.ranked()
        below = [name for name in names if not name.lower().startswith(SHIP)] or names
        chosen = target or (below[0] if below else SHIP)
        if chosen not in names:
            return None
        found = sorted(self.sources.items(), key=lambda item: -item[1])
        ship = next((name for name, total in found if total and not apart), "")
        heading = _NO_RANK if apart else min(self.headings, default=_NO_RANK)
        place = _place(self.targets[chosen], bool(ship), heading < _NO_RANK)
        others = tuple(name for name in names if name != chosen)
        return Plan(chosen, place, ship, heading, others, apart)

    def _worth(self, name: str) -> float:
        """Valid sightings of a target; one that was filtered counts as half a measured one."""
        return sum(self.targets[name].values()) / (2 if name.endswith(NOT_MEASURED) else 1)


def _place(seen: dict[Place, int], ship: bool, heading: bool) -> Place:
    """The most that can be said of where a target is, from how it was seen."""
    turned = seen.get("north") or (seen.get("ship") and heading)
    if seen.get("globe") or (turned and ship):
        return "globe"
    if seen.get("grid"):
        return "grid"
    return "north" if turned else "ship"
