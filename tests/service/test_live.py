"""The whole service: what comes in at one end comes out clean at the other, and stays known."""

import asyncio
import contextlib
import math
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from service.test_station import CLEAN, recorded, table
from service.test_transport import free_port, wait_for
from surefix.errors import InputError, OptionsError
from surefix.io.journal import open_journal
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.joining import join
from surefix.service.live import begin_live, run_live
from surefix.service.options import read_live
from surefix.service.station import begin_station, receive, stored
from surefix.service.telling import epoch_of

SUREFIX = Path(sys.executable).with_name("surefix")
_LIVE = """
[clean]
settle_rows = 40
reorder_s = 2.0

[[input]]
name = "boat"
from = "{source}"

[[output]]
to = "{target}"
talker = "IN"

[journal]
url = "sqlite:///{journal}"
snapshot_s = {snapshot_s}
"""


def options_in(folder, source, target, snapshot_s=10.0):
    place = folder / "live.toml"
    journal = folder / "mission.db"
    place.write_text(
        _LIVE.format(source=source, target=target, journal=journal, snapshot_s=snapshot_s)
    )
    return place


def test_a_log_that_is_replayed_gives_what_clean_gives(tmp_path):
    log = tmp_path / "boat.nmea"
    log.write_bytes(recorded())
    port = free_port()
    source, target = f"file:///{log}?speed=0", f"tcp-listen://127.0.0.1:{port}"
    options = read_live(options_in(tmp_path, source, target))
    heard = []

    async def run():
        live = begin_live(options)
        serving = asyncio.create_task(run_live(live, asyncio.Event()))
        await wait_for(lambda: live.outputs)
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        while line := await asyncio.wait_for(reader.readline(), 30.0):
            heard.append(line)
        writer.close()
        await serving

    asyncio.run(run())
    assert all(
        re.fullmatch(rb"\$IN(GGA|RMC|VTG|GST|HDT),.*\*[0-9A-F]{2}\r\n", line) for line in heard
    )
    journal = open_journal(options.journal)
    told = "".join(each.text for each in journal.told() if each.kind == "nmea")
    assert told.endswith(b"".join(heard).decode())
    station, given = begin_station(options), []
    for piece in journal.received():
        station, batches = receive(station, [piece])
        given += batches
    whole = clean_sources(open_inputs([log]), CLEAN)
    pd.testing.assert_frame_equal(table(join(given)), table(whole), check_exact=True)
    journal.close()


def test_the_journal_is_cleaned_like_a_log(tmp_path):
    log = tmp_path / "boat.nmea"
    log.write_bytes(recorded())
    target = f"udp://127.0.0.1:{free_port()}"
    options = read_live(options_in(tmp_path, f"file:///{log}?speed=0", target))
    asyncio.run(run_live(begin_live(options), asyncio.Event()))
    again = clean_sources(open_inputs([tmp_path / "mission.db"]), CLEAN)
    whole = clean_sources(open_inputs([log]), CLEAN)
    pd.testing.assert_frame_equal(table(again), table(whole), check_exact=True)


def _send(port, lines, pause):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for line in lines:
            out.sendto(line, ("127.0.0.1", port))
            time.sleep(pause)


def test_killed_and_begun_again_it_stands_where_it_stood(tmp_path):
    """Nothing that is in the journal is lost, nothing is doubled, and the state is the same."""
    port = free_port(socket.SOCK_DGRAM)
    place = options_in(tmp_path, f"udp://127.0.0.1:{port}", "tcp-listen://127.0.0.1:0", 0.3)
    options = read_live(place)
    lines = recorded(300).splitlines(keepends=True)
    for part in range(3):
        with (
            subprocess.Popen([SUREFIX, "live", "--options", place]) as run,
            contextlib.ExitStack() as ending,
        ):
            ending.callback(run.kill)
            end = time.monotonic() + 60.0
            journal = None
            while journal is None:
                assert time.monotonic() < end
                with contextlib.suppress(InputError):  # it is not there yet, or just begun
                    journal = open_journal(options.journal, new=False)
                time.sleep(0.05)
            before = journal.last()[0]
            while journal.last()[0] == before:
                _send(port, [b"$HEHDT,218.53,T*12\r\n"], 0.05)
                assert time.monotonic() < end
            _send(port, lines[part * 300 : (part + 1) * 300], 0.001)
            while journal.last()[0] < before + 200:
                time.sleep(0.01)
                assert time.monotonic() < end
            os.kill(run.pid, signal.SIGKILL)
        numbers = [piece.number for piece in journal.received()]
        assert numbers == list(range(1, len(numbers) + 1))
        station = begin_station(options)
        for piece in journal.received():
            station, _ = receive(station, [piece])
        live = begin_live(options)
        assert live.taken == len(numbers)
        assert stored(live.station) == stored(station)
        assert live.station.session.setup is not None
        live.journal.close()
        journal.close()


