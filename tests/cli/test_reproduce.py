"""`surefix reproduce`: files, and errors before any work is done."""

import json

import pytest

from acceptance.product import surefix


def test_figures_go_to_json_and_report(tmp_path):
    places = tmp_path / "usbl.json", tmp_path / "usbl.html"
    done = surefix("reproduce", "usbl", "--runs", "1", "--json", places[0], "--report", places[1])
    assert done.code == 0
    found = json.loads(places[0].read_text(encoding="utf-8"))
    assert (found["paper"], found["seed"], found["runs"]) == ("usbl", 1, 1)
    for table in ("rmse_m", "rejected_pct"):
        rows = found["tables"][table]
        assert {"KF", "Huber", "IGG1", "IGG3"} <= set(rows)
        assert all(len(row) == 3 for row in rows.values())
    assert "Huber" in done.out
    page = places[1].read_text(encoding="utf-8").split("<script>")[0]
    assert "Findings" in page
    assert "://" not in page


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["usbl", "--runs", "0"], "runs 0"),
        (["usbl", "--seed", "-1"], "seed -1"),
        (["sonar"], "'usbl', 'cooperative', 'towed', 'ship', 'radar'"),
        (["usbl", "--log", "ship.txt"], "the paper ship"),
        (["usbl", "--report", "usbl.pdf"], ".html"),
        (["usbl", "--report", "nowhere/usbl.html"], "a directory that exists"),
        (["usbl", "--json", "nowhere/usbl.json"], "a directory that exists"),
    ],
)
def test_wrong_words_are_told_before_the_work(words, told):
    done = surefix("reproduce", *words)
    assert done.code != 0
    assert done.out == ""
    assert told in done.err
    assert len(done.err.splitlines()) == 1
