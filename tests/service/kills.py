"""Kill the live service again and again, and hold what it knows against what it was given.

``make kills`` does it 1,000 times. A recorded log is replayed into a service at a hundred times its
pace. It is killed, looked at and begun again: every byte of the log must be in the journal once,
everything a client heard must be there once, and the state must be, to the byte, that of a service
that never was interrupted.
"""

import os
import random
import re
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from service.crashing import POINTS
from service.test_station import recorded
from surefix.service.live import begin_live
from surefix.service.options import read_live
from surefix.service.station import begin_station, receive, stored

LIVE = """
[clean]
settle_rows = 40
reorder_s = 2.0
[[input]]
name = "boat"
from = "file:boat.nmea?speed={speed}"
[[output]]
to = "udp://127.0.0.1:{port}"
[journal]
url = "{url}"
snapshot_s = 0.2
"""
PROGRAM = (sys.executable, "-c", "from surefix.cli import main; main()", "live", "--options")


class Mission:
    """A log that is replayed, a client that listens, and what must hold after every kill."""

    def __init__(self, folder, url="sqlite:///mission.db", epochs=40_000, speed=100.0):
        self.place = folder / "live.toml"
        (folder / "boat.nmea").write_bytes(recorded(epochs))
        self.begin(LIVE, url, speed)

    def begin(self, text, url, speed):
        """Write the options, and read the logs that they name."""
        self.client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self.client.bind(("127.0.0.1", 0))
        self.client.setblocking(False)
        port = self.client.getsockname()[1]
        self.place.write_text(text.format(port=port, url=url, speed=speed))
        self.options = read_live(self.place)
        self.logs = [Path(each.address.path).read_bytes() for each in self.options.inputs]
        self.sizes = [0] * len(self.logs)
        self.reference = begin_station(self.options)
        self.taken = self.said = 0
        self.heard = []
        self.kills = Counter()
        self.first_outputs = []

    def hear(self):
        """What has come out since; gives how many messages."""
        before = len(self.heard)
        while True:
            try:
                self.heard.append(self.client.recv(1 << 16).decode("ascii"))
            except BlockingIOError:
                return len(self.heard) - before

    def check(self):
        """Nothing lost, nothing doubled, and the state is that of an uninterrupted service."""
        self.hear()
        live = begin_live(self.options)
        pieces = list(live.journal.received(self.taken))
        assert [p.number for p in pieces] == list(range(self.taken + 1, live.taken + 1))
        for piece in pieces:
            before = self.sizes[piece.source]
            self.sizes[piece.source] += len(piece.data)
            assert self.logs[piece.source][before : before + len(piece.data)] == piece.data
            self.reference, _ = receive(self.reference, [piece])
        self.taken = live.taken
        assert stored(live.station) == stored(self.reference)
        told = live.journal.told()
        assert [each.number for each in told] == list(range(1, live.said + 1))
        assert len(told) >= self.said
        self.said = len(told)
        said = [each.text for each in told if each.kind == "nmea"]
        assert len(set(said)) == len(said)
        assert len(set(self.heard)) == len(self.heard)
        assert set(self.heard) <= set(said)
        live.journal.close()

    def end(self):
        """Let it run to the end; then all of the log is there."""
        text = self.place.read_text()
        self.place.write_text(re.sub(r"speed=[\d.]+", "speed=0", text))
        subprocess.run([*PROGRAM, self.place], check=True, stdout=subprocess.DEVNULL)
        self.check()
        assert self.sizes == [len(log) for log in self.logs]
        self.client.close()


class Forked:
    """Services that are forked from a process that has everything loaded."""

    def __init__(self, mission):
        self.mission = mission
        words = [sys.executable, "-m", "service.crashing", mission.place]
        where = str(Path(__file__).parents[1])
        path = os.pathsep.join([where, os.environ.get("PYTHONPATH", "")])
        self.parent = subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip
        assert self.parent.stdout.readline() == "ready\n"

    def begin(self, point="-", passes=0):
        self.parent.stdin.write(f"{point} {passes}\n")
        self.parent.stdin.flush()
        return int(self.parent.stdout.readline())

    def ended(self):
        return int(self.parent.stdout.readline())

    def at(self, point, passes):
        """Run until the service kills itself at a point."""
        self.begin(point, passes)
        assert self.ended() == -signal.SIGKILL
        self.mission.kills[point] += 1

    def after(self, seconds):
        """Kill the service at a time that nobody has chosen."""
        child = self.begin()
        time.sleep(seconds)
        os.kill(child, signal.SIGKILL)
        assert self.ended() == -signal.SIGKILL
        self.mission.kills["at any time"] += 1

    def close(self):
        self.parent.stdin.close()
        self.parent.stdout.close()
        self.parent.kill()
        self.parent.wait(60.0)


def restart(mission, seconds):
    """Begin a service as people do, wait for its first output, and kill it some time later."""
    mission.hear()
    began = time.perf_counter()
    with subprocess.Popen([*PROGRAM, mission.place], stdout=subprocess.DEVNULL) as run:
        while not mission.hear():
            assert run.poll() is None
            assert time.perf_counter() - began < 60.0
            time.sleep(0.002)
        mission.first_outputs.append(time.perf_counter() - began)
        time.sleep(seconds)
        run.send_signal(signal.SIGKILL)
    mission.kills["a process of its own, at any time"] += 1


def main(kills=1000, named=20, own=100):
    """Kill so often, and print what was found."""
    rng = random.Random(7)
    with tempfile.TemporaryDirectory() as folder:
        mission = Mission(Path(folder))
        forked = Forked(mission)
        forked.after(2.0)  # until it is settled
        mission.check()
        plan = [(point, rng.randint(1, 12)) for point in POINTS for _ in range(named)]
        plan += [("own", 0)] * own
        plan += [("any", 0)] * (kills - 1 - len(plan))
        rng.shuffle(plan)
        for number, (what, passes) in enumerate(plan, 2):
            if what == "own":
                restart(mission, rng.uniform(0.0, 0.3))
            elif what == "any":
                forked.after(rng.uniform(0.0, 0.5))
            else:
                forked.at(what, 1 if what.startswith("while it") else passes)
            mission.check()
            if number % 100 == 0:
                print(f"{number} kills, {mission.taken} pieces, {mission.said} said", flush=True)
        forked.close()
        mission.end()
        for point, count in mission.kills.items():
            print(f"{count:5d}  {point}")
        times = sorted(mission.first_outputs)
        ninety = times[int(0.9 * len(times))]
        print(
            f"first output after {statistics.median(times):.2f} s (median of {len(times)}), "
            f"{ninety:.2f} s (90 %), {times[-1]:.2f} s (longest)"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
