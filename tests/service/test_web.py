"""The API on a real port: what it says is what the service knows, and only to those who may."""

import asyncio
import contextlib
import json
import math
import threading

import numpy as np
import pytest
import websockets
from websockets.asyncio.client import connect
from websockets.sync.client import connect as listen

from service.test_live import options_in
from service.test_station import recorded
from service.test_transport import free_port, wait_for
from service.web_made import OPERATOR, TOKENS, VIEWER, served, voyage, web_options
from surefix.errors import OutputError
from surefix.io.journal import open_journal
from surefix.service.alarms import raised
from surefix.service.live import begin_live, run_live
from surefix.service.options import read_live
from surefix.service.web_server import open_web


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    with served(tmp_path_factory.mktemp("open")) as made:
        yield made


@pytest.fixture(scope="module")
def locked(tmp_path_factory):
    more = TOKENS + 'origins = ["https://boat.example"]\nrequests_per_s = 1000'
    with served(tmp_path_factory.mktemp("locked"), more, rows=0) as made:
        yield made


def test_the_state_is_what_the_service_knows(service):
    state = service.client().get("/api/state").json()
    known = service.live.now
    position = state["position"]
    assert state["version"] == 1
    assert position["time"] == pytest.approx(known.time, abs=1e-3)
    assert [position[k] for k in ("latitude", "longitude")] == pytest.approx(known.geodetic[:2])
    assert position["height"] is None  # the log has none: NaN is null
    np.testing.assert_allclose(position["sigma"][:2], known.sigma_position[:2], atol=1e-4)
    assert position["speed"] == pytest.approx(math.hypot(*known.velocity[:2]), abs=1e-3)
    assert position["dead_reckoned"] is False
    assert [each["name"] for each in state["inputs"]] == ["boat"]


def test_the_past_is_what_was_cleaned(service):
    client, history = service.client(), service.live.history
    rows = history.take(history.since(0))
    whole = client.get("/api/track", params={"most": 5000}).json()
    assert whole["rows"]["omitted"] == 0
    assert whole["rows"]["number"] == list(range(len(rows)))
    np.testing.assert_allclose(whole["rows"]["time"], rows["time"], atol=1e-3)
    shown = np.array(whole["rows"]["clean"], dtype=float)
    np.testing.assert_allclose(shown, rows["clean"], atol=1e-3)
    assert {"used", "rejected"} <= set(whole["rows"]["verdict"])
    assert any("σ" in reason for reason in whole["rows"]["reason"])
    assert [whole["first"], whole["last"]] == [rows["time"][0], rows["time"][-1]]
    since, until = float(rows["time"][20]), float(rows["time"][60])
    part = client.get("/api/track", params={"since": since, "until": until, "most": 20}).json()
    kept = part["rows"]["number"]
    total = int(((rows["time"] >= since) & (rows["time"] <= until)).sum())
    assert 2 <= len(kept) < total == len(kept) + part["rows"]["omitted"]
    assert min(part["rows"]["time"]) >= since
    assert max(part["rows"]["time"]) <= until


def test_what_was_wrong_then_is_told_with_the_past(tmp_path):
    """A receiver is silent for half a minute and comes back."""
    with served(tmp_path, rows=0) as service:
        service.sail(list(voyage(95)))
        lost = service.now
        service.silence(30)
        back = service.now
        service.sail(list(voyage(200))[125:])
        client = service.client()

        def then(moment):
            said = client.get("/api/track", params={"since": moment - 60.0, "until": moment}).json()
            (place,) = [each for each in said["sensors"] if each["quantity"] == "position"]
            alarms = [each for each in said["alarms"] if each["concerns"] != "boat HEHDT"]
            return place["validity"], {each["concerns"]: each["gone"] for each in alarms}

        assert then(lost - 1.0) == ("valid", {})
        assert then(back) == ("invalid", {"boat GNSS": None, "position": None})
        validity, alarms = then(service.now)
        assert validity == "valid"
        assert all(gone > back for gone in alarms.values())  # over, and nobody has seen them
        assert alarms.keys() >= {"boat GNSS", "position"}


@pytest.mark.parametrize("query", ["since=x", "since=nan", "until=inf", "most=0", "most=1e9"])
def test_wrong_questions_are_told(service, query):
    answer = service.client().get(f"/api/track?{query}")
    assert answer.status_code == 422
    assert answer.json()["detail"]


