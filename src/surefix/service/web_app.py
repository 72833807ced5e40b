"""The routes of the web side: state, stream, past, alarms, metrics, pages."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Final

from fastapi import FastAPI, HTTPException, Query, Request, Response, WebSocket
from pydantic import BaseModel

from surefix.io.journal import Told
from surefix.service.supervision import acknowledge
from surefix.service.web_access import SESSION_S, Role, cookie_name, session
from surefix.service.web_file import file_answer
from surefix.service.web_hub import Hub
from surefix.service.web_metrics import Metrics
from surefix.service.web_options import WebOptions
from surefix.service.web_pages import Page
from surefix.service.web_record import AlarmRecord, StateRecord, TrackRecord, track_record

if TYPE_CHECKING:
    from surefix.service.running import Live

__all__ = ["SessionRecord", "web_app"]

_STALLED: Final = 10.0  # s without a step
_LOOKING: Final = 2  # who may be answered about the past at a time, for the sake of memory
_WRITTEN: Final = 5.0  # s that an answer waits for the journal
_MOST: Final = 20_000  # rows of the past in one answer
_JSON: Final = "application/json"


class SessionRecord(BaseModel):
    """Who asks, whether there are tokens, and whether this browser has signed in."""

    role: str
    tokens: bool
    signed_in: bool


def web_app(
    live: Live,
    options: WebOptions,
    hub: Hub,
    metrics: Metrics,
    files: Mapping[str, Page],
    clock: Callable[[], float] = time.time,
) -> FastAPI:
    """Make the application; who may ask what is decided before it, by `web_guard.Guard`.

    Parameters
    ----------
    live, options
        The service, and its table ``[web]``.
    hub, metrics
        The stream, and the figures.
    files
        What is under ``/pages``, from `surefix.service.web_pages.pages`.
    clock
        s, Unix.
    """
    tokens = options.viewer.wanted or options.operator.wanted
    looking = asyncio.Semaphore(_LOOKING)
    app = FastAPI(
        title="surefix live", docs_url=None, redoc_url=None, openapi_url="/api/openapi.json"
    )

    @app.get("/api/state", response_model=StateRecord)
    async def state() -> Response:
        """Give the state at present; ``rows`` are those since the last record of the stream."""
        return Response(hub.record().model_dump_json(), media_type=_JSON)

    @app.get("/api/track", response_model=TrackRecord)
    async def track(
        since: Annotated[float, Query(allow_inf_nan=False)] = 0.0,
        until: Annotated[float, Query(allow_inf_nan=False)] = 1e12,
        most: Annotated[int, Query(ge=1, le=_MOST)] = 2000,
    ) -> Response:
        """Give the past from ``since`` until ``until``, s, in about ``most`` rows."""
        async with looking:
            record = await track_record(live, since, until, most)
            text = await asyncio.to_thread(record.model_dump_json)
        return Response(text, media_type=_JSON)

    @app.post("/api/alarms/{number}/acknowledge", response_model=AlarmRecord)
    async def acknowledged(number: int, request: Request) -> Response:
        """Acknowledge an alarm, for operators; 202 says that the journal has not got it yet."""
        host = request.client.host if request.client else ""
        acknowledge(live, number, f"operator at {host}", clock())
        alarm = next((each for each in live.alarms if each.number == number), None)
        if alarm is None:
            raise HTTPException(404, f"no alarm {number}")
        last = live.said
        hub.notice()
        status = 200 if await _written(live, last) else 202
        return Response(AlarmRecord(**alarm._asdict()).model_dump_json(), status, media_type=_JSON)

    @app.get("/api/session")
    async def who(request: Request) -> SessionRecord:
        """Tell who asks: viewer or operator."""
        signed_in = tokens and cookie_name(options) in request.cookies
        return SessionRecord(role=request.state.role, tokens=tokens, signed_in=signed_in)

    @app.post("/api/session")
    async def sign_in(request: Request, response: Response) -> SessionRecord:
        """Begin the session of a browser, for who shows a token."""
        role: Role = request.state.role
        if tokens:
            response.set_cookie(
                cookie_name(options),
                session(options, role, clock()),
                max_age=SESSION_S,
                httponly=True,
                samesite="strict",
                secure=request.headers.get("origin", "").startswith("https:"),
            )
        return SessionRecord(role=role, tokens=tokens, signed_in=tokens)

    @app.delete("/api/session", status_code=204)
    async def sign_out(response: Response) -> None:
        """End the session of a browser."""
        response.delete_cookie(cookie_name(options), httponly=True, samesite="strict")

    @app.websocket("/api/live")
    async def stream(websocket: WebSocket) -> None:
        await hub.stream(websocket)

    @app.get("/metrics")
    async def figures() -> Response:
        """Give the figures for Prometheus."""
        return Response(metrics.text(), media_type="text/plain; version=0.0.4; charset=utf-8")

    @app.get("/healthz")
    async def health() -> Response:
        """Tell whether the service steps, to anybody."""
        well = clock() - metrics.stepped < _STALLED
        text = '{"status":"ok"}' if well else '{"status":"stalled"}'
        return Response(text, 200 if well else 503, media_type=_JSON)

    @app.get("/", include_in_schema=False)
    async def dashboard(request: Request) -> Response:
        return file_answer(files, "live.html", request)

    @app.get("/pages/{name}", include_in_schema=False)
    async def page(name: str, request: Request) -> Response:
        return file_answer(files, name, request)

    return app


async def _written(live: Live, number: int) -> bool:
    """Wait until the journal has what was told up to a number; False if that takes too long."""
    end = time.monotonic() + _WRITTEN
    while any(isinstance(each, Told) and each.number <= number for each in live.unsaved):
        if time.monotonic() > end:
            return False
        await asyncio.sleep(0.02)
    return True
