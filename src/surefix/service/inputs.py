"""Read from sockets, serial lines and recorded logs, and go on when they fail."""

from __future__ import annotations

import asyncio
import ipaddress
import math
import os
import re
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from surefix.errors import InputError
from surefix.io.nmea_clock import receive_time
from surefix.service.addresses import Address
from surefix.service.inbox import Arrived, Inbox

__all__ = ["Line", "listen"]

_CLIENTS: Final = 100  # of one server; more are turned away
_BLOCK: Final = 1 << 16
_AGAIN: Final = (0.2, 5.0)  # s between attempts to connect: at first, and at most
_CLOCK: Final = re.compile(rb"\$..(?:GGA|RMC|GNS|ZDA|GLL,[^*]*?),(\d{2})(\d{2})(\d{2}(?:\.\d+)?)")
_MESSAGE: Final = re.compile(rb"\$|\{|\+\+\+AT")  # what the time of reception stands before
_STEP: Final = 0.02  # s: a replay sends what is due so often
_LONGEST: Final = 5.0  # s: longer gaps of a log are not waited for
_DAY: Final = 86_400.0


@dataclass
class Line:
    """How an input is.

    Parameters
    ----------
    address
        Where it comes from.
    connected
        Whether it is open, and a client, if one is needed, is there.
    trouble
        Why not, in words.
    size, last
        Bytes so far, of a log those of earlier runs, too, and s, Unix, when the last came; NaN
        before.
    refused
        Datagrams and clients that are not listed, clients that are too many, and the last of them.
    ended
        Whether a recorded log has come to its end.
    """

    address: Address
    connected: bool = False
    trouble: str = ""
    size: int = 0
    last: float = math.nan
    refused: int = 0
    refused_from: str = ""
    ended: bool = False


async def listen(
    source: int,
    line: Line,
    inbox: Inbox,
    *,
    allow: tuple[str, ...] = (),
    clock: Callable[[], float] = time.time,
) -> None:
    """Read an input into the inbox for ever, or until a recorded log ends.

    What breaks is opened again, after a time that grows to 5 s.

    Parameters
    ----------
    source, line, inbox
        Number of the input, its state, which is kept up to date, and where the bytes go.
    allow
        Networks that datagrams and clients may come from; empty: any.
    clock
        Gives the time of arrival, s.

    Raises
    ------
    InputError
        A port is taken, or a log is not there: what waiting does not mend.
    """

    def arrived(data: bytes) -> None:
        line.size += len(data)
        line.last = clock()
        inbox.put(Arrived(source, line.last, data))

    kind = line.address.kind
    if kind == "file":
        return await _replay(source, line, inbox)
    listed = _Listed(allow, line)
    if kind == "udp":
        return await _datagrams(line, listed, arrived)
    if kind == "tcp-listen":
        return await _clients(line, listed, arrived)
    opened = _serial if kind == "serial" else _connected
    return await _again(line, arrived, opened)


class _Listed:
    """Who may send."""

    def __init__(self, allow: tuple[str, ...], line: Line) -> None:
        self._networks = [ipaddress.ip_network(text, strict=False) for text in allow]
        self._line = line

    def __call__(self, host: str) -> bool:
        """Tell whether a sender may, and note one that may not."""
        if not self._networks:
            return True
        known = ipaddress.ip_address(host.partition("%")[0])
        if any(known in network for network in self._networks):
            return True
        self._line.refused += 1
        self._line.refused_from = host
        return False


