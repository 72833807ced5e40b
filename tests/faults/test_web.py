"""Faults 42–47 and 50 on the web side: one bad client or page harms nobody else."""

import contextlib
import json
import socket
import threading
import time

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect as listen

from service.web_made import NOON, OPERATOR, TOKENS, VIEWER, served
from surefix.service import web_guard, web_hub, web_server
from surefix.service.alarms import raised
from surefix.service.sensors import SensorState
from surefix.service.web_access import SESSION_S, cookie_name, session

PLENTY = "requests_per_s = 10000"


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    with served(tmp_path_factory.mktemp("here"), PLENTY) as made:
        yield made


def raw(service, text, *, buffer=None):
    """A connection that has said something and waits."""
    made = socket.socket()
    if buffer:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    made.settimeout(10.0)
    made.connect(("127.0.0.1", service.web.port))
    made.sendall(text.encode())
    return made


def request(service, path="/api/state", *headers, method="GET"):
    lines = [f"{method} {path} HTTP/1.1", *headers]
    if not any(each.startswith("Host:") for each in headers):
        lines.append(f"Host: {service.host}")
    return "\r\n".join([*lines, "", ""])


def status(service, text):
    with raw(service, text) as made:
        return int(made.recv(100).split()[1])


def is_cut(connection):
    """Read until the other side ends; False if it does not within 10 s."""
    try:
        while connection.recv(1 << 16):
            pass
    except TimeoutError:
        return False
    except ConnectionResetError:
        return True
    return True


UPGRADE = (
    "Connection: Upgrade",
    "Upgrade: websocket",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)


async def more_rows(service, count):
    history = service.live.history
    history.extend(history.take(history.since(history.total - 100)).repeat(count)[:count])
    service.web.notice([])


def test_fault_42_clients_that_never_read(tmp_path, monkeypatch):
    monkeypatch.setattr(web_hub, "_APART", 0.005)
    with served(tmp_path, PLENTY + "\nclients = 12") as service:
        silent = [
            raw(service, request(service, "/api/live", *UPGRADE), buffer=4096) for _ in range(10)
        ]
        heard = []
        with listen(f"ws://{service.host}/api/live", max_size=None) as good:
            heard += json.loads(good.recv(10.0))["rows"]["number"]
            assert service.web.state.clients == 11
            first, longest = service.live.history.total, 0.0
            end = time.monotonic() + 60.0
            while service.web.state.dropped < 10:
                assert time.monotonic() < end
                service.call(more_rows(service, 300))
                before = time.monotonic()
                heard += json.loads(good.recv(10.0))["rows"]["number"]
                longest = max(longest, time.monotonic() - before)
            while heard[-1] < service.live.history.total - 1:
                heard += json.loads(good.recv(10.0))["rows"]["number"]
            assert heard[-(service.live.history.total - first) :] == list(
                range(first, service.live.history.total)
            )
            assert service.web.state.clients == 1
            assert "surefix_web_dropped_clients_total 10.0" in service.client().get("/metrics").text
        for each in silent:
            assert is_cut(each)
            each.close()


def test_fault_42_no_more_clients_than_allowed(tmp_path):
    with served(tmp_path, PLENTY + "\nclients = 2", rows=0) as service:
        ask = request(service, "/api/live", *UPGRADE)
        with raw(service, ask) as first, raw(service, ask) as second:
            assert first.recv(12) == second.recv(12) == b"HTTP/1.1 101"
            assert status(service, ask) == 503
        end = time.monotonic() + 10.0
        while service.web.state.clients:
            assert time.monotonic() < end
            time.sleep(0.01)
        assert status(service, ask) == 101


def test_fault_43_more_requests_than_allowed(tmp_path):
    with served(tmp_path, "requests_per_s = 2", rows=0) as service:
        client = service.client()
        answers = [client.get("/healthz").status_code for _ in range(20)]
        assert answers[:10] == [200] * 10
        assert answers[15:] == [429] * 5
        time.sleep(1.0)
        assert client.get("/healthz").status_code == 200


@pytest.mark.parametrize("said", ["", "GET / HTT", "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: "])
def test_fault_44_half_open_connections(service, monkeypatch, said):
    """A thousand of them: each has its deadline, and others are served at once."""
    monkeypatch.setattr(web_server, "_REQUEST", 1.0)
    before = service.web.state.late
    halves = [raw(service, said) for _ in range(1000)]
    assert service.client().get("/healthz").status_code == 200
    open_now = len(service.web._server.server_state.connections)
    assert open_now <= service.options.web.connections
    end = time.monotonic() + 20.0
    while service.web.state.late - before < 1000:
        assert time.monotonic() < end
        time.sleep(0.05)
    for each in halves:
        each.close()


def test_fault_44_a_second_request_has_its_deadline_too(service, monkeypatch):
    monkeypatch.setattr(web_server, "_REQUEST", 0.5)
    with raw(service, request(service, "/healthz")) as made:
        said = b""
        while not said.endswith(b'{"status":"ok"}'):
            said += made.recv(1 << 16)
        made.sendall(b"GET /api/st")
        before = time.monotonic()
        assert is_cut(made)
        assert time.monotonic() - before < 4.0  # 5 s is what an idle connection is given


def test_fault_44_an_answer_that_is_not_taken(service, monkeypatch):
    monkeypatch.setattr(web_guard, "_PATIENCE", 0.5)
    before = service.web.state.late
    with raw(service, request(service, "/pages/plotly.js"), buffer=4096):
        end = time.monotonic() + 20.0
        while service.web.state.late == before:
            assert time.monotonic() < end
            time.sleep(0.05)
    assert service.client().get("/healthz").status_code == 200


