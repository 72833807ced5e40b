"""Hand on what was told, to any number of clients, none of which can hold up another."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

from surefix.errors import OutputError
from surefix.service.addresses import Address

__all__ = ["Exit", "Output", "open_output"]

_BACKLOG: Final = 1 << 18  # bytes that a client may leave unread before it is dropped
_CLIENTS: Final = 250


@dataclass
class Exit:
    """How an output is.

    Parameters
    ----------
    address
        Where it goes to; with the port that was given, if it asked for any.
    clients, dropped, refused
        Those connected, those that did not read, and those that were too many.
    size
        Bytes handed on so far.
    trouble
        What went wrong last, in words.
    """

    address: Address
    clients: int = 0
    dropped: int = 0
    refused: int = 0
    size: int = 0
    trouble: str = ""


class Output(Protocol):
    """An open output."""

    state: Exit

    def send(self, data: bytes) -> None:
        """Hand on bytes at once; never waits."""

    async def close(self) -> None:
        """Send what is left, and close."""


async def open_output(address: Address) -> Output:
    """Open an output.

    Raises
    ------
    OutputError
        A port is taken, a device is not there.
    """
    state = Exit(address)
    try:
        if address.kind == "udp":
            return await _Datagrams.opened(state)
        if address.kind == "tcp-listen":
            return await _Server.opened(state)
        return await _Serial.opened(state)
    except OSError as error:
        raise OutputError(
            f"{address}: {error.strerror or error}", "a port that is free, a device that is there"
        ) from error


class _Server:
    """A server that says the same to all its clients."""

    def __init__(self, state: Exit) -> None:
        self.state = state
        self._clients: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server | None = None

    @classmethod
    async def opened(cls, state: Exit) -> _Server:
        made = cls(state)
        server = await asyncio.start_server(made._meet, state.address.host, state.address.port)
        made._server = server
        state.address = state.address._replace(port=server.sockets[0].getsockname()[1])
        return made

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._clients) >= _CLIENTS:
            self.state.refused += 1
            writer.transport.abort()
            return
        self._clients.add(writer)
        self.state.clients = len(self._clients)
        try:
            while await reader.read(1 << 12):
                pass  # what clients say is not listened to
        except OSError:
            pass
        finally:
            self._forget(writer)

    def _forget(self, writer: asyncio.StreamWriter) -> None:
        self._clients.discard(writer)
        self.state.clients = len(self._clients)
        writer.close()

    def send(self, data: bytes) -> None:
        for writer in tuple(self._clients):
            if writer.transport.get_write_buffer_size() > _BACKLOG:
                self.state.dropped += 1
                self._clients.discard(writer)
                writer.transport.abort()
            elif not writer.is_closing():
                writer.write(data)
                self.state.size += len(data)
        self.state.clients = len(self._clients)

    async def close(self) -> None:
        assert self._server is not None
        self._server.close()
        await asyncio.sleep(0.0)  # who is just coming in is met, and so will be closed
        for writer in tuple(self._clients):
            writer.close()
        waits = [asyncio.create_task(_closed(writer)) for writer in self._clients]
        if waits:
            await asyncio.wait(waits, timeout=1.0)
        for writer in self._clients:
            writer.transport.abort()


async def _closed(writer: asyncio.StreamWriter) -> None:
    try:
        await writer.wait_closed()
    except OSError:
        return


class _Datagrams:
    """Datagrams of one or several whole sentences, to a host or, if it is one, a broadcast."""

    def __init__(self, state: Exit) -> None:
        self.state = state
        self._socket: socket.socket | None = None

    @classmethod
    async def opened(cls, state: Exit) -> _Datagrams:
        made = cls(state)
        loop = asyncio.get_running_loop()
        where = state.address.host, state.address.port
        family, kind, protocol, _, place = (await loop.getaddrinfo(*where, type=socket.SOCK_DGRAM))[
            0
        ]
        made._socket = socket.socket(family, kind, protocol)
        made._socket.setblocking(False)
        made._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        made._socket.connect(place)
        return made

    def send(self, data: bytes) -> None:
        assert self._socket is not None
        try:
            self._socket.send(data)
            self.state.size += len(data)
            self.state.trouble = ""
        except OSError as error:
            self.state.trouble = error.strerror or str(error)

    async def close(self) -> None:
        assert self._socket is not None
        self._socket.close()


class _Serial:
    """A serial line; what it is too slow for is given up, a whole message at a time."""

    def __init__(self, state: Exit, port: Any, run: Callable[..., Any]) -> None:
        self.state, self._port, self._run = state, port, run
        self._busy: Any = None

    @classmethod
    async def opened(cls, state: Exit) -> _Serial:
        import serial

        loop = asyncio.get_running_loop()
        try:
            port = serial.Serial(state.address.path, int(state.address.figure), write_timeout=1.0)
        except serial.SerialException as error:
            raise OSError(str(error)) from error
        return cls(state, port, lambda data: loop.run_in_executor(None, port.write, data))

    def send(self, data: bytes) -> None:
        if self._busy is not None and not self._busy.done():
            self.state.dropped += 1
            return
        if self._busy is not None and self._busy.exception() is not None:
            self.state.trouble = str(self._busy.exception())
        self._busy = self._run(data)
        self.state.size += len(data)

    async def close(self) -> None:
        if self._busy is not None:
            await asyncio.wait([self._busy], timeout=1.0)
        self._port.close()
