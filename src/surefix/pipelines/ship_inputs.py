"""Streams of the ship's chain out of logs: any that surefix reads, most of all NMEA 0183."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from surefix.cleaning.clock import ClockState, repair
from surefix.io.attitude_sentence import ATTITUDE
from surefix.pipelines.inputs import open_log
from surefix.pipelines.ship_cleaning import Stream
from surefix.types import BoolArray, FloatArray, Log

__all__ = ["LEAST", "streams_of"]

LEAST = 50
"""Samples that a series must have: damaged sentences make short ones of talkers that are none."""

_QUANTITIES = {
    "heading_deg": "heading",
    "heading_magnetic_deg": "magnetic heading",
    "course_deg": "course",
    "speed_mps": "speed",
    "water_speed_mps": "speed",
    "water_speed_along_mps": "speed",
    "depth_m": "depth",
}
_Parts = dict[tuple[str, str], list[tuple[FloatArray, FloatArray, BoolArray]]]


def streams_of(paths: Sequence[str | Path]) -> tuple[Stream, ...]:
    """Read the positions, speeds, headings and depths of logs, in the order of time.

    Each series gets its own clock repaired; records that came twice, without a time or too late
    are left out, and so are series of fewer than `LEAST` samples, and headings beside roll and
    pitch where the same log has them in a sentence of their own.

    Parameters
    ----------
    paths
        Logs. A series that goes on from one to the next is two streams.

    Raises
    ------
    InputError, ParseError
        A log cannot be read.
    """
    parts: _Parts = {}
    for path in paths:
        _read(open_log(path), parts)
    streams = []
    for (sensor, quantity), found in parts.items():
        if quantity == "heading" and _once_more(sensor, parts):
            continue
        time, value, valid = (np.concatenate([part[i] for part in found]) for i in range(3))
        stream = _in_order(Stream(sensor, quantity, time, value, valid))
        if np.isfinite(stream.value).sum() >= LEAST:
            streams.append(stream)
    return tuple(streams)


def _read(logs: Iterable[Log], parts: _Parts) -> None:
    for log in logs:
        if log.fixes is not None:
            fixes = log.fixes
            for index, sensor in enumerate(log.sensors):
                mine = fixes.sensor == index
                for axis, quantity in enumerate(("latitude", "longitude")):
                    value = np.radians(fixes.position[mine, axis])
                    part = fixes.time[mine], value, fixes.valid[mine]
                    if fixes.geographic:
                        parts.setdefault((sensor, quantity), []).append(part)
        for channel in log.channels:
            if channel.name in _QUANTITIES:
                value = np.radians(channel.value) if channel.period else channel.value
                valid = np.ones(len(value), np.bool_)
                key = channel.sensor, _QUANTITIES[channel.name]
                parts.setdefault(key, []).append((channel.time, value, valid))


def _once_more(sensor: str, parts: _Parts) -> bool:
    """Whether a heading beside roll and pitch is that of a sentence of its own in the same log."""
    log, _, sentence = sensor.rpartition(" ")
    if sentence not in ATTITUDE:
        return False
    others = (other.rpartition(" ") for other, quantity in parts if quantity == "heading")
    return any(each == log and own not in ATTITUDE for each, _, own in others)


def _in_order(stream: Stream) -> Stream:
    """Repair the clock and let each instant count once."""
    n = len(stream.time)
    place, row = np.full((n, 2), np.nan), np.arange(n)
    repaired, _, _ = repair(stream.time, place, row, ClockState(), final=True)
    kept = np.isfinite(repaired.tau) & ~repaired.late
    tau, order = repaired.tau[kept], repaired.order[kept]
    first = np.diff(tau, prepend=-np.inf) > 0.0
    order = order[first]
    return stream._replace(
        time=tau[first], value=stream.value[order], valid=np.asarray(stream.valid)[order]
    )
