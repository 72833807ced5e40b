"""A boat under way whose sentences come as datagrams, and `surefix live` that is fed with them."""

from __future__ import annotations

import math
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path

import numpy as np

from service.test_station import minutes, sentence
from service.test_transport import free_port
from surefix.io.journal import open_journal
from surefix.service.options import read_live
from surefix.service.station import begin_station, latest, receive

SUREFIX = Path(sys.executable).with_name("surefix")


RATE = 20.0  # epochs a second


def voyage(n: int, seed: int = 1) -> Iterator[bytes]:
    """GGA, RMC, HDT, DPT of each instant from now on, then; one position in a dozen is 45 m off."""
    rng = np.random.default_rng(seed)
    now = math.ceil(time.time())
    for k in range(n):
        second = k / RATE
        whole = datetime.fromtimestamp(now + second, UTC)
        time.sleep(max(now + second - time.time(), 0.0))
        clock = f"{whole:%H%M%S}.{whole.microsecond // 10_000:02d}"
        north, east = rng.normal(0.0, 1e-5, 2) + (4e-4 if rng.random() < 0.08 else 0.0)
        place = (
            f"{minutes(54.0 + 2e-5 * second + north, 2)},N,"
            f"{minutes(10.0 + 1e-5 * second + east, 3)},E"
        )
        height, depth = rng.normal(5.0, 1.0), 20.0 + 0.01 * second + rng.normal(0.0, 0.05)
        speed, course = 4.49 + 0.1 * rng.normal(), (16.4 + rng.normal()) % 360.0
        heading = (350.0 + 0.2 * second + rng.normal(0.0, 0.3)) % 360.0
        yield b"".join(
            [
                sentence(f"GPGGA,{clock},{place},1,08,1.0,{height:.1f},M,40.0,M,,"),
                sentence(f"GPRMC,{clock},A,{place},{speed:.2f},{course:.1f},{whole:%d%m%y},,,A"),
                sentence(f"HEHDT,{heading:.2f},T"),
                sentence(f"SDDPT,{depth:.2f},0.0"),
            ]
        )


@contextmanager
def served(folder: Path, *outputs: str) -> Iterator[int]:
    """Run `surefix live` on datagrams, with outputs as TOML; gives the port that it listens to."""
    port = free_port(socket.SOCK_DGRAM)
    tables = "".join(f"[[output]]\n{text}\n" for text in outputs)
    (folder / "live.toml").write_text(
        "[clean]\nsettle_rows = 40\nreorder_s = 2.0\n"
        f"[[input]]\nname = 'boat'\nfrom = 'udp://127.0.0.1:{port}'\n{tables}"
        f"[journal]\nurl = 'sqlite:///{folder}/mission.db'\n"
    )
    command = [SUREFIX, "live", "--options", folder / "live.toml"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        try:
            wait_for_port(port)
            yield port
        finally:
            running.terminate()
            assert running.stdout is not None
            (folder / "said.txt").write_text(running.stdout.read())
            assert running.wait(60.0) == 0


def wait_for_port(port: int, seconds: float = 60.0) -> None:
    """Wait until somebody listens to datagrams there."""
    end = time.monotonic() + seconds
    while True:
        assert time.monotonic() < end, "nobody listens"
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
            try:
                trial.bind(("127.0.0.1", port))
            except OSError:
                return
        time.sleep(0.05)


def begin(folder: Path, port: int, boat: Iterator[bytes]) -> None:
    """Send until a position has been told."""
    journal = open_journal(read_live(folder / "live.toml").journal, new=False)
    end = time.monotonic() + 60.0
    while not journal.newest("nmea", 1):
        assert time.monotonic() < end, "no position is told"
        send(port, islice(boat, 10))
    journal.close()


def send(port: int, datagrams: Iterable[bytes]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for data in datagrams:
            out.sendto(data, ("127.0.0.1", port))


def told(folder: Path) -> dict[int, dict[str, float]]:
    """What live knew when it told of each instant, by the hundredth of a second."""
    options = read_live(folder / "live.toml")
    journal = open_journal(options.journal, new=False)
    epochs = sorted({(each.after, each.time) for each in journal.told() if each.kind == "nmea"})
    station, known = begin_station(options), {}
    received = list(journal.received())
    journal.close()
    begin = 0
    for end, time_told in epochs:
        station, _ = receive(station, received[begin:end])
        begin, now = end, latest(station)
        assert now is not None
        if time_told > now.time:  # dead reckoning
            now = latest(station, time_told)
            assert now is not None
        assert now.time == time_told
        assert now.geodetic is not None
        latitude, longitude, height = now.geodetic.tolist()
        east, north, _ = now.velocity.tolist()
        known[round(now.time * 100.0)] = {
            "latitude": latitude, "longitude": longitude, "height": height,
            "speed": float(np.hypot(east, north)),
            "course": float(np.degrees(np.arctan2(east, north)) % 360.0),
            "heading": now.heading, "depth": now.depth,
            "east": float(now.sigma_position[0]), "north": float(now.sigma_position[1]),
            "up": float(now.sigma_position[2]),
        }  # fmt: skip
    return known
