"""Faults 43, 44 and 51 of the sockets that sentences come in by; those of the web are its own."""

import asyncio
import contextlib
import math
import socket

from service.test_live import options_in
from service.test_station import recorded
from service.test_transport import SENTENCE, free_port, wait_for
from surefix.service import inputs
from surefix.service import live as service
from surefix.service.addresses import INPUTS, address
from surefix.service.inbox import Arrived, Inbox
from surefix.service.inputs import Line, listen
from surefix.service.live import begin_live, step
from surefix.service.options import read_live


def test_fault_43_more_than_can_be_taken(tmp_path):
    """Ten times what there is room for: the oldest goes, is counted, and the newest is put out."""
    place = options_in(tmp_path, "udp://127.0.0.1:1", f"udp://127.0.0.1:{free_port()}")
    live, lines = begin_live(read_live(place)), recorded(400).splitlines(keepends=True)
    start = 1_785_585_600.0

    async def run():
        for line in lines[:300]:
            await step(live, [Arrived(0, math.nan, line)], start)
        inbox = Inbox(most=len(b"".join(lines[300:])) // 10)
        for line in lines[300:]:
            inbox.put(Arrived(0, math.nan, line))
        shed = inbox.shed
        arrived = await inbox.take()
        service._noticed(live, inbox, start)
        await step(live, arrived, start)
        assert inbox.shed == 0
        return shed, arrived

    shed, arrived = asyncio.run(run())
    assert shed + sum(len(each.data) for each in arrived) == len(b"".join(lines[300:]))
    assert live.now.time == start + 399.0
    (said,) = [each.text for each in live.journal.told("event") if "overload" in each.text]
    assert f"{shed} bytes" in said
    assert "load" in {each.concerns for each in live.alarms}
    live.journal.close()


def test_fault_44_many_connections_that_say_nothing(monkeypatch):
    """They are too many, are turned away and counted; the device that sends is heard."""
    monkeypatch.setattr(inputs, "_CLIENTS", 20)

    async def run():
        port, inbox = free_port(), Inbox()
        line = Line(address(f"tcp-listen://127.0.0.1:{port}", INPUTS))
        task = asyncio.create_task(listen(0, line, inbox))
        await asyncio.sleep(0.1)
        _, device = await asyncio.open_connection("127.0.0.1", port)
        silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(100)]
        await wait_for(lambda: line.refused == 81, 20.0)
        assert line.refused_from == "127.0.0.1"
        device.write(SENTENCE)
        await wait_for(lambda: line.size == len(SENTENCE), 20.0)
        for each in silent:
            each.close()
        await asyncio.sleep(0.2)
        _, another = await asyncio.open_connection("127.0.0.1", port)
        another.write(SENTENCE)
        await wait_for(lambda: line.size == 2 * len(SENTENCE), 20.0)
        device.close()
        another.close()
        task.cancel()

    asyncio.run(run())


def test_fault_51_datagrams_and_clients_that_are_not_listed():
    async def run():
        inbox, port = Inbox(), free_port(socket.SOCK_DGRAM)
        line = Line(address(f"udp://127.0.0.1:{port}", INPUTS))
        server = Line(address(f"tcp-listen://127.0.0.1:{port}", INPUTS))
        tasks = [
            asyncio.create_task(listen(0, each, inbox, allow=("127.0.0.2",)))
            for each in (line, server)
        ]
        await wait_for(lambda: line.connected)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            out.bind(("127.0.0.1", 0))
            out.sendto(SENTENCE, ("127.0.0.1", port))
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(SENTENCE)
        await wait_for(lambda: line.refused == 1 and server.refused == 1)
        with contextlib.suppress(ConnectionResetError):
            assert await reader.read() == b""
        writer.close()
        assert (line.refused_from, line.size, server.size) == ("127.0.0.1", 0, 0)
        assert await inbox.take(0.05) == []
        for task in tasks:
            task.cancel()

    asyncio.run(run())