def test_stopped_by_a_signal_it_ends_in_order(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    place = options_in(tmp_path, f"udp://127.0.0.1:{port}", "tcp-listen://127.0.0.1:0")
    with subprocess.Popen(
        [SUREFIX, "live", "--options", place],
        stdout=subprocess.PIPE, text=True,
    ) as run:  # fmt: skip
        assert run.stdout is not None
        assert run.stdout.readline() == f"from udp://127.0.0.1:{port}\n"
        _send(port, recorded().splitlines(keepends=True), 0.001)
        time.sleep(1.0)
        run.send_signal(signal.SIGTERM)
        assert run.wait(60.0) == 0
        assert "stopped after" in run.stdout.read()
    live = begin_live(read_live(place))
    assert live.station.after == live.taken > 0
    live.journal.close()


def test_dead_reckoning_when_nothing_comes(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    place = options_in(tmp_path, f"udp://127.0.0.1:{port}", f"udp://127.0.0.1:{free_port()}")
    live = begin_live(read_live(place))
    now = [1_785_585_600.0]

    async def run():
        stop = asyncio.Event()
        serving = asyncio.create_task(run_live(live, stop, clock=lambda: now[0]))
        await wait_for(lambda: live.lines[0].connected)
        for k, line in enumerate(recorded(100).splitlines(keepends=True)):
            _send(port, [line], 0.0)
            now[0] = 1_785_585_600.0 + k // 3
            await asyncio.sleep(0.005)
        await wait_for(lambda: live.now is not None, 20.0)
        known, sigmas = live.now, []
        for _ in range(3):
            now[0] += 5.0
            await wait_for(lambda at=now[0]: live.now.time >= at - 1.0, 20.0)
            sigmas.append(live.now.sigma_position[0])
        stop.set()
        await serving
        return known, sigmas

    known, sigmas = asyncio.run(run())
    assert sigmas == sorted(sigmas)
    assert sigmas[-1] > known.sigma_position[0]
    assert not math.isnan(live.now.observed)
    assert live.now.time - live.now.observed > 10.0
    assert epoch_of(live.now).known is False


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[clean]\nreorder_s = 1.0\n", "settle_rows"),
        ('[clean]\nsettle_rows = 40\nmode = "offline"\n', "realtime"),
        ("[clean]\nsettle_rows = 40\n", "no input of fixes"),
        ('[clean]\nsettle_rows = 40\n[[input]]\nname = "a"\n', "without name or from"),
        ('[clean]\nsettle_rows = 40\n[[input]]\nname = "a"\nfrom = "x"\n', "udp://"),
        ('[clean]\nsettle_rows = 40\n[[input]]\nname = "a"\nform = "x"\n', "'form'"),
        (
            '[clean]\nsettle_rows = 40\n[[input]]\nname = "a"\nfrom = "udp://0.0.0.0:1"\n'
            '[[output]]\nto = "udp://h:1"\nsentences = ["XYZ"]\n',
            "GGA",
        ),
        (
            '[clean]\nsettle_rows = 40\n[[input]]\nname = "a"\nfrom = "udp://0.0.0.0:1"\n'
            '[[output]]\nto = "udp://h:1"\ntalker = "gps"\n',
            "capital",
        ),
    ],
)
def test_options_that_are_wrong_are_told(tmp_path, text, said):
    place = tmp_path / "live.toml"
    place.write_text(text)
    with pytest.raises(OptionsError, match=said):
        read_live(place)
