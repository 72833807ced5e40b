"""The API of a review: only for who has the address, and it exports what `surefix clean` writes."""

import contextlib
import threading
import time
import zipfile
from io import BytesIO

import httpx
import pytest

from acceptance.product import clean, read, surefix
from service.reviewed import WILD, begun, log
from surefix.errors import OutputError
from surefix.io.edits import read_edits
from surefix.service.review_server import open_server

EVERY = ["used", "downweighted", "rejected", "edited"]
ALL = {"panel": "plan", "line": [[-1e5, -1e5], [1e5, -1e5], [1e5, 1e5], [-1e5, 1e5]]}


@contextlib.contextmanager
def served(review, name="track"):
    """Serve a review on a port of its own, and give a client that has the token."""
    server = open_server(review, name, "surefix clean …")
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    address, _, token = server.url.partition("#")
    try:
        with httpx.Client(
            base_url=address, headers={"authorization": f"Bearer {token}"}, timeout=60.0
        ) as client:
            yield client
    finally:
        server.stop()
        thread.join(30.0)
        assert not thread.is_alive()


@pytest.fixture
def edits(tmp_path):
    return tmp_path / "edits.jsonl"


@pytest.fixture
def place(tmp_path):
    return log(tmp_path / "globe.csv", globe=True)


@pytest.fixture
def client(place, edits):
    with served(begun(edits, place)) as made:
        yield made


def plain(answer):
    """What an answer says."""
    assert answer.status_code in (200, 202), answer.text
    said = answer.json()
    return said.get("figures", said)


def state(client):
    return plain(client.get("/api/state"))


def run(client):
    assert client.post("/api/run").status_code == 202
    deadline = time.monotonic() + 60.0
    while (now := state(client))["busy"]:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return now


def choice(client, *parts, verdicts=EVERY, **more):
    return {"run": state(client)["run"], "parts": parts, "verdicts": verdicts, **more}


def test_without_the_token_nothing_is_told_or_done(client, edits):
    with httpx.Client(base_url=client.base_url) as bare:
        for path in ("state", "figures?of=plan", "export/csv", "step?by=1"):
            assert bare.get(f"/api/{path}").status_code == 401
        for path in ("choose", "edit", "undo", "redo", "run"):
            assert bare.post(f"/api/{path}", json={}).status_code == 401
        wrong = {"authorization": "Bearer 0123456789abcdef0123"}
        assert bare.get("/api/state", headers=wrong).status_code == 401
        assert bare.get("/").status_code == 200  # the page without data
    assert not edits.exists()


def test_foreign_names_and_pages_are_refused(client):
    assert client.get("/api/state", headers={"host": "evil.example"}).status_code == 403
    assert client.post("/api/undo", headers={"origin": "http://evil.example"}).status_code == 403
    own = str(client.base_url).rstrip("/")
    assert client.post("/api/undo", headers={"origin": own}).status_code == 409


def test_pages_need_nothing_from_elsewhere_and_are_all_that_is_served(client):
    page = client.get("/")
    assert "script-src 'self'" in page.headers["content-security-policy"]
    names = ("review.html", "review.css", "review.js", "calls.js", "drawing.js", "words.js")
    for name in names:
        text = client.get(f"/pages/{name}").text
        assert "http://" not in text.replace("http://www.w3.org", "")
        assert "https://" not in text
    assert "plotly.js" in client.get("/pages/plotly.js").text[:2000]
    for path in ("/pages/../review.py", "/pages/%2e%2e/review.py", "/pages/none.js", "/x"):
        assert client.get(path).status_code in (400, 404)


def test_figures_know_the_rows_of_their_marks(client):
    marks = {}
    for of in ("plan", "strips"):
        figure = plain(client.get("/api/figures", params={"of": of}))[of]
        assert len(figure["rows"]) == len(figure["data"])
        marks[of] = {
            trace["name"]
            for trace, rows in zip(figure["data"], figure["rows"], strict=True)
            if rows
        }
    assert marks["plan"] == marks["strips"] == {"used", "rejected"}


def test_what_is_chosen_is_decided_undone_and_redone(client, edits):
    found = plain(client.post("/api/choose", json=choice(client, ALL, verdicts=["rejected"])))
    assert found["total"] == found["verdicts"]["rejected"] == len(WILD)
    assert plain(client.post("/api/choose", json=choice(client)))["total"] == 0
    row = plain(client.get("/api/step", params={"by": 1}))["row"]
    one = choice(client, {"rows": [row]})
    assert "globe, row 40, " in plain(client.post("/api/choose", json=one))["text"]
    now = plain(client.post("/api/edit", json=one | {"action": "accept"}))
    assert (now["waiting"], now["undo"], now["redo"]) == (1, 1, 0)
    assert now["edits"][0]["total"] == 1
    now = plain(client.post("/api/undo"))
    assert (now["waiting"], now["undo"], now["redo"]) == (0, 0, 1)
    assert now["edits"][1]["undone"]
    assert plain(client.post("/api/redo"))["waiting"] == 1
    assert [entry.action for entry in read_edits(edits).entries] == ["accept", "undo", "redo"]


