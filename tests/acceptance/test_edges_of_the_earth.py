"""Where coordinates wrap, a track and a heading do not."""

import numpy as np
import pandas as pd
import pytest

from acceptance.product import METRES_PER_DEGREE, clean, geographic, read, survey, write

MODES = ("realtime", "lagged", "offline")


def spiked(n=300, **how):
    """A survey with a wild fix every 37, and where they are."""
    log = survey(n, **how)
    bad = np.arange(20, n, 37)
    log["x"][bad] += 40.0
    return log, bad


@pytest.mark.parametrize("mode", MODES)
def test_the_antimeridian_changes_nothing(tmp_path, mode):
    log, bad = spiked()
    frames = []
    for longitude in (20.0, 179.9985, 179.9998):
        path = write(tmp_path / "log.csv", geographic(log, -17.0, longitude))
        clean(path, "--mode", mode, "-o", tmp_path / "out.parquet")
        frames.append(read(tmp_path / "out.parquet"))
    plain, *others = frames
    for crossing in others:
        assert crossing.lon.between(-180.0, 180.0).all()
        assert (crossing.lon > 179).any()
        assert (crossing.lon < -179).any()
        assert crossing.verdict.tolist() == plain.verdict.tolist()
        shift = crossing[["x", "y"]].mean() - plain[["x", "y"]].mean()
        moved = crossing[["x", "y"]] - shift
        assert np.abs(moved - plain[["x", "y"]]).max().max() < 0.01
        assert np.abs(crossing[["vx", "vy"]] - plain[["vx", "vy"]]).max().max() < 0.01
    assert (plain.verdict[bad] == "rejected").all()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("latitude", [89.999, 89.9999, -89.999])
def test_across_the_pole(tmp_path, mode, latitude):
    """A straight run over the pole: finite, the wild fixes gone, the course kept."""
    n, sign = 300, np.sign(latitude)
    rng = np.random.default_rng(2)
    time = 1.7e9 + np.arange(n)
    start = (90.0 - abs(latitude)) * METRES_PER_DEGREE
    x, y = rng.normal(0, 0.5, (2, n))
    y += np.linspace(-start, start, n)
    bad = np.arange(20, n, 37)
    x[bad] += 60.0
    log = {
        "time": time,
        "lat": sign * (90.0 - np.hypot(x, y) / METRES_PER_DEGREE),
        "lon": np.degrees(np.arctan2(x, -sign * y)),
        "depth": np.full(n, 12.0) + rng.normal(0, 0.1, n),
    }
    clean(write(tmp_path / "log.csv", log), "--mode", mode, "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.csv")
    columns = ["x", "y", "z", "vx", "vy", "lat", "lon", "depth"]
    assert np.isfinite(track[columns]).all().all()
    assert (track.verdict[bad] == "rejected").all()
    assert (track.verdict == "rejected").sum() < len(bad) + 6
    speed = np.hypot(track.vx, track.vy)[20:]
    assert np.abs(speed - 2 * start / (n - 1)).max() < 0.8
    good = np.setdiff1d(np.arange(20, n), bad)
    place = (90.0 - np.abs(track.lat)) * METRES_PER_DEGREE
    angle = np.radians(track.lon)
    assert np.abs(place * np.sin(angle) - x)[good].max() < 3.0
    assert np.abs(-sign * place * np.cos(angle) - y)[good].max() < 3.0


def test_a_fix_at_the_pole_itself(tmp_path):
    n = 60
    rng = np.random.default_rng(3)
    log = {
        "time": np.arange(n),
        "lat": 90.0 - np.abs(rng.normal(0, 5e-6, n)),
        "lon": rng.uniform(-180, 180, n),
    }
    log["lat"][[0, 30]] = 90.0
    clean(write(tmp_path / "log.csv", log), "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.csv")
    assert np.isfinite(track[["x", "y", "lat", "lon"]]).all().all()
    assert np.hypot(track.vx, track.vy).max() < 1.0


@pytest.mark.parametrize("mode", MODES)
def test_a_heading_through_north(tmp_path, mode):
    """359.9° is beside 0.1°: no innovation is larger than the step, no value off the circle."""
    n = 600
    rng = np.random.default_rng(4)
    true = 358.0 + 6.0 * np.sin(np.arange(n) / 40.0)
    noisy = (true + rng.normal(0, 0.2, n)) % 360.0
    noisy[100], noisy[300] = 170.0, 90.0
    log = {"time": 1.7e9 + np.arange(n) * 0.2, "heading": noisy}
    fixes = {**survey(60, interval=2.0)}
    clean(
        write(tmp_path / "fixes.csv", fixes),
        "--heading",
        write(tmp_path / "gyro.csv", log),
        "--mode",
        mode,
        "-o",
        tmp_path / "out.csv",
    )
    heading = read(tmp_path / "out.gyro.heading_deg.csv")
    assert heading.heading_deg.between(0, 360, inclusive="left").all()
    off = (heading.heading_deg - true + 180.0) % 360.0 - 180.0
    assert np.abs(off[10:]).max() < 1.0
    assert heading.verdict[[100, 300]].tolist() == ["rejected", "rejected"]
    assert (heading.verdict == "rejected").sum() <= 4
    assert np.abs(heading.rate[10:]).max() < 3.0


def test_headings_of_the_quiet_step_through_north(tmp_path):
    """359.9 and 0.1 by turns is a heading of north, ±0.1°."""
    n = 200
    rng = np.random.default_rng(5)
    value = (rng.normal(0, 0.1, n)) % 360.0
    log = pd.DataFrame({"time": np.arange(n), "heading": value})
    log.to_csv(tmp_path / "gyro.csv", index=False)
    fixes = write(tmp_path / "fixes.csv", {**survey(50), "time": np.arange(50.0)})
    clean(fixes, "--heading", tmp_path / "gyro.csv", "-o", tmp_path / "out.csv")
    heading = read(tmp_path / "out.gyro.heading_deg.csv")
    off = (heading.heading_deg + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 0.2
    assert heading.innovation_sigma.max() < 6.0
    assert (heading.verdict == "rejected").sum() == 0
