"""A session is a value: it can be kept, gone on from again, and ended on trial."""

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from surefix.api import to_table
from surefix.io.table import from_frame
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.session import advance, begin_session

OPTIONS = CleanOptions(mode="realtime", settle_rows=60, reorder_s=2.0)


def log(n=300):
    rng = np.random.default_rng(4)
    time = 100.0 + np.arange(n) * 0.5 + rng.uniform(-0.1, 0.1, n)
    made = pd.DataFrame({"time": time, "x": time * 1.2, "y": 3.0 * np.sin(0.01 * time)})
    made[["x", "y"]] += rng.normal(0.0, 0.3, (n, 2))
    made.loc[rng.choice(np.arange(5, n), n // 10, replace=False), "x"] += 40.0
    made["heading"] = (350.0 + 0.1 * np.arange(n)) % 360.0
    return made


def parts(frame, sizes):
    bounds = np.cumsum([0, *sizes]).clip(0, len(frame))
    for first, last in pairwise(np.unique(bounds)):
        yield from_frame(frame[first:last], mapping={}, role="fixes", sensor="fix", source="log")


def table(batches):
    return to_table(join(list(batches))).to_pandas().drop(columns="row")


def run(session, logs):
    given = []
    for part in logs:
        session, batches = advance(session, 0, part)
        given += batches
    return session, given


@pytest.mark.parametrize("method", ["multi-hypothesis", "igg3"])
def test_ended_on_trial_it_tells_what_a_log_that_ends_there_says(method):
    """So a live stream shows at once what waits to be put in order, and then goes on."""
    frame, options = log(), replace(OPTIONS, method=method)
    begun = begin_session([("log", "fixes")], options)
    session, given = run(begun, parts(frame, [150]))
    shown = len(table(given))
    for at in range(150, 300, 30):
        trial, rest = advance(session, 0, None)
        assert trial.merging.ended
        whole = run(begun, [*parts(frame[:at], [150, at - 150]), None])[1]
        now = table([*given, *rest])
        pd.testing.assert_frame_equal(now, table(whole), check_exact=True)
        assert shown < len(now) == at
        session, more = run(session, parts(frame[at : at + 30], [30]))
        given += more
        shown = len(table(given))
    _, rest = advance(session, 0, None)
    _, whole = run(begun, [*parts(frame, [150, *[30] * 5]), None])
    pd.testing.assert_frame_equal(table([*given, *rest]), table(whole), check_exact=True)


def test_a_step_leaves_the_session_as_it_was():
    session, _ = run(begin_session([("log", "fixes")], OPTIONS), parts(log(), [150]))
    one = advance(session, 0, next(parts(log()[150:], [150])))[1]
    two = advance(session, 0, next(parts(log()[150:], [150])))[1]
    pd.testing.assert_frame_equal(table(one), table(two), check_exact=True)
    for field in fields(session):
        with pytest.raises(AttributeError, match="cannot assign"):
            setattr(session, field.name, None)
