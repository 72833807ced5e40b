"""Scalar series as they grow, until they are given out."""

from __future__ import annotations

from array import array
from collections.abc import Iterator

import numpy as np

from surefix.types import Channel

__all__ = ["Series"]

_ANGLES = frozenset({"heading_deg", "heading_magnetic_deg", "course_deg"})


class Series:
    """Series by name and sensor; ``count`` is the number of values in all of them."""

    def __init__(self) -> None:
        self.count = 0
        self._held: dict[tuple[str, str], tuple[array[float], array[float]]] = {}

    def add(self, name: str, sensor: str, time: float, value: float) -> None:
        """Add a value; ``time`` s."""
        series = self._held.get((name, sensor))
        if series is None:
            series = self._held[name, sensor] = array("d"), array("d")
        series[0].append(time)
        series[1].append(value)
        self.count += 1

    def shift(self, seconds: float) -> None:
        """Move everything in time."""
        for times, _ in self._held.values():
            shifted = np.frombuffer(times, dtype=np.float64)
            shifted += seconds

    def copy(self) -> Series:
        """One that goes on by itself from here."""
        other = Series()
        held = {key: (time[:], value[:]) for key, (time, value) in self._held.items()}
        vars(other).update(count=self.count, _held=held)
        return other

    def told(self, stem: str) -> Iterator[Channel]:
        """Give the series, whose sensors' names begin with ``stem``."""
        for (name, sensor), (time, value) in self._held.items():
            yield Channel(
                name=name,
                sensor=f"{stem} {sensor}",
                time=np.array(time, dtype=np.float64),
                value=np.array(value, dtype=np.float64),
                period=360.0 if name in _ANGLES else 0.0,
            )
