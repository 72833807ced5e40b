"""gpsd, fed by a running `surefix live` over TCP and UDP, reports what live knew."""

from __future__ import annotations

import json
import math
import socket
import subprocess
import threading
import time
from datetime import datetime
from itertools import islice

import pytest

from needs import tool
from service.boats import begin, send, served, told, voyage
from service.test_transport import free_port

ASKED = "sentences = ['GGA', 'RMC', 'VTG', 'GST', 'HDT', 'DPT', 'GBS']"


class Watcher(threading.Thread):
    """Read what gpsd tells its clients until stopped."""

    def __init__(self, port: int) -> None:
        super().__init__()
        self.port, self.text, self.done = port, b"", threading.Event()
        self.watching = threading.Event()

    def run(self) -> None:
        with self._client() as client:
            client.sendall(b'?WATCH={"enable":true,"json":true}\n')
            client.settimeout(0.2)
            while not self.done.is_set():
                try:
                    self.text += client.recv(65536)
                except TimeoutError:
                    continue
                if b'"class":"WATCH"' in self.text:
                    self.watching.set()

    def _client(self) -> socket.socket:
        for _ in range(200):
            try:
                return socket.create_connection(("127.0.0.1", self.port), timeout=1)
            except OSError:
                time.sleep(0.1)
        raise AssertionError("gpsd does not answer")


@pytest.mark.parametrize("kind", ["tcp", "udp"])
def test_gpsd_reports_what_live_knew(tmp_path, kind):
    daemon = tool("gpsd", "/usr/sbin/gpsd")
    if kind == "tcp":
        port = free_port()
        to = f"tcp-listen://127.0.0.1:{port}"
    else:
        port = free_port(socket.SOCK_DGRAM)
        to = f"udp://127.0.0.1:{port}"
    control = free_port()
    with served(tmp_path, f"to = '{to}'\n{ASKED}") as feed:
        command = [daemon, "-N", "-n", "-S", str(control), f"{kind}://127.0.0.1:{port}"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
            watcher = Watcher(control)
            try:
                watcher.start()
                assert watcher.watching.wait(30)
                boat = voyage(2000)
                begin(tmp_path, feed, boat)
                send(feed, islice(boat, 100))
                time.sleep(1.0)
            finally:
                watcher.done.set()
                watcher.join()
                run.terminate()
    check(watcher.text.decode(), told(tmp_path))


def check(text, known):
    """Time, place, motion and errors of every report are those that live knew, to their digits."""
    lines = [line for line in text.splitlines() if line.startswith('{"class":"TPV"')]
    reports = [each for each in map(json.loads, lines) if "lat" in each]
    assert len(reports) >= 40
    assert all(each["mode"] == 3 for each in reports[1:])
    errors = 0
    for report in reports:
        at = datetime.fromisoformat(report["time"]).timestamp()
        now = known[round(at * 100.0)]
        assert report["lat"] == pytest.approx(now["latitude"], abs=1e-8)
        assert report["lon"] == pytest.approx(now["longitude"], abs=1e-8)
        if "altMSL" in report:
            assert report["altMSL"] == pytest.approx(now["height"], abs=0.0051)
        if "speed" in report:
            assert report["speed"] == pytest.approx(now["speed"], abs=0.0031)
            assert abs(math.remainder(report["track"] - now["course"], 360.0)) < 0.0051
        if "epx" in report:
            errors += 1
            for name, side in (("epx", "east"), ("epy", "north"), ("epv", "up")):
                assert report[name] == pytest.approx(now[side], abs=0.00051)
    assert errors >= len(reports) - 2  # gpsd has to learn which sentence is the last of an epoch
