"""Panels over one time axis: raw, what was done with it, the clean line and its 2σ band."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from surefix.report.marks import DOUBTED, SURE, Clock, Drawn, drawn, hover, note, rows_of, traces
from surefix.report.series import Series
from surefix.report.style import BAND, CLEAN, FRAME, MUTED, Figure, axis, layout
from surefix.report.thin import View, breaks, extremes, gapped, outline, pieces, view
from surefix.types import Event

__all__ = ["stack", "stacked"]

_LINE = 4_000
_QUIET = ("note", "held", "gap")


def stacked(
    name: str, label: str, panels: Sequence[Series], clock: Clock, events: Sequence[Event] = ()
) -> Figure:
    """Draw panels over one common time axis."""
    drawings = [_panel(panel, clock, i) for i, panel in enumerate(panels)]
    figure = stack(
        name,
        label,
        [(panel.title, 210.0) for panel in panels],
        clock,
        [trace for drawing in drawings for trace in drawing.traces],
    )
    for i, (panel, drawing) in enumerate(zip(panels, drawings, strict=True)):
        ends = drawing.limits.high, drawing.limits.low
        figure["layout"][f"yaxis{i + 1 if i else ''}"]["range"] = ends if panel.down else ends[::-1]
        if panel.period == 360.0:
            figure["layout"][f"yaxis{i + 1 if i else ''}"]["tickvals"] = [0, 90, 180, 270, 360]
    figure["layout"]["shapes"] += _lines(events, clock)
    figure["outside"] = sum(drawing.outside for drawing in drawings)
    figure["note"] = note(drawings[0].groups, panels[0].what)
    return figure


def stack(
    name: str,
    label: str,
    panels: Sequence[tuple[str, float]],
    clock: Clock,
    data: list[dict[str, Any]],
) -> Figure:
    """Lay out panels, (title, height px) each, from top to bottom over one time axis."""
    height = sum(size for _, size in panels)
    gap = 14.0 / height
    axes: dict[str, Any] = {}
    frames = []
    top = 1.0
    for i, (title, size) in enumerate(panels):
        low = max(0.0, top - size / height)
        domain = [low + (gap if i < len(panels) - 1 else 0.0), top]
        axes[f"yaxis{i + 1 if i else ''}"] = axis(
            title, domain=domain, tickformat=",~r", showline=False
        )
        frames.append(_frame(*domain))
        top = low
    last = f"y{len(panels)}" if len(panels) > 1 else "y"
    date = {"type": "date", "hoverformat": "%H:%M:%S.%L"} if clock.calendar else {}
    axes["xaxis"] = axis(clock.title, anchor=last, range=clock.range, showline=False, **date)
    return {
        "id": name,
        "label": label,
        "data": data,
        "layout": layout(shapes=frames, **axes),
        "height": height + 60.0,
        "outside": 0,
        "what": "values",
        "note": "",
    }


class _Drawing(NamedTuple):
    traces: list[dict[str, Any]]
    groups: tuple[Drawn, ...]
    limits: View
    outside: int


def _panel(panel: Series, clock: Clock, index: int) -> _Drawing:
    groups = drawn(panel.basis, panel.verdicts)
    labels = {g.verdict: hover(panel.verdicts, g.rows, panel.marks) for g in groups}
    time = clock.values(panel.time)
    where = {"xaxis": "x", "yaxis": f"y{index + 1}" if index else "y"}
    quantity, _, unit = panel.title.partition(", ")
    template = f"{clock.hover}<br>%{{text}}<br>{quantity.lower()} %{{y:.2f}} {unit}"
    marks = traces(groups, time, panel.raw, template=template, labels=labels, time=time, **where)
    limits = _limits(panel, groups)
    doubtful = rows_of(groups, *SURE, *DOUBTED)
    clean = [trace | where for trace in _clean(panel, clock, quantity.lower(), unit)]
    under = sum(group.rows.size > 0 for group in groups if group.verdict in SURE)
    outside = int((~limits.holds(panel.raw[doubtful])).sum())
    return _Drawing([*marks[:under], *clean, *marks[under:]], groups, limits, outside)


def _limits(panel: Series, groups: Sequence[Drawn]) -> View:
    if panel.period:
        return View(-0.02 * panel.period, 1.02 * panel.period)
    sure = panel.raw[rows_of(groups, *SURE)]
    usual = np.nanmedian(panel.sigma) if np.isfinite(panel.sigma).any() else 0.0
    known = panel.sigma <= 5.0 * usual  # far from every value the line means nothing
    clean, half = panel.clean[known], 2.0 * panel.sigma[known]
    core = np.concatenate((clean - half, clean + half, sure))
    return view(core, panel.raw[rows_of(groups, *DOUBTED)], least=0.2)


def _clean(panel: Series, clock: Clock, quantity: str, unit: str) -> list[dict[str, Any]]:
    rows = extremes(panel.clean[:, None], _LINE)
    cuts = breaks(panel.time)
    if panel.period:
        with np.errstate(invalid="ignore"):
            seam = np.flatnonzero(np.abs(np.diff(panel.clean)) > 0.5 * panel.period) + 1
        cuts = np.union1d(cuts, seam)
    runs = pieces(rows, cuts, np.isfinite(panel.clean) & np.isfinite(panel.time))
    low, high = panel.clean - 2.0 * panel.sigma, panel.clean + 2.0 * panel.sigma
    corner, values = outline(low, high, runs)
    line = gapped(runs)
    half, time, clean = (np.append(c, np.nan) for c in (panel.sigma, panel.time, panel.clean))
    moments = clock.values(time[line])
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "name": "2σ",
            "x": clock.values(time[corner]),
            "y": values,
            "fill": "toself",
            "fillcolor": BAND,
            "line": {"width": 0, "color": CLEAN, "simplify": False},
            "hoverinfo": "skip",
        },
        {
            "type": "scatter",
            "mode": "lines",
            "name": "clean",
            "x": moments,
            "y": clean[line],
            "line": {"color": CLEAN, "width": 1.6},
            "connectgaps": False,
            "customdata": moments,
            "text": np.array([f"{2.0 * value:.2f}" for value in half[line]], dtype=np.str_),
            "hovertemplate": f"{clock.hover}<br><b>clean</b>: {quantity} %{{y:.2f}} {unit},"
            f" ±%{{text}} {unit} (2σ)<extra></extra>",
        },
    ]


def _frame(low: float, high: float) -> dict[str, Any]:
    """Thin rectangle round one panel."""
    corners = {"x0": 0, "x1": 1, "y0": low, "y1": high}
    line = {"color": FRAME, "width": 1}
    return {"type": "rect", "xref": "paper", "yref": "paper", "line": line} | corners


def _lines(events: Sequence[Event], clock: Clock) -> list[dict[str, Any]]:
    """Vertical lines at the events that concern the track itself, at most forty."""
    told = [e for e in events if e.kind not in _QUIET and np.isfinite(e.time)][:40]
    return [
        {
            "type": "line",
            "xref": "x",
            "yref": "paper",
            "x0": clock.place(event.time),
            "x1": clock.place(event.time),
            "y0": 0,
            "y1": 1,
            "layer": "below",
            "line": {"color": MUTED, "width": 1, "dash": "dot"},
        }
        for event in told
    ]