def test_the_stream_brings_every_row_once(tmp_path):
    with served(tmp_path) as service, listen(f"ws://{service.host}/api/live") as stream:
        first = json.loads(stream.recv(10.0))
        known = service.live.history.total
        assert first["position"]["time"] == pytest.approx(service.live.now.time, abs=1e-3)
        heard = list(first["rows"]["number"])
        service.feed(recorded(200)[len(recorded(120)) :])
        while not heard or heard[-1] < service.live.history.total - 1:
            heard += json.loads(stream.recv(10.0))["rows"]["number"]
        assert heard == list(range(heard[0], service.live.history.total))
        assert heard[0] <= known < service.live.history.total - 20
        assert json.loads(stream.recv(3.0))["rows"]["number"] == []  # it speaks without news, too


def test_what_a_client_says_ends_its_stream(service):
    with listen(f"ws://{service.host}/api/live") as stream:
        stream.recv(10.0)
        stream.send("hello")
        with contextlib.suppress(websockets.ConnectionClosed):
            while True:
                stream.recv(10.0)
        assert stream.close_code == 1003


@pytest.mark.parametrize(
    ("method", "path", "nobody", "viewer"),
    [
        ("GET", "/api/state", 401, 200),
        ("GET", "/api/track", 401, 200),
        ("GET", "/api/openapi.json", 401, 200),
        ("GET", "/metrics", 401, 200),
        ("GET", "/api/session", 401, 200),
        ("POST", "/api/alarms/7/acknowledge", 401, 403),
        ("POST", "/api/unknown", 401, 403),
        ("GET", "/api/unknown", 401, 404),
        ("GET", "/docs", 401, 404),
        ("GET", "/", 200, 200),
        ("GET", "/healthz", 200, 200),
        ("GET", "/pages/live.css", 200, 200),
        ("GET", "/pages/absent", 404, 404),
    ],
)
def test_who_may_what(locked, method, path, nobody, viewer):
    assert locked.client().request(method, path).status_code == nobody
    assert locked.client(VIEWER).request(method, path).status_code == viewer
    operator = locked.client(OPERATOR).request(method, path).status_code
    assert operator == (404 if "7" in path or "unknown" in path else viewer)


def test_wrong_tokens_are_few(tmp_path):
    with served(tmp_path, TOKENS, rows=0) as service:
        wrong = service.client("wrong-token-0123456789")
        answers = [wrong.get("/api/state").status_code for _ in range(15)]
        assert answers[:10] == [401] * 10
        assert answers[11:] == [429] * 4
        assert service.client(VIEWER).get("/api/state").status_code == 200


def test_only_those_who_may_see_hear_the_stream(locked):
    for token, status in (("", 401), ("wrong-token-0123456789", 401)):
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        with pytest.raises(websockets.InvalidStatus) as refused:
            listen(f"ws://{locked.host}/api/live", additional_headers=headers)
        assert refused.value.response.status_code == status
    headers = {"Authorization": f"Bearer {VIEWER}"}
    with listen(f"ws://{locked.host}/api/live", additional_headers=headers) as stream:
        assert json.loads(stream.recv(10.0))["position"] is None


def test_a_browser_signs_in_and_out(locked):
    client = locked.client()
    shown = {"Authorization": f"Bearer {OPERATOR}"}
    answer = client.post("/api/session", headers=shown | {"Origin": f"http://{locked.host}"})
    assert answer.json() == {"role": "operator", "tokens": True, "signed_in": True}
    said = answer.headers["set-cookie"].lower()
    assert "httponly" in said
    assert "samesite=strict" in said
    assert OPERATOR not in said
    assert client.get("/api/state").status_code == 200
    here = {"Origin": f"http://{locked.host}"}
    assert client.post("/api/alarms/7/acknowledge").status_code == 403  # no Origin: no browser
    assert client.post("/api/alarms/7/acknowledge", headers=here).status_code == 404
    assert client.delete("/api/session", headers=here).status_code == 204
    assert client.get("/api/state").status_code == 401


