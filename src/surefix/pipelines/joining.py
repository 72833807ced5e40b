"""Batches of one log put together again."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from surefix.types import Cleaned, CleanedChannel, Event, Problem, Track, Verdicts

__all__ = ["join", "thinned"]


def join(parts: list[Cleaned]) -> Cleaned:
    """Put the batches of one log together."""
    same = [part for part in parts if len(part.track.time)] or parts[-1:]
    resampled = [part.resampled for part in parts if part.resampled is not None]
    series: dict[tuple[str, str], list[CleanedChannel]] = {}
    for part in parts:
        for channel in part.channels:
            series.setdefault((channel.sensor, channel.name), []).append(channel)
    return replace(
        parts[-1],
        sensors=parts[-1].sensors,
        track=_join_tracks([part.track for part in same]),
        verdicts=_join_verdicts([part.verdicts for part in same]),
        has_depth=any(part.has_depth for part in parts),
        raw_position=np.concatenate([part.raw_position for part in same]),
        raw_coordinates=np.concatenate([part.raw_coordinates for part in same]),
        sensor=np.concatenate([part.sensor for part in same]),
        row=np.concatenate([part.row for part in same]),
        resampled=_join_tracks(resampled) if resampled else None,
        channels=tuple(_join_channel(pieces) for pieces in series.values()),
        noise=parts[-1].noise,
        events=_in_time(event for part in parts for event in part.events),
        problems=_join_problems(problem for part in parts for problem in part.problems),
    )


def _in_time(events: Iterable[Event]) -> tuple[Event, ...]:
    """Events in the order of time; those of the whole log come last."""
    return tuple(sorted(events, key=lambda e: e.time if math.isfinite(e.time) else math.inf))


def thinned(cleaned: Cleaned, every: int) -> Cleaned:
    """Keep one row of ``every``, of fixes, regular times and series alike.

    All are copied: a part of an array would keep the whole of it alive.
    """
    if every == 1:
        return cleaned
    some = slice(None, None, every)
    return replace(
        cleaned,
        track=_some_track(cleaned.track, some),
        verdicts=_some_verdicts(cleaned.verdicts, some),
        raw_position=cleaned.raw_position[some].copy(),
        raw_coordinates=cleaned.raw_coordinates[some].copy(),
        sensor=cleaned.sensor[some].copy(),
        row=cleaned.row[some].copy(),
        resampled=None if cleaned.resampled is None else _some_track(cleaned.resampled, some),
        channels=tuple(
            channel._replace(
                time=channel.time[some].copy(),
                raw=channel.raw[some].copy(),
                value=channel.value[some].copy(),
                rate=channel.rate[some].copy(),
                sigma=channel.sigma[some].copy(),
                verdicts=_some_verdicts(channel.verdicts, some),
            )
            for channel in cleaned.channels
        ),
    )


def _some_track(track: Track, some: slice) -> Track:
    return Track._make(None if column is None else column[some].copy() for column in track)


def _some_verdicts(verdicts: Verdicts, some: slice) -> Verdicts:
    return Verdicts._make(column[some].copy() for column in verdicts)


def _join_tracks(tracks: list[Track]) -> Track:
    columns = zip(*tracks, strict=True)
    return Track._make(None if c[0] is None else np.concatenate(c) for c in columns)


def _join_verdicts(parts: list[Verdicts]) -> Verdicts:
    return Verdicts._make(np.concatenate(column) for column in zip(*parts, strict=True))


def _join_channel(parts: list[CleanedChannel]) -> CleanedChannel:
    return parts[0]._replace(
        time=np.concatenate([part.time for part in parts]),
        raw=np.concatenate([part.raw for part in parts]),
        value=np.concatenate([part.value for part in parts]),
        rate=np.concatenate([part.rate for part in parts]),
        sigma=np.concatenate([part.sigma for part in parts]),
        verdicts=_join_verdicts([part.verdicts for part in parts]),
    )


def _join_problems(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """Add up problems of a kind; the first example stays."""
    by_kind: dict[str, Problem] = {}
    for problem in problems:
        known = by_kind.get(problem.kind)
        total = problem.total + (known.total if known is not None else 0)
        by_kind[problem.kind] = (known or problem)._replace(total=total)
    return tuple(by_kind.values())
