"""The report of an experiment: its findings, its tables, and its pictures."""

from __future__ import annotations

import re
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np

from surefix.experiment import Experiment, Panel, Table, Trace
from surefix.experiment import Figure as Picture
from surefix.io.atomic import replacing
from surefix.report.shell import Section, page, place
from surefix.report.style import CLEAN, FRAME, INK, MUTED, Figure, axis, layout
from surefix.report.wording import escape, number, table

__all__ = ["COLOURS", "colours_of", "write_experiment"]

COLOURS: Final = (
    CLEAN, "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7a5c3e", "#8a63d2",
)  # fmt: skip
"""Lines of the methods, in the order of their first appearance."""

_DASHES: Final = ("solid", "dash", "dot")
_PANEL: Final = 300.0  # px, height of a panel
_GAP: Final = 86.0  # px between rows of panels
_FOOTER: Final = "Made with surefix. Every figure was computed for this page."


def write_experiment(experiment: Experiment, path: str | Path) -> None:
    """Write an experiment as one HTML file that needs no network; whole or not at all.

    Raises
    ------
    MissingExtraError
        Plotly is not installed.
    OutputError
        The file cannot be written.
    """
    runs = f"{experiment.runs} runs" if experiment.runs > 1 else "1 run"
    text = page(
        _sections(experiment),
        kind="Experiment",
        title=experiment.title,
        subtitle=f"{escape(experiment.source)} · seed {experiment.seed}, {runs}",
        footer=_FOOTER,
    )
    with replacing(path) as file:
        file.write(text.encode("utf-8", "replace"))


def colours_of(picture: Picture) -> dict[str, tuple[str, str]]:
    """Colour and dash of each name that is drawn as a line, in the order of appearance.

    Every other line with marks is dashed: such lines often lie on each other.

    Returns
    -------
    colours
        Name → colour as ``#rrggbb``, and one of ``solid``, ``dash``, ``dot``.
    """
    drawn = [trace for panel in picture.panels for trace in panel.traces]
    names = dict.fromkeys(trace.name for trace in drawn if trace.kind in ("line", "points"))
    marked = {trace.name for trace in drawn if trace.kind == "points"}
    found = {}
    for i, name in enumerate(names):
        turn = i // len(COLOURS) + (name in marked and i % 2)
        found[name] = (COLOURS[i % len(COLOURS)], _DASHES[turn % len(_DASHES)])
    return found


def _sections(experiment: Experiment) -> list[Section]:
    found = "".join(f"<li>{escape(finding)}</li>" for finding in experiment.findings)
    parts = [Section("findings", "Findings", "Findings", f"<ul>{found}</ul>")] if found else []
    parts += [
        Section(f"table-{t.key}", _heading(t), _short(t.title), _table(t))
        for t in experiment.tables
    ]
    for picture in experiment.figures:
        drawn = _drawn(picture)
        title = escape(picture.title)
        name = f"section-{picture.key}"
        parts.append(Section(name, title, _short(picture.title), place(drawn), (drawn,)))
    return parts


def _short(title: str) -> str:
    """Title for the row of links: up to its first aside."""
    return escape(re.split(r"[(:;,] ?", title, maxsplit=1)[0].strip())


def _heading(shown: Table) -> str:
    return escape(f"{shown.title}, {shown.unit}" if shown.unit else shown.title)


def _table(shown: Table) -> str:
    rows = []
    for row, mean, spread in zip(shown.rows, shown.mean, shown.spread, strict=True):
        cells = [_cell(m, s, shown.digits) for m, s in zip(mean, spread, strict=True)]
        rows.append([escape(row), *cells])
        if row in shown.printed:
            printed = [number(v, shown.digits) for v in shown.printed[row]]
            rows.append([_aside("printed in the paper"), *map(_aside, printed)])
    note = f'<p class="note">{escape(shown.note)}</p>' if shown.note else ""
    names = [escape(shown.of), *(f"{escape(column)}#" for column in shown.columns)]
    return table(names, rows, kind="experiment") + note


def _cell(mean: float, spread: float, digits: int) -> str:
    return number(mean, digits) + (
        " " + _aside(f"± {number(spread, digits)}") if np.isfinite(spread) else ""
    )


