"""Fault 36: the power fails, and what was not synced is gone; what was acknowledged is not."""

import os
import random
import struct
import subprocess
import sys
from pathlib import Path

from needs import tool
from surefix.io.journal import open_journal

_SHIM = Path(__file__).with_name("power.c")
_WRITER = """
import os, sys
from surefix.io import journal_place
from surefix.io.journal import Received, Told, open_journal
if sys.argv[2] == "careless":
    whole = journal_place._durable
    def careless(connection, record):
        whole(connection, record)
        connection.execute("PRAGMA synchronous = OFF")
    journal_place._durable = careless
journal = open_journal(sys.argv[1])
said = os.open(sys.argv[1].removeprefix("sqlite:///") + "-said", os.O_WRONLY | os.O_CREAT)
for n in range(1, 121):
    journal.write([Received(n, 0, float(n), b"x" * 60_000)], [Told(n, n, 0.0, "nmea", "y")])
    os.write(said, b"%d\\n" % n)
os._exit(0)
"""


def trace(folder, how):
    """What a journal that is written did to the disk, in its order."""
    shim, log = folder / "power.so", folder / "trace"
    words = [tool("gcc", "cc"), "-shared", "-fPIC", "-O1", "-o", shim, _SHIM, "-ldl"]
    subprocess.run(words, check=True)
    env = {**os.environ, "LD_PRELOAD": str(shim), "POWER_TRACE": str(log)}
    url = f"sqlite:///{folder / 'mission.db'}"
    subprocess.run([sys.executable, "-c", _WRITER, url, how], check=True, env=env)
    data, at, steps = log.read_bytes(), 0, []
    while at < len(data):
        kind = data[at : at + 1]
        length, place, size = struct.unpack_from("<qqq", data, at + 1)
        at += 25
        name = data[at : at + length].decode()
        at += length
        content = data[at : at + size] if kind == b"w" else b""
        at += len(content)
        steps.append((kind, name, place, content))
    return steps


class Disk:
    """What is on the disk for good, and what is only on its way there."""

    def __init__(self):
        self.files, self.coming = {}, {}

    def take(self, kind, name, place, content):
        if kind == b"u":
            self.files.pop(name, None)
            self.coming.pop(name, None)
        elif kind == b"s":
            self.files[name] = self.after(name, self.coming.pop(name, []))
        else:
            self.coming.setdefault(name, []).append((kind, place, content))

    def after(self, name, steps):
        file = bytearray(self.files.get(name, b""))
        for kind, place, content in steps:
            if kind == b"t":
                del file[place:]
            else:
                file.extend(bytes(max(place + len(content) - len(file), 0)))
                file[place : place + len(content)] = content
        return file

    def fail(self, folder, source):
        """The power fails: of what was on its way some arrived, perhaps none."""
        share = source.choice((0.0, 0.5, 0.9))
        for name in {*self.files, *self.coming} - {"mission.db-said"}:
            came = [step for step in self.coming.get(name, []) if source.random() < share]
            if name in self.files or came:
                (folder / name).write_bytes(self.after(name, came))


def lost(folder, how, cuts):
    """How often something that was acknowledged is not there after a power failure."""
    steps, source, disk = trace(folder, how), random.Random(3), Disk()
    at, acknowledged, found, checked = set(source.sample(range(len(steps)), cuts)), 0, 0, 0
    for number, step in enumerate(steps):
        disk.take(*step)
        if step[1] == "mission.db-said":
            acknowledged = int(step[3])
        if number in at and acknowledged:
            after = folder / f"after{number}"
            after.mkdir()
            disk.fail(after, source)
            journal = open_journal(f"sqlite:///{after / 'mission.db'}")
            numbers = [piece.number for piece in journal.received()]
            told = [each.number for each in journal.told()]
            journal.close()
            assert numbers == told == list(range(1, len(numbers) + 1))
            assert len(numbers) <= acknowledged + 1
            found += len(numbers) < acknowledged
            checked += 1
    assert acknowledged == 120
    assert checked > cuts / 2
    return found


def test_fault_36_acknowledged_is_on_the_disk(tmp_path):
    assert lost(tmp_path, "careful", 40) == 0


def test_fault_36_without_syncing_it_is_not(tmp_path):
    """The same check finds what is lost when the journal does not wait for the disk."""
    assert lost(tmp_path, "careless", 12) > 0
