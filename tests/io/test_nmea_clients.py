"""What programs that nobody here wrote make of the NMEA that is written: gpsd and gpsbabel."""

from __future__ import annotations

import csv
import json
import math
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from needs import tool
from surefix.geo.time import parse_time
from surefix.io.write_nmea import TYPES, Epoch, sentences

START = parse_time("2024-12-31T23:59:50")
LOST = (8, 9)  # seconds of dead reckoning
WITH_ERRORS = (*TYPES, "GBS")


def epochs() -> Iterator[Epoch]:
    """Twenty seconds over midnight, the new year and the antimeridian, southwards."""
    for k in range(20):
        yield Epoch(
            START + k, -36.7 - k * 2e-5, 179.9999 + k * 2e-5, 12.5, 1.5, -2.0, 0.5, 0.4, 0.9, 0.05,
            known=k not in LOST,
        )  # fmt: skip


def stream() -> bytes:
    return b"".join(sentences(epoch, types=WITH_ERRORS) for epoch in epochs())


def reports(lines: str, kind: str) -> list[dict[str, Any]]:
    found = [json.loads(text) for text in lines.splitlines() if f'"class":"{kind}"' in text]
    return [report for report in found if "time" in report]


def second(report: dict[str, Any]) -> int:
    return round(datetime.fromisoformat(report["time"]).timestamp() - START)


def check_positions(found: list[dict[str, Any]]) -> None:
    """Time, place, motion and errors of what gpsd reports are those that were written."""
    written = list(epochs())
    assert len(found) >= 15
    for report in found:
        k = second(report)
        if k in LOST:
            assert report["mode"] == 1
            assert "lat" not in report
            continue
        assert report["mode"] == 3
        assert report["lat"] == pytest.approx(written[k].latitude, abs=1e-8)
        assert abs(math.remainder(report["lon"] - written[k].longitude, 360.0)) < 1e-8
        assert report["altMSL"] == pytest.approx(12.5)
        assert report["speed"] == pytest.approx(2.5, abs=0.003)
        assert report["track"] == pytest.approx(143.13, abs=0.01)
        if k > 0:  # with the first epoch gpsd does not know yet which sentence is the last
            assert (report["epx"], report["epy"], report["epv"]) == (0.5, 0.4, 0.9)


def test_gpsdecode_reports_place_time_and_errors() -> None:
    decoder = tool("gpsdecode")
    done = subprocess.run([decoder], input=stream(), capture_output=True, timeout=30, check=True)
    told = done.stdout.decode()
    check_positions(reports(told, "TPV"))
    ellipses = reports(told, "GST")
    assert [second(report) for report in ellipses] == list(range(20))
    for report in ellipses:
        assert (report["lon"], report["lat"], report["alt"]) == (0.5, 0.4, 0.9)
        assert (report["major"], report["minor"]) == (0.522, 0.371)
        assert report["orient"] == pytest.approx(66.0, abs=0.05)


class _Port:
    """A TCP server that sends the stream, epoch by epoch, to whoever connects."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.number = self._server.getsockname()[1]
        self.go = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        try:
            client, _ = self._server.accept()
            with client:
                self.go.wait(20)
                for epoch in epochs():
                    client.sendall(sentences(epoch, types=WITH_ERRORS))
                    time.sleep(0.05)
                time.sleep(0.5)
        except OSError:
            pass

    def close(self) -> None:
        self._server.close()
        self._thread.join(5)


@pytest.fixture
def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def test_gpsd_reads_the_stream_over_tcp(free_port: int) -> None:
    daemon = tool("gpsd", "/usr/sbin/gpsd")
    port = _Port()
    command = [daemon, "-N", "-n", "-S", str(free_port), f"tcp://127.0.0.1:{port.number}"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        told = _watch(free_port, port.go)
    finally:
        running.terminate()
        running.wait(10)
        port.close()
    check_positions(reports(told, "TPV"))


def _watch(number: int, go: threading.Event) -> str:
    """What gpsd tells a client until it has told the last epoch."""
    deadline = time.monotonic() + 20
    while True:
        try:
            client = socket.create_connection(("127.0.0.1", number), timeout=1)
            break
        except OSError:
            assert time.monotonic() < deadline, "gpsd does not answer"
            time.sleep(0.1)
    told = b""
    with client:
        client.sendall(b'?WATCH={"enable":true,"json":true}\n')
        go.set()
        while time.monotonic() < deadline and b"2025-01-01T00:00:08.000Z" not in told:
            try:
                told += client.recv(65536)
            except TimeoutError:
                continue
    return told.decode()


def test_gpsbabel_reads_the_file(tmp_path: Path) -> None:
    babel = tool("gpsbabel")
    (tmp_path / "out.nmea").write_bytes(stream())
    command = [babel, "-t", "-i", "nmea", "-f", "out.nmea", "-o", "unicsv,utc=0", "-F", "out.csv"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=30, capture_output=True)
    with (tmp_path / "out.csv").open() as file:
        rows = list(csv.DictReader(file))
    written = [epoch for epoch in epochs() if epoch.known]
    assert len(rows) == len(written)
    for row, epoch in zip(rows, written, strict=True):
        assert float(row["Latitude"]) == pytest.approx(epoch.latitude, abs=1e-6)
        apart = math.remainder(float(row["Longitude"]) - epoch.longitude, 360.0)
        assert abs(apart) < 1e-6
        assert parse_time(f"{row['Date']} {row['Time']}") == epoch.time
