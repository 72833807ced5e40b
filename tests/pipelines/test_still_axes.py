"""Axes whose digits never change: a real place along a meridian, or a column nobody filled."""

import numpy as np
import pytest

import surefix as sf

N = 150
SIGMA = 0.5


def line(seed, across, geographic):
    """A log along one axis at 1 m/s, every tenth fix wrong; the other axis stands still."""
    rng = np.random.default_rng(seed)
    moving = np.arange(N) + rng.normal(0.0, SIGMA, N)
    moving[5::10] += 40.0
    log = {"time": np.arange(float(N)) + 1.7e9}
    if not geographic:
        return log | {"x": np.full(N, 5.0), "y": moving}
    if across == "lon":
        return log | {"lat": 60.0 + moving / 111_415.0, "lon": np.full(N, 5.0)}
    return log | {"lat": np.full(N, 60.0), "lon": 5.0 + moving / 55_800.0}


@pytest.mark.parametrize("method", ["multi-hypothesis", "igg3"])
@pytest.mark.parametrize("mode", ["offline", "lagged", "realtime"])
@pytest.mark.parametrize(
    ("across", "geographic"), [("lon", True), ("lat", True), ("x", False)], ids=str
)
def test_a_straight_line_keeps_its_fixes_and_its_noise(across, geographic, mode, method):
    for seed in range(3):
        options = sf.CleanOptions(mode=mode, method=method)
        found = sf.clean(line(seed, across, geographic), options=options)
        verdict = found.verdicts.verdict
        wrong = np.arange(N) % 10 == 5
        assert (verdict[wrong] == sf.Verdict.REJECTED).all()
        assert (verdict[~wrong] == sf.Verdict.REJECTED).mean() <= 0.02
        assert np.isfinite(found.track.position[:, :2]).all()
        assert found.noise[0].quantity == "position"
        assert found.noise[0].value == pytest.approx(SIGMA, rel=0.3)
        assert not [event for event in found.events if event.kind == "idle-axis"]


def test_rest_under_a_height_that_varies_is_a_place():
    rng = np.random.default_rng(0)
    log = {
        "time": np.arange(float(N)),
        "lat": np.full(N, 60.0),
        "lon": np.full(N, 5.0),
        "height": rng.normal(0.0, 1.0, N),
    }
    found = sf.clean(log)
    assert (found.verdicts.verdict == sf.Verdict.USED).mean() > 0.95
    np.testing.assert_allclose(found.track.geodetic[:, :2], [[60.0, 5.0]] * N)


def test_columns_of_zeros_are_left_out_and_said_so():
    rng = np.random.default_rng(0)
    log = {"time": np.arange(float(N)), "x": np.arange(N) + rng.normal(0.0, SIGMA, N)}
    found = sf.clean(log | {"y": np.zeros(N), "z": np.zeros(N)})
    told = [event.text for event in found.events if event.kind == "idle-axis"]
    assert told == [f"axis {axis} of fix never changes; left out" for axis in "yz"]
    assert np.isnan(found.track.position[:, 1:]).all()
    assert np.isfinite(found.track.position[:, 0]).all()
