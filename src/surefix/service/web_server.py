"""Serve the web side inside the event loop of the live service."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final, cast

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from surefix.errors import OutputError
from surefix.service.inbox import Arrived
from surefix.service.web_app import web_app
from surefix.service.web_guard import Guard, WebState, cut
from surefix.service.web_hub import Hub
from surefix.service.web_metrics import Metrics
from surefix.service.web_options import WebOptions
from surefix.service.web_pages import pages

if TYPE_CHECKING:
    from surefix.service.running import Live

__all__ = ["Web", "open_web"]

_REQUEST: Final = 5.0  # s to send a whole request head
_HEAD: Final = 16_384  # bytes of it
_UNREAD: Final = 1 << 17  # bytes that the system keeps for a client that does not read
_END: Final = 1.0  # s to take the last answers


class Web:
    """The web side as it runs; from `open_web`.

    Parameters
    ----------
    live
        The service.
    options
        Its table ``[web]``.
    listening
        The socket, bound.
    clock
        s, Unix.
    """

    def __init__(
        self,
        live: Live,
        options: WebOptions,
        listening: socket.socket,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._socket = listening
        self.state = WebState()
        self.port: int = listening.getsockname()[1]
        self._metrics = Metrics(live, self.state, clock)
        self._hub = Hub(live, options.clients, self.state, self._cut, clock)
        app = web_app(live, options, self._hub, self._metrics, pages(), clock)
        config = uvicorn.Config(
            cast("Any", Guard(cast("Any", app), options, self.state, self._cut, clock)),
            http=_connection(options.connections, self.state),
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=int(_END),
            h11_max_incomplete_event_size=_HEAD,
            ws_max_size=4096,
            ws_ping_interval=10.0,
            ws_ping_timeout=10.0,
            ws_per_message_deflate=False,
        )
        self._server = _Server(config)
        log = logging.getLogger("uvicorn.error")
        log.setLevel(logging.ERROR)  # what is wrong with a request is said in its answer
        log.addFilter(_is_error)

    def notice(self, arrived: Sequence[Arrived]) -> None:
        """Be told of a step of the service, and of what it took in."""
        self._metrics.notice(arrived)
        self._hub.notice()

    async def run(self) -> None:
        """Serve until `stop` is called."""
        publishing = asyncio.create_task(self._hub.publish())
        try:
            await self._server.serve([self._socket])
        finally:
            publishing.cancel()
            await asyncio.gather(publishing, return_exceptions=True)
            for connection in list(self._server.server_state.connections):
                connection.transport.abort()
            self._socket.close()

    def stop(self) -> None:
        """Let `run` come to its end: no new requests, the last answers are sent."""
        self._server.should_exit = True

    def _cut(self, client: tuple[str, int]) -> None:
        cut(self._server.server_state.connections, client)


def open_web(live: Live, options: WebOptions, clock: Callable[[], float] = time.time) -> Web:
    """Take the port and make everything ready to serve.

    Raises
    ------
    OutputError
        The port is taken, or there is no such address here.
    MissingExtraError
        Plotly is not installed.
    """
    host, port = options.place
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listening = socket.socket(family, kind, protocol)
    except OSError as error:
        raise _refused(options, error) from error
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _UNREAD)
        listening.bind(place)
        listening.listen()
    except OSError as error:
        listening.close()
        raise _refused(options, error) from error
    return Web(live, options, listening, clock)


def _refused(options: WebOptions, error: OSError) -> OutputError:
    return OutputError(
        f"[web] address {options.address}: {error.strerror or error}",
        "an address of this machine and a port that is free",
        "choose another port",
    )


def _is_error(record: logging.LogRecord) -> bool:
    """A WebSocket that is refused with a status is none, though uvicorn takes it for one."""
    return "without completing handshake" not in str(record.msg)


class _Server(uvicorn.Server):
    """One that leaves signals to the service."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def _connection(most: int, state: WebState) -> type[H11Protocol]:
    """Connections that must say what they want in time, and are not too many.

    When there are too many, the one that has been silent for the longest gives way.
    """

    class Connection(H11Protocol):
        _deadline: asyncio.TimerHandle | None = None
        _stream = False  # it has become that of a WebSocket

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._wait()
            if len(self.connections) > most:
                others = [each for each in self.connections if isinstance(each, Connection)]
                min(others, key=Connection.due).drop()

        def connection_lost(self, exc: Exception | None) -> None:
            self._heard()
            super().connection_lost(exc)

        def handle_websocket_upgrade(self, event: Any) -> None:
            self._stream = True
            super().handle_websocket_upgrade(event)

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self._stream or (self.cycle is not None and not self.cycle.response_complete):
                self._heard()  # at work; an answer that is not taken has a limit of its own
            elif self._deadline is None:
                self._wait()

        def due(self) -> float:
            return math.inf if self._deadline is None else self._deadline.when()

        def _wait(self) -> None:
            self._deadline = self.loop.call_later(_REQUEST, self.drop)

        def _heard(self) -> None:
            if self._deadline is not None:
                self._deadline.cancel()
                self._deadline = None

        def drop(self) -> None:
            self._heard()
            state.late += 1
            self.transport.abort()

    return Connection
