"""Find the one column of a table that has a given role."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from surefix.errors import OptionsError, ParseError
from surefix.io.roles import ALIASES, NEEDS_UNIT, ROLES, UNITS
from surefix.io.units import Heading, factor, known, split_unit
from surefix.types import Event

__all__ = ["Pick", "Search", "candidates", "optional", "required", "search"]

_SIZES = (("s", 1e11), ("ms", 1e14), ("us", 1e17), ("ns", math.inf))


class Pick(NamedTuple):
    """One column that is read, and what turns its numbers into SI or degrees.

    Parameters
    ----------
    column
        Its position, from 0.
    name
        Its name as it stands.
    factor
        Sign and, except for times, unit: value in m, deg or m/s = factor × number.
    unit
        Of a time: ``s``, ``ms``, ``us``, ``ns``, ``iso``, or empty where the values must tell.
    """

    column: int
    name: str
    factor: float = 1.0
    unit: str = ""


@dataclass
class Search:
    """The names of one table, the user's choices, and the notes collected on the way."""

    source: str
    names: Sequence[Heading]
    first: Sequence[str]
    chosen: Mapping[str, Pick]
    notes: list[Event] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Keep a note, once."""
        event = Event("note", math.nan, text)
        if all(known_event.text != text for known_event in self.notes):
            self.notes.append(event)

    def listed(self) -> str:
        """Return the names there are, for a message."""
        texts = [heading.text for heading in self.names]
        return ", ".join(texts[:30]) + (f" … ({len(texts)} in all)" if len(texts) > 30 else "")


def search(
    names: Sequence[str], chosen: Mapping[str, str], source: str, first: Sequence[str]
) -> Search:
    """Take the names apart and resolve the user's choices among them.

    Raises
    ------
    ParseError
        A chosen column is not there.
    OptionsError
        A choice names an unknown role or unit.
    """
    split = [split_unit(i, name) for i, name in enumerate(names)]
    picks = dict(_choice(role, column, split, source) for role, column in chosen.items())
    return Search(source, split, first, picks)


def required(seek: Search, role: str) -> Pick:
    """Find the column of a role, or say what to do.

    Raises
    ------
    ParseError
        There is none, two compete, or its unit is not known.
    """
    found = _free(seek, role)
    if role in seek.chosen:
        return seek.chosen[role]
    if not found:
        raise ParseError(
            f"{seek.source}: no {role} column; there are {seek.listed()}",
            f"a column {role} ({UNITS[ROLES[role].dimension]})",
            f"say which it is: --column {role}=NAME",
        )
    if len(found) > 1:
        names, remedy = _competing(seek, role, found)
        raise ParseError(
            f"{seek.source}: {names} can each be the {role}", f"one {role} column", remedy
        )
    pick = _made(role, *found[0])
    if pick is None:
        what, remedy = _unclear(role, found[0])
        raise ParseError(
            f"{seek.source}: {what} is not known", UNITS[ROLES[role].dimension], remedy
        )
    return pick


def optional(seek: Search, role: str) -> Pick | None:
    """Find the column of a role, or None; what is in doubt is left out with a note."""
    if role in seek.chosen:
        return seek.chosen[role]
    found = _free(seek, role)
    if not found:
        return None
    if len(found) > 1:
        names, remedy = _competing(seek, role, found)
        seek.note(f"{names} can each be the {role}, so none was read; to read one, {remedy}")
        return None
    pick = _made(role, *found[0])
    if pick is None:
        what, remedy = _unclear(role, found[0])
        seek.note(f"{what} is not known, so it was not read; to read it, {remedy}")
    return pick


class _Found(NamedTuple):
    heading: Heading
    base: str
    unit: str


def candidates(seek: Search, role: str) -> list[_Found]:
    """Columns that can have a role, all of equal trust."""
    for tier in ROLES[role].tiers:
        found = [hit for heading in seek.names if (hit := _hit(role, tier, heading))]
        if found:
            return found
    return []


def _free(seek: Search, role: str) -> list[_Found]:
    taken = {pick.column for pick in seek.chosen.values()}
    return [found for found in candidates(seek, role) if found.heading.column not in taken]


def _hit(role: str, tier: Sequence[str], heading: Heading) -> _Found | None:
    """Match one name; a unit split off its end must be one (``time_s``, but not ``time_gap``)."""
    for i, (base, unit) in enumerate(heading.readings):
        trusted = i == 0 or _unit(role, unit) is not None
        if trusted and any(_matches(base, name) for name in tier):
            return _Found(heading, base, unit)
    return None


def _matches(base: str, name: str) -> bool:
    return base.endswith(name[1:]) if name.startswith("*") else base == name


def _unit(role: str, unit: str) -> str | None:
    return known(ROLES[role].dimension, unit)


def _made(role: str, heading: Heading, base: str, text: str, sign: float = 1.0) -> Pick | None:
    unit = _unit(role, text)
    if unit is None or (base in NEEDS_UNIT and not unit):
        return None
    return _pick(role, heading, unit, sign)


def _pick(role: str, heading: Heading, unit: str, sign: float = 1.0) -> Pick:
    scale = 1.0 if ROLES[role].dimension == "time" else factor(unit)
    return Pick(heading.column, heading.text, sign * scale, unit)


def _competing(seek: Search, role: str, found: Sequence[_Found]) -> tuple[str, str]:
    names = " and ".join(heading.text for heading, _, _ in found)
    heading = found[0].heading
    return names, f"say which: --column {role}={heading.text}{_hint(seek, role, heading)}"


def _unclear(role: str, found: _Found) -> tuple[str, str]:
    what = f"the unit of {found.heading.text}" + (f", {found.unit}," if found.unit else "")
    units = UNITS[ROLES[role].dimension]
    return what, f"give it: --column {role}={found.heading.text}:UNIT (one of {units})"


def _hint(seek: Search, role: str, heading: Heading) -> str:
    """Return the unit of time that the first value suggests, as ``:us``."""
    if role != "time" or heading.column >= len(seek.first):
        return ""
    text = seek.first[heading.column].strip()
    try:
        size = abs(float(text))
    except ValueError:
        return ":iso" if text else ""
    return next((f":{unit}" for unit, top in _SIZES if size < top), "")


def _choice(role: str, column: str, names: Sequence[Heading], source: str) -> tuple[str, Pick]:
    canonical = ALIASES.get(role, role)
    if canonical not in ROLES:
        raise OptionsError(
            f"--column {role}={column}: {role} is not a role",
            "one of " + ", ".join([*ROLES, *ALIASES]),
            "for example --column time=stamp:us",
        )
    heading, sign, text = _resolved(role, column, names, source)
    if text:
        unit = _unit(canonical, text)
    else:
        unit = next((u for _, t in reversed(heading.readings) if (u := _unit(canonical, t))), "")
    if unit is None:
        raise OptionsError(
            f"--column {role}={column}: {text} is not a unit of {role}",
            f"one of {UNITS[ROLES[canonical].dimension]}",
        )
    return canonical, _pick(canonical, heading, unit, sign)


def _resolved(
    role: str, column: str, names: Sequence[Heading], source: str
) -> tuple[Heading, float, str]:
    """Column, sign and unit of ``[-]column[:unit]``; a literal name comes before the syntax."""
    by_name = {heading.text.strip(): heading for heading in reversed(names)}
    head, colon, tail = column.rpartition(":")
    for text, unit in ((column, ""), (head, tail)) if colon else ((column, ""),):
        for name, sign in ((text.strip(), 1.0), (text.strip().removeprefix("-").strip(), -1.0)):
            if name in by_name:
                return by_name[name], sign, unit
    wanted = (head if head else column).removeprefix("-")
    raise ParseError(
        f"{source}: no column {wanted}",
        "one of " + ", ".join(heading.text for heading in names),
        f"correct --column {role}={column}",
    )
