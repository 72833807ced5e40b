"""Edits on the command line: made, undone, listed, and obeyed by `surefix clean`."""

import json
import signal
import subprocess
from urllib.request import Request, urlopen

import numpy as np
import pytest

from acceptance.product import PROGRAM, clean, read, surefix


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Run a command in a folder of its own: exit code, and what was printed."""
    monkeypatch.chdir(tmp_path)

    def go(*words):
        done = surefix(*words)
        return done.code, done.out + done.err

    return go


def test_edits_are_made_listed_undone_and_obeyed(log, tmp_path, run):
    assert run("edit", log, "--reject", "--rows", "60-62, 70")[0] == 0
    assert run("edit", log, "--accept", "--rows", "40")[0] == 0
    assert run("edit", "--undo")[0] == 0
    said = run("edit", "--list")[1].splitlines()
    assert [line.split("  ")[-1] for line in said[:1]] == [
        "reject 4 of dive.csv dive, rows 60-62, 70"
    ]
    assert said[1].endswith("accept 1 of dive.csv dive, rows 40  (undone)")
    assert said[2].endswith("undo")
    words = "--edits", tmp_path / "edits.jsonl", "-o", tmp_path / "out.csv"
    clean(log, *words)
    by_row = read(tmp_path / "out.csv").set_index("row")
    assert by_row.index[by_row.verdict == "edited"].tolist() == [60, 61, 62, 70]
    assert set(by_row.reason[by_row.verdict == "edited"]) == {"rejected by the user"}
    run("edit", "--redo")
    clean(log, *words)
    by_row = read(tmp_path / "out.csv").set_index("row")
    assert by_row.reason[40] == "accepted by the user"


def test_a_stretch_of_time(log, tmp_path, run):
    time = read(log).time
    code, said = run("edit", log, "--reject", "--since", time[10], "--until", time[13])
    assert (code, said.count("rows 10-13")) == (0, 1)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "one of --accept, --reject, --restore, --undo, --redo or --list"),
        (("--undo", "--redo"), "2 things to do"),
        (("LOG", "--reject"), "--rows, --since, --until or --sensor"),
        (("--reject", "--rows", "1"), "expected a log"),
        (("LOG", "--undo"), "--undo alone"),
        (("LOG", "--reject", "--rows", "9-3"), "numbers such as"),
        (("LOG", "--reject", "--rows", "99999"), "reject of no fix"),
        (("LOG", "--reject", "--since", "noon"), "ISO 8601"),
        (("LOG", "--reject", "--sensor", "x"), "one of dive"),
        (("LOG", "--reject", "--rows", "1", "--edits", "LOG"), "is also an input"),
        (("--list",), "No such file"),
        (("--undo",), "nothing was changed"),
    ],
)
def test_wrong_words_are_told(log, run, words, said):
    before = log.read_bytes()
    code, told = run("edit", *(log if word == "LOG" else word for word in words))
    assert code == 1
    assert said in told
    assert "Traceback" not in told
    assert log.read_bytes() == before


def test_edits_without_their_fix_and_torn_lines_are_told(log, tmp_path, run):
    run("edit", log, "--reject", "--rows", "50-52")
    with (tmp_path / "edits.jsonl").open("ab") as file:
        file.write(b'{"number": 2, "ti')
    table = read(log)
    table.loc[51, "x"] += 1.0
    table.to_csv(log, index=False)
    code, said = run("clean", log, "--edits", "edits.jsonl")
    assert code == 0
    assert "2 edited" in said
    assert "1 × edit-lost (dive.csv, dive, row 51" in said
    assert "1 × edit-torn (edits.jsonl, line 2" in said
    assert "left out, cut off in a crash" in run("edit", "--list")[1]


def test_without_edits_it_is_as_without_a_log(log, tmp_path, run):
    (tmp_path / "edits.jsonl").touch()
    clean(log, "-o", tmp_path / "plain.csv")
    clean(log, "--edits", tmp_path / "edits.jsonl", "-o", tmp_path / "edited.csv")
    assert (tmp_path / "plain.csv").read_bytes() == (tmp_path / "edited.csv").read_bytes()
    assert np.isfinite(read(tmp_path / "plain.csv").x).any()


def test_review_serves_its_page_until_it_is_interrupted(log, tmp_path):
    pytest.importorskip("fastapi")
    words = "review", log, "--edits", tmp_path / "edits.jsonl"
    command = [*PROGRAM, *(str(word) for word in words)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        address = server.stdout.readline().removeprefix("open ").strip()
        place, _, token = address.partition("#")
        ask = Request(f"{place}api/state", headers={"Authorization": f"Bearer {token}"})
        with urlopen(ask, timeout=30) as answer:
            said = json.load(answer)
        server.send_signal(signal.SIGINT)
        rest, _ = server.communicate(timeout=30)
    finally:
        server.kill()
        server.communicate()
    assert said["sources"] == ["dive.csv"]
    assert said["command"] == f"surefix clean {log} --edits {tmp_path / 'edits.jsonl'}"
    assert said["waiting"] == 0
    assert server.returncode == 0
    assert "ended; 0 edits" in rest


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("none.csv",), "none.csv: No such file"),
        (("LOG", "--edits", "LOG"), "is also an input"),
        (("LOG", "--options", "none.toml"), "none.toml"),
        (("LOG", "--mode", "sideways"), "sideways"),
    ],
)
def test_review_tells_what_is_wrong(log, run, words, said):
    code, told = run("review", *(log if word == "LOG" else word for word in words))
    assert code in (1, 2)
    assert said in told
    assert "Traceback" not in told
