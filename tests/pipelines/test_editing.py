"""Edits find their fixes again, and only these."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from acceptance.product import survey
from surefix.errors import OptionsError
from surefix.io.edits import EditLog, append_edit, read_edits
from surefix.io.table import from_frame
from surefix.pipelines.clean import Source, clean_sources
from surefix.pipelines.editing import Wanted, choose, digests, edit_sources
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import take_fixes
from surefix.types import Edit, Reason, Verdict


def frame(n=60):
    table = pd.DataFrame(survey(n))[["time", "x", "y", "z"]]
    table.loc[20, "x"] += 60.0
    return table


def source(table, name="dive.csv", sensor="usbl", parts=1):
    logs, cuts = [], np.linspace(0, len(table), parts + 1).astype(int)
    for first, last in pairwise(cuts):
        log = from_frame(
            table.iloc[first:last], mapping={}, role="fixes", sensor=sensor, source="t"
        )
        log.fixes.row[:] += first
        logs.append(log)
    return Source(iter(logs), "fixes", name)


def edit(tmp_path, action, table, wanted, **names):
    append_edit(tmp_path / "e.jsonl", action, choose([source(table, **names)], wanted))
    return read_edits(tmp_path / "e.jsonl")


def edits_of(sources):
    logs = [log for each in sources for log in each.logs]
    codes = [log.fixes.edit for log in logs if log.fixes is not None]
    return np.concatenate(codes), [problem for log in logs for problem in log.problems]


@pytest.mark.parametrize("parts", [1, 3, 60])
def test_the_fixes_that_were_chosen_are_edited(tmp_path, parts):
    table = frame()
    edit(tmp_path, "reject", table, Wanted(rows=((10, 12), (30, 30))))
    log = edit(tmp_path, "accept", table, Wanted(since=table.time[12], until=table.time[13]))
    found, problems = edits_of(edit_sources([source(table, parts=parts)], log))
    wanted = np.zeros(60)
    wanted[[10, 11, 30]], wanted[[12, 13]] = Edit.REJECT, Edit.ACCEPT
    np.testing.assert_array_equal(found, wanted)
    assert problems == []


def test_an_edit_wins_over_the_column_of_the_input(tmp_path):
    table = frame().assign(edit="reject")
    log = edit(tmp_path, "restore", table, Wanted(rows=((5, 6),)))
    found, _ = edits_of(edit_sources([source(table)], log))
    assert np.flatnonzero(found == Edit.NONE).tolist() == [5, 6]
    assert (np.delete(found, [5, 6]) == Edit.REJECT).all()


def test_rows_that_moved_keep_their_edits_and_changed_ones_are_told(tmp_path):
    table = frame()
    log = edit(tmp_path, "reject", table, Wanted(rows=((10, 14),)))
    moved = table.drop(index=[0, 3, 11]).reset_index(drop=True)
    moved.loc[10, "x"] += 0.01  # it was row 13
    found, problems = edits_of(edit_sources([source(moved)], log))
    assert np.flatnonzero(found).tolist() == [8, 9, 11]
    assert [(p.kind, p.total) for p in problems] == [("edit-lost", 2)]
    assert problems[0].example.startswith("dive.csv, usbl, row 11 of ")


def test_an_input_or_sensor_of_another_name_gets_nothing(tmp_path):
    table = frame()
    log = edit(tmp_path, "reject", table, Wanted(rows=((10, 14),)))
    for other in ({"name": "other.csv"}, {"sensor": "gnss"}):
        found, problems = edits_of(edit_sources([source(table, **other)], log))
        assert not found.any()
        assert [(p.kind, p.total) for p in problems] == [("edit-lost", 5)]


def test_what_is_lost_is_told_once_all_inputs_are_read(tmp_path):
    one, two = frame(), frame().assign(x=lambda t: t.x + 1.0)
    log = edit(tmp_path, "reject", two, Wanted(rows=((4, 4),)))
    found, problems = edits_of(edit_sources([source(one), source(two)], log))
    assert np.flatnonzero(found).tolist() == [64]
    assert problems == []
    found, problems = edits_of(edit_sources([source(one), source(one)], log))
    assert not found.any()
    assert [p.total for p in problems] == [1]


def test_a_torn_line_is_told():
    _, problems = edits_of(edit_sources([source(frame())], EditLog((), "e.jsonl, line 1: {")))
    assert [(p.kind, p.example) for p in problems] == [("edit-torn", "e.jsonl, line 1: {")]


@pytest.mark.parametrize("mode", ["offline", "lagged", "realtime"])
def test_cleaning_with_a_log_is_cleaning_with_the_column(tmp_path, mode):
    table, options = frame(), CleanOptions(mode=mode)
    edit(tmp_path, "accept", table, Wanted(rows=((20, 20),)))
    log = edit(tmp_path, "reject", table, Wanted(rows=((40, 42),)))
    by_log = clean_sources(edit_sources([source(table)], log), options)
    table["edit"] = ""
    table.loc[20, "edit"], table.loc[40:42, "edit"] = "accept", "reject"
    by_column = clean_sources([source(table)], options)
    for one, other in zip(by_log.track[:5], by_column.track[:5], strict=True):
        np.testing.assert_array_equal(one, other)
    assert by_log.verdicts.verdict[20] == Verdict.EDITED
    assert by_log.verdicts.reason[40] == Reason.REJECTED_BY_USER
    plain = clean_sources([source(frame())], options)
    assert not np.array_equal(plain.track.position, by_log.track.position)


def test_digests_tell_fixes_apart_and_copies_not():
    rng = np.random.default_rng(1)
    table = pd.DataFrame({"time": np.arange(20_000) / 100.0, "x": rng.integers(0, 9, 20_000)})
    fixes = next(source(table).logs).fixes
    known = digests(fixes)
    assert len(set(known.tolist())) == len(known)
    np.testing.assert_array_equal(digests(take_fixes(fixes, slice(7, 50))), known[7:50])
    nudged = fixes._replace(
        time=np.nextafter(fixes.time, np.inf), position=np.nextafter(fixes.position, np.inf)
    )
    np.testing.assert_array_equal(digests(nudged), known)
    missing = fixes._replace(time=np.full(20_000, np.nan), position=fixes.position + 1e300)
    assert np.unique(digests(missing)).size == 1


def test_digests_are_for_ever():
    """Those in the files of users must be found by every later version."""
    fixes = next(source(pd.DataFrame({"time": [0.0, 1715673602.25], "x": [4, 2]})).logs).fixes
    fixes.position[1, 1] = -7.5
    known = [digests(fixes), digests(fixes._replace(geographic=True))]
    assert [[f"{digest:016x}" for digest in part.tolist()] for part in known] == [
        ["8375594ace0c9bab", "8f949f5a11a14755"],
        ["e5a55cacb7e75ce8", "3de348702b8ca6c2"],
    ]


def test_choosing_by_sensor_and_time():
    table = frame().assign(sensor=np.where(np.arange(60) % 2, "b", "a"))
    found = choose([source(table)], Wanted(sensors=("b",), rows=((0, 9),)))
    assert [(part.sensor, part.row.tolist()) for part in found] == [("b", [1, 3, 5, 7, 9])]
    table.loc[3, "time"] = np.nan
    found = choose([source(table)], Wanted(until=float(table.time[8]), sensors=("b",)))
    assert found[0].row.tolist() == [1, 5, 7]
    with pytest.raises(OptionsError, match="one of a, b"):
        choose([source(table)], Wanted(sensors=("c",)))
