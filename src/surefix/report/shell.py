"""The page around every report: one HTML file that holds everything it needs."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from importlib.resources import files
from importlib.util import find_spec
from string import Template
from typing import NamedTuple

from surefix.errors import MissingExtraError
from surefix.report.encode import dumps
from surefix.report.style import Figure
from surefix.report.wording import escape

__all__ = ["Section", "check_extra", "page", "place"]


class Section(NamedTuple):
    """One part of the page.

    Parameters
    ----------
    name
        Anchor.
    title
        Heading; ``short`` is its form in the list of contents.
    body
        HTML.
    figures
        The figures that ``body`` has places for.
    """

    name: str
    title: str
    short: str
    body: str
    figures: tuple[Figure, ...] = ()


def page(parts: Sequence[Section], *, kind: str, title: str, subtitle: str, footer: str) -> str:
    """Make the whole page.

    Parameters
    ----------
    parts
        In the order shown.
    kind, title, footer
        Text above the heading, heading, and last line, as plain text.
    subtitle
        HTML below the heading.

    Raises
    ------
    MissingExtraError
        Plotly is not installed.
    """
    plotly, script = _plotly(), _own("page.js")
    return Template(_own("page.html")).substitute(
        kind=escape(kind),
        title=escape(title),
        policy=_policy(plotly, script),
        style=_own("page.css"),
        subtitle=subtitle,
        contents="".join(f'<a href="#{part.name}">{part.short}</a>' for part in parts),
        sections="\n".join(
            f'<section id="{part.name}">\n<h2>{part.title}</h2>\n{part.body}\n</section>'
            for part in parts
        ),
        footer=escape(footer),
        figures=dumps([figure for part in parts for figure in part.figures]),
        plotly=plotly,
        script=script,
    )


def place(figure: Figure) -> str:
    """Give the place of a figure as HTML; the page's script fills it."""
    outside = figure["outside"]
    notes = [figure["note"]] if figure["note"] else []
    if outside:
        lie = f"{figure['what'].rstrip('s')} lies" if outside == 1 else f"{figure['what']} lie"
        notes.insert(0, f"{outside:,} rejected {lie} outside this view.")
    button = '<button type="button">Show everything</button>' if outside else ""
    note = f'<p class="note">{" ".join(notes)} {button}</p>' if notes else ""
    label = escape(figure["label"])
    return (
        f'<figure id="{figure["id"]}"><div class="legend"></div>'
        f'<div class="plot" role="img" aria-label="{label}"></div>{note}</figure>'
    )


def check_extra() -> None:
    """Raise the error of `page` if Plotly is not installed, before any work is done."""
    if find_spec("plotly") is None:
        raise _missing()


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