def test_wrong_questions_are_told(client, edits):
    nothing = choice(client, action="reject")
    for answer, status, said in (
        (client.post("/api/undo"), 409, "nothing was changed"),
        (client.post("/api/edit", json=nothing), 409, "reject of no fix"),
        (client.post("/api/edit", json=nothing | {"run": 7}), 409, "cleaned again"),
        (client.post("/api/edit", json=nothing | {"action": "delete"}), 422, "action"),
        (client.post("/api/edit", json=nothing | {"verdicts": ["x"]}), 422, "verdict"),
        (client.post("/api/choose", json={}), 422, "missing"),
        (client.post("/api/choose", content=b"x" * 5_000_000), 413, "bytes"),
        (client.get("/api/export/exe"), 400, "csv, parquet"),
        (client.get("/api/figures", params={"of": "all"}), 422, "plan"),
    ):
        assert answer.status_code == status, answer.text
        assert said in answer.text
        assert "Traceback" not in answer.text
    assert not edits.exists() or not read_edits(edits).entries


def test_what_is_exported_is_what_surefix_clean_writes(client, place, edits, tmp_path):
    wild = choice(client, ALL, verdicts=["rejected"], action="accept")
    assert plain(client.post("/api/edit", json=wild))["waiting"] == len(WILD)
    refused = client.get("/api/export/csv")
    assert (refused.status_code, "run it first" in refused.text) == (409, True)
    run(client)
    formats = ("csv", "parquet", "geojson", "gpx", "nmea")
    outs = [tmp_path / f"track.{suffix}" for suffix in formats]
    clean(place, "--edits", edits, *(word for out in outs for word in ("-o", out)))
    for out in outs:
        answer = client.get(f"/api/export/{out.suffix[1:]}")
        assert f'filename="{out.name}"' in answer.headers["content-disposition"]
        assert answer.content == out.read_bytes()
    assert (read(outs[0]).reason == "accepted by the user").sum() == len(WILD)
    clean(place, "-o", tmp_path / "plain.csv")
    assert (tmp_path / "plain.csv").read_bytes() != outs[0].read_bytes()


def test_series_and_regular_times_come_as_one_archive(tmp_path, place, edits):
    with served(begun(edits, place, every_s=5.0)) as client:
        answer = client.get("/api/export/csv")
        assert 'filename="track.zip"' in answer.headers["content-disposition"]
        packed = zipfile.ZipFile(BytesIO(answer.content))
        assert sorted(packed.namelist()) == ["track.csv", "track.fixes.csv"]
        clean(place, "--every", "5s", "-o", tmp_path / "track.csv")
        for name in packed.namelist():
            assert packed.read(name) == (tmp_path / name).read_bytes()
        assert b"Track report" in client.get("/api/export/html").content


def test_runs_are_compared(client):
    assert plain(client.get("/api/figures", params={"of": "plan"}))["compared"] is None
    rows = {"rows": list(range(100, 130))}
    client.post("/api/edit", json=choice(client, rows, action="reject"))
    assert run(client)["run"] == 2
    found = plain(client.get("/api/figures", params={"of": "strips", "compare": "before"}))
    assert found["compared"]["verdicts"]["edited"] == 0
    assert found["told"]["verdicts"]["edited"] > 25
    assert 0.0 < found["compared"]["rms_m"] < found["compared"]["most_m"]
    names = [trace["name"] for trace in found["strips"]["data"]]
    assert names.count("before") == len(found["strips"]["panels"]) == 3
    assert "difference" in names
    again = plain(client.get("/api/figures", params={"of": "plan", "compare": "first"}))
    assert again["compared"] == found["compared"]


def test_a_window_is_drawn_alone(client):
    whole = plain(client.get("/api/figures", params={"of": "strips"}))["strips"]
    assert whole["note"] == ""
    none = {"of": "strips", "t0": 0.0, "t1": 1.0}
    assert plain(client.get("/api/figures", params=none))["strips"] is None


def test_a_port_that_is_taken_is_told(client, place, edits):
    port = client.base_url.port
    told = surefix("review", place, "--edits", edits, "--port", port)
    assert told.code == 1
    assert f"port {port}" in told.err
    with pytest.raises(OutputError):
        open_server(None, "x", "", 99999)