def _aside(text: str) -> str:
    return f"<small>{text}</small>"


def _drawn(picture: Picture) -> Figure:
    """One Plotly figure with a pair of axes per panel."""
    columns = min(picture.columns, len(picture.panels))
    rows = -(-len(picture.panels) // columns)
    height = rows * _PANEL + (rows - 1) * _GAP + 60.0
    named = colours_of(picture)
    data: list[dict[str, Any]] = []
    axes: dict[str, Any] = {}
    titles: list[dict[str, Any]] = []
    for i, panel in zip(count(1), picture.panels, strict=False):
        row, column = divmod(i - 1, columns)
        low_x, high_x = _share(column, columns, 0.07)
        low_y, high_y = _share(rows - 1 - row, rows, _GAP / height)
        name = str(i) if i > 1 else ""
        axes[f"xaxis{name}"] = _x_axis(panel, [low_x, high_x], name)
        axes[f"yaxis{name}"] = _y_axis(panel, [low_y, high_y], name)
        titles.append(_title(panel.title, low_x, high_y))
        where = {"xaxis": f"x{name}", "yaxis": f"y{name}"}
        data += [_line(trace, named) | where for trace in panel.traces]
    return {
        "id": picture.key,
        "label": picture.title,
        "data": data,
        "layout": layout(annotations=titles, **axes)
        | {"margin": {"l": 62, "r": 14, "t": 30, "b": 48, "pad": 0}},
        "height": height,
        "outside": 0,
        "what": "values",
        "note": "",
    }


def _share(place_: int, places: int, gap: float) -> tuple[float, float]:
    """Where one of several equal parts with gaps between them lies in 0 … 1."""
    width = (1.0 - gap * (places - 1)) / places
    low = place_ * (width + gap)
    return low, min(low + width, 1.0)


def _x_axis(panel: Panel, domain: list[float], name: str) -> dict[str, Any]:
    more: dict[str, Any] = {"domain": domain, "anchor": f"y{name}"}
    if panel.x_names:
        places = list(range(len(panel.x_names)))
        more |= {"tickvals": places, "ticktext": [escape(each) for each in panel.x_names]}
        more |= {"tickangle": -30}
    return axis(panel.x_label, **more)


def _y_axis(panel: Panel, domain: list[float], name: str) -> dict[str, Any]:
    more: dict[str, Any] = {"domain": domain, "anchor": f"x{name}"}
    if panel.log_y:
        more["type"] = "log"
    if panel.y_range is not None:
        more["range"] = (
            [float(v) for v in np.log10(panel.y_range)] if panel.log_y else list(panel.y_range)
        )
    if panel.equal:
        more |= {"scaleanchor": f"x{name}", "scaleratio": 1.0}
    return axis(panel.y_label, **more)


def _title(text: str, x: float, y: float) -> dict[str, Any]:
    return {
        "text": escape(text), "x": x, "y": y, "xref": "paper", "yref": "paper",
        "xanchor": "left", "yanchor": "bottom", "showarrow": False,
        "font": {"size": 13, "color": INK},
    }  # fmt: skip


def _line(trace: Trace, named: dict[str, tuple[str, str]]) -> dict[str, Any]:
    shape: dict[str, Any] = {"type": "scatter", "name": trace.name, "x": trace.x, "y": trace.y}
    match trace.kind:
        case "truth":
            return shape | {"mode": "lines", "line": {"color": INK, "width": 1.4}}
        case "raw":
            marker = {"symbol": "circle", "size": 3.5, "color": FRAME}
            return shape | {"mode": "markers", "marker": marker}
        case "bad":
            line = {"width": 1.4, "color": MUTED}
            marker = {"symbol": "x-thin", "size": 6, "color": MUTED, "line": line}
            return shape | {"mode": "markers", "marker": marker}
    colour, dash = named[trace.name]
    line = {"color": colour, "width": 1.6} | ({"dash": dash} if dash != "solid" else {})
    if trace.kind == "points":
        return shape | {
            "mode": "lines+markers",
            "line": line,
            "marker": {"symbol": "circle", "size": 6, "color": colour},
        }
    return shape | {"mode": "lines", "line": line, "connectgaps": False}
