"""One simulated voyage through every method and through the chain: the rows of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from surefix.cleaning.plausibility import Check
from surefix.cleaning.replacement import Replaced
from surefix.cleaning.tukey53h import tukey53h
from surefix.geo.angle import wrap
from surefix.papers.ship_methods import METHODS, SMOOTHERS, Series
from surefix.pipelines.ship import Integrated, integrate
from surefix.pipelines.ship_cleaning import Stream
from surefix.pipelines.ship_fusion import Quality
from surefix.pipelines.ship_options import ShipOptions, thresholds
from surefix.simulate.ship import QUANTITIES, ShipLog, ShipSensor
from surefix.simulate.ship_faults import BURSTS
from surefix.types import BoolArray, FloatArray

__all__ = [
    "CHAIN",
    "CHANNELS",
    "FACTORS",
    "UNITS",
    "Rows",
    "chain_rows",
    "editing_rows",
    "isolated_rows",
    "series",
]

Rows = dict[str, dict[str, list[float]]]
"""Table → row → one figure a column."""

CHANNELS = QUANTITIES["INS"]
FACTORS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Of the thresholds, to see what they do."""

CHAIN = ShipOptions(
    order=("GNSS", "INS"),
    frozen=5,
    systematic={"position": 1.5, "heading": np.radians(0.1)},
)
"""The chain's options: GNSS is trusted most, where there is none the INS."""

_RADIUS = 6_371_008.8
_DEGREE = 180.0 / np.pi
UNITS: Mapping[str, tuple[str, float]] = {
    "latitude": ("m", _RADIUS),
    "longitude": ("m", _RADIUS * np.cos(np.radians(38.4))),
    "v_east": ("m/s", 1.0),
    "v_north": ("m/s", 1.0),
    "roll": ("°", _DEGREE),
    "pitch": ("°", _DEGREE),
    "heading": ("°", _DEGREE),
}
"""Unit in which errors of a channel are shown, and how many of it there are in one of its own."""


class _Scores(NamedTuple):
    """What one method did to one channel."""

    removed: FloatArray  # (6,) share by length of burst
    found: FloatArray  # (6,) share that was edited, whatever it became
    false: float  # share of the good samples that was edited
    altered: float
    distortion: float
    error: float


def series(log: ShipLog, sensor: ShipSensor) -> Series:
    """Samples of a sensor as every method gets them: what it marks as invalid is left out."""
    latitude = log.sensor("INS", "latitude").value
    limit = thresholds(sensor.quantity, log.time, latitude, CHAIN)
    value = np.where(sensor.valid, sensor.value, np.nan)
    return Series(value, log.time, limit, sensor.period if sensor.quantity == "heading" else 0.0)


def editing_rows(log: ShipLog) -> Rows:
    """Every method on every channel of the INS."""
    scores: dict[str, list[_Scores]] = {}
    sweep: dict[float, list[_Scores]] = {}
    raw = []
    for quantity in CHANNELS:
        sensor = log.sensor("INS", quantity)
        given = series(log, sensor)
        nothing = np.zeros(len(given.value), np.bool_)
        raw.append(_score(sensor, given, Replaced(given.value, given.value, nothing)))
        for name, method in METHODS.items():
            scores.setdefault(name, []).append(_score(sensor, given, method(given)))
        for factor in FACTORS:
            found = tukey53h(given.value, factor * given.threshold, period=given.period)
            sweep.setdefault(factor, []).append(_score(sensor, given, found))
    everything = {"as logged": raw} | scores
    return {
        "removed_pct": {
            name: (100.0 * np.nanmean([s.removed for s in each], axis=0)).tolist()
            for name, each in scores.items()
        },
        "found_pct": {
            name: [
                *(100.0 * np.nanmean([s.found for s in scores[name]], axis=0)).tolist(),
                1e4 * float(np.max([s.false for s in scores[name]])),
            ]
            for name in scores
            if name not in SMOOTHERS
        },
        "altered_pct": _rows(scores, "altered", 100.0),
        "distortion": _rows(scores, "distortion", 1.0),
        "rmse": _rows(everything, "error", 1.0),
        "threshold_pct": {
            f"{factor:g} T": [
                100.0 * float(np.nanmean([s.removed[0] for s in each])),
                *(100.0 * s.altered for s in each),
            ]
            for factor, each in sweep.items()
        },
    }


def isolated_rows(log: ShipLog) -> dict[str, list[float]]:
    """RMSE of the INS's two velocities by method: the paper's own comparison."""
    rows: dict[str, list[float]] = {}
    for quantity in ("v_east", "v_north"):
        sensor = log.sensor("INS", quantity)
        given = series(log, sensor)
        nothing = np.zeros(len(given.value), np.bool_)
        logged = Replaced(given.value, given.value, nothing)
        rows.setdefault("as logged", []).append(_score(sensor, given, logged).error)
        for name, method in METHODS.items():
            rows.setdefault(name, []).append(_score(sensor, given, method(given)).error)
    return rows


