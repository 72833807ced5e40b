"""Plan view: raw against clean, in local metres with equal axes, north up."""

from __future__ import annotations

import numpy as np

from surefix.report.marks import (
    DOUBTED,
    SURE,
    Clock,
    drawn,
    fix_marks,
    hover,
    note,
    rows_of,
    traces,
)
from surefix.report.style import BAND, CLEAN, Figure, axis, layout
from surefix.report.thin import View, breaks, extremes, gapped, pieces, view
from surefix.types import BoolArray, Cleaned, FloatArray, IntArray

__all__ = ["plan", "swept"]

_LINE = 8_000
_BAND = 1_500
_CORNERS = 16


def plan(cleaned: Cleaned, clock: Clock) -> Figure | None:
    """Plan view, or None where no fix has both an east and a north coordinate."""
    raw, track = cleaned.raw_position, cleaned.track
    both = _known(raw[:, :2])
    if not both.any():
        return None
    shown = np.where(both[:, None], raw, np.nan)
    groups = drawn(raw, cleaned.verdicts)
    called = fix_marks(cleaned)
    labels = {g.verdict: hover(cleaned.verdicts, g.rows, called) for g in groups}
    time = clock.values(track.time)
    template = f"{clock.hover}<br>%{{text}}<br>east %{{x:.2f}} m, north %{{y:.2f}} m"
    marks = traces(groups, shown[:, 0], shown[:, 1], template=template, labels=labels, time=time)
    under = sum(group.rows.size > 0 for group in groups if group.verdict in SURE)
    data = [*marks[:under], _band(cleaned), *_line(cleaned, clock), *marks[under:]]
    sure, doubtful = rows_of(groups, *SURE), rows_of(groups, *DOUBTED)
    ranges = [
        view(np.concatenate((track.position[:, i], shown[sure, i])), shown[doubtful, i], least=2.0)
        for i in (0, 1)
    ]
    return {
        "id": "plan",
        "label": "Plan view of the raw fixes and the clean track",
        "data": data,
        "layout": layout(
            xaxis=axis("East, m", range=list(ranges[0]), tickformat=",~r"),
            yaxis=axis("North, m", range=list(ranges[1]), tickformat=",~r")
            | {"scaleanchor": "x", "scaleratio": 1.0},
        ),
        "aspect": (ranges[1].high - ranges[1].low) / (ranges[0].high - ranges[0].low),
        "plan": True,
        "what": "fixes",
        **_outside(shown[:, :2], np.concatenate((sure, doubtful)), ranges),
        "note": note(groups),
    }


def _outside(values: FloatArray, rows: IntArray, ranges: list[View]) -> dict[str, int]:
    """Count the drawn fixes that lie out of the first view."""
    inside = np.ones(rows.size, dtype=np.bool_)
    for column, limits in zip(values.T, ranges, strict=True):
        inside &= limits.holds(column[rows]) | np.isnan(column[rows])
    return {"outside": int((~inside).sum())}


def _line(cleaned: Cleaned, clock: Clock) -> list[Figure]:
    track = cleaned.track
    flat = track.position[:, :2]
    rows = extremes(flat, _LINE)
    runs = pieces(rows, breaks(track.time), _known(flat))
    line = gapped(runs)
    radius = 2.0 * track.sigma_position[:, :2].max(axis=1)
    east, north, time, radius = (
        np.append(column, np.nan) for column in (*flat.T, track.time, radius)
    )
    clean = {
        "type": "scatter",
        "mode": "lines",
        "name": "clean",
        "x": east[line],
        "y": north[line],
        "line": {"color": CLEAN, "width": 1.8},
        "connectgaps": False,
        "customdata": clock.values(time[line]),
        "text": np.array([f"{value:.2f}" for value in radius[line]], dtype=np.str_),
        "hovertemplate": f"{clock.hover}<br><b>clean</b>: ±%{{text}} m (2σ)"
        "<br>east %{x:.2f} m, north %{y:.2f} m<extra></extra>",
    }
    ends = [runs[0][0], runs[-1][-1]] if runs else []
    marker = {
        "type": "scatter",
        "mode": "markers+text",
        "name": "start, end",
        "x": flat[ends, 0],
        "y": flat[ends, 1],
        "text": ["start", "end"][: len(ends)],
        "textposition": "top center",
        "textfont": {"size": 11, "color": CLEAN, "shadow": "0 0 2px #fff, 0 0 4px #fff"},
        "marker": {
            "symbol": ["circle", "square"],
            "size": 9,
            "color": "#ffffff",
            "line": {"width": 2, "color": CLEAN},
        },
        "hoverinfo": "skip",
    }
    return [clean, marker]


def _known(flat: FloatArray) -> BoolArray:
    return np.isfinite(flat[:, 0]) & np.isfinite(flat[:, 1])


def _band(cleaned: Cleaned) -> Figure:
    track = cleaned.track
    known = _known(track.position[:, :2]) & _known(track.sigma_position[:, :2])
    rows = extremes(track.position[:, :2], _BAND)
    runs = pieces(rows, breaks(track.time), known)
    corners = [swept(track.position[run, :2], 2.0 * track.sigma_position[run, :2]) for run in runs]
    points = np.concatenate([np.zeros((0, 2)), *corners])
    return {
        "type": "scatter",
        "mode": "lines",
        "name": "2σ",
        "x": points[:, 0],
        "y": points[:, 1],
        "fill": "toself",
        "fillcolor": BAND,
        "line": {"width": 0, "color": CLEAN, "simplify": False},
        "hoverinfo": "skip",
    }


def swept(centre: FloatArray, radius: FloatArray) -> FloatArray:
    """Cover what an ellipse sweeps along a line: the convex hull of each pair of neighbours.

    The hull of two ellipses is read off its support: in each of 16 directions u the corner is the
    farther of the two points c + r²u/|ru|. Neighbouring hulls overlap and all turn the same way
    round, so that together they fill as one.

    Parameters
    ----------
    centre, radius
        (n, 2) m; half-axes along x and y.

    Returns
    -------
    points
        (m, 2) closed polygons, a row of NaN after each.
    """
    angle = 2.0 * np.pi * np.arange(_CORNERS + 1) / _CORNERS
    u = np.column_stack((np.cos(angle), np.sin(angle)))
    reach = radius[:, None, :] * u
    length = np.maximum(np.linalg.norm(reach, axis=2, keepdims=True), 1e-12)
    corner = centre[:, None, :] + radius[:, None, :] * reach / length
    far = (corner * u).sum(axis=2)
    one, two = (slice(None, -1), slice(1, None)) if len(centre) > 1 else (slice(None),) * 2
    hull = np.where((far[one] >= far[two])[:, :, None], corner[one], corner[two])
    gap = np.full((hull.shape[0], 1, 2), np.nan)
    return np.concatenate((hull, gap), axis=1).reshape(-1, 2)
