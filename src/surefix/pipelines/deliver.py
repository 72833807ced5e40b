"""Results written as they come: every output whole or not at all, however many batches."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from surefix.errors import OptionsError
from surefix.io.records import believed
from surefix.io.writers import SUFFIXES, TrackWriter, channel_writer, resampled_writer, track_writer
from surefix.pipelines.beside import while_next_is_made
from surefix.pipelines.joining import join, thinned
from surefix.report.headline import counts
from surefix.types import BoolArray, Cleaned, CleanedChannel, Event, Track, Verdict

__all__ = ["Delivered", "deliver"]

_INTERVALS = 3.0  # between fixes, after which a track without any is dead reckoning
_KEPT = 250_000  # rows that are kept for the report and the summary; of more, every k-th


@dataclass(frozen=True)
class Delivered:
    """What came of a log.

    Parameters
    ----------
    cleaned
        The result; of a log with more than 250,000 rows every k-th, k a power of two.
    counts
        How many fixes had each verdict, all rows counted.
    written
        The files that were written.
    """

    cleaned: Cleaned
    counts: dict[Verdict, int]
    written: tuple[str, ...]


def deliver(batches: Iterable[Cleaned], outputs: Sequence[str | Path], *, iso: bool) -> Delivered:
    """Write batches to the outputs while they come.

    Each output has one row per fix. A resampled track takes its place, and the fixes go beside it
    as ``NAME.fixes.suffix``. Scalar series go beside each ``.csv`` and ``.parquet`` as
    ``NAME.SENSOR.SERIES.suffix``; a log with a single series and no positions has it in the output
    itself.

    Parameters
    ----------
    batches
        From `surefix.pipelines.clean.clean_batches`; at least one.
    outputs
        Files; the suffix says the format.
    iso
        Write times as ISO 8601.

    Raises
    ------
    OptionsError
        Two outputs are the same file.
    OutputError
        As `surefix.io.writers`.
    """
    places = [Path(path) for path in outputs]
    if len({place.absolute() for place in places}) < len(places):
        raise OptionsError("two outputs of the same name", "different files")
    kept: list[Cleaned] = []
    totals = dict.fromkeys(Verdict, 0)
    every = 1
    with contextlib.ExitStack() as stack:
        files = _Files(stack, places, iso)

        def take(batch: Cleaned) -> None:
            nonlocal kept, every
            files.add(batch)
            for verdict, total in counts(batch.verdicts).items():
                totals[verdict] += total
            kept.append(thinned(batch, every))
            while len(kept) > 1 and sum(len(part.track.time) for part in kept) > _KEPT:
                kept, every = [join([thinned(part, 2) for part in kept])], 2 * every

        while_next_is_made(take, batches)
        if not files.written:
            files.add_track(kept[-1])
    whole = join(kept)
    if every > 1:
        text = f"a long log: figures and report show one of {every} fixes, the files hold all"
        whole = replace(whole, events=(Event("note", float("nan"), text), *whole.events))
    return Delivered(whole, totals, tuple(files.written))


class _Files:
    """The open outputs of one log."""

    def __init__(self, stack: contextlib.ExitStack, places: list[Path], iso: bool) -> None:
        self._stack, self._places, self._iso = stack, places, iso
        self._tracks: list[TrackWriter] | None = None
        self._resampled: list[Callable[..., None]] = []
        self._series: dict[tuple[str, str], list[Callable[[CleanedChannel], None]]] = {}
        self.written: list[str] = []

    def add(self, batch: Cleaned) -> None:
        if len(batch.track.time):
            self.add_track(batch)
        for channel in batch.channels:
            self._add_series(channel, alone=len(batch.channels) == 1 and self._tracks is None)

    def add_track(self, batch: Cleaned) -> None:
        geographic = batch.track.geodetic is not None
        if self._tracks is None:
            self._tracks = self._open(batch, geographic)
        for writer in self._tracks:
            writer.write(
                batch.track,
                batch.verdicts,
                sensors=batch.sensors,
                sensor=batch.sensor,
                row=batch.row,
                coordinates=batch.raw_coordinates if geographic else None,
            )
        for write in self._resampled if batch.resampled is not None else ():
            assert batch.resampled is not None
            write(batch.resampled, _supported(batch, batch.resampled))

    def _open(self, batch: Cleaned, geographic: bool) -> list[TrackWriter]:
        enter, places = self._stack.enter_context, self._places
        if batch.resampled is not None:
            self._resampled = [
                enter(
                    resampled_writer(
                        place, geographic=geographic, has_depth=batch.has_depth, iso=self._iso
                    )
                )
                for place in places
            ]
            self.written += [str(place) for place in places]
            places = [place.with_name(f"{place.stem}.fixes{place.suffix}") for place in places]
        self.written += [str(place) for place in places]
        return [
            enter(
                track_writer(place, geographic=geographic, has_depth=batch.has_depth, iso=self._iso)
            )
            for place in places
        ]

    def _add_series(self, channel: CleanedChannel, *, alone: bool) -> None:
        key = channel.sensor, channel.name
        if key not in self._series:
            places = [place for place in self._places if place.suffix.lower() in SUFFIXES[:2]]
            if not alone:
                places = [_beside(place, channel) for place in places]
            self._series[key] = [
                self._stack.enter_context(channel_writer(place, iso=self._iso)) for place in places
            ]
            self.written += [str(place) for place in places]
        for write in self._series[key]:
            write(channel)


def _supported(batch: Cleaned, track: Track) -> BoolArray:
    """Whether a fix that was believed lies within three usual intervals of each epoch."""
    used = believed(batch.verdicts) & np.isfinite(batch.track.time)
    times = np.sort(batch.track.time[used])
    if not len(times):
        return np.zeros(len(track.time), np.bool_)
    after = np.searchsorted(times, track.time)
    near = [np.abs(times[np.clip(after - k, 0, len(times) - 1)] - track.time) for k in (0, 1)]
    return np.minimum(*near) <= _INTERVALS * float(batch.settings["interval_s"])


def _beside(place: Path, channel: CleanedChannel) -> Path:
    """``track.csv`` → ``track.gyro-HEHDT.heading_deg.csv``."""
    sensor = re.sub(r"[^\w.-]+", "-", channel.sensor).strip("-.")
    return place.with_name(f"{place.stem}.{sensor}.{channel.name}{place.suffix}")
