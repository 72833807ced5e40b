"""Colours, marks and the layout every figure shares.

The colours are those of Okabe and Ito (*Color universal design*, 2008), told apart by people of any
colour vision; marks differ by shape as well, so that a grey print still tells them apart.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from surefix.types import Verdict

__all__ = [
    "BAND",
    "CLEAN",
    "FONT",
    "FRAME",
    "INK",
    "MARKS",
    "MUTED",
    "Figure",
    "Mark",
    "axis",
    "layout",
]

Figure = dict[str, Any]
"""A figure as plain data: ``id, data, layout`` for Plotly; ``height, note …`` for the page."""

CLEAN: Final = "#0072B2"
BAND: Final = "rgba(0,114,178,0.20)"
INK: Final = "#1c2733"
MUTED: Final = "#5c6a78"
FRAME: Final = "#c3ccd4"
FONT: Final = "Inter, 'Source Sans 3', 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"


class Mark(NamedTuple):
    """How the fixes of one verdict are drawn."""

    name: str
    colour: str
    symbol: str
    size: float

    def style(self, scale: float = 1.0) -> dict[str, Any]:
        """Plotly's marker record."""
        line = {"width": 1.6 if self.symbol.endswith("open") or self.symbol[0] == "x" else 0.0}
        return {
            "color": self.colour,
            "symbol": self.symbol,
            "size": self.size * scale,
            "line": line | {"color": self.colour},
        }


MARKS: Final = {
    Verdict.USED: Mark("used", "#8b98a5", "circle", 4.0),
    Verdict.DOWNWEIGHTED: Mark("down-weighted", "#E69F00", "triangle-up", 6.5),
    Verdict.REJECTED: Mark("rejected", "#D55E00", "x-thin", 7.0),
    Verdict.EDITED: Mark("decided by the user", "#CC79A7", "diamond", 8.0),
    Verdict.DUPLICATE: Mark("duplicate", "#56B4E9", "square-open", 6.0),
    Verdict.MISSING: Mark("missing", "#cfd6dc", "circle-open", 6.0),
}


def axis(title: str, **more: Any) -> dict[str, Any]:
    """One axis: a thin frame, light grid, ticks outside.

    Parameters
    ----------
    title
        Quantity and unit.
    more
        Plotly's own settings for this axis.
    """
    return {
        "title": {"text": title, "standoff": 8, "font": {"size": 12, "color": MUTED}},
        "gridcolor": "#e9edf0",
        "zeroline": False,
        "showline": True,
        "mirror": True,
        "linecolor": FRAME,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": FRAME,
        "tickfont": {"size": 11, "color": MUTED},
        "automargin": True,
    } | more


def layout(**more: Any) -> dict[str, Any]:
    """Settings of a whole figure; ``more`` are the axes and whatever else it needs."""
    return {
        "font": {"family": FONT, "size": 12, "color": INK},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "margin": {"l": 62, "r": 14, "t": 12, "b": 48, "pad": 0},
        "showlegend": False,
        "hovermode": "closest",
        "hoverlabel": {
            "bgcolor": "#ffffff",
            "bordercolor": FRAME,
            "font": {"family": FONT, "size": 12, "color": INK},
            "align": "left",
        },
        "dragmode": "zoom",
    } | more
