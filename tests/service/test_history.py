"""What can be looked back at is what was told, to the last bit; the oldest gives way."""

import math

import numpy as np
import pytest

from service.test_station import CLEAN, recorded, station_of
from surefix.errors import InputError
from surefix.io.journal import Received
from surefix.pipelines.joining import join
from surefix.reasons import texts
from surefix.service.history import History, packed, shown, unpacked, verdicts_of
from surefix.service.station import receive
from surefix.types import Verdict


@pytest.fixture(scope="module")
def batches():
    station, given = station_of("boat", clean=CLEAN), []
    for number, line in enumerate(recorded(300).splitlines(keepends=True), 1):
        station, done = receive(station, [Received(number, 0, math.nan, line)])
        given += done
    return given


def history_of(batches, most=10_000):
    history = History(most)
    for batch in batches:
        history.add([batch])
    return history


def test_it_says_what_was_cleaned(batches):
    history, whole = history_of(batches), join(batches)
    rows = history.take(history.since(0))
    np.testing.assert_array_equal(rows["time"], whole.track.time)
    np.testing.assert_array_equal(rows["clean"], whole.track.position)
    np.testing.assert_array_equal(rows["sigma"], whole.track.sigma_position)
    np.testing.assert_array_equal(rows["raw"], whole.raw_position)
    assert texts(verdicts_of(rows)) == texts(whole.verdicts)
    assert Verdict.REJECTED in whole.verdicts.verdict
    assert [history.sensors[i] for i in rows["sensor"]] == [whole.sensors[i] for i in whole.sensor]


@pytest.mark.parametrize("most", [1, 7, 64, 250])
def test_the_oldest_rows_give_way(batches, most):
    history, whole = history_of(batches, most), history_of(batches)
    assert history.total == whole.total > 250
    numbers = history.since(0)
    np.testing.assert_array_equal(numbers, np.arange(whole.total - most, whole.total))
    assert history.take(numbers).tobytes() == whole.take(numbers).tobytes()
    assert history.since(whole.total).size == 0
    in_one = History(most)
    in_one.extend(whole.take(whole.since(0)))
    assert in_one.take(numbers).tobytes() == whole.take(numbers).tobytes()


def test_a_span_of_time(batches):
    history = history_of(batches)
    time = history.take(history.since(0))["time"]
    assert history.span() == (time[0], time[-1])
    numbers = history.between(time[10], time[20])
    within = time[(time >= time[10]) & (time <= time[20])]
    np.testing.assert_array_equal(history.take(numbers)["time"], within)
    assert history.between(time[20], time[10]).size == 0
    assert np.isnan(History(5).span()).all()


def test_the_journal_gives_it_back_to_the_last_bit(batches):
    history = history_of(batches)
    rows = history.take(history.since(0))
    again = unpacked([packed(rows[:100]), packed(rows[100:101]), packed(rows[101:])])
    assert again.tobytes() == rows.tobytes()
    for damaged in ("", "rows-0:", "rows-1:!!", packed(rows)[:-4], packed(rows[:1])[:-1]):
        with pytest.raises(InputError, match="rows-1"):
            unpacked([damaged])


def test_what_is_drawn_leaves_out_no_rejected_fix(batches):
    history = history_of(batches)
    rows = history.take(history.since(0))
    assert shown(rows, 10_000).tolist() == list(range(len(rows)))
    few = shown(rows, 120)
    assert len(few) <= 130
    assert np.all(np.diff(few) > 0)
    rejected = np.flatnonzero(rows["verdict"] == Verdict.REJECTED)
    assert 0 < len(rejected) <= 60
    assert set(rejected) <= set(few)
    assert {0, len(rows) - 1} <= set(few)
    assert int(np.argmax(rows["sigma"][:, 0])) in few
