"""Events from verdicts: runs of wrong fixes, sensors that fall and recover, noise that grows."""

import numpy as np
import pytest

import surefix as sf
from surefix.reasons import texts

MODES = ("realtime", "lagged", "offline")


def dive(seed=1, n=1200):
    rng = np.random.default_rng(seed)
    t = np.arange(float(n))
    truth = np.column_stack([0.5 * t + 5.0 * np.sin(t / 60.0), 0.2 * t])
    return t, truth + rng.normal(0.0, 0.4, truth.shape)


def told(t, fixes, mode, kind, *, drags=False, **more):
    log = {"time": 1.7e9 + t, "x": fixes[:, 0], "y": fixes[:, 1], **more}
    found = sf.clean(log, options=sf.CleanOptions(mode=mode, drags=drags))
    return [(event.time - 1.7e9, event.text) for event in found.events if event.kind == kind], found


@pytest.mark.parametrize("mode", MODES)
def test_a_run_is_told_with_its_offset(mode):
    t, fixes = dive()
    fixes[500:517] += [14.0, -27.0]
    runs, found = told(t, fixes, mode, "run")
    assert len(runs) == 1
    time, text = runs[0]
    assert time == (502.0 if mode == "realtime" else 500.0)
    assert "wrong together by (1" in text
    if mode != "realtime":
        assert text.startswith("17 fixes of ")
    off = found.verdicts.offset[510]
    np.testing.assert_allclose(off[:2], [14.0, -27.0], atol=0.6)
    assert np.isnan(off[2])
    assert np.isnan(found.verdicts.offset[300]).all()


@pytest.mark.parametrize("mode", MODES)
def test_runs_and_jumps_are_told_beside_sensors_that_come_between(mode):
    """A depth and a velocity neither end a run nor keep a jump to themselves."""
    t, fixes = dive()
    fixes[500:517] += [14.0, -27.0]
    fixes[800:] += [15.0, -9.0]
    rng = np.random.default_rng(9)
    fast = np.arange(0.0, t[-1], 0.45)
    found = sf.clean(
        {"time": 1.7e9 + t, "x": fixes[:, 0], "y": fixes[:, 1], "z": rng.normal(-50, 0.4, len(t))},
        depth={"time": 1.7e9 + fast, "depth": 50.0 + rng.normal(0.0, 0.02, len(fast))},
        velocity={
            "time": 1.7e9 + fast + 0.1,
            "ve": 0.5 + np.cos(fast / 60.0) / 12.0 + rng.normal(0.0, 0.02, len(fast)),
            "vn": 0.2 + rng.normal(0.0, 0.02, len(fast)),
        },
        options=sf.CleanOptions(mode=mode),
    )
    told = [(event.kind, event.time - 1.7e9) for event in found.events]
    first = next(time for kind, time in told if kind == "run")
    assert first == (502.0 if mode == "realtime" else 500.0)
    assert (found.verdicts.detail[510:517] >= 10.0).all()
    assert (found.verdicts.reason == sf.Reason.JUMP).sum() == 1
    ((_, jump),) = [each for each in told if each[0] == "jump"]
    assert jump == 800.0 if mode == "offline" else 800.0 <= jump < 860.0


@pytest.mark.parametrize("mode", MODES)
def test_a_log_of_isolated_errors_has_no_such_events(mode):
    t, fixes = dive(2)
    bad = np.random.default_rng(5).random(len(t)) < 0.1
    fixes[bad] += np.random.default_rng(6).normal(0.0, 30.0, (bad.sum(), 2))
    for kind in ("run", "jump", "sensor-suspect", "noise-changed"):
        assert not told(t, fixes, mode, kind)[0], kind


@pytest.mark.parametrize("mode", MODES)
def test_a_sensor_that_goes_mad_is_suspect_until_it_agrees_again(mode):
    """Another one carries the track meanwhile."""
    t, fixes = dive(3)
    _, others = dive(4)
    fixes[400:600] += np.random.default_rng(7).normal(0.0, 50.0, (200, 2))
    both = np.empty((2 * len(t), 2))
    both[::2], both[1::2] = fixes, others
    names = np.resize(["usbl", "gnss"], len(both))
    time = np.repeat(t, 2) + np.resize([0.0, 0.3], len(both))
    fell, found = told(time, both, mode, "sensor-suspect", sensor=names)
    rose = [event for event in found.events if event.kind == "sensor-trusted"]
    assert len(fell) == len(rose) == 1
    assert "usbl" in fell[0][1]
    assert 400.0 < fell[0][0] < 440.0
    assert 600.0 < rose[0].time - 1.7e9 < 700.0


@pytest.mark.parametrize("mode", MODES)
def test_noise_that_grows_is_told(mode):
    """What was settled is given, so that the log as a whole cannot settle something between."""
    t, fixes = dive(5, 3000)
    fixes[1500:] += np.random.default_rng(8).normal(0.0, 1.6, (1500, 2))
    log = {"time": 1.7e9 + t, "x": fixes[:, 0], "y": fixes[:, 1]}
    options = sf.CleanOptions(mode=mode, method="huber", sigma_position=0.4)
    found = sf.clean(log, options=options)
    changed = [event for event in found.events if event.kind == "noise-changed"]
    assert changed
    assert changed[0].time - 1.7e9 > 1500.0


@pytest.mark.parametrize("mode", MODES)
def test_a_drag_beside_velocities_is_told_once(mode):
    """With the offset of each fix now; the fixes that begin and end it look like any other."""
    t, fixes = dive(3, 600)
    pull = np.clip(0.5 * np.arange(-300.0, 300.0), 0.0, 30.0)
    pull[420:] = 0.0
    fixes[:, 0] += 0.8 * pull
    fixes[:, 1] -= 0.6 * pull
    rng = np.random.default_rng(4)
    ve = 0.5 + np.cos(t / 60.0) / 12.0 + rng.normal(0.0, 0.02, len(t))
    vn = 0.2 + rng.normal(0.0, 0.02, len(t))
    events, found = told(t, fixes, mode, "drag", drags=True, ve=ve, vn=vn)
    assert len(events) == 1
    assert 295.0 < events[0][0] < 330.0
    assert "wander off, by (" in events[0][1]
    assert (found.verdicts.reason[330:419] == sf.Reason.DRAG).mean() > 0.95
    np.testing.assert_allclose(found.verdicts.offset[400, :2], [24.0, -18.0], atol=2.5)
    assert texts(found.verdicts)[400].startswith("in a drag of ")
    assert np.isfinite(found.track.position[:, 0]).all()
    assert (found.verdicts.verdict[430:] != sf.Verdict.REJECTED).mean() > 0.97
