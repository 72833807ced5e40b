"""What stands before every request: limits, names, origins, tokens; and the headers of answers.

A route that is added behind it is closed to all but viewers, and what changes anything to all but
operators, unless it is named in `OPEN`. Behind it ``scope["state"]`` has the ``role`` of who asks,
and ``allowed()``, which tells whether they may still, for answers that last.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Mapping, MutableMapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, NamedTuple, TypeVar

from surefix.service.web_access import host_known, origin_known, role_of
from surefix.service.web_limits import Turns
from surefix.service.web_options import WebOptions

__all__ = ["HEADERS", "OPEN", "Guard", "WebState", "cut"]

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
_T = TypeVar("_T")
App = Callable[[Scope, Receive, Send], Awaitable[None]]

HEADERS: Final = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    ),
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}
"""Of every answer. Plotly sets styles of its own, so those may be inline; scripts may not."""

OPEN: Final = ("/", "/healthz", "/pages/")
"""Paths without data of the mission, open to all; one that ends with ``/`` with all below it."""

_READS: Final = ("GET", "HEAD")
_SESSION: Final = "/api/session"  # whoever may see may also sign in and out
_WRONG: Final = (0.1, 10.0)  # wrong tokens of one client: a second, and at once
_BURST_S: Final = 5.0  # s of requests that may come at once
_PIECE: Final = 1 << 16  # bytes of an answer handed on at a time
_PATIENCE: Final = 20.0  # s to take such a piece, or to send the next part of a body


@dataclass
class WebState:
    """How the web side is.

    Parameters
    ----------
    clients
        WebSocket clients connected.
    dropped
        WebSocket clients that did not read.
    late
        Connections that were cut because a request or an answer took too long.
    answers
        How many, by status.
    """

    clients: int = 0
    dropped: int = 0
    late: int = 0
    answers: Counter[int] = field(default_factory=Counter)


class _Refusal(NamedTuple):
    status: int
    detail: str


class Guard:
    """An ASGI application around another.

    Parameters
    ----------
    app
        The other.
    options, state
        What is allowed, and where it is counted.
    cut
        Cuts the connection of a client, (host, port), at once.
    clock
        s, Unix.
    """

    def __init__(
        self,
        app: App,
        options: WebOptions,
        state: WebState,
        cut: Callable[[tuple[str, int]], None],
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._app, self._options, self._state = app, options, state
        self._cut, self._clock = cut, clock
        rate = options.requests_per_s
        self._turns = Turns(rate, max(1.0, _BURST_S * rate))
        self._wrong = Turns(*_WRONG)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or refuse it."""
        if scope["type"] == "lifespan":
            return await self._app(scope, receive, send)
        headers = {
            name.decode("latin-1").lower(): value.decode("latin-1")
            for name, value in scope["headers"]
        }
        if scope["type"] == "http":
            receive, send = self._bounded(scope, receive), self._patient(scope, send)
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            return await self._refuse(scope, refusal, send)
        return await self._app(scope, receive, send)

    def _refusal(self, scope: Scope, headers: Mapping[str, str]) -> _Refusal | None:
        """Say why a request is refused; note in the scope who asks, if it is not."""
        client, now = (scope.get("client") or ("", 0))[0], time.monotonic()
        if not self._turns.take(client, now):
            return _Refusal(429, "too many requests; wait a second")
        host, origin = headers.get("host", ""), headers.get("origin")
        if not host_known(self._options, host):
            return _Refusal(403, f"Host {host!r} is not known here; list it in [web] origins")
        if origin is not None and not origin_known(self._options, origin, host):
            return _Refusal(403, f"Origin {origin!r} may not; list it in [web] origins")
        path = scope["path"]
        if "\0" in path or "\\" in path or "//" in path or ".." in path.split("/"):
            return _Refusal(400, "a path without .., //, \\ and NUL expected")
        size = headers.get("content-length", "0")
        if not size.isdecimal() or int(size[:20]) > self._options.body_bytes:
            return _Refusal(413, f"a body of at most {self._options.body_bytes} bytes expected")
        role = role_of(self._options, headers, self._clock())
        if role == "wrong" and not self._wrong.take(client, now):
            return _Refusal(429, "too many wrong tokens; wait a minute")
        allowed = partial(self._allowed, headers)
        scope["state"] = {**scope.get("state", {}), "role": role, "allowed": allowed}
        method = scope.get("method", "GET")
        if method in _READS and any(
            path.startswith(each) if each.endswith("/") and each != "/" else path == each
            for each in OPEN
        ):
            return None
        if role in ("wrong", "nobody"):
            return _Refusal(401, "a valid token expected, as Authorization: Bearer …, or a session")
        if method not in _READS and path != _SESSION:
            if role != "operator":
                return _Refusal(403, "only operators may do this")
            if "cookie" in headers and "authorization" not in headers and origin is None:
                return _Refusal(403, "a browser's Origin expected")
        return None

    def _allowed(self, headers: Mapping[str, str]) -> bool:
        """Tell whether who asked in this way might still ask now."""
        return role_of(self._options, headers, self._clock()) not in ("wrong", "nobody")

    async def _refuse(self, scope: Scope, refusal: _Refusal, send: Send) -> None:
        kind = "http" if scope["type"] == "http" else "websocket.http"
        headers = [(b"content-type", b"application/json"), (b"cache-control", b"no-store")]
        if refusal.status == 401:
            headers.append((b"www-authenticate", b"Bearer"))
        if kind != "http":
            headers += _encoded(HEADERS)
            self._state.answers[refusal.status] += 1
        body = json.dumps({"detail": refusal.detail}).encode()
        headers.append((b"content-length", str(len(body)).encode()))
        start = {"type": f"{kind}.response.start", "status": refusal.status, "headers": headers}
        await send(start)
        await send({"type": f"{kind}.response.body", "body": body})

    def _bounded(self, scope: Scope, receive: Receive) -> Receive:
        """Receive a body in time, and no more than is allowed."""
        size, whole = 0, False

        async def bounded() -> Message:
            nonlocal size, whole
            if whole:
                return await receive()
            message = await self._in_time(scope, receive())
            size += len(message.get("body", b""))
            whole = not message.get("more_body", False)
            if size > self._options.body_bytes:
                self._late(scope)
                return {"type": "http.disconnect"}
            return message

        return bounded

    def _patient(self, scope: Scope, send: Send) -> Send:
        """Add the headers, and send in pieces, each of which must be taken in time."""

        async def patient(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._state.answers[message["status"]] += 1
                known = {name.lower() for name, _ in message.get("headers", [])}
                more = [each for each in _encoded(HEADERS) if each[0] not in known]
                if b"cache-control" not in known:
                    more.append((b"cache-control", b"no-store"))
                message = {**message, "headers": [*message.get("headers", []), *more]}
                return await send(message)
            body = message.get("body", b"")
            while len(body) > _PIECE:
                piece = {**message, "body": body[:_PIECE], "more_body": True}
                await self._in_time(scope, send(piece))
                body = body[_PIECE:]
            return await self._in_time(scope, send({**message, "body": body}))

        return patient

    async def _in_time(self, scope: Scope, doing: Awaitable[_T]) -> _T:
        try:
            return await asyncio.wait_for(doing, _PATIENCE)
        except TimeoutError:
            self._late(scope)
            raise

    def _late(self, scope: Scope) -> None:
        self._state.late += 1
        if scope.get("client"):
            self._cut(tuple(scope["client"]))


def _encoded(headers: Mapping[str, str]) -> list[tuple[bytes, bytes]]:
    return [(name.encode(), value.encode()) for name, value in headers.items()]


def cut(connections: Iterable[Any], client: tuple[str, int]) -> None:
    """Cut at once what a client, (host, port), has open.

    Parameters
    ----------
    connections
        Those of a server, each with the client at its other end and a transport.
    client
        As a request names it.
    """
    for connection in list(connections):
        if getattr(connection, "client", None) == client:
            connection.transport.abort()
