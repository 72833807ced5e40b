"""The parts of the report in a surveyor's order: words, tables, and the figures between them."""

from __future__ import annotations

from collections.abc import Iterable

from surefix.report.consistency import histogram, innovations, quantiles
from surefix.report.headline import headline
from surefix.report.marks import Clock
from surefix.report.plan import plan
from surefix.report.series import Series, axis_series, channel_series, heading_of
from surefix.report.shell import Section, place
from surefix.report.stack import stacked
from surefix.report.style import Figure
from surefix.report.tables import (
    channel_table,
    event_table,
    headline_figures,
    noise_table,
    problem_table,
    settings_table,
    verdict_bar,
    worst_table,
)
from surefix.report.wording import escape
from surefix.types import Cleaned, CleanedChannel

__all__ = ["sections"]

_CONSISTENCY = (
    "An innovation is the distance of a fix from where the track expected it, in standard "
    "deviations. If the noise figures are right, the believed ones follow the normal law."
)


def sections(cleaned: Cleaned, clock: Clock) -> list[Section]:
    """Every section, whether or not the log has anything for it."""
    head = headline(cleaned)
    summary = f'<dl class="figures">{headline_figures(head, clock)}</dl>{verdict_bar(head)}'
    return [
        Section("summary", "Summary", "Summary", summary),
        _plan(cleaned, clock),
        _over_time(cleaned, clock),
        _channels(cleaned, clock),
        _consistency(cleaned, clock),
        Section("worst", "Worst fixes", "Worst fixes", worst_table(cleaned, clock)),
        Section("events", "Events", "Events", event_table(cleaned, clock)),
        Section("problems", "Bad input", "Bad input", problem_table(cleaned)),
        Section("noise", "Noise figures", "Noise", noise_table(cleaned)),
        Section("settings", "Settings and versions", "Settings", settings_table(cleaned)),
    ]


def _plan(cleaned: Cleaned, clock: Clock) -> Section:
    figure = plan(cleaned, clock)
    body = _places([figure], "No fix has both an east and a north coordinate.")
    return Section("plan-view", "Plan view", "Plan", body, _present([figure]))


def _over_time(cleaned: Cleaned, clock: Clock) -> Section:
    axes = axis_series(cleaned)
    figure = (
        stacked("position", "Position over time", axes, clock, cleaned.events) if axes else None
    )
    body = _places([figure], "No positions in this log.")
    return Section("over-time", "Position over time", "Position", body, _present([figure]))


def _channels(cleaned: Cleaned, clock: Clock) -> Section:
    panels = [channel_series(channel) for channel in cleaned.channels]
    figures = [
        stacked(f"channel-{i}", panel.title, [panel], clock, cleaned.events)
        for i, panel in enumerate(panels)
    ]
    body = channel_table(cleaned.channels) + "".join(
        f"<h3>{_named(channel)}</h3>{place(figure)}"
        for channel, figure in zip(cleaned.channels, figures, strict=True)
    )
    return Section("channels", "Depth, heading and other series", "Series", body, tuple(figures))


def _consistency(cleaned: Cleaned, clock: Clock) -> Section:
    axes = axis_series(cleaned)
    judged = [("position", "", axes[0])] if axes else []
    judged = judged or [
        (f"channel-{i}", _named(channel), channel_series(channel))
        for i, channel in enumerate(cleaned.channels)
    ]
    figures: list[Figure] = []
    body = ""
    for name, title, panel in judged:
        wide = _present([innovations(f"innovations-{name}", panel, clock)])
        pair = _distribution(name, panel)
        figures += [*wide, *pair]
        body += f"<h3>{title}</h3>" if title else ""
        body += _places(wide) + (f'<div class="pair">{_places(pair)}</div>' if pair else "")
    explained = f'<p class="lead">{_CONSISTENCY}</p>' + body
    empty = '<p class="none">No innovations: nothing was predicted.</p>'
    return Section(
        "consistency", "Consistency", "Consistency", explained if figures else empty, tuple(figures)
    )


def _named(channel: CleanedChannel) -> str:
    """Quantity and sensor, as HTML."""
    quantity = escape(heading_of(channel.name).partition(",")[0])
    return f"{quantity} <small>{escape(channel.sensor)}</small>" if channel.sensor else quantity


def _distribution(name: str, panel: Series) -> tuple[Figure, ...]:
    return _present(
        [
            histogram(f"histogram-{name}", panel.verdicts),
            quantiles(f"quantiles-{name}", panel.verdicts),
        ]
    )


def _present(figures: Iterable[Figure | None]) -> tuple[Figure, ...]:
    return tuple(figure for figure in figures if figure is not None)


def _places(figures: Iterable[Figure | None], otherwise: str = "") -> str:
    """Places for figures, filled by the page's script, or a sentence where there is none."""
    places = "".join(place(figure) for figure in _present(figures))
    return places or (f'<p class="none">{otherwise}</p>' if otherwise else "")
