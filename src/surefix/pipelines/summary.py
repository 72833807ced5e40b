"""The result of a cleaning in a few figures, for machines and for the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from surefix.reasons import CALENDAR_FROM, clock
from surefix.report.headline import counts, headline
from surefix.types import Cleaned, Event, Verdict

__all__ = ["lines", "said", "span", "summary"]

_TOP_EVENTS = 8


def summary(
    cleaned: Cleaned, totals: Mapping[Verdict, int], written: Sequence[str] = ()
) -> dict[str, Any]:
    """Everything about a result but its rows, ready for JSON: figures that are unknown are null.

    Parameters
    ----------
    cleaned
        The result.
    totals
        How many fixes had each verdict.
    written
        Files that were written from it.
    """
    head = headline(cleaned)
    return {
        "surefix": version("surefix"),
        "inputs": list(cleaned.sources),
        "outputs": list(written),
        "fixes": sum(totals.values()),
        "verdicts": {verdict.name.lower(): total for verdict, total in totals.items()},
        "start": _known(head.start),
        "end": _known(head.end),
        "distance_m": _known(head.distance),
        "speed_mps": {
            "clean": {"median": _known(head.clean_speed[0]), "max": _known(head.clean_speed[1])},
            "raw": {"median": _known(head.raw_speed[0]), "max": _known(head.raw_speed[1])},
        },
        "two_sigma_m": {
            "horizontal": _known(head.sigma_horizontal),
            "vertical": _known(head.sigma_vertical),
        },
        "noise": [{**figure._asdict(), "value": _known(figure.value)} for figure in cleaned.noise],
        "channels": [
            {
                "name": channel.name,
                "sensor": channel.sensor,
                "values": len(channel.time),
                "verdicts": {v.name.lower(): n for v, n in counts(channel.verdicts).items()},
            }
            for channel in cleaned.channels
        ],
        "events": [
            {"kind": event.kind, "time": _known(event.time), "text": event.text}
            for event in cleaned.events
        ],
        "problems": [problem._asdict() for problem in cleaned.problems],
        "settings": dict(cleaned.settings),
    }


def lines(
    cleaned: Cleaned, totals: Mapping[Verdict, int], written: Sequence[str] = ()
) -> list[str]:
    """Say the same in a few lines of text."""
    head = headline(cleaned)
    out = [
        f"{', '.join(cleaned.sources)}: {sum(totals.values())} fixes{span(head.start, head.end)}"
    ]
    if head.fixes:
        out.append("  " + _verdicts(totals))
        out.append(
            f"  fastest step {_figure(head.raw_speed[1], 'm/s')} before, "
            f"clean track at most {_figure(head.clean_speed[1], 'm/s')}; "
            f"2σ horizontal {_figure(head.sigma_horizontal, 'm')}, "
            f"vertical {_figure(head.sigma_vertical, 'm')}"
        )
    for figure in cleaned.noise:
        out.append(
            f"  noise: {figure.sensor} {figure.quantity} {figure.value:.3g} {figure.unit} "
            f"({figure.source})"
        )
    for channel in cleaned.channels:
        out.append(f"  {channel.sensor} {channel.name}: {_verdicts(counts(channel.verdicts))}")
    out += [f"  note: {said(event)}" for event in cleaned.events[:_TOP_EVENTS]]
    if len(cleaned.events) > _TOP_EVENTS:
        out.append(
            f"  note: and {len(cleaned.events) - _TOP_EVENTS} more, in the report and --json"
        )
    for problem in cleaned.problems:
        remedy = f"; {problem.remedy}" if problem.remedy else ""
        out.append(f"  input: {problem.total} × {problem.kind} ({problem.example}){remedy}")
    out += [f"  wrote {path}" for path in written]
    return out


def _verdicts(totals: Mapping[Verdict, int]) -> str:
    return ", ".join(
        f"{total} {verdict.name.lower()}" for verdict, total in totals.items() if total
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _figure(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}" if math.isfinite(value) else "unknown"


def said(event: Event) -> str:
    """An event with the time of day it concerns, if it has one.

    >>> said(Event("gap", 1699643598.0, "no fix for 36.4 s"))
    '19:13:18.0 no fix for 36.4 s'
    """
    return f"{clock(event.time)} {event.text}" if math.isfinite(event.time) else event.text


def span(start: float, end: float) -> str:
    """Say from when to when, with a comma in front; nothing if it is not known."""
    if not (math.isfinite(start) and math.isfinite(end)):
        return ""
    if abs(start) < CALENDAR_FROM:
        return f", {start:.1f} … {end:.1f} s"
    first, last = (datetime.fromtimestamp(t, UTC) for t in (start, end))
    return f", {first:%Y-%m-%d %H:%M:%S} … {last:%Y-%m-%d %H:%M:%S} UTC"