def _rows(scores: Mapping[str, list[_Scores]], name: str, factor: float) -> dict[str, list[float]]:
    return {key: [factor * getattr(s, name) for s in each] for key, each in scores.items()}


def _score(sensor: ShipSensor, given: Series, cleaned: Replaced) -> _Scores:
    """Hold a cleaned series against what the sensor would have logged without its faults."""
    error = cleaned.value - sensor.intact
    error = wrap(error, given.period) if given.period else error
    faults, unit = sensor.faults, UNITS[sensor.quantity][1]
    with np.errstate(invalid="ignore"):
        gone = ~(np.abs(error) > given.threshold)  # what was left out is NaN and gone as well
        altered = ~(cleaned.value == given.value)
    removed = np.array([_mean(gone[faults.burst == length]) for length in BURSTS])
    found = np.array([_mean(cleaned.replaced[faults.burst == length]) for length in BURSTS])
    counted = (faults.good | (faults.burst > 0)) & np.isfinite(error)
    return _Scores(
        removed,
        found,
        _mean(cleaned.replaced[faults.good]),
        _mean(altered[faults.good]),
        unit * _rms(error[faults.good & np.isfinite(error)]),
        unit * _rms(error[counted]),
    )


def _mean(flags: BoolArray) -> float:
    return float(flags.mean()) if flags.size else float("nan")


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(x * x))) if x.size else float("nan")


def chain_rows(log: ShipLog) -> tuple[Rows, Integrated]:
    """The whole chain: the record against each sensor, its σ, its jumps, its checks."""
    streams = [Stream(s.sensor, s.quantity, log.time, s.value, s.valid) for s in log.sensors]
    record = integrate(streams, CHAIN)
    error = {name: _record_error(log, record, name) for name in record.quantities}
    rmse = {"mean of the sensors": [_rms(e) for e in _naive(log, record)]}
    rmse = _sensor_rows(log, record) | rmse
    rmse["record"] = [_both(error, record, _everything)]
    rmse["record, where valid"] = [_both(error, record, _valid)]
    for row, which in (("record", _everything), ("record, where valid", _valid)):
        rmse[row] += [_rms(error[q][which(record, q)]) for q in ("speed", "heading", "depth")]
    return {
        "record_rmse": rmse,
        "within_pct": {
            row: [_within(error[q], record, q, which) for q in record.quantities]
            for row, which in (("all", _everything), ("where valid", _valid))
        },
        "quality_pct": {
            mark.name.lower(): [
                100.0 * _mean(f.quality == mark) for f in record.quantities.values()
            ]
            for mark in Quality
        },
        "jump_m": _jumps(log, record),
        "check_pct": _checks(log, record),
    }, record


def _truth(log: ShipLog, name: str) -> FloatArray:
    if name in ("east", "north"):
        return np.asarray(log.position[:, 0 if name == "east" else 1])
    return next(s.truth for s in log.sensors if s.quantity == name)


def _apart(value: FloatArray, truth: FloatArray, name: str) -> FloatArray:
    """Error in m, m/s or degrees."""
    return _DEGREE * wrap(value - truth, 2.0 * np.pi) if name == "heading" else value - truth


def _record_error(log: ShipLog, record: Integrated, name: str) -> FloatArray:
    value = record.quantities[name].value
    if name in ("east", "north"):
        x, y = _local(log, np.degrees(record.latitude), np.degrees(record.longitude))
        value = x if name == "east" else y
    return _apart(value, _truth(log, name), name)


def _local(log: ShipLog, latitude: FloatArray, longitude: FloatArray) -> tuple[FloatArray, ...]:
    return log.frame.to_local(latitude, longitude)[:2]


def _everything(record: Integrated, name: str) -> BoolArray:
    return np.isfinite(record.quantities[name].value)


def _valid(record: Integrated, name: str) -> BoolArray:
    return np.asarray(record.quantities[name].quality == Quality.VALID)


def _both(error: Mapping[str, FloatArray], record: Integrated, which: object) -> float:
    """RMSE of the position over both axes."""
    assert callable(which)
    use = which(record, "east") & which(record, "north")
    return float(np.hypot(_rms(error["east"][use]), _rms(error["north"][use])))


def _within(error: FloatArray, record: Integrated, name: str, which: object) -> float:
    assert callable(which)
    unit = _DEGREE if name == "heading" else 1.0
    use = which(record, name)
    return 100.0 * _mean(np.abs(error[use]) < 2.0 * unit * record.quantities[name].sigma[use])


