"""A review: rows are those of their fixes, edits wait for a run, and a run is `surefix clean`."""

import numpy as np
import pandas as pd
import pytest

from acceptance.product import clean, read, surefix
from service.reviewed import WILD, again, begun, log, row_of
from surefix.errors import InputError, OptionsError
from surefix.io.edits import append_edit, read_edits
from surefix.io.journal import Received, open_journal
from surefix.service.review import pairs
from surefix.service.review_choice import Part, chosen_rows, doubted, inside
from surefix.types import Edit, Reason, Verdict

NONE = np.empty((0, 2))


@pytest.fixture
def edits(tmp_path):
    return tmp_path / "edits.jsonl"


def fixes(review):
    """Source, record and recorded position of the fix of each row, by what was read."""
    read_fixes = [
        (name, row, position)
        for name, parts in review.last.logs
        for part in parts
        for row, position in zip(part.fixes.row.tolist(), part.fixes.position, strict=True)
    ]
    return [read_fixes[k] for k in review.last.place]


def test_every_row_knows_its_fix(tmp_path, edits):
    review = begun(edits, log(tmp_path / "dive.csv"))
    shown = review.last.shown
    for (_, row, position), mine, coordinates in zip(
        fixes(review), shown.row, shown.raw_coordinates, strict=True
    ):
        assert row == mine
        np.testing.assert_array_equal(position, coordinates)


def test_logs_with_the_same_sensor_and_rows_are_told_apart(tmp_path, edits):
    whole = pd.read_csv(log(tmp_path / "whole.csv"), nrows=150).assign(sensor="usbl")
    places = [tmp_path / "one.csv", tmp_path / "two.csv"]
    whole[:70].to_csv(places[0], index=False)
    whole[70:].to_csv(places[1], index=False)
    review = begun(edits, *places)
    sources = [source for source, _, _ in fixes(review)]
    assert sources == ["one.csv"] * 70 + ["two.csv"] * 80
    rows = np.flatnonzero(review.last.shown.row == 20)
    review.edit(review.last, rows[1:], "reject")
    assert [part[:2] for part in read_edits(edits).entries[0].fixes] == [("two.csv", "usbl")]
    again(review)
    shown = review.last.shown.verdicts
    assert shown.reason[rows].tolist() == [Reason.AGREES, Reason.REJECTED_BY_USER]


def test_edits_wait_for_a_run_and_undone_ones_do_not(tmp_path, edits):
    review = begun(edits, log(tmp_path / "dive.csv"))
    assert review.waiting(review.last).size == 0
    rows = np.concatenate([row_of(review, 60), row_of(review, 10)])
    review.edit(review.last, rows, "reject")
    assert sorted(review.waiting(review.last)) == sorted(rows)
    review.step("undo")
    assert review.waiting(review.last).size == 0
    review.step("redo")
    with pytest.raises(OptionsError, match="redo"):
        review.step("redo")
    again(review)
    assert review.waiting(review.last).size == 0
    assert review.last.number == 2
    verdicts = review.last.shown.verdicts.verdict
    assert (verdicts == Verdict.EDITED).sum() == 2
    review.edit(review.last, row_of(review, 60), "restore")
    again(review)
    assert (review.last.shown.verdicts.verdict == Verdict.EDITED).sum() == 1


def test_edits_by_others_are_seen(tmp_path, edits):
    place = log(tmp_path / "dive.csv")
    review = begun(edits, place)
    assert surefix("edit", place, "--reject", "--rows", "5-9", "--edits", edits).code == 0
    assert len(review.waiting(review.last)) == 5
    assert len(review.log.entries) == 1


@pytest.mark.parametrize("mode", ["offline", "realtime"])
def test_a_run_is_surefix_clean(tmp_path, edits, mode):
    place = log(tmp_path / "dive.csv")
    review = begun(edits, place, mode=mode)
    review.edit(review.last, row_of(review, 111), "accept")
    review.edit(
        review.last, np.concatenate([row_of(review, row) for row in range(200, 206)]), "reject"
    )
    again(review)
    clean(place, "--mode", mode, "--edits", edits, "-o", tmp_path / "out.parquet")
    by_command, shown = read(tmp_path / "out.parquet"), review.last.shown
    for axis, name in enumerate("xyz"):
        np.testing.assert_array_equal(by_command[name], shown.track.position[:, axis])
        np.testing.assert_array_equal(by_command[f"v{name}"], shown.track.velocity[:, axis])
    assert by_command.verdict.tolist() == [
        Verdict(v).name.lower() for v in shown.verdicts.verdict.tolist()
    ]


def test_a_run_that_fails_is_told_and_the_last_one_stays(tmp_path, edits):
    place = log(tmp_path / "dive.csv")
    review = begun(edits, place)
    place.unlink()
    again(review)
    assert "dive.csv" in review.progress()["error"]
    assert review.last.number == 1
    log(place)
    again(review)
    assert review.progress()["error"] == ""
    assert review.last.number == 2


def test_a_log_that_grew_is_compared_on_what_both_runs_have(tmp_path, edits):
    place = log(tmp_path / "dive.csv", 260)
    whole = place.read_text()
    place.write_text("".join(whole.splitlines(keepends=True)[:202]))
    review = begun(edits, place)
    place.write_text(whole)
    again(review)
    mine, theirs = pairs(review.last, review.first)
    assert len(mine) == 200  # of 201 fixes one is a copy
    now, then = review.last.shown, review.first.shown
    np.testing.assert_array_equal(now.raw_coordinates[mine], then.raw_coordinates[theirs])
    np.testing.assert_array_equal(now.row[mine], then.row[theirs])


