"""How long a fix takes from its last byte to the clients of `surefix live`.

Run ``python bench/clients.py [--json FILE] [--seconds 30] [--clients 200] [--stuck 10]``. One
process sends five sentences at 10 Hz in datagrams, one is the service with its filter and journal,
one holds the clients, who get five sentences an epoch over TCP. Times are of the one monotonic
clock of the machine: from just before the datagram is sent to when a client has the whole epoch.
First with clients that read, then with some more that never do.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import socket
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from measured import conclude
from surefix.io.nmea import checksum

RATE = 10.0
SETTLE = 60
RUN = "import sys; sys.argv[0] = 'surefix'; from surefix.cli import main; main()"
OPTIONS = """
[clean]
settle_rows = {settle}
reorder_s = 2.0
[[input]]
name = "boat"
from = "udp://127.0.0.1:{feed}"
[[output]]
to = "tcp-listen://127.0.0.1:{out}"
sentences = ["GGA", "RMC", "VTG", "GST", "HDT"]
[journal]
url = "sqlite:///mission.db"
"""


def main() -> None:
    """Print a row without and one with clients that never read."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--json", type=Path)
    options.add_argument("--seconds", type=float, default=30.0)
    options.add_argument("--clients", type=int, default=200)
    options.add_argument("--stuck", type=int, default=10)
    options.add_argument("--hold", nargs=3, type=int, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.hold is not None:
        return hold(*given.hold)
    rows = [
        measured(given.seconds, given.clients, stuck) for stuck in dict.fromkeys([0, given.stuck])
    ]
    return conclude(rows, given.json)


def measured(seconds: float, clients: int, stuck: int) -> dict[str, str]:
    """Serve for some seconds; gives what the clients found."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        feed, out = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
        text = OPTIONS.format(settle=SETTLE, feed=feed, out=out)
        (folder / "live.toml").write_text(text)
        command = [sys.executable, "-c", RUN, "live", "--options", str(folder / "live.toml")]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as service:
            wait_for(out)
            holder = [sys.executable, __file__, "--hold", str(out), str(clients), str(stuck)]
            with subprocess.Popen(
                holder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            ) as held:
                assert held.stdout is not None
                assert held.stdout.readline() == "there\n"
                sent, used, load = fed(feed, seconds, service.pid)
                told, _ = held.communicate("end\n")
            service.terminate()
    found = json.loads(told)
    return row(found["heard"], sent, used, load, f"{stuck:10d} ({found['closed']} dropped)")


def fed(port: int, seconds: float, pid: int) -> tuple[dict[str, int], float, float]:
    """Send at the pace; gives when each epoch was sent, ns, the processor time of each, s, load."""
    sent: dict[str, int] = {}
    began = time.time() + 0.5
    first = 2 * SETTLE + int(3.0 * RATE)  # headings are settled on twice as many
    before = 0.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for k in range(first + int(seconds * RATE)):
            at = round(began + k / RATE, 2)
            data = epoch(k, at)
            time.sleep(max(at - time.time(), 0.0))
            if k == first:
                before = processor(pid)
            clock = time.monotonic_ns()
            out.sendto(data, ("127.0.0.1", port))
            if k >= first:
                sent[hms(at)] = clock
    time.sleep(0.5)
    return sent, (processor(pid) - before) / len(sent), os.getloadavg()[0]


def epoch(k: int, at: float) -> bytes:
    """Five sentences of a boat under way, one position in fifty 45 m off."""
    rng = np.random.default_rng(k)
    off = 4e-4 if k % 50 == 17 else 0.0
    latitude, longitude = (start + k * 2e-6 + off + rng.normal(0.0, 1e-5) for start in (54.0, 10.0))
    place = f"{angle(latitude, 2)},N,{angle(longitude, 3)},E"
    day = datetime.fromtimestamp(at, UTC)
    return b"".join(
        sealed(body)
        for body in (
            f"GPGGA,{hms(at)},{place},1,08,1.0,{rng.normal(2.0, 0.5):.1f},M,40.0,M,,",
            f"GPRMC,{hms(at)},A,{place},4.49,{16.4 + rng.normal():.1f},{day:%d%m%y},,,A",
            "GPVTG,16.4,T,,M,4.49,N,8.3,K,A",
            f"GPGST,{hms(at)},,,,,1.0,1.0,2.0",
            f"HEHDT,{(350.0 + 0.02 * k + 0.3 * rng.normal()) % 360.0:.2f},T",
        )
    )


def angle(degrees: float, digits: int) -> str:
    return f"{int(degrees):0{digits}d}{degrees % 1.0 * 60.0:09.6f}"


def hms(at: float) -> str:
    ticks = round(at * 100.0)
    return f"{datetime.fromtimestamp(ticks // 100, UTC):%H%M%S}.{ticks % 100:02d}"


def sealed(body: str) -> bytes:
    return b"$%s*%02X\r\n" % (body.encode(), checksum(body.encode()))


def hold(port: int, clients: int, stuck: int) -> None:
    """Be the clients, until told to end on standard input; write what was heard as JSON."""
    silent = [connected(port, 4096) for _ in range(stuck)]
    chosen = selectors.DefaultSelector()
    begun: dict[int, bytes] = {}
    for _ in range(clients):
        client = connected(port, None)
        client.setblocking(False)
        chosen.register(client, selectors.EVENT_READ)
        begun[client.fileno()] = b""
    chosen.register(sys.stdin, selectors.EVENT_READ)
    print("there", flush=True)
    heard: list[tuple[str, int]] = []
    while True:
        for key, _ in chosen.select():
            if key.fileobj is sys.stdin:
                closed = sum(gone(each) for each in silent)
                return print(json.dumps({"heard": heard, "closed": closed}))
            data = begun[key.fd] + key.fileobj.recv(1 << 16)  # type: ignore[union-attr]
            now = time.monotonic_ns()
            *whole, begun[key.fd] = data.split(b"\r\n")
            clock = b""
            for line in whole:
                if line[3:6] == b"GGA":
                    clock = line.split(b",", 2)[1]
                elif line[3:6] == b"HDT" and clock:
                    heard.append((clock.decode(), now))


def connected(port: int, room: int | None) -> socket.socket:
    client = socket.socket()
    if room is not None:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
    client.connect(("127.0.0.1", port))
    return client


def gone(client: socket.socket) -> bool:
    """Whether the service has let go of a client."""
    try:
        client.setblocking(False)
        while client.recv(1 << 20):
            continue
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def row(
    heard: list[tuple[str, int]], sent: dict[str, int], used: float, load: float, stuck: str
) -> dict[str, str]:
    delays = np.array([(at - sent[clock]) / 1e6 for clock, at in heard if clock in sent])
    epochs = {clock for clock, _ in heard} & set(sent)
    p50, p99 = np.percentile(delays, [50.0, 99.0])
    return {
        "never read": stuck,
        "epochs": f"{len(epochs):6d}/{len(sent)}",
        "p50 ms": f"{p50:6.1f}",
        "p99 ms": f"{p99:6.1f}",
        "worst ms": f"{delays.max():8.1f}",
        "processor ms an epoch": f"{1e3 * used:21.1f}",
        "load": f"{load:4.1f}",
    }


def processor(pid: int) -> float:
    """Processor time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def wait_for(port: int) -> None:
    for _ in range(600):
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            return
        except OSError:
            time.sleep(0.1)
    raise SystemExit("the service does not answer")


if __name__ == "__main__":
    main()
