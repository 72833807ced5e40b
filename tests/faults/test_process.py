"""Faults 38, 39 and 41 of processes; 35 to 37 and 40 have files of their own."""

import asyncio
import math
import os
import pickle
import random
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time

import pytest

from service.test_live import SUREFIX, options_in
from service.test_station import recorded, sentence
from service.test_transport import SENTENCE, free_port, wait_for
from surefix.errors import InputError, OutputError
from surefix.io.journal import open_journal
from surefix.service import inputs
from surefix.service.addresses import INPUTS, OUTPUTS, address
from surefix.service.inbox import Arrived, Inbox
from surefix.service.inputs import Line, listen
from surefix.service.live import begin_live, step
from surefix.service.logbook import Logbook
from surefix.service.options import read_live
from surefix.service.outputs import open_output
from surefix.service.station import begin_station, receive, stored


def flood(port, stop):
    """Send without a pause until asked to stop."""
    lines = recorded(300).splitlines(keepends=True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        while not stop.is_set():
            for line in lines:
                out.sendto(line, ("127.0.0.1", port))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_fault_38_asked_to_stop_under_load(tmp_path, number):
    port = free_port(socket.SOCK_DGRAM)
    place = options_in(tmp_path, f"udp://127.0.0.1:{port}", "tcp-listen://127.0.0.1:0")
    stop = threading.Event()
    sending = threading.Thread(target=flood, args=(port, stop))
    with subprocess.Popen([SUREFIX, "live", "--options", place], stdout=subprocess.PIPE) as run:
        try:
            run.stdout.readline()
            sending.start()
            wait_until((tmp_path / "mission.db").exists)
            journal = open_journal(f"sqlite:///{tmp_path / 'mission.db'}", new=False)
            wait_until(lambda: journal.last()[1] > 3)
            run.send_signal(number)
            assert run.wait(60.0) == 0
        finally:
            stop.set()
            sending.join()
    live = begin_live(read_live(place))
    assert live.station.after == live.taken == journal.last()[0]  # the snapshot is of the end
    live.journal.close()


def wait_until(condition):
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def interrupted(tmp_path):
    """A service that was killed: its folder, and options."""
    place = options_in(tmp_path, "udp://127.0.0.1:1", f"udp://127.0.0.1:{free_port()}", 0.05)
    body = (
        "import asyncio, math, os, signal, sys\n"
        "from service.test_station import recorded\n"
        "from surefix.service.inbox import Arrived\n"
        "from surefix.service.live import begin_live, step\n"
        "from surefix.service.options import read_live\n"
        "live = begin_live(read_live(sys.argv[1]))\n"
        "async def run():\n"
        "    for line in recorded().splitlines(keepends=True):\n"
        "        await step(live, [Arrived(0, math.nan, line)], 0.0)\n"
        "asyncio.run(run())\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", body, place], env=env, check=False)
    assert done.returncode == -signal.SIGKILL
    return read_live(place)


def uninterrupted(options, pieces):
    station = begin_station(options)
    for piece in pieces:
        station, _ = receive(station, [piece])
    return stored(station)


def test_fault_39_a_tail_of_the_log_that_is_garbage(tmp_path):
    options = interrupted(tmp_path)
    content = (tmp_path / "mission.db-wal").read_bytes()
    source, kept = random.Random(2), []
    for share in (1.0, 0.9, 0.5, 0.1):
        folder = tmp_path / f"{share}"
        folder.mkdir()
        shutil.copy(tmp_path / "mission.db", folder)
        cut = int(len(content) * share)
        (folder / "mission.db-wal").write_bytes(content[:cut] + source.randbytes(3000))
        copy = open_journal(f"sqlite:///{folder / 'mission.db'}", new=False)
        pieces = list(copy.received())
        assert [piece.number for piece in pieces] == list(range(1, len(pieces) + 1))
        assert recorded().startswith(b"".join(piece.data for piece in pieces))
        kept.append(len(pieces))
    assert kept[0] == len(recorded().splitlines())
    assert kept == sorted(kept, reverse=True)
    live = begin_live(options)
    assert stored(live.station) == uninterrupted(options, live.journal.received())
    live.journal.close()


