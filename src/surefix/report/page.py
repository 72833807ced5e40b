"""The report: one HTML file that holds everything it needs."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path, PurePath
from string import Template

import numpy as np

from surefix.errors import MissingExtraError
from surefix.io.atomic import replacing
from surefix.report.encode import dumps
from surefix.report.marks import clock_of
from surefix.report.sections import sections
from surefix.report.wording import escape, instant
from surefix.types import Cleaned

__all__ = ["check_extra", "write_report"]


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
    page = _page(cleaned, title or named or "Clean track")
    with replacing(path) as file:
        file.write(page.encode("utf-8", "replace"))


def check_extra() -> None:
    """Raise the error of `write_report` if Plotly is not installed, before any work is done."""
    if find_spec("plotly") is None:
        raise _missing()


def _page(cleaned: Cleaned, title: str) -> str:
    plotly, script = _plotly(), _own("page.js")
    clock = clock_of(cleaned.track.time, *(channel.time for channel in cleaned.channels))
    parts = sections(cleaned, clock)
    return Template(_own("page.html")).substitute(
        title=escape(title),
        policy=_policy(plotly, script),
        style=_own("page.css"),
        subtitle=_subtitle(cleaned),
        contents="".join(f'<a href="#{part.name}">{part.short}</a>' for part in parts),
        sections="\n".join(
            f'<section id="{part.name}">\n<h2>{part.title}</h2>\n{part.body}\n</section>'
            for part in parts
        ),
        figures=dumps([figure for part in parts for figure in part.figures]),
        plotly=plotly,
        script=script,
    )


def _subtitle(cleaned: Cleaned) -> str:
    """Day, inputs and sensors."""
    time = np.concatenate([cleaned.track.time, *(channel.time for channel in cleaned.channels)])
    clock = clock_of(time)
    time = time[np.isfinite(time)]
    names = [*cleaned.sensors, *(channel.sensor for channel in cleaned.channels)]
    said = [instant(float(time.min()), clock)[:10]] if clock.calendar else []
    said += [escape(", ".join(dict.fromkeys(name for name in names if name)))]
    return " · ".join(text for text in said if text)


def _policy(*scripts: str) -> str:
    """Content security policy: these scripts, nothing else, and nothing from anywhere."""
    known = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in scripts
    )
    return (
        f"default-src 'none'; script-src {known}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )


def _own(name: str) -> str:
    return files("surefix.report").joinpath(name).read_text(encoding="utf-8")


def _plotly() -> str:
    """Plotly's own script, as its package ships it."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise _missing() from error
    return str(get_plotlyjs()).replace("\r\n", "\n").replace("</script", "<\\/script")


def _missing() -> MissingExtraError:
    return MissingExtraError(
        "the report needs Plotly, which is not installed", remedy="pip install 'surefix[report]'"
    )
