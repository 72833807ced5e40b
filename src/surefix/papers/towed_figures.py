"""Pictures of the towed sonar's experiment: figure 2 of the paper, and what it does not show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from surefix.experiment import Figure, Kind, Panel, Table, Trace
from surefix.geo.angle import unwrap, wrap
from surefix.models.towed import offset
from surefix.papers.towed_methods import Estimate
from surefix.simulate.towed import TowedSurvey
from surefix.types import FloatArray

__all__ = ["figures"]

_LINES: Final = ("KF", "M eqs 19")
_POINTS: Final = 400  # of a trace, about
_SHOWN: Final = 330.0  # s, the first line and turn


def figures(
    survey: TowedSurvey, estimates: Mapping[str, Estimate], contamination: Sequence[Table]
) -> tuple[Figure, ...]:
    """Draw the first run, and the table of the contamination.

    Parameters
    ----------
    survey, estimates
        The first run: what was measured, and what each method made of it.
    contamination
        Ratios to the oracle, of position and heading: a column per share of bad values.
    """
    return (
        Figure(
            key="states",
            title="Longitude, latitude, heading and speed with gross errors: beside figure 2; "
            "the body dives after 4 min",
            panels=_states(survey, estimates),
            columns=2,
        ),
        Figure(
            key="errors",
            title="Errors of position, heading and speed; GPS is missing in every second stretch",
            panels=_errors(survey, estimates),
            columns=2,
        ),
        Figure(
            key="track",
            title="Track: filtered in real time, and smoothed offline",
            panels=(_plan(survey, estimates),),
        ),
        Figure(
            key="contamination",
            title="RMSE ÷ that of an oracle that knows the bad values; position at the surface",
            panels=tuple(map(_shares, contamination, ("position", "heading"))),
            columns=2,
        ),
    )


def _states(survey: TowedSurvey, estimates: Mapping[str, Estimate]) -> tuple[Panel, ...]:
    """(a) longitude, (b) latitude, (c) heading, (d) speed, as in the paper."""
    rows = survey.time <= _SHOWN
    measured, true = survey.z[rows], survey.truth[rows][:, [0, 1, 4, 5]]
    lines = {name: estimates[name].track.mean[rows][:, [0, 1, 4, 5]] for name in _LINES}
    measured[:, 2] = unwrap(measured[:, 2], true[:, 2], 2.0 * np.pi)
    start = np.round(np.degrees(true[0, :2]), 2)
    for values in (true, measured, *lines.values()):
        values[:, :3] = np.degrees(values[:, :3])
        values[:, :2] = 1e3 * wrap(values[:, :2] - start)
    panels = []
    for column, label in (
        (1, f"(a) longitude less {start[1]:g}°, 10⁻³ °"),
        (0, f"(b) latitude less {start[0]:g}°, 10⁻³ °"),
        (2, "(c) heading, °"),
        (3, "(d) speed, m/s"),
    ):
        x, bad = survey.time[rows] / 60.0, survey.bad[rows, column]
        traces = [
            _thin("measured", x[~bad], measured[~bad, column], "raw"),
            Trace("bad value", x[bad], measured[bad, column], "bad"),
            _thin("truth", x, true[:, column], "truth"),
            *(_thin(name, x, values[:, column]) for name, values in lines.items()),
        ]
        low, high = true[:, column].min(), true[:, column].max()
        margin = (0.5 if column != 3 else 1.2) * (high - low)
        panels.append(
            Panel(
                x_label="time, min",
                y_label=label,
                traces=tuple(traces),
                y_range=(float(low - margin), float(high + margin)),
            )
        )
    return tuple(panels)


def _errors(survey: TowedSurvey, estimates: Mapping[str, Estimate]) -> tuple[Panel, ...]:
    names = (*_LINES, "M eqs 19 + RTS", "multi-hypothesis + RTS", "oracle")
    x = survey.time / 60.0
    panels = []
    for label, top, columns in (
        ("position, m", 60.0, [0, 1]),
        ("current, m/s", 0.6, [2, 3]),
        ("heading, °", 5.0, [4]),
        ("speed, m/s", 0.4, [5]),
    ):
        traces = []
        for name in names:
            size = np.sqrt(np.sum(estimates[name].error[:, columns] ** 2, axis=1))
            traces.append(_thin(name, x, np.degrees(size) if columns == [4] else size))
        panels.append(
            Panel(
                x_label="time, min",
                y_label=f"error of {label}",
                traces=tuple(traces),
                y_range=(0.0, top),
            )
        )
    return tuple(panels)


def _plan(survey: TowedSurvey, estimates: Mapping[str, Estimate]) -> Panel:
    def local(position: FloatArray) -> FloatArray:
        origin = np.broadcast_to(survey.truth[:1, :2], position.shape)
        return np.column_stack(offset(*origin.T, *position.T))

    fixes, bad = local(survey.z[:, :2]), survey.bad[:, :2].any(axis=1)
    true = local(survey.truth[:, :2])
    names = (*_LINES, "M eqs 19 + RTS")
    lines = {name: local(estimates[name].track.mean[:, :2]) for name in names}
    seen = np.all(np.abs(fixes - true.mean(axis=0)) < 0.75 * np.ptp(true, axis=0).max(), axis=1)
    return Panel(
        x_label="east, m",
        y_label="north, m",
        traces=(
            _thin("measured", fixes[~bad, 1], fixes[~bad, 0], "raw"),
            Trace("bad value", fixes[bad & seen, 1], fixes[bad & seen, 0], "bad"),
            _thin("truth", true[:, 1], true[:, 0], "truth"),
            *(_thin(name, values[:, 1], values[:, 0]) for name, values in lines.items()),
        ),
        equal=True,
    )


def _shares(table: Table, what: str) -> Panel:
    x = np.array([float(name.split()[1]) for name in table.columns])
    return Panel(
        x_label="bad values, %",
        y_label=f"{what} RMSE ÷ oracle",
        traces=tuple(
            Trace(name, x, values, "points")
            for name, values in zip(table.rows, table.mean, strict=True)
        ),
        log_y=True,
    )


def _thin(name: str, x: FloatArray, y: FloatArray, kind: Kind = "line") -> Trace:
    step = max(1, len(x) // _POINTS)
    return Trace(name, x[::step], y[::step], kind)
