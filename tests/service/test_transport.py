"""Sockets, serial lines and recorded logs: what goes in comes out; what breaks is opened again."""

import asyncio
import math
import os
import socket
import time

from surefix.service.addresses import INPUTS, OUTPUTS, address
from surefix.service.inbox import Arrived, Inbox
from surefix.service.inputs import Line, listen
from surefix.service.outputs import open_output

SENTENCE = b"$HEHDT,218.53,T*12\r\n"


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


async def wait_for(condition, seconds=5.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        await asyncio.sleep(0.01)


class Listening:
    """An input that is read while the body runs."""

    def __init__(self, text, **options):
        self.line, self.inbox = Line(address(text, INPUTS)), Inbox()
        self.options, self.data = options, b""

    async def __aenter__(self):
        self.task = asyncio.create_task(listen(3, self.line, self.inbox, **self.options))
        return self

    async def __aexit__(self, *_):
        self.task.cancel()

    async def read(self, size):
        while len(self.data) < size:
            for arrived in await asyncio.wait_for(self.inbox.take(), 5.0):
                assert arrived.source == 3
                self.data += arrived.data
        return self.data


def test_the_oldest_is_given_up_when_too_much_waits():
    async def run():
        inbox = Inbox(most=100)
        for n in range(10):
            inbox.put(Arrived(0, float(n), bytes([n]) * 30))
        taken = await inbox.take()
        assert [arrived.time for arrived in taken] == [7.0, 8.0, 9.0]
        assert inbox.shed == 210
        assert await inbox.take(0.01) == []

    asyncio.run(run())


def test_a_log_waits_for_room():
    async def run():
        inbox, order = Inbox(most=100), []

        async def write():
            for n in range(20):
                await inbox.put_in_turn(Arrived(0, math.nan, bytes(40)))
                order.append(n)

        task = asyncio.create_task(write())
        taken = 0
        while taken < 20:
            taken += len(await inbox.take(1.0))
        await task
        assert inbox.shed == 0

    asyncio.run(run())


def test_datagrams_of_listed_senders_alone():
    async def run():
        port = free_port(socket.SOCK_DGRAM)
        text = f"udp://127.0.0.1:{port}"
        async with Listening(text, allow=("127.0.0.2", "10.0.0.0/8")) as listening:
            await wait_for(lambda: listening.line.connected)
            for sender, data in (("127.0.0.1", b"$NO\n"), ("127.0.0.2", SENTENCE.strip())):
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
                    out.bind((sender, 0))
                    out.sendto(data, ("127.0.0.1", port))
            assert await listening.read(len(SENTENCE)) == SENTENCE
            assert listening.line.refused == 1
            assert listening.line.refused_from == "127.0.0.1"

    asyncio.run(run())


def test_a_server_that_goes_away_is_found_again():
    async def run():
        port = free_port()

        async def greet(_, writer):
            writer.write(SENTENCE)
            await writer.drain()
            writer.close()

        async with Listening(f"tcp://127.0.0.1:{port}") as listening:
            await wait_for(lambda: listening.line.trouble != "")
            assert not listening.line.connected
            for _ in range(2):
                before = listening.line.size
                async with await asyncio.start_server(greet, "127.0.0.1", port):
                    await listening.read(before + len(SENTENCE))
                await wait_for(lambda: "refused" in listening.line.trouble.lower())
            assert listening.data == SENTENCE * (len(listening.data) // len(SENTENCE))

    asyncio.run(run())


def test_clients_come_and_go():
    async def run():
        port = free_port()
        async with Listening(f"tcp-listen://127.0.0.1:{port}") as listening:
            await asyncio.sleep(0.05)
            for n in (1, 2, 3):
                _, writer = await asyncio.open_connection("127.0.0.1", port)
                writer.write(SENTENCE)
                await listening.read(n * len(SENTENCE))
                assert listening.line.connected
                writer.close()
                await wait_for(lambda: not listening.line.connected)

    asyncio.run(run())


def test_a_serial_line_both_ways():
    async def run():
        ours, theirs = os.openpty()
        name = os.ttyname(theirs)
        async with Listening(f"serial://{name}?baud=9600") as listening:
            await wait_for(lambda: listening.line.connected or listening.line.trouble)
            os.write(ours, SENTENCE)
            assert await listening.read(len(SENTENCE)) == SENTENCE
        output = await open_output(address(f"serial://{name}?baud=9600", OUTPUTS))
        output.send(SENTENCE)
        await output.close()
        assert os.read(ours, 100) == SENTENCE
        os.close(ours)
        os.close(theirs)

    asyncio.run(run())


def test_a_recorded_log_keeps_its_pace(tmp_path):
    log = tmp_path / "log.nmea"
    lines = [b"2014-08-01T00:00:%02dZ $HEHDT,218.53,T*12\r\n" % n for n in range(8)]
    log.write_bytes(b"".join(lines))

    async def run(speed):
        began = time.monotonic()
        async with Listening(f"file://{log}?speed={speed}") as listening:
            await listening.read(len(b"".join(lines)))
            await wait_for(lambda: listening.line.ended)
        assert listening.data == b"".join(lines)
        return time.monotonic() - began

    assert 0.65 < asyncio.run(run(10)) < 2.0
    assert asyncio.run(run(0)) < 0.5


def test_clients_that_never_read_change_nothing_for_the_others():
    async def run():
        output = await open_output(address("tcp-listen://127.0.0.1:0", OUTPUTS))
        port = output.state.address.port
        stuck = []
        for _ in range(3):
            silent = socket.create_connection(("127.0.0.1", port))
            silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            stuck.append(silent)
        reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=1 << 25)
        await wait_for(lambda: output.state.clients == 4)
        got = 0
        for n in range(300):
            output.send(bytes([n % 256]) * 40_000)
            while got < (n + 1) * 40_000:
                got += len(await asyncio.wait_for(reader.read(1 << 20), 2.0))
        assert output.state.dropped == 3
        assert output.state.clients == 1
        writer.close()
        for silent in stuck:
            silent.close()
        await output.close()

    asyncio.run(run())


def test_datagrams_out():
    async def run():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind(("127.0.0.1", 0))
            receiver.settimeout(2.0)
            port = receiver.getsockname()[1]
            output = await open_output(address(f"udp://127.0.0.1:{port}", OUTPUTS))
            output.send(SENTENCE)
            assert receiver.recv(100) == SENTENCE
            await output.close()

    asyncio.run(run())
