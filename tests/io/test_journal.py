"""The journal: what is in it is in it, once, and nothing else is."""

import contextlib
import os
import signal
import sqlite3
import subprocess
import sys
import time

import numpy as np
import pytest

from surefix.errors import InputError, OptionsError, OutputError
from surefix.io.journal import Received, Told, journal_logs, open_journal

INPUTS = [("gnss", "fixes"), ("sounder", "depth")]


def received(first, count):
    rng = np.random.default_rng(first)
    return [
        Received(n, n % 2, 1e9 + n / 7.0 if n % 3 else float("nan"), rng.bytes(n % 50))
        for n in range(first, first + count)
    ]


def same(one, other):
    assert [repr(record) for record in one] == [repr(record) for record in other]


@pytest.fixture
def url(tmp_path):
    return f"sqlite:///{tmp_path / 'mission.db'}"


@pytest.fixture(params=["sqlite", "postgresql"])
def any_url(request):
    """A place for a journal in either data base."""
    if request.param == "sqlite":
        return request.getfixturevalue("url")
    return request.getfixturevalue("postgres").database()


def test_gives_back_what_was_written(any_url):
    journal = open_journal(any_url)
    assert journal.last() == (0, 0)
    journal.begin(INPUTS)
    told = [Told(1, 40, 1e9, "nmea", "$GPGGA"), Told(2, 41, 1e9 + 1, "event", "σ is large")]
    journal.write(received(1, 100), told[:1])
    journal.write(received(101, 25_000), told[1:], (25_100, b"\x00state"))
    journal.close()
    again = open_journal(any_url, new=False)
    same(again.received(), received(1, 100) + received(101, 25_000))
    same(again.received(25_090), received(101, 25_000)[-10:])
    assert again.told() == told
    assert again.snapshots() == [(25_100, b"\x00state")]
    assert again.sources() == INPUTS
    assert again.last() == (25_100, 2)
    sizes = {s: sum(len(r.data) for r in again.received(source=s)) for s in (0, 1)}
    assert again.sizes() == sizes
    again.close()


def test_written_twice_it_is_there_once(any_url):
    journal = open_journal(any_url)
    told = [Told(1, 10, 0.0, "nmea", "x")]
    for _ in range(2):
        journal.write(received(1, 10), told, (10, b"a"))
    same(journal.received(), received(1, 10))
    assert journal.told() == told
    journal.close()


def test_the_last_snapshots_are_kept(any_url):
    journal = open_journal(any_url)
    for after in range(10, 100, 10):
        journal.write(received(after, 1), (), (after, b"%d" % after))
    assert journal.snapshots() == [(90, b"90"), (80, b"80"), (70, b"70")]
    journal.close()


def test_of_other_inputs_it_is_refused(any_url):
    journal = open_journal(any_url)
    journal.begin(INPUTS)
    journal.close()
    again = open_journal(any_url)
    again.begin(INPUTS)
    with pytest.raises(OptionsError, match=r"gnss \(fixes\), sounder \(depth\)"):
        again.begin(INPUTS[:1])
    again.close()


@pytest.mark.parametrize("wrong", ["mission.db", "mysql://host/x", "http://host", "sqlite:///", ""])
def test_no_such_kind_of_data_base(wrong):
    with pytest.raises(OptionsError, match="sqlite:///PATH"):
        open_journal(wrong)


def test_a_place_that_cannot_be_written(tmp_path):
    with pytest.raises(OutputError, match="expected"):
        open_journal(f"sqlite:///{tmp_path / 'no' / 'where.db'}")
    with pytest.raises(InputError, match="not a journal"):
        open_journal(f"sqlite:///{tmp_path / 'no.db'}", new=False)


def test_a_damaged_file_is_put_aside(url, tmp_path):
    journal = open_journal(url)
    journal.write(received(1, 2000))
    journal.close()
    place = tmp_path / "mission.db"
    content = bytearray(place.read_bytes())
    content[4096:40_960] = np.random.default_rng(1).bytes(36_864)
    place.write_bytes(content)
    again = open_journal(url)
    assert again.last() == (0, 0)
    again.close()
    (aside,) = tmp_path.glob("mission.db.damaged-*")
    assert aside.read_bytes() == content


@pytest.mark.parametrize("damaged", [False, True])
def test_what_is_only_read_stays_as_it_is(tmp_path, damaged):
    place = tmp_path / "other.db"
    with contextlib.closing(sqlite3.connect(place)) as other:
        other.execute("create table mine (a)")
    content = bytearray(place.read_bytes())
    if damaged:
        content[100:] = np.random.default_rng(1).bytes(len(content) - 100)
        place.write_bytes(content)
    with pytest.raises(InputError, match=r"other\.db.*expected .*surefix live"):
        journal_logs(f"sqlite:///{place}")
    assert [each.name for each in tmp_path.iterdir()] == ["other.db"]
    assert place.read_bytes() == content


def test_two_services_cannot_write_one_journal(any_url):
    first = open_journal(any_url)
    first.begin(INPUTS)
    with pytest.raises(OutputError, match="another service writes this journal"):
        open_journal(any_url)
    first.write(received(1, 5))
    reader = open_journal(any_url, new=False)  # reading is free
    same(reader.received(), received(1, 5))
    reader.close()
    first.close()
    second = open_journal(any_url)
    second.write(received(6, 5))
    same(second.received(), received(1, 5) + received(6, 5))
    second.close()


def test_what_no_text_may_hold_is_replaced(any_url):
    journal = open_journal(any_url)
    journal.write((), [Told(1, 0, float("nan"), "event", "a\0b \udc80 µ")])
    assert journal.told()[0].text == "a?b ? µ"
    journal.close()


_WRITER = """
import sys
from surefix.io.journal import Received, Told, open_journal
journal = open_journal(sys.argv[1])
n = journal.last()[0]
while True:
    step = [Received(n + i, 0, float(n + i), b"x" * 40) for i in range(1, 4)]
    n += 3
    journal.write(step, [Told(n // 3, n, float(n), "nmea", "y")], (n, b"z"))
    print(n, flush=True)
"""


def test_killed_at_any_time_it_has_what_it_said_it_had(any_url):
    """Whole steps, without a gap and without doubles, at least up to the last one that was told."""
    rng = np.random.default_rng(5)
    known = 0
    for _ in range(6):
        with subprocess.Popen(
            [sys.executable, "-c", _WRITER, any_url], stdout=subprocess.PIPE, text=True
        ) as writer:
            assert writer.stdout is not None
            known = int(writer.stdout.readline())
            time.sleep(rng.uniform(0.0, 0.3))
            os.kill(writer.pid, signal.SIGKILL)
            rest = writer.stdout.read().split("\n")
        known = max([known, *(int(line) for line in rest[:-1] if line)])
        journal = open_journal(any_url)
        numbers = [record.number for record in journal.received()]
        assert numbers == list(range(1, len(numbers) + 1))
        assert len(numbers) % 3 == 0
        assert known <= len(numbers) <= known + 3
        assert [told.after for told in journal.told()] == list(range(3, len(numbers) + 1, 3))
        assert journal.snapshots()[0][0] == len(numbers)
        journal.close()
