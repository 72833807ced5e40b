"""A log that is settled at rest is still cleaned in real time once its vehicle is under way."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pipelines.test_session import parts, run, table
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.session import begin_session
from surefix.pipelines.snapshot import restored, snapshot
from surefix.pipelines.state import Session

REST = 150
OPTIONS = CleanOptions(mode="realtime", settle_rows=120)


def voyage(seed, sigma=0.5, n=600):
    """At rest for 150 s, then a boat that turns: truth, right fixes, log of fixes and heading."""
    rng = np.random.default_rng(seed)
    k = np.arange(n)
    heading = 90.0 + np.cumsum(np.where(k < REST, 0.0, 3.0 * np.sin((k - REST) / 20.0)))
    speed = np.clip((k - REST) * 0.05, 0.0, 3.0)
    north, east = (np.cumsum(speed * turn(np.radians(heading))) for turn in (np.cos, np.sin))
    truth = np.column_stack((east, north))
    made = pd.DataFrame(truth + rng.normal(0.0, sigma, truth.shape), columns=["x", "y"])
    made.insert(0, "time", k.astype(float))
    made["heading"] = (heading + rng.normal(0.0, 0.5, n)) % 360.0
    wild = rng.choice(np.arange(10, n), n // 20, replace=False)
    made.loc[wild, ["x", "y"]] += rng.normal(0.0, 30.0, (len(wild), 2))
    right = np.ones(n, bool)
    right[wild] = False
    return truth, right, made


def cleaned(made, options=OPTIONS, sizes=(600,)):
    return run(begin_session([("log", "fixes")], options), [*parts(made, sizes), None])


def test_it_is_followed_and_told():
    errors, losses = [], []
    for seed in range(4):
        truth, right, made = voyage(seed)
        whole = join(list(cleaned(made)[1]))
        late = np.arange(len(truth)) >= REST + 60
        off = whole.track.position[:, :2] - truth
        errors.append(float(np.sqrt(np.mean(off[late & right] ** 2))))
        told = [each for each in whole.events if "livelier" in each.text]
        assert told
        assert all(each.kind == "noise-changed" and each.time >= REST for each in told)
        used = whole.verdicts.verdict <= 1
        losses.append(float(np.mean(~used[late & right])))
        (heading,) = whole.channels
        assert np.mean(heading.verdicts.verdict[late] <= 1) > 0.9
    assert np.median(errors) < 0.6  # of fixes with σ .5 m; a filter that lags is off by metres
    assert np.median(losses) < 0.02


def test_it_does_not_depend_on_the_parts_nor_on_a_snapshot():
    _, _, made = voyage(1)
    _, whole = cleaned(made)
    _, parted = cleaned(made, sizes=[150, *[7] * 65])
    pd.testing.assert_frame_equal(table(parted), table(whole), check_exact=True)
    session, given = run(begin_session([("log", "fixes")], OPTIONS), parts(made, [300]))
    again = restored(snapshot(session), Session)
    _, rest = run(again, [*parts(made[300:], [300]), None])
    pd.testing.assert_frame_equal(table([*given, *rest]), table(whole), check_exact=True)


def test_a_figure_that_is_given_stays():
    _, _, made = voyage(2)
    session, batches = cleaned(made, replace(OPTIONS, process=0.01))
    assert session.lively is None
    assert not [each for each in join(list(batches)).events if "livelier" in each.text]


@pytest.mark.parametrize("mode", ["offline", "lagged"])
def test_the_other_modes_see_the_log_whole(mode):
    _, _, made = voyage(3)
    session, _ = cleaned(made, replace(OPTIONS, mode=mode))
    assert session.lively is None
