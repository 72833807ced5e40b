"""Figures 4–7 of paper 004, and what it does not show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from surefix.experiment import Figure, Panel, Table, Trace
from surefix.papers.radar_breakdown import LENGTHS
from surefix.papers.radar_hypotheses import SEVERAL
from surefix.papers.radar_methods import (
    BEFORE,
    CURRENT,
    OURS,
    PRINTED,
    ROBUST,
    SEVERAL_ONE,
    cv_names,
)
from surefix.papers.radar_series import Cartesian, Fusion
from surefix.papers.radar_tables import Parts
from surefix.simulate.radar import RadarFlight
from surefix.types import FloatArray, IntArray

__all__ = ["figures"]

_LABEL: Final = "sample"
_EVERY, _CLOSE = 20, 60  # thinning of long traces; samples around the burst that are all shown
_REACH = {1: 160.0, 2: 130.0}  # m shown of the errors in Y and Z


def figures(
    flight: RadarFlight,
    parts: Parts,
    series: tuple[Cartesian, Cartesian],
    one: Mapping[str, FloatArray],
    both: Mapping[str, Fusion],
    weight: FloatArray,
    tables: Mapping[str, Table],
) -> tuple[Figure, ...]:
    """Draw the first run, and the breakdown over all runs.

    Parameters
    ----------
    flight, parts
        The scene.
    series
        Both radars in the common frame.
    one, both
        Radar A under each method, and both fused.
    weight
        (n, 3) weight of A by residual scale.
    tables
        By key.
    """
    return (
        _errors(flight, parts, one, 1, "Y", "4"),
        _errors(flight, parts, one, 2, "Z", "5"),
        _differences(flight, parts, series, one, both),
        _fused(flight, parts, series, both),
        _weights(parts, weight),
        _breakdown(tables),
    )


def _errors(
    flight: RadarFlight, parts: Parts, one: Mapping[str, FloatArray], axis: int, name: str, no: str
) -> Figure:
    """Error of radar A in one axis, before and after each filter."""
    at = _thinned(parts, len(flight.position))
    error = {method: x[:, axis] - flight.position[:, axis] for method, x in one.items()}
    wild = np.flatnonzero(flight.radars[0].wild & (np.arange(len(error[BEFORE])) >= parts.settled))
    reach = 1.1 * float(np.abs(error[BEFORE][wild]).max(initial=_REACH[axis]))
    near = (-_REACH[axis], _REACH[axis])
    few = np.arange(parts.settled, len(flight.position), _EVERY)
    first = (
        Trace("measured", few.astype(np.float64), error[BEFORE][few], "raw"),
        Trace("wild", wild.astype(np.float64), error[BEFORE][wild], "bad"),
    )
    after = (*cv_names(), CURRENT, OURS, PRINTED, ROBUST, SEVERAL_ONE)

    def panel(
        letter: str, title: str, traces: tuple[Trace, ...], shown: tuple[float, float]
    ) -> Panel:
        return Panel(
            title=f"({letter}) {title}",
            x_label=_LABEL,
            y_label=f"error in {name}, m",
            traces=traces,
            y_range=shown,
        )

    lines = (
        panel(letter, method, (Trace("filtered", at.astype(np.float64), error[method][at]),), near)
        for letter, method in zip("bcdefghi", after, strict=True)
    )
    return Figure(
        key=f"error-{name.lower()}",
        title=f"Error of radar A in {name} before and after filtering (beside Fig. {no})",
        panels=(panel("a", BEFORE, first, (-reach, reach)), *lines),
        columns=2,
    )


def _differences(
    flight: RadarFlight,
    parts: Parts,
    series: tuple[Cartesian, Cartesian],
    one: Mapping[str, FloatArray],
    both: Mapping[str, Fusion],
) -> Figure:
    """First differences of Y across the manoeuvre, before and after filtering and fusion."""
    n = len(flight.position)
    begin = max(parts.manoeuvre.start - n // 20, 1)
    at = np.arange(begin, min(parts.manoeuvre.stop + n // 20, n), 4)

    def trace(name: str, position: FloatArray, kind: str) -> Trace:
        step = position[at, 1] - position[at - 1, 1]
        return Trace(name, at.astype(np.float64), step, kind)  # type: ignore[arg-type]

    truth = trace("truth", flight.position, "truth")
    steps = truth.y
    near = (float(steps.min()) - 8.0, float(steps.max()) + 8.0)

    def panel(title: str, shown: Trace, y_range: tuple[float, float]) -> Panel:
        return Panel(
            title=title,
            x_label=_LABEL,
            y_label="first difference of Y, m",
            traces=(shown, truth),
            y_range=y_range,
        )

    wide = (-150.0, 150.0)
    return Figure(
        key="first-difference",
        title="First differences of Y across the manoeuvre (beside Fig. 6)",
        panels=(
            panel("(a) radar A", trace("measured", series[0].position, "raw"), wide),
            panel("(b) radar A, medians with feedback", trace("filtered", one[OURS], "line"), near),
            panel("(c) radar B", trace("measured", series[1].position, "raw"), wide),
            panel(
                "(d) both, fused by residual scale",
                trace("fused", both["residual scale"].position, "line"),
                near,
            ),
        ),
        columns=2,
    )


def _fused(
    flight: RadarFlight,
    parts: Parts,
    series: tuple[Cartesian, Cartesian],
    both: Mapping[str, Fusion],
) -> Figure:
    """Errors of the fused track in Y and Z."""
    at = _thinned(parts, len(flight.position))
    few = np.arange(parts.settled, len(flight.position), _EVERY)
    lines = (
        ("CV Kalman", "CV Kalman, inverse covariance"),
        ("medians by residual scale", "residual scale"),
        ("IGG3 Kalman", "IGG3 Kalman, inverse covariance"),
        ("multi-hypothesis", SEVERAL),
    )

    def off(position: FloatArray, rows: IntArray, axis: int) -> FloatArray:
        return np.asarray(position[rows, axis] - flight.position[rows, axis])

    panels = tuple(
        Panel(
            x_label=_LABEL,
            y_label=f"error in {name}, m",
            traces=(
                Trace(
                    "A, measured", few.astype(np.float64), off(series[0].position, few, axis), "raw"
                ),
                *(
                    Trace(title, at.astype(np.float64), off(both[key].position, at, axis))
                    for title, key in lines
                ),
            ),
            y_range=(-80.0, 80.0),
        )
        for axis, name in ((1, "Y"), (2, "Z"))
    )
    return Figure(
        key="fused", title="Error of both radars fused (beside Fig. 7)", panels=panels, columns=2
    )


def _weights(parts: Parts, weight: FloatArray) -> Figure:
    at = np.arange(parts.settled, len(weight), _EVERY)
    return Figure(
        key="weight",
        title="Weight of radar A by residual scale; it is noisier in the shorter part near the end",
        panels=(
            Panel(
                x_label=_LABEL,
                y_label="weight",
                traces=tuple(
                    Trace(name, at.astype(np.float64), weight[at, axis])
                    for axis, name in ((1, "Y"), (2, "Z"))
                ),
                y_range=(0.0, 1.0),
            ),
        ),
    )


def _breakdown(tables: Mapping[str, Table]) -> Figure:
    panels = []
    for key, title in (
        ("survived_common_pct", "one common offset"),
        ("survived_own_pct", "independent errors"),
    ):
        table = tables[key]
        panels.append(
            Panel(
                title=title,
                x_label="length of the burst, samples",
                y_label="survived, %",
                traces=tuple(
                    Trace(
                        row.replace("Kalman, ", ""),
                        np.asarray(LENGTHS, dtype=np.float64),
                        mean,
                        "points",
                    )
                    for row, mean in zip(table.rows, table.mean, strict=True)
                ),
                y_range=(-4.0, 104.0),
            )
        )
    return Figure(
        key="breakdown", title="Bursts survived, by their length", panels=tuple(panels), columns=2
    )


def _thinned(parts: Parts, n: int) -> IntArray:
    """Every so many samples, and all near the burst."""
    close = np.arange(max(parts.burst.start - _CLOSE, 0), parts.burst.stop + _CLOSE)
    return np.unique(np.concatenate([np.arange(parts.settled, n, _EVERY), close]))
