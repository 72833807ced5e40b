"""The review page over HTTP: what is shown, chosen, decided, cleaned again and exported."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from fastapi import FastAPI, HTTPException, Request, Response
from pydantic import BaseModel, Field, FiniteFloat

from surefix.errors import SurefixError
from surefix.io.edits import standing
from surefix.io.writers import SUFFIXES
from surefix.pipelines.deliver import deliver
from surefix.report.encode import dumps
from surefix.report.page import write_report
from surefix.service.review import Review, Run
from surefix.service.review_choice import Part, chosen_rows, doubted
from surefix.service.review_view import Window, compared, figure, outlined, said, told
from surefix.service.web_file import file_answer
from surefix.service.web_pages import Page
from surefix.types import IntArray, Verdict

__all__ = ["ChoicePart", "ChoiceRecord", "DecisionRecord", "review_app"]

_ENTRIES: Final = 100  # of the edit log that are shown
_KINDS: Final = {
    ".csv": "text/csv; charset=utf-8",
    ".geojson": "application/geo+json",
    ".gpx": "application/gpx+xml",
    ".html": "text/html; charset=utf-8",
}
_BINARY: Final = "application/octet-stream"
_JSON: Final = "application/json"

Compare = Literal["off", "before", "first"]
Corner = tuple[FiniteFloat, FiniteFloat]


class ChoicePart(BaseModel):
    """A line around fixes on a panel, or rows."""

    panel: Literal["", "plan", "east", "north", "vertical"] = ""
    line: Annotated[list[Corner], Field(max_length=5_000)] = []
    rows: Annotated[list[int], Field(max_length=100_000)] = []


class ChoiceRecord(BaseModel):
    """Which fixes are meant, of the run that is shown, among those whose verdict is shown."""

    run: int
    parts: Annotated[list[ChoicePart], Field(max_length=1_000)]
    verdicts: list[str]


class DecisionRecord(ChoiceRecord):
    """What is decided about them."""

    action: Literal["accept", "reject", "restore"]


def review_app(review: Review, files: Mapping[str, Page], name: str, command: str) -> FastAPI:
    """Make the application; who may ask is decided before it, by `web_guard.Guard`.

    Parameters
    ----------
    review
        What it is about.
    files
        What is under ``/pages``, from `surefix.service.web_pages.pages`.
    name
        What exported files are called after.
    command
        The command that gives the same without the page.
    """
    app = FastAPI(title="surefix review", docs_url=None, redoc_url=None, openapi_url=None)

    @app.exception_handler(SurefixError)
    async def refused(_: Request, error: Exception) -> Response:
        return _answer({"detail": str(error)}, 409)

    @app.get("/api/state")
    def state() -> Response:
        return _answer(_state(review) | {"command": command})

    @app.get("/api/figures")
    def drawn(
        of: Literal["plan", "strips"],
        compare: Compare = "off",
        x0: float = -np.inf,
        x1: float = np.inf,
        y0: float = -np.inf,
        y1: float = np.inf,
        t0: float = -np.inf,
        t1: float = np.inf,
    ) -> Response:
        run, other = review.last, _other(review, compare)
        window = Window((x0, x1), (y0, y1), (t0, t1))
        found = {"number": run.number, of: figure(run, of, review.waiting(run), other, window)}
        found["told"] = told(run)
        found["compared"] = compared(run, other) if other else None
        return Response(dumps(found), media_type=_JSON)

    @app.post("/api/choose")
    def choose(choice: ChoiceRecord) -> Response:
        run, rows = _meant(review, choice)
        cleaned = run.shown
        verdicts = cleaned.verdicts.verdict[rows]
        found = {
            "total": len(rows),
            "verdicts": {v.name.lower(): int((verdicts == v).sum()) for v in Verdict},
            "marks": outlined(cleaned, rows),
            "first": int(rows[0]) if len(rows) else None,
            "text": said(cleaned, int(rows[0])) if len(rows) == 1 else "",
        }
        return Response(dumps(found), media_type=_JSON)

    @app.get("/api/step")
    def step(by: int, row: int | None = None) -> Response:
        return _answer({"row": doubted(review.last.shown, row, by)})

    @app.post("/api/edit")
    def edit(decision: DecisionRecord) -> Response:
        review.edit(*_meant(review, decision), decision.action)
        return _answer(_state(review))

    @app.post("/api/undo")
    def undo() -> Response:
        review.step("undo")
        return _answer(_state(review))

    @app.post("/api/redo")
    def redo() -> Response:
        review.step("redo")
        return _answer(_state(review))

    @app.post("/api/run", status_code=202)
    def run() -> Response:
        review.begin()
        return _answer(_state(review), 202)

    @app.get("/api/export/{suffix}")
    def export(suffix: str) -> Response:
        if f".{suffix}" not in (*SUFFIXES, ".html"):
            raise HTTPException(400, "one of csv, parquet, geojson, gpx, nmea and html expected")
        run = review.last
        if len(review.waiting(run)):
            raise HTTPException(409, "edits wait for a run; run it first, then export")
        called, content = _exported(run, f"{name}.{suffix}")
        kind = _KINDS.get(Path(called).suffix, _BINARY)
        headers = {"content-disposition": f'attachment; filename="{_plain(called)}"'}
        return Response(content, media_type=kind, headers=headers)

    @app.get("/")
    def page(request: Request) -> Response:
        return file_answer(files, "review.html", request)

    @app.get("/pages/{called}")
    def part(called: str, request: Request) -> Response:
        return file_answer(files, called, request)

    return app


def _answer(content: Mapping[str, Any], status: int = 200) -> Response:
    return Response(json.dumps(content, allow_nan=False), status, media_type=_JSON)


def _state(review: Review) -> dict[str, Any]:
    log = review.log
    done, undone = standing(log.entries)
    gone = {entry.number for entry in undone}
    edits = [
        {
            "number": entry.number,
            "time": entry.time,
            "by": entry.by,
            "action": entry.action,
            "total": entry.total,
            "sensors": sorted({part.sensor for part in entry.fixes}),
            "undone": entry.number in gone,
        }
        for entry in log.entries[: -_ENTRIES - 1 : -1]
    ]
    run = review.last
    geographic = run.shown.track.geodetic is not None
    return {
        **review.progress(),
        "run": run.number,
        "sources": list(run.shown.sources),
        "waiting": len(review.waiting(run)),
        "edits": edits,
        "total": len(log.entries),
        "torn": log.torn,
        "undo": len(done),
        "redo": len(undone),
        "formats": [s[1:] for s in (SUFFIXES if geographic else SUFFIXES[:2])] + ["html"],
    }


def _other(review: Review, compare: Compare) -> Run | None:
    """The run to compare with; none with itself."""
    run = {"off": None, "before": review.before, "first": review.first}[compare]
    return None if run is review.last else run


def _meant(review: Review, choice: ChoiceRecord) -> tuple[Run, IntArray]:
    run = review.last
    if choice.run != run.number:
        raise HTTPException(409, "the log was cleaned again since; choose once more")
    try:
        verdicts = [Verdict[word.upper()] for word in choice.verdicts]
    except KeyError as error:
        raise HTTPException(422, f"no such verdict: {error}") from error
    parts = [
        Part(
            part.panel,
            np.array(part.line, dtype=np.float64).reshape(-1, 2),
            np.array(part.rows, dtype=np.int64),
        )
        for part in choice.parts
    ]
    return run, chosen_rows(run.shown, parts, verdicts)


def _exported(run: Run, called: str) -> tuple[str, bytes]:
    """What `surefix clean -o` writes, by the same writers; several files as one archive."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, called)
        if place.suffix == ".html":
            write_report(deliver(run.batches, (), iso=False).cleaned, place)
            written: Sequence[str] = (str(place),)
        else:
            written = deliver(run.batches, [place], iso=False).written
        if len(written) == 1:
            return called, Path(written[0]).read_bytes()
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
            for each in written:
                packed.write(each, Path(each).name)
        return f"{place.stem}.zip", archive.getvalue()


def _plain(name: str) -> str:
    """A name that is safe in a header."""
    return "".join(c if c.isascii() and (c.isalnum() or c in "-_. ") else "_" for c in name)
