"""The chain of paper 003 from a ship's sensors to one integrated record per epoch.

Sensors → validity and plausibility → 53H → evaluation → fusion → distribution. Every sample gets a
verdict, every epoch a position, speed, heading and depth with their standard deviations, the
sensors they were made of, and whether they are valid, doubtful or invalid. 53H decides a sample
four samples late; but for that nothing looks ahead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surefix.cleaning.replacement import continued
from surefix.errors import OptionsError
from surefix.geo.local_frame import LocalFrame, origin_of
from surefix.pipelines.ship_cleaning import CleanStream, Stream, clean_stream
from surefix.pipelines.ship_fusion import Fused, align, fuse
from surefix.pipelines.ship_options import PERIODS, ShipOptions
from surefix.types import FloatArray

__all__ = ["Integrated", "integrate"]

_RADIUS = 6_371_008.8  # m, mean; for standard deviations only


@dataclass(frozen=True, kw_only=True)
class Integrated:
    """What the chain gives: one record per epoch, and what was done with each sample.

    Parameters
    ----------
    time
        (n,) s.
    latitude, longitude
        (n,) rad; NaN where there is none.
    quantities
        ``east``, ``north`` (m in ``frame``), ``speed`` (m/s), ``heading`` (rad), ``depth`` (m), as
        far as there are sensors.
    sensors
        By the same names, the sensors behind the bits of ``sources``, the most trusted first.
    frame
        Origin of east and north.
    streams
        The streams after cleaning, in the order given.
    """

    time: FloatArray
    latitude: FloatArray
    longitude: FloatArray
    quantities: dict[str, Fused]
    sensors: dict[str, tuple[str, ...]]
    frame: LocalFrame
    streams: tuple[CleanStream, ...]


class _Column:
    """Samples of one sensor for one quantity of the record: time, value, σ."""

    def __init__(self, sensor: str, time: FloatArray, value: FloatArray, sigma: FloatArray) -> None:
        self.sensor, self.time, self.value, self.sigma = sensor, time, value, sigma


def integrate(streams: Sequence[Stream], options: ShipOptions) -> Integrated:
    """Clean and combine what a ship's sensors measure.

    Parameters
    ----------
    streams
        One a sensor and quantity. A sensor with a latitude has a longitude at the same times.
    options
        Of the chain.

    Raises
    ------
    OptionsError
        No samples with a time at all, or a latitude and a longitude that do not belong together.
    """
    times = [stream.time[np.isfinite(stream.time)] for stream in streams]
    known = [time for time in times if time.size]
    if not known:
        raise OptionsError("no samples with a time", "at least one stream that has some")
    _check_positions(streams)
    latitude = _joined(streams, "latitude")
    cleaned = tuple(clean_stream(stream, latitude, options) for stream in streams)
    first, last = min(time[0] for time in known), max(time[-1] for time in known)
    step = options.step_s
    time = first + step * np.arange(int((last - first) / step + 1e-6) + 1)
    frame = origin_of(np.degrees(latitude), np.degrees(_joined(streams, "longitude")))
    columns = _columns(cleaned, frame)
    quantities, sensors = {}, {}
    for name, given in columns.items():
        if given:
            ordered = sorted(given, key=lambda column: _rank(column.sensor, options))
            quantities[name] = _combined(name, ordered, time, options)
            sensors[name] = tuple(column.sensor for column in ordered)
    missing = np.full(len(time), np.nan)
    north, east = missing, missing
    if "east" in quantities:
        place = (quantities["east"].value, quantities["north"].value)
        north, east, _ = (np.radians(part) for part in frame.to_geographic(*place))
    return Integrated(
        time=time,
        latitude=north,
        longitude=east,
        quantities=quantities,
        sensors=sensors,
        frame=frame,
        streams=cleaned,
    )


def _check_positions(streams: Sequence[Stream]) -> None:
    sizes = {(s.sensor, s.quantity): len(s.value) for s in streams}
    for (sensor, quantity), size in sizes.items():
        pair = {"latitude": "longitude", "longitude": "latitude"}.get(quantity)
        if pair is not None and sizes.get((sensor, pair)) != size:
            raise OptionsError(f"{sensor} has {size} of {quantity}", f"as many of {pair}")


def _joined(streams: Sequence[Stream], quantity: str) -> FloatArray:
    values = [s.value for s in streams if s.quantity == quantity]
    return np.concatenate(values) if values else np.empty(0)


def _rank(sensor: str, options: ShipOptions) -> int:
    return options.order.index(sensor) if sensor in options.order else len(options.order)


def _columns(cleaned: Sequence[CleanStream], frame: LocalFrame) -> dict[str, list[_Column]]:
    """Samples by quantity of the record; positions in the local frame."""
    columns: dict[str, list[_Column]] = {"east": [], "north": []}
    columns |= {"speed": [], "heading": [], "depth": []}
    by_name: dict[tuple[str, str], CleanStream] = {}
    for each in cleaned:
        sensor, quantity = each.stream.sensor, each.stream.quantity
        if quantity in ("speed", "heading", "depth"):
            columns[quantity].append(_Column(sensor, each.stream.time, each.value, each.sigma))
        by_name[sensor, quantity] = each
    for (sensor, quantity), each in by_name.items():
        if quantity == "latitude":
            other = by_name[sensor, "longitude"]
            x, y, _ = frame.to_local(np.degrees(each.value), np.degrees(other.value))
            across = _RADIUS * np.cos(np.radians(frame.latitude_deg))
            columns["east"].append(_Column(sensor, each.stream.time, x, across * other.sigma))
            columns["north"].append(_Column(sensor, each.stream.time, y, _RADIUS * each.sigma))
        if quantity == "v_east" and (sensor, "v_north") in by_name:
            other = by_name[sensor, "v_north"]
            sigma = np.sqrt(0.5 * (each.sigma**2 + other.sigma**2))
            speed = np.hypot(each.value, other.value)
            columns["speed"].append(_Column(sensor, each.stream.time, speed, sigma))
    return columns


def _combined(
    name: str, columns: Sequence[_Column], time: FloatArray, options: ShipOptions
) -> Fused:
    """One quantity: on common epochs, aligned, combined."""
    period, kind = PERIODS.get(name, 0.0), "position" if name in ("east", "north") else name
    sampled = [_sampled(column, time, options, period) for column in columns]
    value, sigma = (np.column_stack([each[i] for each in sampled]) for i in (0, 1))
    window = max(round(options.alignment_s / options.step_s), 1)
    drift = options.drift.get(kind, 0.0)
    return fuse(
        align(value, sigma, options.step_s, window, drift, period),
        options.step_s,
        gate=options.gate,
        fade_s=options.fade_s,
        period=period,
        systematic=options.systematic.get(kind, 0.0),
    )


def _sampled(
    column: _Column, time: FloatArray, options: ShipOptions, period: float
) -> tuple[FloatArray, FloatArray]:
    """Value and σ at the epochs: between two samples that are not too far apart, linearly."""
    turned, _ = continued(column.value, period)
    known = np.isfinite(turned) & np.isfinite(column.time) & np.isfinite(column.sigma)
    nothing = np.full(len(time), np.nan)
    if not known.any():
        return nothing, nothing
    at, value, sigma = column.time[known], turned[known], column.sigma[known]
    after = np.searchsorted(at, time).clip(1, max(len(at) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(at) - 1)
    usual = float(np.median(np.diff(at))) if len(at) > 1 else 0.0
    near = at[after] - at[before] <= max(options.stale_s, 3.0 * usual)
    near |= (time == at[before]) | (time == at[after])
    inside = near & (time >= at[0]) & (time <= at[-1])
    between = np.where(inside, np.interp(time, at, value), np.nan)
    return between, np.where(inside, sigma[before], np.nan)
