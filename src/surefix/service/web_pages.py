"""The files of the pages: our own, Plotly's script as its package ships it, and the marks."""

from __future__ import annotations

import gzip
import hashlib
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Final, NamedTuple

from surefix.errors import MissingExtraError
from surefix.report import style
from surefix.report.marks import DOUBTED, SURE

__all__ = ["Page", "pages"]

_KINDS: Final = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}


class Page(NamedTuple):
    """One file that is served.

    Parameters
    ----------
    kind
        Media type.
    content, packed
        As it is, and by gzip.
    tag
        Changes with the content.
    """

    kind: str
    content: bytes
    packed: bytes
    tag: str


def pages(folder: str = "surefix.service.pages") -> Mapping[str, Page]:
    """Read all files of a package of pages, by name, with ``plotly.js`` and ``marks.json``.

    No other file can be asked for, whatever its name.

    Raises
    ------
    MissingExtraError
        Plotly is not installed.
    """
    found = {
        each.name: each.read_bytes()
        for each in files(folder).iterdir()
        if each.is_file() and "." + each.name.rpartition(".")[2] in _KINDS
    }
    found |= {"plotly.js": _plotly(), "marks.json": _marks()}
    return {name: _page(name, content) for name, content in found.items()}


def _page(name: str, content: bytes) -> Page:
    kind = _KINDS["." + name.rpartition(".")[2]]
    tag = f'"{hashlib.sha256(content).hexdigest()[:32]}"'
    return Page(kind, content, gzip.compress(content, 6, mtime=0), tag)


def _plotly() -> bytes:
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise MissingExtraError(
            "the dashboard needs Plotly, which is not installed",
            remedy="pip install 'surefix[live]'",
        ) from error
    return str(get_plotlyjs()).encode()


def _marks() -> bytes:
    """How the fixes of each verdict are drawn: as in the report."""
    order = [verdict for verdict in style.MARKS if verdict in (*SURE, *DOUBTED)]
    marks = {
        verdict.name.lower(): {"name": mark.name, "marker": mark.style()}
        for verdict, mark in ((each, style.MARKS[each]) for each in order)
    }
    return json.dumps({"clean": style.CLEAN, "band": style.BAND, "verdicts": marks}).encode()
