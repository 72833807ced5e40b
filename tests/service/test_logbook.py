"""What happens is written down, a JSON object a line; systemd is told that the service lives."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from service.test_live import SUREFIX, _send, options_in
from service.test_station import recorded
from service.test_transport import free_port
from surefix.service.alarms import acknowledged, cleared, raised
from surefix.service.live import begin_live
from surefix.service.logbook import Logbook
from surefix.service.options import read_live

DOCS = Path(__file__).parents[2] / "docs" / "live.md"


def test_only_what_changes_is_written(tmp_path):
    place = options_in(tmp_path, "udp://127.0.0.1:1", f"udp://127.0.0.1:{free_port()}")
    live, lines = begin_live(read_live(place)), []
    log = Logbook(live, lines.append, lambda: 1_785_585_600.25)

    def said():
        log.note()
        told = [tuple(json.loads(line).values()) for line in lines]
        lines.clear()
        assert all(each[0] == "2026-08-01T12:00:00.250Z" for each in told)
        return [each[1:] for each in told]

    assert said() == [
        ("info", "start", "service", "after 0 pieces in the journal"),
        ("info", "input", "boat", "waits"),
    ]
    assert said() == []
    (line,) = live.lines
    line.trouble = "Connection refused"
    assert said() == [("warning", "input", "boat", "Connection refused")]
    line.connected, line.trouble, line.refused, line.refused_from = True, "", 2, "10.0.0.9"
    assert said() == [
        ("info", "input", "boat", "connected"),
        ("warning", "sender", "boat", "2 refused so far, the last from 10.0.0.9"),
    ]
    live.alarms = raised((), "boat RMC", "alarm", 'stale "for" 5 s\\n', 0.0)
    assert said() == [("error", "alarm", "boat RMC", 'raised: stale "for" 5 s\\n')]
    live.alarms = acknowledged(live.alarms, 1, "ann", 0.0)
    assert said() == [("info", "alarm", "boat RMC", 'acknowledged by ann: stale "for" 5 s\\n')]
    live.alarms = cleared(live.alarms, "boat RMC", 0.0)
    assert said() == [("info", "alarm", "boat RMC", 'cleared: stale "for" 5 s\\n')]
    assert said() == []
    live.journal.close()


def test_a_service_of_systemd(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    place = options_in(tmp_path, f"udp://127.0.0.1:{port}", f"udp://127.0.0.1:{free_port()}")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(60.0)
        words = [SUREFIX, "live", "--options", place, "--log-json"]
        env = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify")}
        with subprocess.Popen(words, env=env, stderr=subprocess.PIPE, text=True) as run:
            assert manager.recv(100) == b"READY=1\nWATCHDOG=1"
            assert manager.recv(100) == b"WATCHDOG=1"
            _send(port, recorded(60).splitlines(keepends=True), 0.002)
            for line in run.stderr:
                if json.loads(line)["event"] == "position":
                    break
            asked = time.monotonic()
            run.send_signal(signal.SIGTERM)
            while manager.recv(100) != b"STOPPING=1":
                pass
            rest = [json.loads(line) for line in run.stderr]
            assert run.wait(60.0) == 0
            assert time.monotonic() - asked < 30.0
    assert rest[-1]["event"] == "stop"
    assert set(rest[-1]) == {"time", "level", "event", "about", "text"}


def test_the_unit_of_the_docs_is_sound(tmp_path):
    (unit,) = re.findall(r"```ini\n(.*?)```", DOCS.read_text(), re.DOTALL)
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("systemd-analyze is not installed")
    unit = unit.replace("/opt/surefix/bin/surefix", shutil.which("true") or sys.executable)
    place = tmp_path / "surefix.service"
    place.write_text(unit)
    words = [program, "verify", "--man=no", place]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    ours = [line for line in done.stderr.splitlines() if "surefix" in line]
    assert ours == []
