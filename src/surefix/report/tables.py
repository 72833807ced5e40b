"""The parts of the page that are words and tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surefix.reasons import texts
from surefix.report.headline import Headline, counts
from surefix.report.marks import Clock, chosen
from surefix.report.series import heading_of
from surefix.report.style import MARKS
from surefix.report.wording import duration, escape, instant, number, share, table
from surefix.types import Cleaned, CleanedChannel, FloatArray, Verdict

__all__ = [
    "channel_table",
    "event_table",
    "headline_figures",
    "noise_table",
    "problem_table",
    "settings_table",
    "verdict_bar",
    "worst_table",
]

_WORST = 25
_MOST = 200
_NOTHING = '<p class="none">{}</p>'


def headline_figures(head: Headline, clock: Clock) -> str:
    """Figures in a grid: name, value, a line of context."""
    raw, clean = head.raw_speed, head.clean_speed
    cards = [
        ("Fixes", f"{head.fixes:,}", _rejected(head)),
        ("Duration", duration(head.end - head.start), _span(head, clock)),
        ("Distance", number(head.distance, 1, "m"), "along the clean track"),
        ("Median 2σ", number(head.sigma_horizontal, 2, "m"), _vertical(head)),
        ("Median speed", number(clean[0], 2, "m/s"), f"raw {number(raw[0], 2, 'm/s')}"),
        ("Greatest speed", number(clean[1], 2, "m/s"), f"raw {number(raw[1], 2, 'm/s')}"),
    ]
    return "".join(
        f"<div><dt>{name}</dt><dd>{value}<small>{context}</small></dd></div>"
        for name, value, context in cards
    )


def _rejected(head: Headline) -> str:
    rejected = head.counts[Verdict.REJECTED]
    return f"{rejected:,} rejected ({share(rejected, head.fixes)})"


def _span(head: Headline, clock: Clock) -> str:
    if not clock.calendar or not np.isfinite(head.start):
        return f"{number(head.start, 1, 's')} to {number(head.end, 1, 's')}"
    first, last = instant(head.start, clock), instant(head.end, clock)
    return f"{first[11:19]} to {last[11:19] if last[:10] == first[:10] else last[:19]}"


def _vertical(head: Headline) -> str:
    vertical = f"vertical {number(head.sigma_vertical, 2, 'm')}"
    return f"horizontal; {vertical}" if np.isfinite(head.sigma_vertical) else "horizontal"


def verdict_bar(head: Headline) -> str:
    """Shares of the verdicts as one bar and its key."""
    present = [(verdict, n) for verdict, n in head.counts.items() if n]
    if not present:
        return _NOTHING.format("No position fixes in this log.")
    bar = "".join(
        f'<i class="v{verdict.value}" style="flex-grow:{n}"></i>' for verdict, n in present
    )
    key = "".join(
        f'<li><i class="v{verdict.value}"></i>{MARKS[verdict].name.capitalize()} '
        f"<b>{n:,}</b> <span>{share(n, head.fixes)}</span></li>"
        for verdict, n in present
    )
    return f'<div class="bar" aria-hidden="true">{bar}</div><ul class="key">{key}</ul>'


def worst_table(cleaned: Cleaned, clock: Clock) -> str:
    """Fixes that lay furthest from the track, in standard deviations."""
    sigma = np.nan_to_num(cleaned.verdicts.innovation_sigma, nan=-1.0, posinf=1e300)
    doubted = np.isin(
        cleaned.verdicts.verdict, (Verdict.REJECTED, Verdict.DOWNWEIGHTED, Verdict.EDITED)
    )
    rows = np.flatnonzero(doubted & (sigma >= 0.0))
    rows = rows[np.argsort(-sigma[rows], kind="stable")][:_WORST]
    if rows.size == 0:
        return _NOTHING.format("No fix was rejected or down-weighted.")
    why = texts(chosen(cleaned.verdicts, rows))
    off = np.sqrt(np.nansum((cleaned.raw_position - cleaned.track.position)[rows] ** 2, axis=1))
    coordinates = _coordinates(cleaned)
    return table(
        ["Time", "Row#", "Sensor", *coordinates, "Off#", "σ#", "Verdict", "Why"],
        [
            (
                instant(cleaned.track.time[row], clock),
                str(cleaned.row[row]),
                escape(cleaned.sensors[cleaned.sensor[row]]),
                *(number(values[row], digits) for values, digits in coordinates.values()),
                number(off[i], 1, "m"),
                number(cleaned.verdicts.innovation_sigma[row], 1),
                _badge(Verdict(cleaned.verdicts.verdict[row])),
                escape(why[i]),
            )
            for i, row in enumerate(rows.tolist())
        ],
        kind="worst",
    )


def _coordinates(cleaned: Cleaned) -> dict[str, tuple[FloatArray, int]]:
    """Heading, values and digits of the coordinates that were observed, as they were given."""
    vertical = "Depth, m#" if cleaned.has_depth else "Height, m#"
    if cleaned.track.geodetic is not None:
        kinds = [("Latitude#", 6), ("Longitude#", 6), (vertical, 2)]
    else:
        kinds = [("x, m#", 2), ("y, m#", 2), (vertical, 2)]
    columns = cleaned.raw_coordinates.T * np.array(
        [[1.0], [1.0], [-1.0 if cleaned.has_depth else 1.0]]
    )
    return {
        name: (values, digits)
        for (name, digits), values in zip(kinds, columns, strict=True)
        if np.isfinite(values).any()
    }


def _badge(verdict: Verdict) -> str:
    return f'<span class="badge"><i class="v{verdict.value}"></i>{MARKS[verdict].name}</span>'


def channel_table(channels: Sequence[CleanedChannel]) -> str:
    """One line per channel."""
    if not channels:
        return _NOTHING.format("No other series in this log.")
    return table(
        ["Channel", "Sensor", "Values#", "Used#", "Down-weighted#", "Rejected#", "Median 2σ#"],
        [
            (
                escape(heading_of(channel.name).partition(",")[0]),
                escape(channel.sensor),
                f"{channel.time.size:,}",
                *(
                    f"{counts(channel.verdicts)[verdict]:,}"
                    for verdict in (Verdict.USED, Verdict.DOWNWEIGHTED, Verdict.REJECTED)
                ),
                number(_twice_median(channel), 3, heading_of(channel.name).partition(", ")[2]),
            )
            for channel in channels
        ],
    )


def _twice_median(channel: CleanedChannel) -> float:
    finite = channel.sigma[np.isfinite(channel.sigma)]
    return 2.0 * float(np.median(finite)) if finite.size else float("nan")


def event_table(cleaned: Cleaned, clock: Clock) -> str:
    """What to know about the log, in the order of time."""
    if not cleaned.events:
        return _NOTHING.format("Nothing to note.")
    events = sorted(cleaned.events, key=lambda e: (not np.isnan(e.time), e.time))
    rows = [
        (
            "whole log" if np.isnan(e.time) else instant(e.time, clock),
            escape(e.kind),
            escape(e.text),
        )
        for e in events[:_MOST]
    ]
    more = len(events) - len(rows)
    return table(["Time", "Event", "What happened"], rows) + (
        f'<p class="note">… and {more:,} more.</p>' if more else ""
    )


def problem_table(cleaned: Cleaned) -> str:
    """Bad input, counted, with what can be done about it."""
    if not cleaned.problems:
        return _NOTHING.format("No bad input was met.")
    return table(
        ["Problem", "Count#", "First met", "What to do"],
        [
            (escape(p.kind), f"{p.total:,}", f"<code>{escape(p.example)}</code>", escape(p.remedy))
            for p in cleaned.problems
        ],
    )


def noise_table(cleaned: Cleaned) -> str:
    """Noise figures of the sensors and of the motion."""
    noise = [*cleaned.noise, *(n for channel in cleaned.channels for n in channel.noise)]
    if not noise:
        return _NOTHING.format("No noise figures.")
    return table(
        ["Sensor", "Quantity", "Standard deviation#", "Unit", "Source"],
        [
            (
                escape(n.sensor),
                escape(n.quantity),
                f"{n.value:.3g}" if np.isfinite(n.value) else "–",
                escape(n.unit),
                escape(n.source),
            )
            for n in noise
        ],
    )


def settings_table(cleaned: Cleaned) -> str:
    """Every option as it was used."""
    if not cleaned.settings:
        return _NOTHING.format("No settings recorded.")
    return table(
        ["Setting", "Value"],
        [(escape(name), escape(value)) for name, value in cleaned.settings.items()],
    )
