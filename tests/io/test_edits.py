"""The edit log: undo and redo without limit, and nothing of it is lost or half there."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surefix.errors import InputError, OptionsError, OutputError, ParseError
from surefix.io.edits import Chosen, Entry, append_edit, decided, read_edits, standing
from surefix.types import Edit

CODES = {"accept": Edit.ACCEPT, "reject": Edit.REJECT, "restore": Edit.NONE}


def fixes(*rows, source="usbl.csv", sensor="usbl"):
    at = np.array(rows, dtype=np.int64)
    return Chosen(source, sensor, at, at / 8.0, at.astype(np.uint64) * np.uint64(2**58 + 3))


def entries(actions):
    return tuple(
        Entry(
            n,
            "2024-05-14T08:00:00.000Z",
            "anna",
            action,
            (fixes(*rows),) if action in CODES else (),
        )
        for n, (action, rows) in enumerate(actions, start=1)
    )


def state(log):
    """What holds, as plain values."""
    return [
        (*part.fixes[:2], part.fixes.digest.tolist(), part.edit.tolist()) for part in decided(log)
    ]


ROWS = st.lists(st.integers(0, 12), min_size=1, max_size=5, unique=True)
EDITS = st.lists(st.tuples(st.sampled_from(sorted(CODES)), ROWS), max_size=12)
MOVES = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(sorted(CODES)), ROWS),
        st.tuples(st.sampled_from(["undo", "redo"]), st.just([])),
    ),
    max_size=25,
)


@given(MOVES, st.integers(0, 12))
def test_undone_and_redone_it_is_as_it_was(moves, times):
    before = standing(entries(moves))
    times = min(times, len(before[0]))
    after = entries([*moves, *[("undo", [])] * times, *[("redo", [])] * times])
    assert [plain(part) for part in standing(after)] == [plain(part) for part in before]
    assert state(after) == state(entries(moves))


@given(EDITS, st.integers(0, 15))
def test_undone_it_is_as_if_it_had_not_been(edits, times):
    undone = entries([*edits, *[("undo", [])] * times])
    assert state(undone) == state(entries(edits[: max(0, len(edits) - times)]))


@given(MOVES)
def test_the_fold_is_that_of_a_plain_pair_of_stacks(moves):
    done, undone = [], []
    for action, rows in moves:
        if action == "undo":
            undone += [done.pop()] if done else []
        elif action == "redo":
            done += [undone.pop()] if undone else []
        else:
            done, undone = [*done, (action, rows)], []
    holds = {}
    for action, rows in done:
        holds |= {int(d): int(CODES[action]) for d in fixes(*rows).digest}
    found = state(entries(moves))
    assert {
        d: e for _, _, digests, edits in found for d, e in zip(digests, edits, strict=True)
    } == (holds)
    assert all(digests == sorted(digests) for _, _, digests, _ in found)


@settings(max_examples=40, deadline=None)
@given(MOVES.filter(len), st.data())
def test_every_beginning_of_a_log_is_a_log(tmp_path_factory, moves, data):
    place = tmp_path_factory.mktemp("log") / "edits.jsonl"
    kept = []
    for action, rows in moves:
        with contextlib.suppress(OptionsError):
            kept = append_edit(place, action, [fixes(*rows)] if rows else (), by="änne")
    whole = place.read_bytes() if kept else b""
    cut = data.draw(st.integers(0, len(whole)))
    place.write_bytes(whole[:cut])
    log = read_edits(place)
    lines = whole[:cut].count(b"\n")
    complete = lines + (whole[cut : cut + 1] == b"\n")  # all but the end of the line is there
    assert plain(log.entries) == plain(kept[:complete])
    assert bool(log.torn) == (complete == lines and not whole[:cut].endswith(b"\n") and cut > 0)
    after = append_edit(place, "reject", [fixes(1)])
    assert plain(after[:-1]) == plain(kept[:complete])
    assert read_edits(place).torn == ""
    assert plain(read_edits(place).entries) == plain(after)


def plain(log):
    return [
        (*entry[:4], [[np.asarray(column).tolist() for column in part] for part in entry.fixes])
        for entry in log
    ]


def test_what_is_written_is_read(tmp_path):
    place = tmp_path / "edits.jsonl"
    strange = fixes(3, 9, source="Tauchgang #3 „Süd“\n.csv", sensor='a"b')
    strange.time[1] = np.nan
    append_edit(place, "reject", [strange, fixes(7)], by="anna")
    append_edit(place, "undo", by="bob")
    log = read_edits(place)
    assert [entry.by for entry in log.entries] == ["anna", "bob"]
    first = log.entries[0]
    assert first.total == 3
    for one, other in zip(first.fixes, (strange, fixes(7)), strict=True):
        assert one[:2] == other[:2]
        for column, wanted in zip(one[2:], other[2:], strict=True):
            np.testing.assert_array_equal(column, wanted)
    assert all(json.loads(line) for line in place.read_text(encoding="utf-8").splitlines())


@pytest.mark.parametrize("action", ["undo", "redo"])
def test_nothing_to_undo_is_told_and_not_written(tmp_path, action):
    place = tmp_path / "edits.jsonl"
    with pytest.raises(OptionsError, match="nothing was changed"):
        append_edit(place, action)
    with pytest.raises(OptionsError, match="no fix"):
        append_edit(place, "reject", [fixes()])
    assert read_edits(place, new=True).entries == ()


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"\x00\x00\x00", "line 2 is damaged"),
        (b'{"number": 2, "time": "x", "by": "b", "action": "delete"}', "line 2 says no edit"),
        (b"[1, 2]", "line 2 says no edit"),
        (b'{"number": 7, "time": "x", "by": "b", "action": "undo"}', "line 2 has the number 7"),
        (b'{"number": 1, "time": "x", "by": "b", "action": "undo"}', "line 2 has the number 1"),
        (
            b'{"number": 2, "time": "x", "by": "b", "action": "accept", "fixes": [{"source": "s", '
            b'"sensor": "t", "row": [1, 2], "time": [0], "digest": ["ff"]}]}',
            "line 2 says no edit",
        ),
    ],
)
def test_a_damaged_line_amid_others_is_no_edit_to_guess(tmp_path, line, said):
    place = tmp_path / "edits.jsonl"
    for row in range(3):
        append_edit(place, "reject", [fixes(row)])
    lines = place.read_bytes().splitlines()
    place.write_bytes(b"\n".join([lines[0], line, lines[2], b""]))
    before = place.read_bytes()
    for attempt in (lambda: read_edits(place), lambda: append_edit(place, "undo")):
        with pytest.raises(ParseError, match=said):
            attempt()
    assert place.read_bytes() == before


def test_places_that_cannot_be_read_or_written(tmp_path):
    with pytest.raises(InputError):
        read_edits(tmp_path / "none.jsonl")
    with pytest.raises(InputError):
        read_edits(tmp_path)
    with pytest.raises(OutputError):
        append_edit(tmp_path / "none" / "edits.jsonl", "reject", [fixes(1)])


def test_on_a_full_disk_the_log_stays_as_it_was(tmp_path, monkeypatch):
    place = tmp_path / "edits.jsonl"
    append_edit(place, "reject", [fixes(1)])
    before, write = place.read_bytes(), os.write

    def full(handle, data):
        if len(data) > 40:
            return write(handle, data[:40])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OutputError, match="No space left"):
        append_edit(place, "reject", [fixes(2)])
    assert place.read_bytes() == before


WRITER = """
import sys
import numpy as np
from surefix.io.edits import Chosen, append_edit
name = sys.argv[2]
for k in range(int(sys.argv[3])):
    at = np.arange(k % 50 + 1)
    fixes = Chosen("usbl.csv", name, at, at / 8.0, at.astype(np.uint64))
    print(append_edit(sys.argv[1], "reject", [fixes], by=name)[-1].number, flush=True)