def _sensor_rows(log: ShipLog, record: Integrated) -> dict[str, list[float]]:
    """RMSE of each sensor, as logged and cleaned, in the columns of the record."""
    rows: dict[str, list[float]] = {}
    for state in ("logged", "cleaned"):
        for sensor in QUANTITIES:
            values = {}
            for each, stream in zip(log.sensors, record.streams, strict=True):
                if each.sensor == sensor:
                    shown = np.where(each.valid, each.value, np.nan)
                    values[each.quantity] = stream.value if state == "cleaned" else shown
            rows[f"{sensor}, {state}"] = [_rms(_known(e)) for e in _errors(log, values)]
    return rows


def _known(x: FloatArray) -> FloatArray:
    return x[np.isfinite(x)]


def _errors(log: ShipLog, values: dict[str, FloatArray]) -> list[FloatArray]:
    """Errors of position, speed, heading and depth; empty where the sensor has none."""
    none = np.empty(0)
    if "v_east" in values:
        values = values | {"speed": np.hypot(values["v_east"], values["v_north"])}
    place = none
    if "latitude" in values:
        x, y = _local(log, *(np.degrees(values[q]) for q in ("latitude", "longitude")))
        place = np.hypot(x - log.position[:, 0], y - log.position[:, 1])
    rest = [
        _apart(values[q], _truth(log, q), q) if q in values else none
        for q in ("speed", "heading", "depth")
    ]
    return [place, *rest]


def _naive(log: ShipLog, record: Integrated) -> list[FloatArray]:
    """Errors of the plain mean of the cleaned sensors there are, at each epoch."""
    total: dict[str, list[FloatArray]] = {}
    for sensor in QUANTITIES:
        values = {s.stream.quantity: s.value for s in record.streams if s.stream.sensor == sensor}
        if "v_east" in values:
            values["speed"] = np.hypot(values["v_east"], values["v_north"])
        if "latitude" in values:
            at = _local(log, *(np.degrees(values[q]) for q in ("latitude", "longitude")))
            values |= {"east": at[0], "north": at[1]}
        for name in ("east", "north", "speed", "heading", "depth"):
            if name in values:
                total.setdefault(name, []).append(_apart(values[name], _truth(log, name), name))
    mean = {name: _mean_of(np.array(each)) for name, each in total.items()}
    place = np.hypot(mean["east"], mean["north"])
    return [_known(e) for e in (place, mean["speed"], mean["heading"], mean["depth"])]


def _mean_of(each: FloatArray) -> FloatArray:
    known = np.isfinite(each)
    count = known.sum(axis=0)
    total = np.where(known, each, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _jumps(log: ShipLog, record: Integrated) -> dict[str, list[float]]:
    """Greatest step of the position's error from epoch to epoch as GNSS goes and returns."""
    streams = {(s.stream.sensor, s.stream.quantity): s.value for s in record.streams}
    at = {
        sensor: np.column_stack(
            _local(log, *(np.degrees(streams[sensor, q]) for q in ("latitude", "longitude")))
        )
        for sensor in ("GNSS", "INS")
    }
    switched = np.where(np.isfinite(at["GNSS"]), at["GNSS"], at["INS"])
    ours = np.column_stack([_record_error(log, record, q) for q in ("east", "north")])
    naive = switched - log.position
    rows: dict[str, list[float]] = {}
    for name, error in (("switch to the INS", naive), ("record", ours)):
        step = np.hypot(*np.diff(error, axis=0).T)
        rows[name] = []
        for instant in log.outage:
            near = np.abs(log.time[1:] - instant) <= 10.0
            rows[name].append(float(np.nanmax(step[near], initial=0.0)))
    return rows


def _checks(log: ShipLog, record: Integrated) -> dict[str, list[float]]:
    """Faults that each check found, and good samples that it refused, over all sensors."""
    found: dict[str, list[BoolArray]] = {}
    good: dict[str, list[BoolArray]] = {}
    for sensor, stream in zip(log.sensors, record.streams, strict=True):
        faults, check = sensor.faults, stream.check
        edited = (check == Check.RATE) | stream.replaced
        for name, flag, fault in (
            ("validity bit", check == Check.INVALID, faults.invalid),
            ("frozen value", check == Check.FROZEN, faults.stuck),
            ("rate", check == Check.RATE, faults.burst > 0),
            ("rate or 53H", edited, faults.burst > 0),
        ):
            found.setdefault(name, []).append(flag[fault])
            good.setdefault(name, []).append(flag[faults.good])
    return {
        name: [100.0 * _mean(np.concatenate(each)) for each in (found[name], good[name])]
        for name in found
    }
