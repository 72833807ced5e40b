"""Edits of people brought to the fixes they were made on, before anything else is done with these.

A fix is found again by what was recorded of it, not by its place: rows that were added or taken
out before it do not matter, and a fix whose time or position changed is not taken for the old one.
What finds no fix is told as a problem of the input.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surefix.errors import OptionsError
from surefix.io.edits import Chosen, Decided, EditLog, decided
from surefix.pipelines.clean import Source
from surefix.pipelines.rows import take_fixes
from surefix.reasons import clock
from surefix.types import BoolArray, Fixes, FloatArray, IntArray, Log, Problem

__all__ = ["Wanted", "by_sensor", "choose", "chosen_of", "digests", "edit_sources"]

_TICK: Final = 1e-3  # s
_STEPS: Final = {True: (1e-9, 1e-9, 1e-6), False: (1e-6, 1e-6, 1e-6)}  # degrees and m, or m
_UNKNOWN: Final = np.iinfo(np.int64).min


class Wanted(NamedTuple):
    """Which fixes are meant: those for which all that is said holds.

    Parameters
    ----------
    rows
        First and last number of the record, of one or more stretches; None: any.
    since, until
        Times as recorded, s; the ends belong to it.
    sensors
        Names; empty: any.
    """

    rows: tuple[tuple[int, int], ...] | None = None
    since: float = -np.inf
    until: float = np.inf
    sensors: tuple[str, ...] = ()


def digests(fixes: Fixes) -> NDArray[np.uint64]:
    """Digest of what was recorded of each fix: its time to 1 ms, its position to 1 µm or 1e-9°.

    Rounded, so that another last digit of a float makes no other fix. The mixing function is the
    finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014).

    Parameters
    ----------
    fixes
        As they were read, n.

    Returns
    -------
    digests
        (n,)
    """
    known = np.zeros(len(fixes.time), dtype=np.uint64)
    columns = zip(fixes.position.T, _STEPS[fixes.geographic], strict=True)
    for column, step in ((fixes.time, _TICK), *columns):
        known = _mixed(known ^ _whole(column / step).view(np.uint64))
    return known


def _whole(values: FloatArray) -> IntArray:
    """Nearest whole numbers; one of its own for what is missing or too large."""
    with np.errstate(invalid="ignore"):
        fit = np.abs(values) < 2.0**62
    return np.where(fit, np.rint(np.where(fit, values, 0.0)).astype(np.int64), _UNKNOWN)


def _mixed(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    bits = bits + np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(bits ^ (bits >> np.uint64(31)), dtype=np.uint64)


def edit_sources(sources: Sequence[Source], log: EditLog) -> list[Source]:
    """Sources whose fixes carry what people decided about them.

    An edit wins over the column ``edit`` of the input. With the last part of the last source come
    the problems ``edit-lost``, edits that found no fix, and ``edit-torn``, a damaged last line.

    Parameters
    ----------
    sources
        As from `surefix.pipelines.inputs.open_inputs`.
    log
        From `surefix.io.edits.read_edits`.
    """
    desk = _Desk(log, sum(source.role == "fixes" for source in sources))
    return [
        source._replace(logs=desk.edited(source)) if source.role == "fixes" else source
        for source in sources
    ]


class _Desk:
    """Where decisions meet the fixes as they are read; remembers which of them found one."""

    def __init__(self, log: EditLog, sources: int) -> None:
        self._torn, self._open = log.torn, sources
        self._decided = {part.fixes[:2]: part for part in decided(log.entries)}
        self._found = {
            key: np.zeros(len(part.edit), np.bool_) for key, part in self._decided.items()
        }

    def edited(self, source: Source) -> Iterator[Log]:
        for log in source.logs:
            yield self._apply(source.name, log)
        self._open -= 1
        if not self._open and (problems := self._problems()):
            yield Log(source=source.name, problems=problems)

    def _apply(self, name: str, log: Log) -> Log:
        parts = [
            (number, part, self._found[name, sensor])
            for number, sensor in enumerate(log.sensors)
            if (part := self._decided.get((name, sensor))) is not None
        ]
        if log.fixes is None or not parts:
            return log
        known, edit = digests(log.fixes), log.fixes.edit.copy()
        for number, part, found in parts:
            _decide(np.flatnonzero(log.fixes.sensor == number), known, edit, part, found)
        return replace(log, fixes=log.fixes._replace(edit=edit))

    def _problems(self) -> tuple[Problem, ...]:
        out = []
        if self._torn:
            out.append(Problem("edit-torn", 1, self._torn, "a crash cut it off; it is left out"))
        lost = [(self._decided[key].fixes, ~found) for key, found in self._found.items()]
        total = sum(int(where.sum()) for _, where in lost)
        if total:
            fixes, where = next((fixes, where) for fixes, where in lost if where.any())
            first = int(np.argmax(where))
            row, time = fixes.row[first], float(fixes.time[first])
            example = f"{fixes.source}, {fixes.sensor}, row {row} of {clock(time)}"
            remedy = "no such fix is in the inputs as it was when it was edited; edit it again"
            out.append(Problem("edit-lost", total, example, remedy))
        return tuple(out)


def _decide(
    rows: IntArray, known: NDArray[np.uint64], edit: IntArray, part: Decided, found: BoolArray
) -> None:
    """Enter the decisions about one sensor into ``edit``, and note in ``found`` which were met."""
    digest = part.fixes.digest
    at = np.minimum(np.searchsorted(digest, known[rows]), len(digest) - 1)
    met = digest[at] == known[rows]
    edit[rows[met]] = part.edit[at[met]]
    found[at[met]] = True


def choose(sources: Sequence[Source], wanted: Wanted) -> tuple[Chosen, ...]:
    """Find the fixes that are meant; sources as for `edit_sources`, read to their end.

    Raises
    ------
    OptionsError
        A sensor is named that is in no source.
    """
    found: list[Chosen] = []
    met: set[str] = set()
    for source in sources:
        for log in source.logs if source.role == "fixes" else ():
            met.update(log.sensors)
            if log.fixes is None:
                continue
            rows = np.flatnonzero(_meant(log.fixes, log.sensors, wanted))
            found += chosen_of(source.name, log.sensors, log.fixes, rows)
    if missing := set(wanted.sensors) - met:
        raise OptionsError(f"sensor {min(missing)!r}", "one of " + ", ".join(sorted(met)))
    return by_sensor(found)


def by_sensor(parts: Iterable[Chosen]) -> tuple[Chosen, ...]:
    """Put fixes of the same source and sensor together."""
    found: dict[tuple[str, str], list[Chosen]] = {}
    for part in parts:
        found.setdefault(part[:2], []).append(part)
    return tuple(
        Chosen(*key, *(np.concatenate(c) for c in zip(*(p[2:] for p in same), strict=True)))
        for key, same in found.items()
    )


def _meant(fixes: Fixes, sensors: Sequence[str], wanted: Wanted) -> BoolArray:
    meant = np.ones(len(fixes.time), np.bool_)
    if wanted.rows is not None:
        meant = np.zeros(len(fixes.time), np.bool_)
        for first, last in wanted.rows:
            meant |= (fixes.row >= first) & (fixes.row <= last)
    if wanted.since > -np.inf or wanted.until < np.inf:
        meant &= (fixes.time >= wanted.since) & (fixes.time <= wanted.until)  # NaN is at no time
    if wanted.sensors:
        some = [number for number, name in enumerate(sensors) if name in wanted.sensors]
        meant &= np.isin(fixes.sensor, some)
    return meant


def chosen_of(
    source: str, sensors: Sequence[str], fixes: Fixes, rows: IntArray
) -> tuple[Chosen, ...]:
    """Name fixes so that an edit log can hold them, sensor by sensor.

    Parameters
    ----------
    source, sensors
        Name of the input; names that ``fixes.sensor`` indexes.
    fixes
        As they were read.
    rows
        (n,) which of them: indices.
    """
    some = take_fixes(fixes, rows)
    known = digests(some)
    return tuple(
        Chosen(source, name, some.row[mine], some.time[mine], known[mine])
        for number, name in enumerate(sensors)
        if (mine := some.sensor == number).any()
    )