def test_runs_share_a_frame(tmp_path, edits):
    place = log(tmp_path / "globe.csv", 200, globe=True)
    review = begun(edits, place)
    review.edit(review.last, np.arange(120), "reject")  # the middle of the rest lies elsewhere
    again(review)
    first, last = review.first.shown, review.last.shown
    mine, theirs = pairs(review.last, review.first)
    np.testing.assert_allclose(last.raw_position[mine], first.raw_position[theirs], atol=1e-6)
    assert last.settings["origin"] != first.settings["origin"]


def test_a_log_without_fixes_cannot_be_reviewed(tmp_path, edits):
    place = tmp_path / "gyro.nmea"
    place.write_text("".join(f"{1.7e9 + k} $HEHDT,{k % 360}.0,T\n" for k in range(50)))
    with pytest.raises(InputError, match="no fixes"):
        begun(edits, place, require_checksum=False)


def test_inside_is_the_parity_of_crossings():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-2, 2, (2, 4_000))
    angle = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    apart = np.abs(np.hypot(x, y) - 1.0) > 1e-3
    np.testing.assert_array_equal(inside(circle, x, y)[apart], (np.hypot(x, y) < 1.0)[apart])
    star = np.column_stack([np.cos(2.0 * angle[::60]), np.sin(2.0 * angle[::60])])
    assert not inside(star, np.zeros(1), np.zeros(1))[0]  # wound round twice
    assert not inside(circle[:2], x, y).any()


def test_a_line_means_what_is_shown_inside_it(tmp_path, edits):
    shown = begun(edits, log(tmp_path / "dive.csv")).last.shown
    time, raw = shown.track.time, shown.raw_position
    first, last = time[100] + 0.1, time[120] + 0.1
    box = np.array([[first, -1e4], [last, -1e4], [last, 1e4], [first, 1e4]])
    part = Part("north", box, np.empty(0, np.int64))
    within = (time > first) & (time < last)
    everything = chosen_rows(shown, [part], list(Verdict))
    np.testing.assert_array_equal(everything, np.flatnonzero(within))
    wrong = chosen_rows(shown, [part], [Verdict.REJECTED])
    assert shown.row[wrong].tolist() == [111]
    rows = Part("", NONE, np.array([3, 5, -1, 10**6]))
    assert chosen_rows(shown, [part, rows], [Verdict.REJECTED]).tolist() == [3, 5, *wrong]
    depth = Part("vertical", np.array([[0, 0], [2e9, 0], [2e9, -1e3], [0, -1e3]]), rows.rows)
    assert len(chosen_rows(shown, [depth], list(Verdict))) == np.isfinite(raw[:, 2]).sum()
    plan = Part("plan", np.array([[-1e4, -1e4], [1e4, -1e4], [1e4, 1e4], [-1e4, 1e4]]), rows.rows)
    assert len(chosen_rows(shown, [plan], list(Verdict))) == np.isfinite(raw[:, 0]).sum()


def test_doubted_fixes_follow_each_other(tmp_path, edits):
    shown = begun(edits, log(tmp_path / "dive.csv")).last.shown
    found, row = [], None
    while (row := doubted(shown, row, 1)) is not None:
        found.append(row)
    assert set(WILD) <= set(shown.row[found])
    back, row = [], None
    while (row := doubted(shown, row, -1)) is not None:
        back.append(row)
    assert back == found[::-1]
    assert set(shown.verdicts.verdict[found]) <= {Verdict.REJECTED, Verdict.DOWNWEIGHTED}


def test_the_column_of_the_input_is_the_beginning(tmp_path, edits):
    place = log(tmp_path / "dive.csv")
    table = pd.read_csv(place).assign(edit="")
    table.loc[30, "edit"] = "reject"
    table.to_csv(place, index=False)
    review = begun(edits, place)
    assert review.waiting(review.last).size == 0
    assert (review.last.edit == Edit.REJECT).sum() == 1
    append_edit(edits, "restore", _named(review, 30))
    assert len(review.waiting(review.last)) == 1
    again(review)
    assert (review.last.edit == Edit.REJECT).sum() == 0


def test_a_mission_is_reviewed_from_its_journal(tmp_path, edits):
    globe = log(tmp_path / "globe.csv", 200, globe=True)
    clean(globe, "-o", tmp_path / "boat.nmea")
    mission = tmp_path / "mission.db"
    journal = open_journal(f"sqlite:///{mission}")
    journal.begin([("boat", "fixes")])
    sent = (tmp_path / "boat.nmea").read_bytes()
    cut = len(sent) // 2 + 7  # amid a sentence
    parts = sent[:cut], sent[cut:]
    journal.write([Received(n, 0, np.nan, part) for n, part in enumerate(parts, start=1)])
    journal.close()
    review = begun(edits, mission)
    review.edit(review.last, row_of(review, 60), "reject")
    again(review)
    assert [part[:1] for part in read_edits(edits).entries[0].fixes] == [("boat",)]
    clean(mission, "--edits", edits, "-o", tmp_path / "out.parquet")
    by_command = read(tmp_path / "out.parquet")
    np.testing.assert_array_equal(by_command.lat, review.last.shown.track.geodetic[:, 0])
    assert by_command.row[by_command.verdict == "edited"].tolist() == [60]


def _named(review, number):
    """A fix as the command line names it."""
    from surefix.pipelines.clean import Source
    from surefix.pipelines.editing import Wanted, choose

    sources = [Source(iter(parts), "fixes", name) for name, parts in review.last.logs]
    return choose(sources, Wanted(rows=((number, number),)))
