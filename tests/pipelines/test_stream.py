"""A log pushed part by part, stored in between, gives the numbers of one call."""

import pickle

import numpy as np
import pyarrow as pa
import pytest

import surefix
from fleet.tracks import one, track
from surefix.io.table import from_frame
from surefix.pipelines.stream import begin_stream, end, push, restored, snapshot


def pushed(rows, options, seed, most):
    rng, stream, found, at = np.random.default_rng(seed), begin_stream(options), [], 0
    while at < rows.num_rows:
        count = int(rng.integers(1, most))
        stream = restored(snapshot(stream))
        found += push(stream, from_frame(rows.slice(at, count)))
        at += count
    found += end(restored(snapshot(stream)))
    return pa.concat_tables([surefix.to_table(each) for each in found if len(each.track.time)])


@pytest.mark.parametrize(
    ("method", "most"), [("multi-hypothesis", 90), ("igg3", 25), ("median", 7)]
)
@pytest.mark.parametrize("seed", [1, 2])
def test_parts_give_the_numbers_of_the_whole(method, most, seed):
    rows = one(track("a", 400, seed), "a")
    options = surefix.CleanOptions(mode="realtime", method=method, settle_rows=150)
    whole = surefix.to_table(surefix.clean(rows, options=options))
    assert pushed(rows, options, seed, most).equals(whole)


def test_late_rows_are_judged_as_in_a_log():
    rows = one(track("a", 300, 3), "a")
    order = np.r_[np.arange(200), 150, np.arange(200, 300), 20]
    order = np.delete(order, [150, 20])
    mixed = rows.take(pa.array(order))
    options = surefix.CleanOptions(mode="realtime", method="igg3", settle_rows=50)
    whole = surefix.clean(mixed, options=options)
    assert (whole.verdicts.reason == surefix.Reason.LATE).sum() == 2
    assert pushed(mixed, options, 1, 30).equals(surefix.to_table(whole))


def test_settling_on_fewer_rows_changes_the_result():
    rows = one(track("a", 300, 4), "a")
    few, many = (
        surefix.clean(rows, options=surefix.CleanOptions(mode="realtime", settle_rows=count))
        for count in (60, 20_000)
    )
    assert not np.array_equal(few.track.position, many.track.position, equal_nan=True)


def test_a_stream_is_real_time():
    with pytest.raises(surefix.OptionsError, match="mode offline for a stream; expected mode real"):
        begin_stream(surefix.CleanOptions())


def test_nothing_to_clean_is_an_error_at_the_end():
    with pytest.raises(surefix.InputError, match="no position"):
        list(end(begin_stream(surefix.CleanOptions(mode="realtime"))))


def test_a_snapshot_of_another_version_is_refused():
    stream = begin_stream(surefix.CleanOptions(mode="realtime"))
    form, _, kept = pickle.loads(snapshot(stream))
    with pytest.raises(surefix.InputError, match=r"a snapshot of surefix 0\.0\.1; expected"):
        restored(pickle.dumps((form, "0.0.1", kept)))


@pytest.mark.parametrize("rows", [1, 0, True, 2.5])
def test_rows_to_settle_on_are_a_whole_number(rows):
    with pytest.raises(surefix.OptionsError, match="settle_rows"):
        surefix.CleanOptions(settle_rows=rows)


def test_options_travel_between_processes():
    options = surefix.CleanOptions(sensor_sigma={"usbl": 0.5}, mode="lagged", lag_s=3.0)
    assert pickle.loads(pickle.dumps(options)) == options
