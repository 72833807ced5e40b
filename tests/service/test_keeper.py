"""A journal that cannot be written: the service goes on, says so, catches up, declares the gap."""

import asyncio
import json
import math
import signal
import threading
import time

import pandas as pd
import pytest

from acceptance.product import clean, read
from service.test_live import options_in
from service.test_station import CLEAN, recorded, table
from service.test_transport import free_port
from surefix.errors import OutputError
from surefix.io.journal import open_journal
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.service import keeper
from surefix.service.inbox import Arrived
from surefix.service.live import begin_live, step
from surefix.service.options import read_live


def service(folder, url=None):
    target = f"udp://127.0.0.1:{free_port()}"
    place = options_in(folder, f"udp://127.0.0.1:{free_port()}", target)
    if url is not None:
        known = f"sqlite:///{folder / 'mission.db'}"
        place.write_text(place.read_text().replace(known, url))
    return begin_live(read_live(place))


def away(live):
    """What the alarm about the journal says; empty if there is none that lasts."""
    lasting = (each for each in live.alarms if math.isnan(each.gone))
    return next((each.text for each in lasting if each.concerns == "journal"), "")


async def feed(live, each=lambda number: None):
    """A log sentence by sentence; gives whether the journal was in alarm, and where we were."""
    seen = []
    for number, line in enumerate(recorded().splitlines(keepends=True)):
        each(number)
        await step(live, [Arrived(0, math.nan, line)], 0.0)
        seen.append((bool(away(live)), live.now))
    return seen


async def caught_up(live, seconds=30.0):
    end = time.monotonic() + seconds
    while away(live):
        assert time.monotonic() < end, live.alarms
        await asyncio.sleep(0.05)
        await step(live, [], 0.0)
    await step(live, [], 0.0)


def nothing_is_missing(live):
    journal = live.journal
    pieces = list(journal.received())
    assert [piece.number for piece in pieces] == list(range(1, live.taken + 1))
    assert b"".join(piece.data for piece in pieces) == recorded()
    told = journal.told()
    assert [each.number for each in told] == list(range(1, live.said + 1))
    assert not [each for each in told if "not in it" in each.text]


def went_on(seen):
    during = [now.time for alarmed, now in seen if alarmed and now is not None]
    return during[-1] - during[0]


def failing(live, monkeypatch, which):
    write, calls = live.journal.write, []

    def sometimes(*what):
        calls.append(what)
        if which(len(calls)):
            raise OutputError("the journal cannot be written: disk full", "room")
        write(*what)

    monkeypatch.setattr(keeper, "_AGAIN", 0.0)
    monkeypatch.setattr(keeper, "_HARDLY", 1.0)
    monkeypatch.setattr(live.journal, "write", sometimes)


def test_fault_37_it_goes_on_while_the_disk_is_full(tmp_path, monkeypatch):
    live = service(tmp_path)
    failing(live, monkeypatch, lambda n: 300 < n < 330)
    seen = asyncio.run(feed(live))
    assert not away(live)
    assert sum(alarmed for alarmed, _ in seen) == 29
    assert went_on(seen) > 5.0
    nothing_is_missing(live)
    live.journal.close()


def test_fault_37_what_the_journal_never_gets_is_a_gap_that_is_declared(tmp_path, monkeypatch):
    live = service(tmp_path)
    monkeypatch.setattr(keeper, "_KEPT", 1000)
    failing(live, monkeypatch, lambda n: 100 < n < 200)
    asyncio.run(feed(live))
    alarms = [json.loads(each.text) for each in live.journal.told("alarm")]
    (said,) = [each["text"] for each in alarms if "not in it" in each["text"]]
    pieces = list(live.journal.received())
    missing = len(recorded()) - sum(len(piece.data) for piece in pieces)
    assert 0 < live.taken - len(pieces) < 100
    assert 0 < missing <= int(said.split()[5])  # what was told is missing, too
    live.journal.close()


def test_nothing_waits_for_a_journal_that_does_not_answer(tmp_path, monkeypatch):
    live = service(tmp_path)
    write, free = live.journal.write, threading.Event()

    def stuck(*what):
        if len(what[0]) and what[0][0].number == 200:
            free.wait(60.0)
        write(*what)

    monkeypatch.setattr(live.journal, "write", stuck)
    monkeypatch.setattr(keeper, "_PATIENCE", 0.2)
    monkeypatch.setattr(keeper, "_HARDLY", 0.001)

    async def run():
        seen = await feed(live)
        assert away(live) == "the journal does not answer"
        free.set()
        await caught_up(live)
        return seen

    assert went_on(asyncio.run(run())) > 50.0
    nothing_is_missing(live)
    live.journal.close()


@pytest.mark.parametrize("away", ["stopped", "frozen"])
def test_fault_40_a_data_base_goes_away_and_comes_back(tmp_path, postgres, monkeypatch, away):
    monkeypatch.setattr(keeper, "_AGAIN", 0.05)
    monkeypatch.setattr(keeper, "_PATIENCE", 0.5)
    live = service(tmp_path, postgres.database())
    go, come = {
        "stopped": (postgres.stop, postgres.begin),
        "frozen": (
            lambda: postgres.signal(signal.SIGSTOP),
            lambda: postgres.signal(signal.SIGCONT),
        ),
    }[away]

    def each(number):
        if number == 200:
            go()
        if number == 400:
            come()

    async def run():
        seen = await feed(live, each)
        await caught_up(live)
        return seen

    seen = asyncio.run(run())
    assert went_on(seen) > 20.0
    assert all(alarmed for alarmed, _ in seen[205:395])
    nothing_is_missing(live)
    live.journal.close()


def test_a_journal_that_another_service_carried_on_is_left_to_it(tmp_path, postgres, monkeypatch):
    monkeypatch.setattr(keeper, "_AGAIN", 0.0)
    url = postgres.database()
    live = service(tmp_path, url)

    def each(number):
        if number == 200:
            postgres.stop()
            postgres.begin()
            open_journal(url).close()  # the other one; ours has not noticed yet

    asyncio.run(feed(live, each))
    assert "another service writes this journal" in away(live)
    kept = open_journal(url, new=False)
    assert [piece.number for piece in kept.received()] == list(range(1, 201))
    kept.close()
    live.journal.close()


def test_a_mission_in_postgresql_is_cleaned_by_its_url(tmp_path, postgres):
    url = postgres.database()
    live = service(tmp_path, url)

    async def run():
        await feed(live)
        await caught_up(live)

    asyncio.run(run())
    live.journal.close()
    log = tmp_path / "boat.nmea"
    log.write_bytes(recorded())
    whole = clean_sources(open_inputs([log]), CLEAN)
    again = clean_sources(open_inputs([url]), CLEAN)
    pd.testing.assert_frame_equal(table(again), table(whole), check_exact=True)
    words = ["--options", tmp_path / "live.toml", "-o", tmp_path / "out.csv"]
    assert clean(url, *words).code == 0
    assert len(read(tmp_path / "out.csv")) == len(whole.track.time)