"""


def writer(place, name, times):
    words = [sys.executable, "-c", WRITER, str(place), name, str(times)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


def test_two_writers_take_turns(tmp_path):
    place = tmp_path / "edits.jsonl"
    both = [writer(place, name, 60) for name in "ab"]
    numbers = [[int(line) for line in process.communicate()[0].split()] for process in both]
    log = read_edits(place).entries
    assert sorted(numbers[0] + numbers[1]) == list(range(1, 121)) == [e.number for e in log]
    for name, mine in zip("ab", numbers, strict=True):
        assert [e.number for e in log if e.by == name] == mine
        assert [e.total for e in log if e.by == name] == [k % 50 + 1 for k in range(60)]


def test_killed_amid_writing_what_was_acknowledged_is_there(tmp_path):
    place = tmp_path / "edits.jsonl"
    rng = np.random.default_rng(3)
    acknowledged = 0
    for _ in range(4):
        process = writer(place, "a", 100_000)
        first = process.stdout.readline()
        time.sleep(float(rng.uniform(0.0, 0.2)))
        process.send_signal(signal.SIGKILL)
        told = [int(n) for n in (first + process.communicate()[0]).split()]
        assert told == list(range(acknowledged + 1, acknowledged + 1 + len(told)))
        found = read_edits(place).entries
        assert len(found) - told[-1] in (0, 1)  # the last may be there and not acknowledged yet
        acknowledged = len(found)
    assert acknowledged > 10