def test_an_alarm_is_acknowledged_and_written_down(tmp_path):
    with served(tmp_path, TOKENS) as service:
        alarms = raised((), "test", "warning", "away: for a test", service.now)
        service.call(service.set(alarms=alarms))
        number = alarms[0].number
        stop = threading.Event()

        def steps():
            while not stop.wait(0.05):
                service.feed(b"\r\n")

        stepping = threading.Thread(target=steps)
        stepping.start()
        try:
            path = f"/api/alarms/{number}/acknowledge"
            answer = service.client(OPERATOR).post(path)
            again = service.client(OPERATOR).post(path)
        finally:
            stop.set()
            stepping.join()
        assert answer.status_code == 200
        assert answer.json()["by"] == "operator at 127.0.0.1"
        assert again.json()["seen"] == answer.json()["seen"]  # the first one counts
        told = [each.text for each in service.live.journal.told() if each.kind == "alarm"]
        assert any("operator at 127.0.0.1" in text for text in told)


def test_figures_for_prometheus(service):
    service.client().get("/api/state")
    text = service.client().get("/metrics").text
    known = {
        line.rpartition(" ")[0]: float(line.rpartition(" ")[2])
        for line in text.splitlines()
        if not line.startswith("#")
    }
    history = service.live.history
    counted = [value for key, value in known.items() if key.startswith("surefix_fixes_total")]
    assert sum(counted) == history.total
    assert any('verdict="rejected"' in key for key in known)
    assert known["surefix_latency_seconds_count"] == service.live.taken
    assert known['surefix_web_answers_total{status="200"}'] > 0
    assert known["surefix_journal_unwritten"] == known["surefix_journal_lag_seconds"] == 0.0
    assert 0.0 < known['surefix_sigma_metres{axis="x"}'] < 10.0


def test_health_tells_when_the_service_stands_still(tmp_path):
    with served(tmp_path) as service:
        assert service.client().get("/healthz").json() == {"status": "ok"}
        service.now += 60.0
        answer = service.client().get("/healthz")
        assert (answer.status_code, answer.json()) == (503, {"status": "stalled"})


def test_pages_are_kept_by_browsers_and_need_no_other_host(service):
    client = service.client()
    whole = client.get("/pages/plotly.js")
    assert len(whole.content) > 1_000_000
    again = client.get("/pages/plotly.js", headers={"If-None-Match": whole.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    plain = client.get("/pages/live.css", headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    policy = client.get("/").headers["content-security-policy"]
    assert "script-src 'self';" in policy
    assert "http" not in policy
    page = client.get("/").text
    assert "<script>" not in page
    assert " on" not in " ".join(part.split(">")[0] for part in page.split("<"))


def test_a_port_that_is_taken_is_told(service, tmp_path):
    options = web_options(tmp_path, address=service.host)
    with pytest.raises(OutputError, match="choose another port"):
        open_web(service.live, options.web)


def test_the_whole_service_serves_until_it_is_stopped_and_remembers(tmp_path):
    log = tmp_path / "boat.nmea"
    log.write_bytes(recorded())
    port = free_port()
    place = options_in(tmp_path, f"file:///{log}?speed=0", f"udp://127.0.0.1:{free_port()}")
    place.write_text(place.read_text() + f'\n[web]\naddress = "127.0.0.1:{port}"\n')
    options = read_live(place)

    async def run():
        live = begin_live(options)
        known = live.history.total
        serving = asyncio.create_task(run_live(live, asyncio.Event()))
        heard = []
        await wait_for(lambda: live.watchers)
        async with connect(f"ws://127.0.0.1:{port}/api/live") as stream:
            with contextlib.suppress(websockets.ConnectionClosedError):  # 1012: it goes
                async for text in stream:
                    heard.append(json.loads(text))
        await asyncio.wait_for(serving, 60.0)
        return live, known, heard

    live, known, heard = asyncio.run(run())
    assert known == 0
    assert heard[-1]["version"] == 1
    rows = live.history.take(live.history.since(0))
    assert len(rows) > 140
    again = begin_live(options)
    assert again.history.take(again.history.since(0)).tobytes() == rows.tobytes()
    assert again.history.sensors == live.history.sensors
    for moment in rows["time"][::20]:
        assert repr(again.past.at(moment)) == repr(live.past.at(moment))
    again.journal.close()
    journal = open_journal(options.journal, new=False)
    assert sum(each.kind == "rows" for each in journal.told()) > 0
    journal.close()
