"""``method="multi-hypothesis"`` from a log to verdicts with their reasons."""

import numpy as np
import pandas as pd
import pytest

import surefix as sf
from acceptance.product import survey
from surefix import CleanOptions, Reason, Verdict
from surefix.reasons import texts

MODES = ("realtime", "lagged", "offline")
ALONE = [20, 61, 62, 119, 230, 231, 232, 333]
RUN = np.arange(150, 175)
ONE = [80, 210, 300]
JUMP = 400
N = 500


@pytest.fixture(scope="module")
def log():
    """Single errors, a run with a common offset, errors of one axis, a true jump, missing ones."""
    rng = np.random.default_rng(4)
    made = survey(N)
    for name in ("x", "y"):
        made[name][ALONE] += rng.choice([-1, 1], len(ALONE)) * rng.uniform(15, 60, len(ALONE))
        made[name][RUN] += 35.0
        made[name][JUMP:] -= 50.0
    made["x"][ONE] += 20.0
    for name in "xyz":
        made[name][[44, 45]] = np.nan
    return made


@pytest.fixture(scope="module", params=MODES)
def cleaned(request, log):
    """The mode, the log cleaned in it, and the sentences."""
    lag = {"lag_s": 45.0} if request.param == "lagged" else {}
    options = CleanOptions(method="multi-hypothesis", mode=request.param, **lag)
    found = sf.clean(log, options=options)
    return request.param, found, texts(found.verdicts)


def truth():
    calm = survey(N, sigma=0.0)
    position = np.column_stack([calm[name] for name in "xyz"])
    position[JUMP:, :2] -= 50.0
    return position


def test_what_is_wrong_is_rejected(cleaned):
    _, found, _ = cleaned
    verdict, reason = found.verdicts.verdict, found.verdicts.reason
    assert (verdict[ALONE] == Verdict.REJECTED).all()
    assert (reason[ALONE] != Reason.AGREES).all()
    assert (verdict[[44, 45]] == Verdict.MISSING).all()
    good = np.ones(N, bool)
    good[[*ALONE, *RUN, *ONE, 44, 45]] = False
    good[JUMP : JUMP + 41] = False
    assert (verdict[good] == Verdict.REJECTED).mean() < 0.005
    assert (verdict[good] == Verdict.USED).mean() > 0.9


def test_a_run_is_named_and_counted(cleaned):
    mode, found, said = cleaned
    verdicts = found.verdicts
    assert (verdicts.verdict[RUN] == Verdict.REJECTED).all()
    named = verdicts.reason[RUN] == Reason.RUN
    if mode == "realtime":  # the first of them might have been wrong by themselves
        assert named[3:].all()
        assert verdicts.detail[RUN[-1]] in range(23, 27)
        assert (np.diff(verdicts.detail[RUN[named]]) >= 1.0).all()
    else:
        assert named.all()
        assert (verdicts.detail[RUN] == len(RUN)).all()
        assert said[160].startswith("in a run of 25 with offset (")
        assert said[160].endswith(" σ off")


def test_the_axis_that_is_wrong_is_named(cleaned):
    _, found, said = cleaned
    for row in ONE:
        assert found.verdicts.verdict[row] == Verdict.REJECTED
        assert found.verdicts.reason[row] == Reason.AXIS_OFF
        assert found.verdicts.detail[row] == 1
        assert said[row].endswith("along x, the rest used")


def test_a_jump_is_told_once(cleaned):
    mode, found, said = cleaned
    rows = np.flatnonzero(found.verdicts.reason == Reason.JUMP)
    assert len(rows) == 1
    assert (rows[0] == JUMP) == (mode != "realtime")
    assert found.verdicts.detail[rows[0]] == found.track.time[JUMP]
    assert said[rows[0]].startswith("jump accepted, dated back to ")
    events = [event for event in found.events if event.kind == "jump"]
    assert [event.time for event in events] == [found.track.time[JUMP]]


def test_the_track_stays_on_the_truth(cleaned):
    mode, found, _ = cleaned
    error = np.abs(found.track.position - truth())
    last = JUMP + 42 if mode == "realtime" else JUMP
    assert error[10:JUMP].max() < 2.5
    assert error[last:].max() < 2.5
    sigma = found.track.sigma_position
    assert np.mean((error[20:JUMP] / sigma[20:JUMP]) ** 2) < 1.6


def test_the_noise_is_that_of_the_log(cleaned):
    _, found, _ = cleaned
    figures = {each.quantity: each.value for each in found.noise if each.sensor != "motion"}
    assert figures["position"] == pytest.approx(0.5, rel=0.1)
    assert figures["height"] == pytest.approx(0.5, rel=0.1)


def test_figures_of_the_user_are_taken(log):
    options = CleanOptions(method="multi-hypothesis", sigma_position=0.8, process=0.05)
    found = sf.clean(log, options=options)
    figures = {each.quantity: (each.value, each.source) for each in found.noise}
    assert figures["position"] == (0.8, "given")
    assert figures["acceleration"] == (0.05, "given")
    assert figures["height"][1] == "estimated"


@pytest.mark.parametrize("mode", MODES)
def test_what_the_user_decided_stays(log, mode):
    table = pd.DataFrame(log)
    table["edit"] = ""
    table.loc[[61, 160], "edit"] = "accept"
    table.loc[90, "edit"] = "reject"
    found = sf.clean(table, options=CleanOptions(method="multi-hypothesis", mode=mode))
    verdicts = found.verdicts
    assert (verdicts.verdict[[61, 90, 160]] == Verdict.EDITED).all()
    assert (verdicts.reason[[61, 160]] == Reason.ACCEPTED_BY_USER).all()
    assert verdicts.reason[90] == Reason.REJECTED_BY_USER
    assert verdicts.weight[90] == 0.0
    assert verdicts.weight[61] > 0.9
    assert np.abs(found.track.position[61, :2] - truth()[61, :2]).max() > 3.0


@pytest.mark.parametrize("mode", ["realtime", "offline"])
def test_depth_and_velocity_of_other_sensors(log, mode):
    """They support the track where the fixes are wrong."""
    calm = survey(N, sigma=0.0)
    rng = np.random.default_rng(9)
    depth = {"time": log["time"] + 0.3, "depth": -calm["z"] + rng.normal(0, 0.05, N)}
    rate = np.gradient(calm["x"]), np.gradient(calm["y"])
    velocity = {
        "time": log["time"] + 0.1,
        "ve": rate[0] + rng.normal(0, 0.03, N),
        "vn": rate[1] + rng.normal(0, 0.03, N),
    }
    velocity["ve"][250:270] += 1.5
    options = CleanOptions(method="multi-hypothesis", mode=mode)
    found = sf.clean(log, depth=depth, velocity=velocity, options=options)
    error = np.abs(found.track.position - truth())
    assert error[20:JUMP, :2].max() < 1.2
    assert error[20:JUMP, 2].max() < 0.5
    assert (found.verdicts.verdict[RUN] == Verdict.REJECTED).all()
