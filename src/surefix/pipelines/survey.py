"""What a log of single sights holds: its columns, where its receivers are, how the target moves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from surefix.errors import OptionsError
from surefix.filters.sight_records import MOST_CHANNELS
from surefix.io.toml_file import read_toml
from surefix.models.sights import BEARING, COMPONENT, ELEVATION, RANGE

__all__ = ["KINDS", "SightSource", "Survey", "read_survey"]

_AXES = ("x", "y", "z")
KINDS = {"range": RANGE, "bearing": BEARING, "elevation": ELEVATION}
KINDS |= {"x": COMPONENT, "y": COMPONENT + 1, "z": COMPONENT + 2, "depth": COMPONENT + 2}
KINDS |= {"vx": -1, "vy": -2, "vz": -3}
"""What a sight can be, and its code; velocities count from behind the position."""

_FROM = {"range", "bearing", "elevation"}


@dataclass(frozen=True, kw_only=True)
class SightSource:
    """One column of single sights.

    Parameters
    ----------
    kind
        ``range`` m; ``bearing`` deg, clockwise from y; ``elevation`` deg, above the horizontal;
        ``x``, ``y``, ``z``, ``vx``, ``vy``, ``vz``: a component of position or velocity, m and m/s;
        ``depth`` m, positive down.
    column
        Where it is. A range that is not above 0 is missing.
    at
        Where it is taken from: for each axis a number, m, or the name of a column.
    sigma
        Standard deviation, m, deg or m/s; None: it is learnt.
    group
        Sights of one group share their noise; default is their kind.
    """

    kind: str
    column: str
    at: tuple[float | str, ...] = ()
    sigma: float | None = None
    group: str = ""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise OptionsError(f"kind {self.kind!r}", "one of " + ", ".join(KINDS))
        if not isinstance(self.column, str) or not self.column:
            raise OptionsError(f"column {self.column!r} of a {self.kind}", "the name of a column")
        if self.sigma is not None and not (_is_number(self.sigma) and self.sigma > 0.0):
            raise OptionsError(f"sigma {self.sigma!r} of {self.column}", "a number above 0")
        if (self.kind in _FROM) != bool(self.at):
            what = "at = [x, y, z]" if self.kind in _FROM else "no at"
            raise OptionsError(f"at {list(self.at)} of the {self.kind} {self.column}", what)
        if not all(isinstance(a, str) or _is_number(a) for a in self.at):
            raise OptionsError(f"at {list(self.at)} of {self.column}", "numbers or columns")


@dataclass(frozen=True, kw_only=True)
class Survey:
    """What a log of single sights holds, and what is known beforehand.

    Parameters
    ----------
    sights
        Columns that are used.
    time
        Column of the time, s or ISO 8601.
    speed
        Standard deviation of a velocity nothing is known about, m/s.
    process
        Root density of the driving noise, m/s^1.5; None: it is learnt.
    start, start_sigma
        Where the track begins, and its standard deviations, m, one per axis; None: it is found.
    within
        Lowest and highest position per axis, m: of two mirror images the one inside is taken.
    gap_s
        Time without a sight, s, after which a track begins anew.
    polled
        Whether rows that repeat the one before them are the same sights polled again.

    Raises
    ------
    OptionsError
        A figure is out of range, or the sights do not agree on the number of axes.
    """

    sights: tuple[SightSource, ...]
    time: str = "time"
    speed: float = 2.0
    process: float | None = None
    start: tuple[float, ...] | None = None
    start_sigma: tuple[float, ...] | None = None
    within: tuple[tuple[float, float], ...] | None = None
    gap_s: float = 60.0
    polled: bool = True
    axes: int = field(init=False)

    def __post_init__(self) -> None:
        sizes = {len(sight.at) for sight in self.sights if sight.at}
        if not 1 <= len(self.sights) <= MOST_CHANNELS:
            raise OptionsError(f"{len(self.sights)} sights", f"1 to {MOST_CHANNELS} of them")
        if len(sizes) > 1 or not sizes <= {1, 2, 3}:
            raise OptionsError(f"at with {sorted(sizes)} coordinates", "1 to 3, as many everywhere")
        object.__setattr__(self, "axes", sizes.pop() if sizes else 3)
        for sight in self.sights:
            needs = 1 + "xyz".find(sight.kind[-1]) if sight.kind[-1] in _AXES else 1
            needs = {"bearing": 2, "elevation": 3, "depth": 3}.get(sight.kind, needs)
            if needs > self.axes:
                raise OptionsError(f"a {sight.kind} with {self.axes} axes", f"{needs} axes")
        for name in ("speed", "process", "gap_s"):
            value = getattr(self, name)
            if value is not None and not (_is_number(value) and value > 0.0):
                raise OptionsError(f"{name} {value!r}", "a number above 0")
        for name in ("start", "start_sigma", "within"):
            value = getattr(self, name)
            if value is not None and len(value) != self.axes:
                raise OptionsError(f"{name} {list(value)}", f"{self.axes} axes")
        if (self.start is None) != (self.start_sigma is None):
            raise OptionsError("start without start_sigma, or the reverse", "both or none")
        if self.start_sigma is not None and not all(s > 0.0 for s in self.start_sigma):
            raise OptionsError(f"start_sigma {list(self.start_sigma)}", "numbers above 0")
        if self.start is None and not any(sight.kind == "range" for sight in self.sights):
            raise OptionsError("no range and no start", "one of them", "say start and start_sigma")

    def groups(self) -> list[str]:
        """Return the names of the groups, in the order of the sights."""
        return list(dict.fromkeys(sight.group or sight.kind for sight in self.sights))


def _is_number(value: object) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(float(value))  # type: ignore[arg-type]


def read_survey(path: str | Path) -> Survey:
    """Read a survey from a TOML file: the fields of `Survey`, with one ``[[sight]]`` per column.

    Raises
    ------
    InputError, ParseError
        The file cannot be read, or is not TOML.
    OptionsError
        A key is not known, or a value is wrong.
    """
    place = Path(path)
    content = read_toml(place)
    sights = content.pop("sight", None)
    if not isinstance(sights, list) or not all(isinstance(each, dict) for each in sights):
        raise OptionsError(f"{place}: no sights", "one table [[sight]] per column")
    found = tuple(SightSource(**_known(place, SightSource, each)) for each in sights)
    return Survey(sights=found, **_known(place, Survey, content))


def _known(
    place: Path, kind: type[SightSource | Survey], given: Mapping[str, Any]
) -> dict[str, Any]:
    names = [each.name for each in fields(kind) if each.init and each.name != "sights"]
    for name in given:
        if name not in names:
            raise OptionsError(f"{place}: {name!r}", "one of " + ", ".join(names))
    for name in {"kind", "column"} & set(names):
        if name not in given:
            raise OptionsError(f"{place}: a sight without {name}", "kind and column in each")
    return {name: _tuples(value) for name, value in given.items()}


def _tuples(value: Any) -> Any:
    return tuple(_tuples(each) for each in value) if isinstance(value, list) else value
