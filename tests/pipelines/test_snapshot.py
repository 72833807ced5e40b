"""A session stored and read back goes on as if nothing had happened."""

import pickle
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pandas as pd
import pytest

from pipelines.test_session import OPTIONS, log, parts, run, table
from surefix.errors import InputError, OptionsError
from surefix.io.table import from_frame
from surefix.pipelines.options import METHODS
from surefix.pipelines.session import advance, begin_session
from surefix.pipelines.snapshot import restored, snapshot
from surefix.pipelines.state import Session

REALTIME = [method for method in METHODS if method not in ("53h", "hampel")]


def same(one, two):
    """Whether two records are equal to the last bit."""
    if isinstance(one, np.ndarray):
        return one.dtype == two.dtype and one.shape == two.shape and one.tobytes() == two.tobytes()
    if is_dataclass(one):
        return type(one) is type(two) and all(
            same(getattr(one, f.name), getattr(two, f.name)) for f in fields(one)
        )
    if isinstance(one, tuple):
        return type(one) is type(two) and len(one) == len(two) and all(map(same, one, two))
    if hasattr(one, "items"):
        return one.keys() == two.keys() and all(same(one[key], two[key]) for key in one)
    return one == two or (one != one and two != two)  # noqa: PLR0124


@pytest.mark.parametrize("method", REALTIME)
def test_stored_between_any_two_parts_it_gives_the_same(method):
    frame, options = log(), replace(OPTIONS, method=method, every_s=0.7)
    sizes = [20, 30, 100, 1, 1, 98, 50]
    begun = begin_session([("log", "fixes")], options)
    _, whole = run(begun, [*parts(frame, sizes), None])
    session, given = begun, []
    for part in [*parts(frame, sizes), None]:
        stored = restored(snapshot(session), Session)
        assert same(stored, session)
        session, batches = advance(stored, 0, part)
        given += batches
    pd.testing.assert_frame_equal(table(given), table(whole), check_exact=True)


def test_geographic_logs_and_several_inputs_are_stored_too():
    frame = log()
    frame["lat"], frame["lon"] = 54.0 + frame.pop("y") / 1e5, 179.999 + frame.pop("x") / 1e5
    depth = pd.DataFrame({"time": frame["time"] + 0.1, "depth": 40.0 + np.sin(frame["time"])})
    beside = from_frame(depth, mapping={}, role="depth", sensor="pressure", source="depth")
    session = begin_session([("log", "fixes"), ("depth", "depth")], OPTIONS)
    session, given = run(session, parts(frame, [200]))
    session, more = advance(session, 1, beside)
    assert same(restored(snapshot(session), Session), session)
    assert len(table([*given, *more])) > 100


def test_what_is_damaged_is_refused():
    session, _ = run(begin_session([("log", "fixes")], OPTIONS), parts(log(), [150]))
    stored = snapshot(session)
    rng = np.random.default_rng(1)
    for at in [*range(24), *rng.integers(0, len(stored), 200)]:
        with pytest.raises(InputError, match="snapshot"):
            restored(stored[:at], Session)
        changed = bytearray(stored)
        changed[at] ^= 1 << int(rng.integers(0, 8))
        with pytest.raises(InputError, match="snapshot"):
            restored(bytes(changed), Session)


def test_a_pickle_is_never_loaded():
    with pytest.raises(InputError, match="no snapshot"):
        restored(pickle.dumps({"surefix": 1}), Session)


def test_an_estimator_cannot_be_stored():
    session = begin_session([("log", "fixes")], OPTIONS, lambda *_: (None, None))
    with pytest.raises(OptionsError, match="estimator"):
        snapshot(session)


def test_options_travel_between_processes():
    options = replace(OPTIONS, sensor_sigma={"usbl": 0.5})
    assert pickle.loads(pickle.dumps(options)) == options
