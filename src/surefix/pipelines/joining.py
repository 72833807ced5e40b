"""Batches of one log put together again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from surefix.types import Cleaned, CleanedChannel, Problem, Track, Verdicts

__all__ = ["join"]


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
        events=tuple(event for part in parts for event in part.events),
        problems=_join_problems(problem for part in parts for problem in part.problems),
    )


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
