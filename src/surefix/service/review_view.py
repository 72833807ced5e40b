"""What the review page draws: the figures of the report, with more on them.

Marks carry the rows they are of, so that a click says which fix is meant. Of a long log a part is
drawn, and a part of the part once that is zoomed into.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from surefix.pipelines.summary import summary
from surefix.reasons import clock, texts
from surefix.report.headline import counts
from surefix.report.marks import Clock, clock_of, drawn
from surefix.report.plan import plan
from surefix.report.series import axis_series
from surefix.report.stack import stack, stacked
from surefix.report.style import INK, MARKS, Figure
from surefix.report.thin import breaks, extremes, gapped, pieces
from surefix.service.review import Run, pairs
from surefix.service.review_choice import PANELS, drawn_up
from surefix.types import BoolArray, Cleaned, FloatArray, IntArray, Track, Verdict, Verdicts

__all__ = ["Window", "compared", "figure", "outlined", "places", "said", "told"]

_OUTLINED: Final = 3_000  # marks
_LINE: Final = 4_000
_REJECTED: Final = 3_000  # marks
_CROWD: Final = 300  # marks, from which they are small
_BEFORE: Final = {"color": INK, "width": 1.4, "dash": "dot"}


class Window(NamedTuple):
    """The part that is looked at: from and to along x and y of the plan, m, and in time, s."""

    x: tuple[float, float] = (-np.inf, np.inf)
    y: tuple[float, float] = (-np.inf, np.inf)
    time: tuple[float, float] = (-np.inf, np.inf)

    def holds(self, cleaned: Cleaned) -> BoolArray:
        """Rows whose fix or track lies in it."""
        out = np.ones(len(cleaned.track.time), np.bool_)
        if np.isfinite(self.time).any():
            out &= _between(cleaned.track.time, self.time)
        if np.isfinite((*self.x, *self.y)).any():
            flat = [
                _between(place[:, 0], self.x) & _between(place[:, 1], self.y)
                for place in (cleaned.raw_position, cleaned.track.position)
            ]
            out &= flat[0] | flat[1]
        return out


def _between(values: FloatArray, ends: tuple[float, float]) -> BoolArray:
    return np.asarray((values >= ends[0]) & (values <= ends[1]))


def figure(
    run: Run, of: str, waiting: IntArray, before: Run | None, window: Window
) -> Figure | None:
    """Draw a run: its plan view or its strips.

    Parameters
    ----------
    run
        What is shown.
    of
        ``plan`` or ``strips``.
    waiting
        Rows whose edits wait for the next run.
    before
        A run to compare with, or None.
    window
        What is looked at.

    Returns
    -------
    figure
        With ``rows``, per trace the rows of its marks or None, and ``panels``, which of `PANELS`
        its y axes are. None where there is nothing to draw.
    """
    seen = np.flatnonzero(window.holds(run.shown))
    rows = _fewer(run.shown, seen)
    some = _part(run.shown, rows)
    clock = clock_of(run.shown.track.time)
    older = _older(run, before, rows) if before is not None else None
    found = (_plan if of == "plan" else _strips)(some, clock, older)
    if found is None:
        return None
    groups = {g.verdict: rows[g.rows] for g in drawn(some.raw_position, some.verdicts)}
    named = {MARKS[verdict].name: mine for verdict, mine in groups.items()}
    found["rows"] = [named.get(trace.get("name", "")) for trace in found["data"]]
    found["note"] = _note(groups, run.shown, seen)
    changed = waiting[window.holds(run.shown)[waiting]]
    changed = changed[:: max(1, -(-len(changed) // _OUTLINED))]
    for i, panel in enumerate(found["panels"]):
        found["data"].append(_ring(*places(run.shown, panel, changed, clock), i))
        found["rows"].append(None)
    return found


def _fewer(cleaned: Cleaned, rows: IntArray) -> IntArray:
    """Rows without most of the rejected ones, where these are too many to be drawn smoothly."""
    wrong = rows[cleaned.verdicts.verdict[rows] == Verdict.REJECTED]
    columns = np.column_stack(
        [cleaned.raw_position[wrong], cleaned.verdicts.innovation_sigma[wrong]]
    )
    return np.setdiff1d(rows, np.delete(wrong, extremes(columns, _REJECTED)), assume_unique=True)


def _note(groups: dict[Verdict, IntArray], cleaned: Cleaned, rows: IntArray) -> str:
    """Say what of the window is not drawn; empty where everything is."""
    known = np.isfinite(cleaned.raw_position[rows]).any(axis=1)
    verdicts = cleaned.verdicts.verdict[rows][known]
    totals = {verdict: int((verdicts == verdict).sum()) for verdict in groups}
    parts = [
        f"{len(mine):,} of {totals[verdict]:,} {MARKS[verdict].name}"
        for verdict, mine in groups.items()
        if len(mine) < totals[verdict]
    ]
    said = f"Drawn are {' and '.join(parts)} fixes, those that stand out: zoom in to see more. "
    return said + "A box or a line around fixes means all of them." if parts else ""


class _Older(NamedTuple):
    """An earlier run at the fixes of this one: time, position (n, 3), and how far apart, m."""

    time: FloatArray
    position: FloatArray
    apart: FloatArray


def _older(run: Run, before: Run, rows: IntArray) -> _Older:
    mine, theirs = pairs(run, before)
    kept = np.isin(mine, rows)
    now, then = run.shown.track, before.shown.track
    place = then.position[theirs[kept]]
    apart = np.linalg.norm(np.nan_to_num(now.position[mine[kept]] - place), axis=1)
    return _Older(now.time[mine[kept]], place, apart)


def _plan(some: Cleaned, clock: Clock, older: _Older | None) -> Figure | None:
    found = plan(some, clock)
    if found is None:
        return None
    if older is not None:
        east, north = older.position[:, 0], older.position[:, 1]
        found["data"].insert(0, _line("before", east, north, older.time))  # under all else
    return found | {"panels": ["plan"]}


def _strips(some: Cleaned, clock: Clock, older: _Older | None) -> Figure | None:
    panels = axis_series(some)
    if not panels:
        return None
    found = stacked("strips", "Position over time", panels, clock, some.events)
    seen = np.isfinite(some.raw_position)
    names = [name for i, name in enumerate(PANELS[1:]) if seen[:, i].any()]
    if older is not None:
        found = _with_difference(found, [panel.title for panel in panels], clock)
        time = clock.values(older.time)
        for i, name in enumerate(names):
            values = drawn_up(some, name, older.position)
            found["data"].insert(0, _line("before", time, values, older.time) | _axis(i))
        apart = _line("difference", time, older.apart, older.time) | _axis(len(names))
        found["data"].append(apart | {"line": {"color": INK, "width": 1.4}})
    return found | {"panels": names}


def _with_difference(strips: Figure, titles: list[str], clock: Clock) -> Figure:
    """Strips with room below for how far two tracks are apart."""
    panels = [*((title, 180.0) for title in titles), ("Difference, m", 110.0)]
    found = stack("strips", strips["label"], panels, clock, strips["data"])
    for i in range(len(titles)):
        axis = f"yaxis{i + 1 if i else ''}"
        found["layout"][axis]["range"] = strips["layout"][axis]["range"]
    found["layout"][f"yaxis{len(panels)}"]["rangemode"] = "tozero"
    found["layout"]["shapes"] += strips["layout"]["shapes"][len(titles) :]  # events, behind frames
    return strips | {"layout": found["layout"], "height": found["height"]}


def _axis(index: int) -> dict[str, str]:
    return {"xaxis": "x", "yaxis": f"y{index + 1}" if index else "y"}


def _ring(x: Any, y: FloatArray, index: int) -> dict[str, Any]:
    """Rings around fixes whose edits wait for the next run."""
    line = {"width": 2 if len(y) < _CROWD else 1, "color": MARKS[Verdict.EDITED].colour}
    return _axis(index) | {
        "type": "scatter",
        "mode": "markers",
        "name": "waits for a run",
        "x": x,
        "y": y,
        "marker": {
            "symbol": "diamond-open",
            "size": 12 if len(y) < _CROWD else 7,
            "color": line["color"],
            "line": line,
        },
        "hoverinfo": "skip",
    }


def _line(name: str, x: Any, y: FloatArray, time: FloatArray) -> dict[str, Any]:
    """The track of an earlier run, dotted."""
    flat = np.column_stack([y, y if np.asarray(x).dtype.kind == "M" else x])
    rows = gapped(pieces(extremes(flat, _LINE), breaks(time), np.isfinite(flat).all(axis=1)))
    missing = np.datetime64("NaT", "ms") if np.asarray(x).dtype.kind == "M" else np.nan
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": np.append(x, missing)[rows],
        "y": np.append(y, np.nan)[rows],
        "line": _BEFORE,
        "connectgaps": False,
        "hoverinfo": "skip",
    }


def outlined(cleaned: Cleaned, rows: IntArray) -> dict[str, Any]:
    """Where chosen fixes are, for rings around them: by panel, and the time; at most 3,000."""
    some = rows[:: max(1, -(-len(rows) // _OUTLINED))]
    clock = clock_of(cleaned.track.time)
    ups = {panel: places(cleaned, panel, some, clock)[1] for panel in PANELS[1:]}
    return {"time": clock.values(cleaned.track.time[some]), **ups}


def places(cleaned: Cleaned, panel: str, rows: IntArray, clock: Clock) -> tuple[Any, FloatArray]:
    """Where fixes are on a panel: along and up."""
    up = drawn_up(cleaned, panel, cleaned.raw_position[rows])
    if panel == "plan":
        return cleaned.raw_position[rows, 0], up
    return clock.values(cleaned.track.time[rows]), up


def said(cleaned: Cleaned, row: int) -> str:
    """One fix in words: which it is, and what was done with it and why."""
    here = np.array([row])
    part = _part(cleaned, here)
    name, number = cleaned.sensors[part.sensor[0]], part.row[0]
    verdict = MARKS[Verdict(part.verdicts.verdict[0])].name
    return (
        f"{name}, row {number}, {clock(part.track.time[0])}: {verdict}, {texts(part.verdicts)[0]}"
    )


def told(run: Run) -> dict[str, Any]:
    """The figures of a run: those of `surefix clean --json` that a page shows."""
    found = summary(run.shown, counts(run.shown.verdicts))
    return {key: found[key] for key in ("verdicts", "distance_m", "speed_mps", "two_sigma_m")}


def compared(run: Run, before: Run) -> dict[str, Any]:
    """Figures of an earlier run, and how far its track is from that of this one, m."""
    apart = _older(run, before, np.arange(len(run.shown.track.time))).apart
    rms = float(np.sqrt(np.mean(apart**2))) if len(apart) else None
    return told(before) | {"rms_m": rms, "most_m": float(apart.max()) if len(apart) else None}


def _part(cleaned: Cleaned, rows: IntArray) -> Cleaned:
    """Some rows of a result."""
    if len(rows) == len(cleaned.track.time):
        return cleaned
    return replace(
        cleaned,
        track=Track._make(None if c is None else c[rows] for c in cleaned.track),
        verdicts=Verdicts._make(column[rows] for column in cleaned.verdicts),
        raw_position=cleaned.raw_position[rows],
        raw_coordinates=cleaned.raw_coordinates[rows],
        sensor=cleaned.sensor[rows],
        row=cleaned.row[rows],
    )
