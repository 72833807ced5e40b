"""Signal K, fed by a running `surefix live` over TCP and UDP, holds what live knew."""

from __future__ import annotations

import json
import math
import os
import subprocess
import threading
import time
from datetime import datetime
from itertools import islice
from socket import SOCK_DGRAM
from urllib.request import urlopen

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from needs import built, tool
from service.boats import begin, send, served, told, voyage
from service.test_transport import free_port

INTERFACES = ("plugins", "webapps", "appstore", "nmea-tcp", "tcp", "mfd_webapp")


def provider(name, **where):
    options = {"logging": False, "type": "NMEA0183", "subOptions": {"type": name, **where}}
    piped = [{"type": "providers/simple", "options": options}]
    return {"id": name, "enabled": True, "pipeElements": piped}


def settings(tcp, udp):
    return {
        "interfaces": dict.fromkeys(INTERFACES, False),
        "mdns": False,
        "ssl": False,
        "pipedProviders": [
            provider("tcp", host="127.0.0.1", port=str(tcp)),
            provider("udp", port=str(udp)),
        ],
    }


def answered(port):
    """The REST API's view of the vessel, once it answers."""
    end = time.monotonic() + 60.0
    while True:
        try:
            with urlopen(f"http://127.0.0.1:{port}/signalk/v1/api/vessels/self") as answer:
                return json.load(answer)
        except OSError:
            assert time.monotonic() < end, "Signal K does not answer"
            time.sleep(0.2)


class Watcher(threading.Thread):
    """Read all that Signal K streams, until stopped."""

    def __init__(self, port):
        super().__init__()
        self.seen, self.done, self.there = [], threading.Event(), threading.Event()
        self.port = port

    def run(self):
        with connect(f"ws://127.0.0.1:{self.port}/signalk/v1/stream?subscribe=self") as socket:
            self.there.set()
            while not self.done.is_set():
                try:
                    self.seen.append(json.loads(socket.recv(timeout=0.2)))
                except TimeoutError:
                    continue
                except ConnectionClosed:
                    return


def test_signal_k_holds_what_live_knew(tmp_path):
    node = tool("node", "nodejs")
    program = built("signalk", "node_modules", "signalk-server", "bin", "signalk-server")
    tcp, udp, web = free_port(), free_port(SOCK_DGRAM), free_port()
    (tmp_path / "settings.json").write_text(json.dumps(settings(tcp, udp)))
    outputs = (f"to = 'tcp-listen://127.0.0.1:{tcp}'", f"to = 'udp://127.0.0.1:{udp}'")
    places = {"PORT": str(web), "SIGNALK_NODE_CONFIG_DIR": str(tmp_path), "HOME": str(tmp_path)}
    with (
        served(tmp_path, *outputs) as feed,
        (tmp_path / "signalk.log").open("wb") as log,
        subprocess.Popen(
            [node, program, "-c", tmp_path], stdout=log, stderr=log, env=os.environ | places
        ) as run,
    ):
        answered(web)
        watcher = Watcher(web)
        try:
            watcher.start()
            assert watcher.there.wait(10.0)
            boat = voyage(2000)
            begin(tmp_path, feed, boat)
            send(feed, islice(boat, 100))
            time.sleep(0.7)
            vessel = answered(web)
        finally:
            watcher.done.set()
            watcher.join()
            run.terminate()
    known = told(tmp_path)
    check_stream(watcher.seen, known)
    check_vessel(vessel, known)


def check_stream(seen, known):
    """Every value that was streamed, of either source, is that of its instant."""
    at, counts = {}, {}
    for update in [each for message in seen for each in message.get("updates", [])]:
        source = update.get("$source", "")
        for value in update.get("values", []):
            path = value["path"]
            if path == "navigation.position":
                at[source] = datetime.fromisoformat(update["timestamp"]).timestamp()
            if (
                source in at
                and value["value"] is not None
                and matches(path, value["value"], known[round(at[source] * 100.0)])
            ):
                counts[source, path] = counts.get((source, path), 0) + 1
    assert len(counts) == 10
    assert all(count >= 40 for count in counts.values())


def check_vessel(vessel, known):
    """What the REST API holds is what was told of the instant that it says."""
    navigation = vessel["navigation"]
    at = datetime.fromisoformat(navigation["position"]["timestamp"]).timestamp()
    last = known[round(at * 100.0)]
    assert max(known) - round(at * 100.0) < 300
    for name in ("position", "speedOverGround", "courseOverGroundTrue", "headingTrue"):
        assert matches(f"navigation.{name}", navigation[name]["value"], last)
    depth = vessel["environment"]["depth"]["belowTransducer"]["value"]
    assert matches("environment.depth.belowTransducer", depth, last)


def matches(path, value, now):
    """Check a value, to the digits it was sent with; False if it is none of ours."""
    angles = {"navigation.courseOverGroundTrue": "course", "navigation.headingTrue": "heading"}
    if path == "navigation.position":
        assert value["latitude"] == pytest.approx(now["latitude"], abs=1e-8)
        assert value["longitude"] == pytest.approx(now["longitude"], abs=1e-8)
    elif path in angles:
        off = math.remainder(math.degrees(value) - now[angles[path]], 360.0)
        assert abs(off) < 0.0051
    elif path == "navigation.speedOverGround":
        assert value == pytest.approx(now["speed"], abs=0.0027)
    elif path == "environment.depth.belowTransducer":
        assert value == pytest.approx(now["depth"], abs=0.0051)
    else:
        return False
    return True
