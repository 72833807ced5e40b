"""A slow drag: an error that grows over a minute and goes back. A second source tells it."""

import numpy as np
import pytest

import surefix as sf

MODES = ("realtime", "lagged", "offline")
N = 1100
T = np.arange(float(N))
DRAG = slice(600, 720)
FAR = slice(610, 712)  # where it is more than noise


def vehicle(seed, sigma):
    rng = np.random.default_rng(seed)
    truth = np.column_stack([0.5 * T + 5.0 * np.sin(T / 60.0), 0.2 * T])
    return truth, truth + rng.normal(0.0, sigma, truth.shape)


def ramp(far=30.0):
    out = np.zeros(N)
    out[DRAG] = np.concatenate([np.linspace(0.0, far, 60), np.linspace(far, 0.0, 60)])
    return out


def options(mode):
    return sf.CleanOptions(mode=mode)


@pytest.mark.parametrize("mode", MODES)
def test_another_sensor_of_positions_tells(mode):
    """Though it is the noisier one."""
    truth, usbl = vehicle(1, 0.4)
    _, gnss = vehicle(2, 0.8)
    usbl += ramp()[:, None] * [0.8, 0.6]
    both = np.stack([usbl, gnss], axis=1).reshape(-1, 2)
    time = 1.7e9 + np.repeat(T, 2) + np.resize([0.0, 0.4], 2 * N)
    log = {
        "time": time,
        "x": both[:, 0],
        "y": both[:, 1],
        "sensor": np.resize(["usbl", "gnss"], 2 * N),
    }
    found = sf.clean(log, options=options(mode))
    error = np.abs(found.track.position[::2, :2] - truth)
    assert error[DRAG].max() < (1.5 if mode == "realtime" else 1.0)
    verdict = found.verdicts.verdict[::2]
    assert (verdict[FAR] == sf.Verdict.REJECTED).all()
    assert (found.verdicts.verdict[1::2][FAR] == sf.Verdict.REJECTED).mean() < 0.05


@pytest.mark.parametrize("mode", MODES)
def test_a_pressure_sensor_tells(mode):
    _, fixes = vehicle(3, 0.4)
    rng = np.random.default_rng(4)
    z = -50.0 - 5.0 * np.sin(T / 100.0)
    log = {
        "time": 1.7e9 + T,
        "x": fixes[:, 0],
        "y": fixes[:, 1],
        "z": z + rng.normal(0.0, 0.4, N) + ramp(),
    }
    depth = {"time": 1.7e9 + T, "depth": -z + rng.normal(0.0, 0.05, N)}
    found = sf.clean(log, depth=depth, options=options(mode))
    error = np.abs(found.track.position[:, 2] - z)
    assert error[DRAG].max() < 0.3
    assert (found.verdicts.verdict[FAR] != sf.Verdict.USED).all()


def test_fixes_alone_cannot_tell():
    """Nothing distinguishes it from the motion of the vehicle; σ does not say so either."""
    truth, usbl = vehicle(5, 0.4)
    usbl += ramp()[:, None] * [0.8, 0.6]
    log = {"time": 1.7e9 + T, "x": usbl[:, 0], "y": usbl[:, 1]}
    found = sf.clean(log, options=options("offline"))
    assert np.abs(found.track.position[DRAG, :2] - truth[DRAG]).max() > 10.0
