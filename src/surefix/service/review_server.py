"""Serve a review to browsers of this machine, behind the guard of the live service."""

from __future__ import annotations

import contextlib
import secrets
import socket
from typing import Any, Final, cast

import uvicorn

from surefix.errors import OutputError
from surefix.service.review import Review
from surefix.service.review_app import review_app
from surefix.service.web_guard import Guard, WebState, cut
from surefix.service.web_options import Token, WebOptions
from surefix.service.web_pages import pages

__all__ = ["ReviewServer", "open_server"]

_HOST: Final = "127.0.0.1"
_BODY: Final = 4_000_000  # bytes: a line around fixes, or many rows


class ReviewServer:
    """A server that has its port; from `open_server`.

    Parameters
    ----------
    review, name, command
        As for `surefix.service.review_app.review_app`.
    listening
        The socket, bound.
    """

    def __init__(self, review: Review, name: str, command: str, listening: socket.socket) -> None:
        self._socket = listening
        port = listening.getsockname()[1]
        token = secrets.token_urlsafe(24)
        options = WebOptions(
            address=f"{_HOST}:{port}",
            operator=Token(token),
            viewer=Token(secrets.token_urlsafe(24)),  # nobody knows it: without one nothing is seen
            body_bytes=_BODY,
            requests_per_s=50.0,
        )
        app = review_app(review, pages("surefix.service.pages.review"), name, command)
        guard = Guard(cast("Any", app), options, WebState(), self._cut)
        self._server = uvicorn.Server(
            uvicorn.Config(
                cast("Any", guard),
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                timeout_graceful_shutdown=1,
            )
        )
        self.url = f"http://{_HOST}:{port}/#{token}"
        """With the token behind ``#``, which browsers keep to themselves."""

    def run(self) -> None:
        """Serve until interrupted, or `stop` is called."""
        with contextlib.suppress(KeyboardInterrupt):  # raised again once all is shut down
            self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """Let `run` come to its end."""
        self._server.should_exit = True

    def _cut(self, client: tuple[str, int]) -> None:
        cut(self._server.server_state.connections, client)


def open_server(review: Review, name: str, command: str, port: int = 0) -> ReviewServer:
    """Take a port of this machine; 0 is any that is free.

    Raises
    ------
    OutputError
        The port is taken.
    MissingExtraError
        Plotly is not installed.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((_HOST, port))
        listening.listen()  # who asks before it serves waits
    except (OSError, OverflowError) as error:
        listening.close()
        raise OutputError(
            f"port {port}: {error}", "a port of this machine that is free", "leave out --port"
        ) from error
    return ReviewServer(review, name, command, listening)
