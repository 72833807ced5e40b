"""The report of a cleaned log."""

from __future__ import annotations

from pathlib import Path, PurePath

import numpy as np

from surefix.io.atomic import replacing
from surefix.report.marks import clock_of
from surefix.report.sections import sections
from surefix.report.shell import page
from surefix.report.wording import escape, instant
from surefix.types import Cleaned

__all__ = ["write_report"]

_FOOTER = (
    "Made with surefix. Every fix of the input is accounted for: used, down-weighted or rejected "
    "with its reason."
)


def write_report(cleaned: Cleaned, path: str | Path, *, title: str | None = None) -> None:
    """Write a report as one HTML file that needs no network; whole or not at all.

    Parameters
    ----------
    cleaned
        The result to show.
    path
        Place of the file; its directory must exist.
    title
        Heading; the names of the inputs if None.

    Raises
    ------
    MissingExtraError
        Plotly is not installed.
    OutputError
        The file cannot be written.
    """
    named = ", ".join(PurePath(source).name or source for source in cleaned.sources)
    clock = clock_of(cleaned.track.time, *(channel.time for channel in cleaned.channels))
    text = page(
        sections(cleaned, clock),
        kind="Track report",
        title=title or named or "Clean track",
        subtitle=_subtitle(cleaned),
        footer=_FOOTER,
    )
    with replacing(path) as file:
        file.write(text.encode("utf-8", "replace"))


def _subtitle(cleaned: Cleaned) -> str:
    """Day, inputs and sensors."""
    time = np.concatenate([cleaned.track.time, *(channel.time for channel in cleaned.channels)])
    clock = clock_of(time)
    time = time[np.isfinite(time)]
    names = [*cleaned.sensors, *(channel.sensor for channel in cleaned.channels)]
    said = [instant(float(time.min()), clock)[:10]] if clock.calendar else []
    said += [escape(", ".join(dict.fromkeys(name for name in names if name)))]
    return " · ".join(text for text in said if text)
