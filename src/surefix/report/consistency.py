"""Do the innovations behave as the filter believes? Over time, as a histogram and as a Q–Q plot."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from scipy.stats import norm

from surefix.report.marks import Clock, drawn, hover, rows_of, traces
from surefix.report.series import Series
from surefix.report.stack import stack
from surefix.report.style import INK, MARKS, Figure, axis, layout
from surefix.types import FloatArray, Verdict, Verdicts

__all__ = ["histogram", "innovations", "quantiles"]

_FLOOR = 0.05  # σ; smaller innovations are drawn here, for the logarithmic axis
_EDGE = 6.0  # σ; the outermost bars hold what lies beyond
_WIDTH = 0.25
_AXES: Final = (
    ("east", "#0072B2", "circle-open"),
    ("north", "#009E73", "square-open"),
    ("vertical", "#CC79A7", "diamond-open"),
)


def innovations(name: str, panel: Series, clock: Clock) -> Figure | None:
    """Size of the innovations in σ, logarithmic, and the weights; None without innovations."""
    verdicts = panel.verdicts
    sigma = np.where(np.isfinite(verdicts.innovation_sigma), verdicts.innovation_sigma, np.nan)
    if not np.isfinite(sigma).any():
        return None
    size = np.maximum(sigma, _FLOOR)
    groups = drawn(panel.basis, verdicts)
    labels = {g.verdict: hover(verdicts, g.rows, panel.marks) for g in groups}
    time = clock.values(panel.time)
    common: dict[str, Any] = {"labels": labels, "time": time}
    start = f"{clock.hover}<br>%{{text}}<br>"
    data = traces(groups, time, size, template=start + "%{y:.2f} σ", **common) + traces(
        groups, time, verdicts.weight, template=start + "weight %{y:.2f}", yaxis="y2", **common
    )
    figure = stack(
        name,
        "Innovations and weights over time",
        [("Innovation, σ", 230.0), ("Weight", 130.0)],
        clock,
        data,
    )
    top = float(np.log10(max(5.0, np.nanmax(size[rows_of(groups, *MARKS)], initial=1.0)))) + 0.1
    figure["layout"]["yaxis"] |= {
        "type": "log",
        "range": [float(np.log10(_FLOOR)) - 0.05, top],
        "tickmode": "array",
        "tickvals": [0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000, 1e4, 1e5, 1e6],
        "ticktext": [
            "0.1",
            "0.3",
            "1",
            "3",
            "10",
            "30",
            "100",
            "300",
            "1,000",
            "10⁴",
            "10⁵",
            "10⁶",
        ],
    }
    figure["layout"]["yaxis2"] |= {"range": [-0.06, 1.06], "tickvals": [0, 0.5, 1]}
    return figure


def histogram(name: str, verdicts: Verdicts) -> Figure | None:
    """Standardised innovations of all axes against the normal curve."""
    edges = np.arange(-_EDGE, _EDGE + 0.5 * _WIDTH, _WIDTH)
    centres = 0.5 * (edges[1:] + edges[:-1])
    believed = _values(verdicts, Verdict.USED, Verdict.DOWNWEIGHTED, Verdict.EDITED)
    rejected = _values(verdicts, Verdict.REJECTED)
    if believed.size + rejected.size == 0:
        return None
    bars = [
        {
            "type": "bar",
            "name": label,
            "x": centres,
            "y": np.histogram(np.clip(values, -_EDGE + 1e-6, _EDGE - 1e-6), edges)[0].astype(float),
            "marker": {"color": colour, "pattern": {"shape": shape, "size": 5, "solidity": 0.4}},
            "hovertemplate": "%{y} between %{x:.2f} ± 0.125 σ<extra></extra>",
        }
        for label, values, colour, shape in (
            ("used or down-weighted", believed, MARKS[Verdict.USED].colour, ""),
            ("rejected", rejected, MARKS[Verdict.REJECTED].colour, "/"),
        )
        if values.size
    ]
    fine = np.linspace(-_EDGE, _EDGE, 121)
    curve = {
        "type": "scatter",
        "mode": "lines",
        "name": "normal",
        "x": fine,
        "y": believed.size * _WIDTH * norm.pdf(fine),
        "line": {"color": INK, "width": 1.5},
        "hoverinfo": "skip",
    }
    return {
        "id": name,
        "label": "Histogram of the standardised innovations",
        "data": [*bars, curve],
        "layout": layout(
            barmode="stack",
            bargap=0.08,
            xaxis=axis("Standardised innovation, σ", dtick=2),
            yaxis=axis("Count", rangemode="tozero", tickformat=",~r"),
        ),
        "height": 330.0,
        "outside": 0,
        "note": "The outermost bars hold everything beyond 6 σ.",
    }


def quantiles(name: str, verdicts: Verdicts) -> Figure | None:
    """Quantiles of the innovations that were believed against those of the normal law."""
    data: list[dict[str, Any]] = []
    reach = 3.0
    axes = verdicts.standardised.shape[1]
    for i, (label, colour, symbol) in enumerate(_AXES[:axes]):
        values = np.sort(_values(verdicts, Verdict.USED, Verdict.DOWNWEIGHTED, column=i))
        if values.size < 2:
            continue
        expected = norm.ppf((np.arange(values.size) + 0.5) / values.size)
        rows = np.searchsorted(expected, np.linspace(expected[0], expected[-1], 250))
        reach = max(reach, float(np.abs(values).max()), float(expected.max()))
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": label if axes > 1 else "innovations",
                "x": expected[rows],
                "y": values[rows],
                "marker": {"color": colour, "symbol": symbol, "size": 5, "line": {"width": 1.2}},
                "hovertemplate": "%{y:.2f} σ where a normal law has %{x:.2f} σ<extra></extra>",
            }
        )
    if not data:
        return None
    limit = [-1.05 * reach, 1.05 * reach]
    line = {
        "type": "scatter",
        "mode": "lines",
        "name": "normal",
        "x": limit,
        "y": limit,
        "line": {"color": INK, "width": 1.2, "dash": "dash"},
        "hoverinfo": "skip",
    }
    return {
        "id": name,
        "label": "Quantiles of the standardised innovations against the normal law",
        "data": [line, *data],
        "layout": layout(
            xaxis=axis("Normal quantile, σ", range=[-4.2, 4.2]),
            yaxis=axis("Innovation quantile, σ", range=limit),
        ),
        "height": 330.0,
        "outside": 0,
        "note": "",
    }


def _values(verdicts: Verdicts, *which: Verdict, column: int | None = None) -> FloatArray:
    """Finite standardised innovations of some verdicts, of one axis or of all."""
    rows = np.isin(verdicts.verdict, which)
    chosen = verdicts.standardised[rows] if column is None else verdicts.standardised[rows, column]
    return np.asarray(chosen[np.isfinite(chosen)])
