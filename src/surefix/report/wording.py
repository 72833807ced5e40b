"""Numbers, times and tables as HTML; every text that comes from data is escaped here."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime

from surefix.report.marks import Clock

__all__ = ["duration", "escape", "instant", "number", "share", "table"]

_NONE = "–"
_LONG = 300  # characters of one cell that are shown


def escape(text: str) -> str:
    """Text for HTML, in an element or an attribute; very long texts are cut.

    >>> escape("<script>")
    '&lt;script&gt;'
    """
    return html.escape(text if len(text) <= _LONG else text[:_LONG] + " …")


def number(value: float, digits: int = 2, unit: str = "") -> str:
    """Number with its unit, a dash where there is none.

    >>> number(1234.567, 1, "m"), number(float("nan"))
    ('1,234.6 m', '–')
    """
    if not math.isfinite(value):
        return _NONE
    text = f"{value:,.{digits}f}" if abs(value) < 1e9 else f"{value:.3g}"
    return f"{text} {unit}".rstrip()


def share(part: int, whole: int) -> str:
    """Per cent, never rounded to nothing or to all.

    >>> share(1, 3), share(1, 100_000), share(99_999, 100_000), share(0, 0)
    ('33.3 %', '< 0.1 %', '> 99.9 %', '0 %')
    """
    if not part:
        return "0 %"
    percent = 100.0 * part / whole
    if percent < 0.1:
        return "< 0.1 %"
    return "> 99.9 %" if 99.9 < percent < 100.0 else f"{percent:.1f} %".replace("100.0", "100")


def duration(seconds: float) -> str:
    """Length of time in its two largest units.

    >>> duration(2391.2), duration(51000.0), duration(12.34)
    ('39 min 51 s', '14 h 10 min', '12.3 s')
    """
    if not math.isfinite(seconds):
        return _NONE
    if seconds < 60.0:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    minutes = round(seconds / 60.0)
    if minutes < 48 * 60:
        return f"{minutes // 60} h {minutes % 60} min"
    hours = round(seconds / 3600.0)
    return f"{hours // 24} d {hours % 24} h"


def instant(time: float, clock: Clock) -> str:
    """Date and time in UTC, or seconds."""
    if not math.isfinite(time):
        return _NONE
    if not clock.calendar or not 0.0 <= time < 2.5e11:
        return f"{time:,.1f} s"
    tenths = round(time * 10.0)
    return f"{datetime.fromtimestamp(tenths // 10, UTC):%Y-%m-%d %H:%M:%S}.{tenths % 10}"


def table(names: Sequence[str], rows: Iterable[Sequence[str]], *, kind: str = "") -> str:
    """Write a table of cells that are HTML already.

    Parameters
    ----------
    names
        Headings; a trailing ``#`` marks a column of numbers, set to the right.
    kind
        Class of the table.
    """
    right = [name.endswith("#") for name in names]
    head = "".join(_cell("th", name.rstrip("#"), i) for name, i in zip(names, right, strict=True))
    body = "".join(
        f"<tr>{''.join(_cell('td', cell, i) for cell, i in zip(row, right, strict=True))}</tr>"
        for row in rows
    )
    named = f' class="{kind}"' if kind else ""
    return (
        f'<div class="scroll" tabindex="0"><table{named}><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _cell(tag: str, text: str, right: bool) -> str:
    return f'<{tag} class="n">{text}</{tag}>' if right else f"<{tag}>{text}</{tag}>"
