"""Which fixes are drawn, and the traces that draw them: one per verdict, none rejected left out."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surefix.reasons import CALENDAR_FROM, texts
from surefix.report.style import MARKS
from surefix.report.thin import extremes
from surefix.types import Cleaned, FloatArray, IntArray, Verdict, Verdicts

__all__ = [
    "DOUBTED",
    "SURE",
    "Clock",
    "Drawn",
    "chosen",
    "clock_of",
    "drawn",
    "fix_marks",
    "hover",
    "note",
    "rows_of",
    "traces",
]

SURE: Final = (Verdict.USED, Verdict.DOWNWEIGHTED)
DOUBTED: Final = (Verdict.REJECTED, Verdict.EDITED)

_LIMITS: Final = {
    Verdict.USED: 3_000,
    Verdict.DOWNWEIGHTED: 2_000,
    Verdict.REJECTED: 20_000,
    Verdict.EDITED: 20_000,
}


class Clock(NamedTuple):
    """How times are shown, calendar in UTC or seconds, and from when to when, s."""

    calendar: bool
    start: float = float("nan")
    end: float = float("nan")

    @property
    def title(self) -> str:
        """Title of a time axis."""
        return "Time, UTC" if self.calendar else "Time, s"

    @property
    def hover(self) -> str:
        """Plotly template of a time in ``customdata``."""
        return "%{customdata}" if self.calendar else "%{customdata:.2f} s"

    def values(self, time: FloatArray) -> NDArray[Any]:
        """Values on a time axis, (n,): datetime64 or s; never infinite."""
        if not self.calendar:
            return np.where(np.isfinite(time), time, np.nan)
        known = np.isfinite(time) & (np.abs(time) < 1e11)
        ticks = np.round(np.where(known, time, 0.0) * 1e3).astype("datetime64[ms]")
        return np.where(known, ticks, np.datetime64("NaT", "ms"))

    @property
    def range(self) -> list[str | float] | None:
        """Range of a time axis, or None where it has no length."""
        pad = 0.012 * (self.end - self.start)
        return [self.place(self.start - pad), self.place(self.end + pad)] if pad > 0.0 else None

    def place(self, time: float) -> str | float:
        """One value on a time axis, for Plotly's shapes."""
        return str(self.values(np.array([time]))[0]) if self.calendar else time


def clock_of(*times: FloatArray) -> Clock:
    """Tell calendar times from seconds by their size.

    >>> clock_of(np.array([1.7e9])).title, clock_of(np.array([0.0, 60.0])).title
    ('Time, UTC', 'Time, s')
    """
    every = np.concatenate([np.zeros(0), *times])
    finite = every[np.isfinite(every)]
    if finite.size == 0:
        return Clock(False)
    calendar = float(np.median(np.abs(finite))) >= CALENDAR_FROM
    return Clock(calendar, float(finite.min()), float(finite.max()))


class Drawn(NamedTuple):
    """The fixes of one verdict: rows that are drawn, and how many there are."""

    verdict: Verdict
    rows: IntArray
    total: int


def drawn(values: FloatArray, verdicts: Verdicts) -> tuple[Drawn, ...]:
    """Choose the rows to draw, per verdict, drawn from the least to the most remarkable.

    Every figure of one series asks with the same values, and so shows the same rows.

    Parameters
    ----------
    values
        (n, k) what is drawn; rows without any number are left out.
    verdicts
        (n,) verdicts.
    """
    present = np.isfinite(values).any(axis=1)
    columns = np.column_stack((values, verdicts.innovation_sigma))
    groups = []
    for verdict, limit in _LIMITS.items():
        rows = np.flatnonzero((verdicts.verdict == verdict) & present)
        groups.append(Drawn(verdict, rows[extremes(columns[rows], limit)], rows.size))
    return tuple(groups)


def rows_of(groups: Sequence[Drawn], *verdicts: Verdict) -> IntArray:
    """Rows drawn for some of the verdicts."""
    empty = np.zeros(0, dtype=np.int64)
    return np.concatenate([empty, *(group.rows for group in groups if group.verdict in verdicts)])


def note(groups: Sequence[Drawn], what: str = "fixes") -> str:
    """Say what was left undrawn; empty where everything is drawn."""
    thinned = [group for group in groups if group.rows.size < group.total]
    said = [
        f"{group.rows.size:,} of {group.total:,} {MARKS[group.verdict].name}" for group in thinned
    ]
    if not said:
        return ""
    whole = any(g.verdict == Verdict.REJECTED and g.total for g in groups if g not in thinned)
    return f"Drawn are {' and '.join(said)} {what}, the extremes of equal spans" + (
        "; every rejected one is drawn." if whole else "."
    )


def chosen(verdicts: Verdicts, rows: IntArray) -> Verdicts:
    """Keep the verdicts of some rows."""
    return Verdicts(
        verdicts.verdict[rows],
        verdicts.weight[rows],
        verdicts.innovation_sigma[rows],
        verdicts.standardised[rows],
        verdicts.reason[rows],
        verdicts.detail[rows],
        verdicts.offset[rows],
    )


def fix_marks(cleaned: Cleaned) -> list[str]:
    """Name each fix by its sensor and its number in the input, (n,) escaped."""
    names = [html.escape(name) for name in cleaned.sensors]
    return [
        f"{names[sensor]}, row {row}"
        for sensor, row in zip(cleaned.sensor.tolist(), cleaned.row.tolist(), strict=True)
    ]


def hover(verdicts: Verdicts, rows: IntArray, called: str | Sequence[str]) -> NDArray[np.str_]:
    """One text per drawn value: what it is, its verdict and why.

    Parameters
    ----------
    called
        What each value is called, escaped: one text for all, or (n,).
    """
    lines = [
        f"{called if isinstance(called, str) else called[row]}"
        f"<br><b>{MARKS[Verdict(verdicts.verdict[row])].name}</b>: {html.escape(why)}"
        for row, why in zip(rows.tolist(), texts(chosen(verdicts, rows)), strict=True)
    ]
    return np.array(lines, dtype=np.str_)


def traces(
    groups: Sequence[Drawn],
    x: NDArray[Any],
    y: FloatArray,
    *,
    template: str,
    labels: dict[Verdict, NDArray[np.str_]],
    time: NDArray[Any],
    **more: Any,
) -> list[dict[str, Any]]:
    """Scatter traces, one per verdict that occurs.

    Parameters
    ----------
    x, y
        (n,) coordinates of every row.
    template
        Plotly's hover template; ``%{text}`` is the label, ``%{customdata}`` the time.
    labels
        Texts of the drawn rows by verdict.
    time
        (n,) as it is shown.
    more
        Plotly's own settings, such as the axes.
    """
    crowd = sum(group.rows.size for group in groups)
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": MARKS[group.verdict].name,
            "x": x[group.rows],
            "y": y[group.rows],
            "marker": MARKS[group.verdict].style(
                _scale(crowd if group.verdict in SURE else group.rows.size)
            ),
            "text": labels[group.verdict],
            "customdata": time[group.rows],
            "hovertemplate": template + "<extra></extra>",
        }
        | more
        for group in groups
        if group.rows.size
    ]


def _scale(crowd: int) -> float:
    """Marks shrink where there are many of them."""
    return 1.0 if crowd < 1_500 else 0.8 if crowd < 4_000 else 0.65
