"""The stream of records to WebSocket clients: each gets the same text, none can hold up another."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from starlette.responses import JSONResponse
from starlette.websockets import WebSocket, WebSocketDisconnect

from surefix.service.web_guard import WebState
from surefix.service.web_record import StateRecord, rows_record, state_record

if TYPE_CHECKING:
    from surefix.service.running import Live

__all__ = ["Hub"]

_BACKLOG: Final = 50  # records that a client may leave unread, besides what its socket holds
_APART: Final = 0.1  # s between two records at least
_IDLE: Final = 1.0  # s between two records at most
_CHECK: Final = 10.0  # s after which it is asked again whether a client may still hear
_ROWS: Final = 1000  # rows of a record


class Hub:
    """Clients, and what they are told.

    Parameters
    ----------
    live
        The service.
    most
        Clients at a time.
    state
        Where they are counted.
    cut
        Cuts the connection of a client, (host, port), at once.
    clock
        s, Unix.
    """

    def __init__(
        self,
        live: Live,
        most: int,
        state: WebState,
        cut: Callable[[tuple[str, int]], None],
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._live, self._most, self._state = live, most, state
        self._cut, self._clock = cut, clock
        self._queues: dict[WebSocket, asyncio.Queue[str]] = {}
        self._news = asyncio.Event()
        self._next = live.history.total

    def notice(self) -> None:
        """Let it be known that there is something new."""
        self._news.set()

    def record(self) -> StateRecord:
        """The state at present, with the rows since the record that was sent last."""
        history = self._live.history
        numbers = history.since(self._next)
        rows = rows_record(history.take(numbers), numbers, history.sensors, _ROWS)
        return state_record(self._live, self._clock(), rows)

    async def publish(self) -> None:
        """Tell all clients what is new, for ever."""
        while True:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._news.wait(), _IDLE)
            self._news.clear()
            self._publish()
            await asyncio.sleep(_APART)

    def _publish(self) -> None:
        """Tell all clients what is new, now."""
        if self._queues:
            self._tell(self.record().model_dump_json())
        self._next = self._live.history.total

    def _tell(self, text: str) -> None:
        for websocket, queue in tuple(self._queues.items()):
            try:
                queue.put_nowait(text)
            except asyncio.QueueFull:
                self._state.dropped += 1
                del self._queues[websocket]
                if websocket.client is not None:
                    self._cut((websocket.client.host, websocket.client.port))
        self._state.clients = len(self._queues)

    async def stream(self, websocket: WebSocket) -> None:
        """Serve one client until it goes, is dropped or says anything: it is only to listen."""
        if len(self._queues) >= self._most:
            text = f"at most {self._most} clients at a time; try again later"
            return await websocket.send_denial_response(JSONResponse({"detail": text}, 503))
        await websocket.accept()
        queue: asyncio.Queue[str] = asyncio.Queue(_BACKLOG)
        self._publish()  # so that the new client does not hear again what its first record holds
        queue.put_nowait(self.record().model_dump_json())
        self._queues[websocket] = queue
        self._state.clients = len(self._queues)
        writing = asyncio.create_task(_write(websocket, queue))
        reading = asyncio.create_task(websocket.receive())
        ending = asyncio.create_task(_ended(websocket))
        tasks = {writing, reading, ending}
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if ending.done():
                await asyncio.wait_for(websocket.close(1008, "the session has ended"), _IDLE)
            elif reading.done() and reading.result()["type"] == "websocket.receive":
                await asyncio.wait_for(websocket.close(1003, "this stream only speaks"), _IDLE)
        except (TimeoutError, OSError, RuntimeError, WebSocketDisconnect):
            pass
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._queues.pop(websocket, None)
            self._state.clients = len(self._queues)
        return None


async def _ended(websocket: WebSocket) -> None:
    """Wait until the client may no longer hear: its session, or its token, has ended."""
    while websocket.state.allowed():
        await asyncio.sleep(_CHECK)


async def _write(websocket: WebSocket, queue: asyncio.Queue[str]) -> None:
    while True:
        await websocket.send_text(await queue.get())
