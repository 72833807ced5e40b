"""Take a long mission through the live service, many times faster, and look at its memory.

``make soak`` takes 4.3 million sentences of a boat, 36 days of 11 hours, three a second. Everything
is as in service: they come in over TCP, are journalled in SQLite, cleaned, and put out over TCP to
a client that reads. They come in blocks, the next one when the last one has been taken. The last
figures are in docs/live.md.
"""

import asyncio
import os
import resource
import sys
import tempfile
import time
from datetime import datetime, timedelta
from functools import reduce
from itertools import count, islice
from operator import xor
from pathlib import Path

from service.test_station import recorded
from service.test_transport import free_port, wait_for
from surefix.io.journal import open_journal
from surefix.service.live import begin_live, run_live
from surefix.service.options import read_live

DAY = 40_000  # epochs of three sentences
LIVE = """
[clean]
settle_rows = 40
reorder_s = 2.0
[[input]]
name = "boat"
from = "tcp-listen://127.0.0.1:{port}"
[[output]]
to = "tcp-listen://127.0.0.1:0"
[journal]
url = "sqlite:///mission.db"
"""


def write_log(place, sentences):
    """So many sentences, days of the same trip; gives how many there are."""
    day, written = recorded(DAY).splitlines(keepends=True), 0
    with place.open("wb") as log:
        for number in count():
            lines = day[: sentences - written]
            date = f",{datetime(2026, 8, 1) + timedelta(number):%d%m%y},".encode()
            log.write(_checked(b"".join(lines).replace(b",010826,", date)))
            written += len(lines)
            if written >= sentences:
                return written
    raise AssertionError


def _checked(text):
    """The same sentences with the checksums of what they say now."""
    lines = text.splitlines()
    for k, line in enumerate(lines):
        if line[3:6] == b"RMC" and line[-3:-2] == b"*":
            lines[k] = line[:-2] + b"%02X" % reduce(xor, line[1:-3])
    return b"\r\n".join(lines) + b"\r\n"


def resident():
    """Memory of this process now, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


async def soak(place, block, look):
    """Take a log through the service in blocks of sentences; ``look(share)`` after each."""
    live, stop = begin_live(read_live(place / "live.toml")), asyncio.Event()
    serving = asyncio.create_task(run_live(live, stop))
    await wait_for(lambda: live.outputs)
    _, source = await _connected(live.options.inputs[0].address.port)
    reader, client = await _connected(live.outputs[0][1].state.address.port)

    async def listen():
        heard = 0
        while data := await reader.read(1 << 16):
            heard += data.count(b"\n")
        return heard

    listening, sent = asyncio.create_task(listen()), 0
    size = (place / "boat.nmea").stat().st_size
    with (place / "boat.nmea").open("rb") as log:
        while data := b"".join(islice(log, block)):
            source.write(data)
            sent, before = sent + len(data), live.station.after
            while live.lines[0].size < sent or live.station.after == before:
                await asyncio.sleep(0.001)
            look(sent / size)
    source.close()
    stop.set()
    await serving
    heard = await listening
    client.close()
    return live, heard


async def _connected(port):
    for _ in range(500):
        try:
            return await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            await asyncio.sleep(0.01)
    raise AssertionError(port)


def main(sentences=4_300_000, block=2000):
    """Soak, and print what the memory was."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        written = write_log(folder / "boat.nmea", sentences)
        size = (folder / "boat.nmea").stat().st_size
        (folder / "live.toml").write_text(LIVE.format(port=free_port()))
        marks, began = [0.05, 0.25, 0.5, 0.75, 1.0], time.monotonic()

        def look(share):
            while marks and share >= marks[0]:
                spent = time.monotonic() - began
                print(f"{marks.pop(0):4.0%}: {resident():.0f} MB after {spent:.0f} s", flush=True)

        live, heard = asyncio.run(soak(folder, block, look))
        journal = open_journal(live.options.journal, new=False)
        known = sum(journal.sizes().values())
        told = journal.last()[1]
        stored = (folder / "mission.db").stat().st_size
    assert known == size
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(
        f"{written:,} sentences in {live.taken:,} pieces, {told:,} told, {heard:,} heard; "
        f"CPU {used.ru_utime + used.ru_stime:.0f} s, at most {used.ru_maxrss / 1024:.0f} MB; "
        f"log {size / 1e6:.0f} MB, journal {stored / 1e6:.0f} MB"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