@pytest.mark.parametrize("path", ["/", "/api/state", "/api/live", "/pages/live.css", "/healthz"])
@pytest.mark.parametrize(
    "header",
    [
        "Host: evil.example",
        "Host: evil.example:8000",
        "Host: 127.0.0.1.evil.example",
        "Origin: http://evil.example",
        "Origin: null",
        "Origin: http://127.0.0.1:1",
    ],
)
def test_fault_45_foreign_origin_and_rebound_host(service, path, header):
    more = UPGRADE if path == "/api/live" else ()
    assert status(service, request(service, path, header, *more)) == 403
    own = f"Origin: http://{service.host}"
    assert status(service, request(service, path, own, *more)) == (101 if more else 200)


def test_fault_45_a_foreign_page_acknowledges_nothing(service):
    alarms = raised((), "test", "alarm", "away: for a test", service.now)
    service.call(service.set(alarms=alarms))
    path = f"/api/alarms/{alarms[0].number}/acknowledge"
    foreign = request(service, path, "Origin: http://evil.example", method="POST")
    assert status(service, foreign) == 403
    assert all(each.by == "" for each in service.live.alarms)
    service.call(service.set(alarms=()))


def test_fault_46_writes_without_a_token_and_tokens_that_ended(tmp_path):
    with served(tmp_path, TOKENS + PLENTY, rows=0) as service:
        options = service.options.web
        post = {"method": "POST", "path": "/api/alarms/1/acknowledge"}
        assert status(service, request(service, **post)) == 401
        name, here = cookie_name(options), f"Origin: http://{service.host}"
        good = f"Cookie: {name}={session(options, 'operator', service.now)}"
        ended = f"Cookie: {name}={session(options, 'operator', service.now - SESSION_S)}"
        assert status(service, request(service, post["path"], good, here, method="POST")) == 404
        assert status(service, request(service, post["path"], ended, here, method="POST")) == 401
        assert status(service, request(service, "/api/live", ended, *UPGRADE)) == 401
        assert service.client(VIEWER).post(post["path"]).status_code == 403
        assert service.client(OPERATOR).post(post["path"]).status_code == 404


def test_fault_46_a_stream_ends_with_its_session(tmp_path, monkeypatch):
    monkeypatch.setattr(web_hub, "_CHECK", 0.1)
    with served(tmp_path, TOKENS, rows=0) as service:
        cookie = session(service.options.web, "viewer", service.now)
        headers = {"Cookie": f"{cookie_name(service.options.web)}={cookie}"}
        with listen(f"ws://{service.host}/api/live", additional_headers=headers) as stream:
            for _ in range(3):
                stream.recv(10.0)
            service.now += SESSION_S
            with contextlib.suppress(ConnectionClosed):
                while True:
                    stream.recv(10.0)
            assert stream.close_code == 1008


@pytest.mark.parametrize(
    "path",
    [
        "/pages/../web_app.py", "/pages/%2e%2e/web_app.py", "/pages/..%2fweb_app.py",
        "/../etc/passwd", "/pages//etc/passwd", "/pages/%2fetc/passwd", "//etc/passwd",
        "/pages/live.css%00.html",
        "/pages/..%5cweb_app.py", "/api/alarms/../../healthz",
    ],
)  # fmt: skip
def test_fault_47_names_that_lead_elsewhere(service, path):
    assert status(service, request(service, path)) == 400


def test_fault_47_only_pages_are_given(service):
    client = service.client()
    for name in ("__init__.py", "live", "LIVE.CSS", "web_app.py", ".", "%F0%9F%98%80"):
        assert client.get(f"/pages/{name}").status_code in (400, 404)


@pytest.mark.parametrize(
    ("headers", "body", "expected"),
    [
        (["Content-Length: 20000"], "", 413),
        (["Content-Length: 99999999999999999999999999"], "", 400),
        (["Content-Length: -1"], "", 400),
        (["Content-Length: 2"], "{}", 404),
    ],
)
def test_bodies_and_heads_that_are_too_large(service, headers, body, expected):
    text = request(service, "/api/alarms/9/acknowledge", *headers, method="POST")
    assert status(service, text + body) == expected


def test_a_head_without_an_end(service):
    assert status(service, f"GET / HTTP/1.1\r\nX-Long: {'x' * 60_000}") == 400


def test_fault_50_names_are_text_and_not_markup(service):
    evil = "<script>alert(1)</script>"
    known = service.live.sensors
    service.call(service.set(sensors=(SensorState(evil, evil, reason=evil, since=NOON),)))
    answer = service.client().get("/api/state")
    assert answer.headers["content-type"] == "application/json"
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.json()["sensors"][0]["name"] == evil
    metrics = service.client().get("/metrics")
    assert metrics.headers["content-type"].startswith("text/plain")
    service.call(service.set(sensors=known))


def test_every_answer_has_its_headers(service):
    client = service.client()
    for path in ("/", "/api/state", "/absent", "/pages/live.css", "/metrics", "/pages/../x"):
        answer = client.get(path)
        for name in ("content-security-policy", "x-content-type-options", "x-frame-options"):
            assert name in answer.headers, path
        assert answer.headers["cache-control"] in ("no-store", "no-cache")
        assert "server" not in answer.headers
    assert "unsafe" not in client.get("/").headers["content-security-policy"].split("style-src")[0]


def test_many_ask_at_once(service):
    answers = []

    def asking():
        with service.client() as client:
            answers.extend(client.get("/api/track").status_code for _ in range(5))

    threads = [threading.Thread(target=asking) for _ in range(20)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert answers == [200] * 100
