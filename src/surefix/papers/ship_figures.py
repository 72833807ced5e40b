"""The pictures of paper 003: its Figures 2 to 6, and what its pictures could not show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surefix.experiment import Figure, Panel, Trace
from surefix.papers.ship_methods import FIGURES_SHOW, METHODS, OURS, PAPER, SEVERAL
from surefix.papers.ship_run import series
from surefix.pipelines.ship import Integrated
from surefix.report.thin import extremes
from surefix.simulate.ship import ShipLog
from surefix.simulate.ship_faults import BURSTS
from surefix.types import FloatArray

__all__ = ["figures", "thinned"]

_POINTS = 1200  # drawn of each series
_DEGREE = 180.0 / np.pi
_LOGGED = "as logged"


def thinned(
    name: str, x: FloatArray, y: FloatArray, kind: str = "line", points: int = _POINTS
) -> Trace:
    """Make a trace of the extremes of a long series: the look of the whole with fewer points."""
    rows = extremes(y[:, None], points)
    return Trace(name, x[rows], y[rows], kind)  # type: ignore[arg-type]


def figures(
    alone: ShipLog, log: ShipLog, record: Integrated, removed: Mapping[str, list[float]]
) -> tuple[Figure, ...]:
    """Draw one voyage.

    Parameters
    ----------
    alone
        The voyage with isolated gross errors only, as the paper's pictures show it.
    log
        The voyage.
    record
        What the chain made of it.
    removed
        By method, share of the gross errors that it removed, by length of the burst, percent.
    """
    return (
        _logged(alone, "ins-position", "Position of the INS (Figure 2 of the paper)",
                {"longitude": "longitude, °", "latitude": "latitude, °"}, _DEGREE),
        _logged(alone, "ins-velocity", "Velocity of the INS (Figure 3 of the paper)",
                {"v_east": "east velocity, m/s", "v_north": "north velocity, m/s"}, 1.0),
        _logged(alone, "ins-attitude", "Attitude of the INS (Figure 4 of the paper)",
                {"roll": "roll, °", "pitch": "pitch, °", "heading": "heading, °"}, _DEGREE),
        _filtered(alone, "v_east", "east-velocity",
                  "East velocity, isolated errors (Figure 5 of the paper)"),
        _filtered(alone, "v_north", "north-velocity",
                  "North velocity, isolated errors (Figure 6 of the paper)"),
        _filtered(log, "v_east", "east-velocity-bursts", "East velocity, with bursts",
                  PAPER, OURS, SEVERAL),
        _bursts(removed),
        _record(log, record),
    )  # fmt: skip


def _hours(log: ShipLog) -> FloatArray:
    return np.asarray((log.time - log.time[0]) / 3600.0)


def _logged(log: ShipLog, key: str, title: str, shown: Mapping[str, str], unit: float) -> Figure:
    panels = []
    for quantity, label in shown.items():
        sensor = log.sensor("INS", quantity)
        kind = "raw" if quantity == "heading" else "line"  # a line would cross the seam at north
        points = _POINTS // 2 if kind == "raw" else _POINTS
        trace = thinned("INS, as logged", _hours(log), unit * sensor.value, kind, points)
        panels.append(Panel(x_label="time, h", y_label=label, traces=(trace,)))
    return Figure(key=key, title=title, panels=tuple(panels), columns=2 if len(panels) == 2 else 1)


def _filtered(log: ShipLog, quantity: str, key: str, title: str, *names: str) -> Figure:
    """Raw and filtered, for each method the whole voyage and a stretch with faults of all kinds."""
    sensor, hours = log.sensor("INS", quantity), _hours(log)
    given = series(log, sensor)
    first, last = _stretch(sensor.faults.burst)
    near, second = slice(first, last), np.arange(first, last, dtype=np.float64)
    label = f"{'east' if quantity == 'v_east' else 'north'} velocity, m/s"
    panels = []
    for name in names or FIGURES_SHOW:
        cleaned = METHODS[name](given).value
        panels += [
            Panel(
                title=name, x_label="time, h", y_label=label,
                traces=(thinned(name, hours, cleaned, points=500),),
            ),
            Panel(
                title="a stretch of it",
                x_label="time, s", y_label=label,
                traces=(
                    Trace(_LOGGED, second, given.value[near], "raw"),
                    Trace("without faults", second, sensor.intact[near],
                          "truth"),
                    Trace(name, second, cleaned[near]),
                ),
            ),
        ]  # fmt: skip
    return Figure(key=key, title=title, panels=tuple(panels), columns=2)


def _stretch(burst: np.ndarray[tuple[int], np.dtype[np.int64]]) -> tuple[int, int]:
    """Rows of about three minutes with as many bursts as can be, of different lengths."""
    n, width = len(burst), min(200, len(burst))
    starts = np.arange(0, n - width + 1, 20)
    bursts = np.diff((burst > 0).astype(np.int64), prepend=0) > 0
    rich = [
        len(set(burst[at : at + width].tolist())) + 0.1 * bursts[at : at + width].sum()
        for at in starts
    ]
    at = int(starts[int(np.argmax(rich))])
    return at, at + width


def _bursts(removed: Mapping[str, list[float]]) -> Figure:
    at = np.array(BURSTS, dtype=np.float64)
    panels = tuple(
        Panel(
            title=title,
            x_label="length of the burst, samples",
            y_label="removed, %",
            y_range=(-4.0, 104.0),
            traces=tuple(Trace(name, at, np.array(removed[name]), "points") for name in names),
        )
        for title, names in (
            ("methods that the paper names", (*FIGURES_SHOW, "Lagrange, 3 points")),
            ("others", ("Hampel, 61 samples", OURS, SEVERAL)),
        )
    )
    title = "Gross errors removed, by length of burst"
    return Figure(key="bursts", title=title, panels=panels, columns=2)


def _record(log: ShipLog, record: Integrated) -> Figure:
    """Errors of the record and of the sensors it was made of."""
    hours = _hours(log)
    streams = {(s.stream.sensor, s.stream.quantity): s.value for s in record.streams}
    panels = []
    place = {
        sensor: log.frame.to_local(
            *(np.degrees(streams[sensor, q]) for q in ("latitude", "longitude"))
        )[0]
        for sensor in ("INS", "GNSS")
    }
    ours = log.frame.to_local(np.degrees(record.latitude), np.degrees(record.longitude))[0]
    true = log.position[:, 0]
    panels.append(
        _panel(
            "east, m", 60.0, hours,
            {"INS, cleaned": place["INS"] - true, "GNSS, cleaned": place["GNSS"] - true,
             "record": ours - true},
        )
    )  # fmt: skip
    for name, label, reach, sensors in (
        ("speed", "speed, m/s", 2.0, ("log", "GNSS")),
        ("heading", "heading, °", 4.0, ("gyro", "INS")),
        ("depth", "depth, m", 4.0, ("sounder",)),
    ):
        truth = log.sensor(sensors[0], name).truth
        errors = {f"{s}, cleaned": streams[s, name] - truth for s in sensors}
        errors["record"] = record.quantities[name].value - truth
        if name == "heading":
            turn = 2.0 * np.pi
            errors = {k: _DEGREE * ((e + np.pi) % turn - np.pi) for k, e in errors.items()}
        panels.append(_panel(label, reach, hours, errors))
    return Figure(
        key="record", title="Errors of the integrated record", panels=tuple(panels), columns=2
    )


def _panel(label: str, reach: float, hours: FloatArray, errors: dict[str, FloatArray]) -> Panel:
    return Panel(
        x_label="time, h",
        y_label=f"error of {label}",
        y_range=(-reach, reach),
        traces=tuple(
            thinned(name, hours, np.clip(error, -3.0 * reach, 3.0 * reach), points=600)
            for name, error in errors.items()
        ),
    )
