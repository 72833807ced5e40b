"""The state of a review: what was cleaned, what people decided since, and how the two compare.

Cleaning is that of `surefix clean`: the same readers, edits and steps, each time from the inputs
anew. What is shown and what is exported is the result of the last run.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surefix.errors import InputError, SurefixError
from surefix.geo.local_frame import LocalFrame
from surefix.io.edits import Action, Chosen, EditLog, append_edit, read_edits
from surefix.pipelines.clean import Source, clean_batches
from surefix.pipelines.editing import by_sensor, chosen_of, digests, edit_sources
from surefix.pipelines.inputs import Progress
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.types import Cleaned, Fixes, FloatArray, IntArray, Log

__all__ = ["Opener", "Review", "Run", "begin_review", "pairs"]

Opener = Callable[[Progress | None], list[Source]]
"""Opens the inputs anew; told how many bytes were read."""

Logs = Sequence[tuple[str, list[Log]]]


class Run(NamedTuple):
    """One cleaning.

    Parameters
    ----------
    number
        Counts from 1.
    batches
        As they came: what is exported.
    shown
        Their rows together, in the local frame of the first run.
    logs
        What was read of each input with fixes: its name and parts.
    place
        (n,) for each row shown the fix it is of, counted over all that was read.
    edit
        Codes of `surefix.types.Edit` that the fixes had in this run, by `place`.
    """

    number: int
    batches: tuple[Cleaned, ...]
    shown: Cleaned
    logs: tuple[tuple[str, list[Log]], ...]
    place: IntArray
    edit: IntArray


@dataclass(frozen=True)
class _Busy:
    """What a cleaning in progress is at."""

    doing: str = ""
    done: float = 0.0


class Review:
    """A review; begun by `begin_review`. Its methods may be called from any thread.

    Those that edit raise as `surefix.io.edits.append_edit`.
    """

    def __init__(
        self,
        opener: Opener,
        options: CleanOptions,
        edits: Path,
        files: Sequence[Path],
        told: Progress | None,
    ) -> None:
        self._opener, self._options, self._edits, self._files = opener, options, edits, files
        self._lock = threading.RLock()
        self._busy: _Busy | None = None
        self._error = ""
        self._known: tuple[tuple[int, int], EditLog] = ((0, 0), EditLog(()))
        self._waiting: tuple[object, IntArray] | None = None
        self.first = self.last = self._cleaned(1, None, told)
        self.before: Run | None = None

    @property
    def log(self) -> EditLog:
        """The edit log as it is now, whoever wrote to it."""
        with self._lock:
            try:
                found = self._edits.stat()
                mark = found.st_mtime_ns, found.st_size
            except OSError:
                mark = (0, 0)
            if mark != self._known[0]:
                self._known = mark, read_edits(self._edits, new=True)
                self._waiting = None
            return self._known[1]

    def edit(self, run: Run, rows: IntArray, action: Action) -> None:
        """Accept, reject or restore the fixes of some rows of a run."""
        with self._lock:
            append_edit(self._edits, action, _chosen(run, rows))

    def step(self, action: Action) -> None:
        """Undo or redo."""
        with self._lock:
            append_edit(self._edits, action)

    def waiting(self, run: Run) -> IntArray:
        """Rows of a run whose edits have changed since."""
        with self._lock:
            log = self.log
            if self._waiting is None or self._waiting[0] is not run:
                now = _codes(run.logs, log)
                self._waiting = run, np.flatnonzero((now != run.edit)[run.place])
            return self._waiting[1]

    def begin(self) -> bool:
        """Clean again in a thread; False if that is going on already."""
        with self._lock:
            if self._busy is not None:
                return False
            self._busy, self._error = _Busy("reading"), ""
            threading.Thread(target=self._again, daemon=True).start()
            return True

    def progress(self) -> dict[str, Any]:
        """What is going on: what is done, how much of it from 0 to 1, and the last failure."""
        with self._lock:
            busy = self._busy
            return {
                "busy": busy.doing if busy else "",
                "done": busy.done if busy else 0.0,
                "error": self._error,
            }

    def _again(self) -> None:
        try:
            size = sum(path.stat().st_size for path in self._files if path.is_file())

            def told(done: int) -> None:
                share = min(1.0, done / size) if size else 1.0
                self._busy = _Busy("cleaning" if share == 1.0 else "reading", share)

            run = self._cleaned(self.last.number + 1, self.first, told)
            with self._lock:
                self.before, self.last = self.last, run
        except SurefixError as error:
            self._error = str(error)
        except Exception as error:  # shown on the page, which would wait for ever otherwise
            self._error = f"internal error: {type(error).__name__}: {error}"
        finally:
            with self._lock:
                self._busy = None

    def _cleaned(self, number: int, first: Run | None, told: Progress | None) -> Run:
        log = self.log
        kept: list[tuple[str, list[Log]]] = []
        sources = [_kept(source, kept) for source in self._opener(told)]
        batches = tuple(clean_batches(edit_sources(sources, log), self._options))
        cleaned = join(list(batches))
        if not len(cleaned.track.time):
            raise InputError(
                f"{', '.join(cleaned.sources)}: no fixes",
                "a log with positions",
                "surefix clean takes series without positions",
            )
        shown = _in_one_frame(cleaned, first.shown if first else cleaned)
        logs = tuple(kept)
        return Run(number, batches, shown, logs, _places(cleaned, logs), _codes(logs, log))


def begin_review(
    opener: Opener,
    options: CleanOptions,
    edits: Path,
    files: Sequence[Path] = (),
    told: Progress | None = None,
) -> Review:
    """Clean for the first time.

    Parameters
    ----------
    opener
        Opens the inputs.
    options
        How they are cleaned.
    edits
        The edit log; begun with the first edit.
    files
        The inputs that are files, whose size says how far later runs are.
    told
        Told the bytes that were read for the first time.

    Raises
    ------
    InputError, ParseError, OptionsError
        As the readers; or there are no fixes.
    """
    return Review(opener, options, edits, files, told)


def pairs(one: Run, other: Run) -> tuple[IntArray, IntArray]:
    """Rows of two runs that are of the same fixes; an input may have grown in between."""
    mine, others = _digests(one.logs)[one.place], _digests(other.logs)[other.place]
    _, first, second = np.intersect1d(mine, others, return_indices=True)
    order = np.argsort(first)
    return first[order], second[order]


def _chosen(run: Run, rows: IntArray) -> tuple[Chosen, ...]:
    """Name the fixes of some rows as an edit log knows them."""
    wanted, at = np.sort(run.place[rows]), 0
    out: list[Chosen] = []
    for number, log, fixes in _all_fixes(run.logs):
        count = len(fixes.time)
        first, last = np.searchsorted(wanted, (at, at + count))
        out += chosen_of(run.logs[number][0], log.sensors, fixes, wanted[first:last] - at)
        at += count
    return by_sensor(out)


def _kept(source: Source, kept: list[tuple[str, list[Log]]]) -> Source:
    """A source that leaves behind what was read of its fixes."""
    if source.role != "fixes":
        return source
    parts: list[Log] = []
    kept.append((source.name, parts))

    def passed() -> Iterator[Log]:
        for log in source.logs:
            if log.fixes is not None:
                parts.append(Log(source=log.source, sensors=log.sensors, fixes=log.fixes))
            yield log

    return source._replace(logs=passed())


def _codes(logs: Logs, edits: EditLog) -> IntArray:
    """Codes of all fixes that were read, as edits have them."""
    sources = [Source(iter(parts), "fixes", name) for name, parts in logs]
    return np.concatenate(
        [
            log.fixes.edit
            for source in edit_sources(sources, edits)
            for log in source.logs
            if log.fixes is not None
        ]
    )


def _all_fixes(logs: Logs) -> Iterator[tuple[int, Log, Fixes]]:
    for number, (_, parts) in enumerate(logs):
        for log in parts:
            assert log.fixes is not None
            yield number, log, log.fixes


def _digests(logs: Logs) -> NDArray[np.uint64]:
    """Digests of all fixes that were read; fixes of different inputs differ."""
    return np.concatenate(
        [digests(fixes) + np.uint64(number) for number, _, fixes in _all_fixes(logs)]
    )


def _places(cleaned: Cleaned, logs: Logs) -> IntArray:
    """For each row the fix it is of: every fix has one row, with its sensor, number and place.

    Where several inputs have fixes alike in all of these, they follow each other in time.
    """
    numbers = {name: number for number, name in enumerate(cleaned.sensors)}
    sensor, row, time, position = (
        np.concatenate(column)
        for column in zip(
            *(
                (
                    np.array([numbers[name] for name in log.sensors], np.int64)[fixes.sensor],
                    fixes.row,
                    fixes.time,
                    fixes.position,
                )
                for _, log, fixes in _all_fixes(logs)
            ),
            strict=True,
        )
    )
    read = np.lexsort((time, *position.T, row, sensor))
    coordinates = cleaned.raw_coordinates.T
    out = np.lexsort((cleaned.track.time, *coordinates, cleaned.row, cleaned.sensor))
    place = np.empty(len(out), np.int64)
    place[out] = read
    return place


def _in_one_frame(cleaned: Cleaned, first: Cleaned) -> Cleaned:
    """A result in the local frame of the first, so that views stay where they are."""
    origin = first.settings.get("origin")
    if cleaned.track.geodetic is None or origin is None:
        return cleaned
    latitude, longitude = (float(part) for part in origin.split(","))
    frame = LocalFrame(latitude, longitude)
    position = _moved(frame, cleaned.track.geodetic, cleaned.track.position)
    return replace(
        cleaned,
        track=cleaned.track._replace(position=position),
        raw_position=_moved(frame, cleaned.raw_coordinates, cleaned.raw_position),
    )


def _moved(frame: LocalFrame, geodetic: FloatArray, position: FloatArray) -> FloatArray:
    x, y, _ = frame.to_local(geodetic[:, 0], geodetic[:, 1])
    return np.column_stack([x, y, position[:, 2]])