async def _datagrams(line: Line, listed: _Listed, arrived: Callable[[bytes], None]) -> None:
    class Receiver(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
            if listed(str(addr[0])):
                arrived(data if data.endswith(b"\n") else data + b"\r\n")

    loop = asyncio.get_running_loop()
    where = line.address.host, line.address.port
    try:
        transport, _ = await loop.create_datagram_endpoint(Receiver, local_addr=where)
    except OSError as error:
        raise _taken(line.address, error) from error
    line.connected = True
    try:
        await loop.create_future()
    finally:
        line.connected = False
        transport.close()


async def _clients(line: Line, listed: _Listed, arrived: Callable[[bytes], None]) -> None:
    inside = 0

    async def client(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal inside
        host = str(writer.get_extra_info("peername")[0])
        if inside >= _CLIENTS:
            line.refused, line.refused_from = line.refused + 1, host
            writer.transport.abort()
        elif listed(host):
            inside += 1
            line.connected = True
            try:
                while data := await reader.read(_BLOCK):
                    arrived(data)
            except OSError:
                pass
            finally:
                inside -= 1
                line.connected = inside > 0
                writer.close()
        else:
            writer.close()

    try:
        server = await asyncio.start_server(client, line.address.host, line.address.port)
    except OSError as error:
        raise _taken(line.address, error) from error
    async with server:
        try:
            await server.serve_forever()
        finally:
            await asyncio.sleep(0.0)  # who is just coming in is met, and so will be closed


def _taken(address: Address, error: OSError) -> InputError:
    return InputError(
        f"{address}: {error.strerror or error}", "a port that is free", "choose another port"
    )


async def _again(
    line: Line,
    arrived: Callable[[bytes], None],
    opened: Callable[[Address], AsyncIterator[bytes]],
) -> None:
    """Read what ``opened`` gives; when it breaks, open it again."""
    wait = _AGAIN[0]
    while True:
        try:
            async for data in opened(line.address):
                line.connected, line.trouble, wait = True, "", _AGAIN[0]
                if data:
                    arrived(data)
            line.trouble = "closed by the other side"
        except OSError as error:
            line.trouble = os.strerror(error.errno) if error.errno else str(error)
        line.connected = False
        await asyncio.sleep(wait)
        wait = min(2.0 * wait, _AGAIN[1])


async def _connected(address: Address) -> AsyncIterator[bytes]:
    reader, writer = await asyncio.wait_for(
        asyncio.open_connection(address.host, address.port), _AGAIN[1]
    )
    try:
        yield b""
        while data := await reader.read(_BLOCK):
            yield data
    finally:
        writer.close()


async def _serial(address: Address) -> AsyncIterator[bytes]:
    import serial

    def read(port: Any) -> bytes:
        return bytes(port.read(max(1, port.in_waiting)))

    loop = asyncio.get_running_loop()
    try:
        port = await loop.run_in_executor(
            None, lambda: serial.Serial(address.path, int(address.figure), timeout=0.2)
        )
        try:
            while True:
                yield await loop.run_in_executor(None, read, port)
        finally:
            port.close()
    except serial.SerialException as error:
        raise OSError(str(error)) from error


async def _replay(source: int, line: Line, inbox: Inbox) -> None:
    """Send what is left of a log line by line, as fast as it says times the speed; 0: as can be."""
    speed = line.address.figure
    began, first, due = time.monotonic(), math.nan, 0.0
    latest = math.nan
    line.connected = True
    piece: list[bytes] = []

    async def send() -> None:
        data = b"".join(piece)
        piece.clear()
        if data:
            line.size += len(data)
            line.last = time.time()
            await inbox.put_in_turn(Arrived(source, math.nan, data))

    try:
        with Path(line.address.path).open("rb") as file:
            file.seek(line.size)
            while text := file.readline(_BLOCK):
                now = _recorded(text, latest) if speed > 0.0 else math.nan
                if not math.isnan(now):
                    step = now - latest if not math.isnan(latest) else 0.0
                    first = now if math.isnan(first) else first
                    latest = now
                    due += min(max(step, 0.0), _LONGEST) / speed
                    wait = began + due - time.monotonic()
                    if wait > _STEP:
                        await send()
                        await asyncio.sleep(wait)
                piece.append(text)
                if len(piece) >= 100:
                    await send()
    except OSError as error:
        raise InputError(f"{line.address.path}: {error.strerror}", "a readable log") from error
    await send()
    line.connected, line.ended = False, True
    await inbox.put_in_turn(Arrived(source, math.nan, b""))


def _recorded(text: bytes, latest: float) -> float:
    """Time of a line of a log, s: of its reception, or of the day; NaN if it has none."""
    message = _MESSAGE.search(text)
    if message and not math.isnan(at := receive_time(text[: message.start()])):
        return at
    found = _CLOCK.search(text)
    if found is None:
        return math.nan
    second = 3600.0 * int(found[1]) + 60.0 * int(found[2]) + float(found[3])
    if math.isnan(latest):
        return second
    return second + _DAY * round((latest - second) / _DAY)
