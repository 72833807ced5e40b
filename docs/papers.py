"""Draw the pictures of docs/papers: each figure of each paper's experiment as one SVG file.

Run ``python docs/papers.py [PAPER …]``. All data are simulated from seed 1, one run. With the name
``compare`` it draws those of docs/compare.md: every scenario, which takes some minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from surefix.comparison.options import CompareOptions
from surefix.comparison.run import compare
from surefix.experiment import Experiment, Figure, Panel, Trace
from surefix.papers.reproduce import PAPERS, reproduce
from surefix.report.experiment import colours_of

__all__ = ["draw", "write"]

PLACE = Path(__file__).parent / "papers"
INK, GREY, MUTED = "#1c2733", "#b4bec7", "#5c6a78"
PANEL = (5.2, 2.6)  # inches
NARROW = 3.6  # inches, width of a panel where three or more stand side by side
STYLE = {
    "svg.hashsalt": "surefix",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.edgecolor": "#c3ccd4",
    "axes.labelcolor": MUTED,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "grid.color": "#e9edf0",
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "path.simplify": True,
    "path.simplify_threshold": 0.6,
}


def draw(figure: Figure) -> Canvas:
    """Draw one figure: panels in a grid and one legend below them."""
    columns = min(figure.columns, len(figure.panels))
    rows = -(-len(figure.panels) // columns)
    width = (PANEL[0] if columns < 3 else NARROW) * columns
    canvas = Canvas(figsize=(width, PANEL[1] * rows), layout="constrained")
    grid = np.ravel(canvas.subplots(rows, columns, squeeze=False))
    named = colours_of(figure)
    entries = {}
    for axes, panel in zip(grid, figure.panels, strict=False):
        for trace in panel.traces:
            entries.setdefault(trace.name, _line(axes, trace, named))
        _dress(axes, panel)
    for axes in grid[len(figure.panels) :]:
        axes.set_visible(False)
    _legend(canvas, entries)
    return canvas


def _legend(canvas: Canvas, entries: dict[str, Artist]) -> None:
    """One legend below the panels, in as few rows as the width allows."""
    for columns in range(len(entries), 0, -1):
        legend = canvas.legend(
            entries.values(),
            entries.keys(),
            loc="outside lower center",
            ncols=columns,
            frameon=False,
        )
        if legend.get_window_extent().width < 0.96 * canvas.bbox.width or columns == 1:
            canvas.set_figheight(canvas.get_figheight() + 0.3 + 0.18 * -(-len(entries) // columns))
            return
        legend.remove()


def write(paper: str) -> list[Path]:
    """Write the pictures of one paper, or of the comparison, and give their places."""
    written = []
    place = PLACE.parent if paper == "compare" else PLACE
    place.mkdir(exist_ok=True)
    with mpl.rc_context(STYLE):
        for figure in _experiment(paper).figures:
            written.append(place / f"{paper}-{figure.key}.svg")
            draw(figure).savefig(written[-1], metadata={"Date": None, "Creator": None})
    return written


def _experiment(paper: str) -> Experiment:
    if paper == "compare":
        return compare(CompareOptions(runs=1, modes=("offline", "realtime"), jobs=2))
    return reproduce(paper, seed=1, runs=1)


def _dress(axes: Axes, panel: Panel) -> None:
    axes.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
    axes.set_axisbelow(True)
    if panel.x_names:
        axes.set_xticks(range(len(panel.x_names)), panel.x_names, rotation=30, ha="right")
    if panel.log_y:
        axes.set_yscale("log")
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if panel.equal:
        axes.set_aspect("equal", adjustable="datalim")


def _line(axes: Axes, trace: Trace, named: dict[str, tuple[str, str]]) -> Artist:
    """Draw one trace; gives its entry of the legend."""
    style: dict[str, object]
    match trace.kind:
        case "truth":
            style = {"color": INK, "lw": 1.2}
        case "raw":
            style = {"color": GREY, "ls": "", "marker": ".", "ms": 3}
        case "bad":
            style = {"color": MUTED, "ls": "", "marker": "x", "ms": 4}
        case _:
            colour, dash = named[trace.name]
            ls = {"solid": "-", "dash": "--", "dot": ":"}[dash]
            style = {"color": colour, "lw": 1.3, "ls": ls}
            style |= {"marker": "o", "ms": 3.5} if trace.kind == "points" else {}
    return axes.plot(trace.x, trace.y, **style)[0]


if __name__ == "__main__":
    for name in sys.argv[1:] or PAPERS:
        for path in write(name):
            print(path)