@pytest.mark.parametrize("damage", ["noise", "pickle", "cut", "empty", "all"])
def test_fault_39_a_snapshot_that_is_damaged(tmp_path, damage):
    """The one before it and more of the journal lead to the same state; code is never run."""
    options = interrupted(tmp_path)
    with sqlite3.connect(tmp_path / "mission.db") as base:
        found = base.execute("select after, snapshot from state order by after desc").fetchall()
        assert len(found) > 1
        for after, snapshot in found if damage == "all" else found[:1]:
            bad = {
                "noise": bytes(255 - byte for byte in snapshot),
                "pickle": pickle.dumps(print),
                "cut": snapshot[: len(snapshot) // 2],
                "empty": b"",
                "all": snapshot[:-1] + bytes([snapshot[-1] ^ 1]),
            }[damage]
            base.execute("update state set snapshot = ? where after = ?", (bad, after))
    base.close()
    live = begin_live(options)
    assert stored(live.station) == uninterrupted(options, live.journal.received())
    live.journal.close()


def test_fault_39_a_file_that_is_damaged_is_put_aside_and_told(tmp_path):
    options = interrupted(tmp_path)
    for name in ("mission.db-wal", "mission.db-shm"):
        (tmp_path / name).unlink()
    place = tmp_path / "mission.db"
    content = bytearray(place.read_bytes())
    content[100:] = random.Random(1).randbytes(len(content) - 100)
    place.write_bytes(content)
    live, lines = begin_live(options), []
    Logbook(live, lines.append)
    assert live.taken == 0
    assert (tmp_path / live.journal.aside).read_bytes() == content
    assert '"error"' in lines[-1]
    assert live.journal.aside in lines[-1]
    live.journal.close()


def test_fault_41_a_source_that_is_away_costs_nothing_and_comes_back():
    assert inputs._AGAIN[1] <= 5.0

    async def run():
        inbox, port = Inbox(), free_port()
        line = Line(address(f"tcp://127.0.0.1:{port}", INPUTS))
        task = asyncio.create_task(listen(0, line, inbox))
        await asyncio.sleep(0.5)
        spent, began = time.process_time(), time.monotonic()
        await asyncio.sleep(4.0)
        share = (time.process_time() - spent) / (time.monotonic() - began)
        assert "refused" in line.trouble.lower()

        met = []

        async def greet(_, writer):
            met.append(writer)
            writer.write(SENTENCE)
            await writer.drain()

        async with await asyncio.start_server(greet, "127.0.0.1", port):
            await wait_for(lambda: line.connected, 30.0)
            await wait_for(lambda: line.size == len(SENTENCE), 30.0)
            task.cancel()
            for writer in met:
                writer.close()
        return share

    assert asyncio.run(run()) < 0.05


def test_fault_41_a_device_that_is_unplugged_and_back(tmp_path):
    """A serial line by a link that goes away and comes back, as those of USB do."""
    link = tmp_path / "gnss"

    async def run():
        inbox = Inbox()
        line = Line(address(f"serial://{link}?baud=9600", INPUTS))
        task = asyncio.create_task(listen(0, line, inbox))
        await wait_for(lambda: line.trouble != "", 30.0)
        for n in (1, 2):
            ours, theirs = os.openpty()
            link.unlink(missing_ok=True)
            link.symlink_to(os.ttyname(theirs))
            await wait_for(lambda: line.connected, 30.0)
            os.write(ours, SENTENCE)
            await wait_for(lambda n=n: line.size == n * len(SENTENCE), 30.0)
            os.close(theirs)
            os.close(ours)
            await wait_for(lambda: not line.connected, 30.0)
        task.cancel()

    asyncio.run(run())


def test_fault_41_a_port_that_is_taken():
    async def run():
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            line = Line(address(f"tcp-listen://127.0.0.1:{port}", INPUTS))
            with pytest.raises(InputError, match=r"in use.*expected a port that is free"):
                await listen(0, line, Inbox())
            with pytest.raises(OutputError, match=r"in use.*expected a port that is free"):
                await open_output(address(f"tcp-listen://127.0.0.1:{port}", OUTPUTS))

    asyncio.run(run())


def test_fault_32_a_sensor_that_falls_silent(tmp_path):
    """Dead reckoning by the clock, with less and less certainty, and an alarm."""
    place = options_in(tmp_path, "udp://127.0.0.1:1", f"udp://127.0.0.1:{free_port()}")
    live, start = begin_live(read_live(place)), 1_785_585_600.0

    async def run():
        for k, line in enumerate(recorded(100).splitlines(keepends=True)):
            await step(live, [Arrived(0, start + k / 3.0, line)], start + k / 3.0)
        known, sigmas = live.now, []
        assert not [each for each in live.alarms if each.concerns == "position"]
        for later in (2.0, 20.0, 60.0):
            await step(live, [], start + 100.0 + later)
            sigmas.append(live.now.sigma_position[0])
        assert live.now.time > known.time + 50.0
        assert sigmas == sorted(sigmas)
        assert sigmas[-1] > 1.5 * known.sigma_position[0]

    asyncio.run(run())
    assert {each.validity for each in live.sensors if each.quantity == "position"} == {"invalid"}
    assert any(math.isnan(each.gone) for each in live.alarms)
    texts = [each.text for each in live.journal.told("alarm")]
    assert len(texts) > 0
    live.journal.close()


def test_fault_33_a_clock_that_drifts_for_a_day(tmp_path):
    """The computer's clock is 8.6 s off after a day; where we are is told for the right time."""
    place = options_in(tmp_path, "udp://127.0.0.1:1", f"udp://127.0.0.1:{free_port()}")
    live, start = begin_live(read_live(place)), 1_785_542_400.0
    source = random.Random(5)

    def fix(second):
        clock = f"{second // 3600:02d}{second // 60 % 60:02d}{second % 60:02d}.00"
        where = f"54{source.gauss(10.0, 5e-4):08.5f},N,010{source.gauss(20.0, 8e-4):08.5f},E"
        return sentence(f"GPRMC,{clock},A,{where},0.00,,010826,,,A")

    async def run():
        for begin in range(0, 86_400, 3600):
            seconds = range(begin, begin + 3600, 300)
            arrived = [Arrived(0, start + 1.0001 * second, fix(second)) for second in seconds]
            await step(live, arrived, arrived[-1].time)
        known = live.now.time
        assert known == start + 86_100.0
        await step(live, [], arrived[-1].time + 2.0)
        assert abs(live.now.time - (known + 2.0)) < 0.01

    asyncio.run(run())
    live.journal.close()
