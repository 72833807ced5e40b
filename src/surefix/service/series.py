"""What the scalar series say at the newest instant: the heading and the depth that go out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from surefix.pipelines.state import Session
from surefix.service.heard import QUANTITIES
from surefix.types import Cleaned

__all__ = ["FRESH", "series_at", "with_few_series"]

FRESH: Final = 3.0
"""s that a value of a series is carried on by its rate, after which it is not known any more."""

_ROLES: Final = {"heading_deg": ("heading", "attitude"), "depth_m": ("depth",)}


def with_few_series(session: Session) -> Session:
    """Leave only the series that go out or are judged: others need not be cleaned on trial."""
    kept = {key: state for key, state in session.channels.items() if key[1] in QUANTITIES}
    return replace(session, channels=kept)


def series_at(
    time: float, batches: Sequence[Cleaned], names: Sequence[str], roles: Sequence[str]
) -> Mapping[str, float]:
    """Clean heading, deg, and depth, m, at an instant; NaN where none is known near it.

    Of several sensors it is one of an input whose role says so, then the one met first.

    Parameters
    ----------
    time
        s.
    batches
        With the series.
    names, roles
        Of the inputs.
    """
    values: dict[tuple[str, str], float] = {}
    for batch in batches:
        for series in batch.channels:
            known = np.flatnonzero(np.isfinite(series.value) & np.isfinite(series.time))
            if series.name not in _ROLES or not len(known):
                continue
            k = int(known[-1])
            ahead = time - float(series.time[k])
            rate = float(series.rate[k])
            if abs(ahead) <= FRESH:
                moved = float(series.value[k]) + (ahead * rate if math.isfinite(rate) else 0.0)
                values[series.sensor, series.name] = (
                    moved % series.period if series.period else moved
                )
            else:
                values.pop((series.sensor, series.name), None)
    told = dict.fromkeys(_ROLES, math.nan)
    own = ("heading" if role == "turning" else role for role in roles)
    stems = [(f"{Path(name).stem} ", role) for name, role in zip(names, own, strict=True)]
    for name, ranked in _ROLES.items():
        told[name] = _first(
            (value, [role for stem, role in stems if sensor.startswith(stem)], ranked)
            for (sensor, kind), value in values.items()
            if kind == name
        )
    return told


def _first(found: Iterable[tuple[float, list[str], tuple[str, ...]]]) -> float:
    """Of values, their roles and the roles by preference, the preferred one, or the first."""

    def rank(each: tuple[float, list[str], tuple[str, ...]]) -> int:
        _, roles, ranked = each
        return min((ranked.index(role) for role in roles if role in ranked), default=len(ranked))

    best = sorted(found, key=rank)
    return best[0][0] if best else math.nan
