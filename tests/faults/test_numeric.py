"""Faults 16–25: numbers that break an ordinary filter."""

import numpy as np
import pandas as pd
import pytest

import surefix as sf
from acceptance.product import clean, read, surefix, survey, told_in_one_line, write

MODES = ("realtime", "lagged", "offline")
NUMBERS = ["x", "y", "z", "vx", "vy", "vz", "sigma_x", "sigma_y", "sigma_z"]


def run(tmp_path, columns, *words) -> pd.DataFrame:
    write(tmp_path / "log.csv", columns)
    clean(tmp_path / "log.csv", *words, "-o", tmp_path / "out.csv")
    return read(tmp_path / "out.csv")


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("bad", ["nan", "inf", "-inf", "1e400", ""])
def test_fault_16_not_a_number_anywhere(tmp_path, mode, bad):
    """One axis, all axes, the sigma; in the first fix, amid the log, in the last."""
    log = pd.DataFrame(survey(120)).astype(object)
    log["sigma"] = 0.5
    log = log.astype(object)
    log.loc[0, ["x", "y", "z"]] = bad
    log.loc[40, "x"] = bad
    log.loc[60, "z"] = bad
    log.loc[80, "sigma"] = bad
    log.loc[119, ["x", "y"]] = bad
    track = run(tmp_path, log, "--mode", mode)
    assert len(track) == 120
    assert track.verdict[0] == "missing"
    settled = track[3:]
    assert np.isfinite(settled[NUMBERS].astype(float)).all().all()
    truth = survey(120, sigma=0.0)
    assert np.abs(settled.x - truth["x"][3:]).max() < 3.0
    assert (track.verdict == "rejected").sum() <= 2


@pytest.mark.parametrize("mode", MODES)
def test_fault_16_no_time(tmp_path, mode):
    log = pd.DataFrame(survey(120))
    log.loc[[0, 50, 119], "time"] = [np.nan, np.inf, np.nan]
    track = run(tmp_path, log, "--mode", mode)
    by_row = track.set_index("row")
    assert len(by_row) == 120
    assert (by_row.verdict[[0, 50, 119]] == "missing").all()
    assert (by_row.reason[[0, 50, 119]] == "no time").all()
    assert np.isfinite(by_row[NUMBERS].drop(index=[0, 50, 119])).all().all()


@pytest.mark.parametrize("figure", [0.0, -1.0, float("inf"), float("nan")])
@pytest.mark.parametrize("key", ["sigma_position", "sigma_height", "sigma_velocity", "process"])
def test_fault_17_impossible_noise_of_options(tmp_path, key, figure):
    write(tmp_path / "usbl.csv", survey(30))
    (tmp_path / "o.toml").write_text(f"[clean]\n{key} = {figure}\n")
    done = surefix("clean", tmp_path / "usbl.csv", "--options", tmp_path / "o.toml")
    assert key in told_in_one_line(done)
    if key == "process":
        return
    (tmp_path / "o.toml").write_text(f"[sensor.usbl]\nsigma = {figure}\n")
    done = surefix("clean", tmp_path / "usbl.csv", "--options", tmp_path / "o.toml")
    assert "usbl" in told_in_one_line(done)


@pytest.mark.parametrize("figure", ["0", "-1", "inf"])
@pytest.mark.parametrize("mode", MODES)
def test_fault_17_impossible_noise_of_records(tmp_path, figure, mode):
    """A counted problem that names the sensor; the fix counts with the usual noise."""
    log = pd.DataFrame(survey(120))
    log["sigma"] = 0.5
    log = log.astype(object)
    log.loc[[0, 60], "sigma"] = figure
    write(tmp_path / "usbl.csv", log)
    out = tmp_path / "out.csv"
    told = clean(tmp_path / "usbl.csv", "--mode", mode, "-o", out, "--json").json
    (problem,) = told["problems"]
    assert problem["total"] >= 2
    assert "usbl" in problem["example"] + problem["kind"]
    track = read(out)
    assert np.isfinite(track[NUMBERS]).all().all()
    assert np.abs(track.x - survey(120, sigma=0.0)["x"]).max() < 2.0


@pytest.mark.parametrize("mode", MODES)
def test_fault_18_extremes_of_precision(tmp_path, mode):
    """Standard deviations from a micrometre to a thousand kilometres in turn."""
    log = survey(300, sigma=0.0)
    sigma = np.where(np.arange(300) % 2 == 0, 1e-6, 1e6)
    track = run(tmp_path, {**log, "sigma": sigma}, "--mode", mode)
    assert np.isfinite(track[NUMBERS]).all().all()
    assert (track[["sigma_x", "sigma_y", "sigma_z"]] >= 0).all().all()
    assert np.abs(track.x - log["x"])[5:].max() < 2.0


@pytest.mark.parametrize("mode", MODES)
def test_fault_19_a_day_at_rest_then_moving(tmp_path, mode):
    n, rng = 8640 + 300, np.random.default_rng(5)
    x = np.concatenate([np.zeros(8640), 20.0 * np.arange(300)])
    log = {
        "time": 1.7e9 + 10.0 * np.arange(n),
        "x": x + rng.normal(0, 0.5, n),
        "y": rng.normal(0, 0.5, n),
    }
    track = run(tmp_path, log, "--mode", mode)
    assert np.abs(track.x - x)[8640 + 60 :].max() < 4.0
    assert np.abs(track.x[100:8600]).max() < 1.5
    assert (track.verdict[8640 + 60 :] == "rejected").mean() < 0.05


@pytest.mark.parametrize("mode", MODES)
def test_fault_20_heading_over_north(tmp_path, mode):
    value = (np.arange(200) * 0.2 + 340.0) % 360.0
    heading = {"time": np.arange(200.0), "heading": value}
    write(tmp_path / "gyro.csv", heading)
    write(tmp_path / "log.csv", {**survey(200), "time": np.arange(200.0)})
    words = "--heading", tmp_path / "gyro.csv", "--mode", mode
    clean(tmp_path / "log.csv", *words, "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.gyro.heading_deg.csv")
    off = (track.heading_deg - value + 180.0) % 360.0 - 180.0
    assert np.abs(off[5:]).max() < 0.2
    assert (track.verdict[5:] == "used").mean() > 0.95


@pytest.mark.parametrize("mode", MODES)
def test_fault_23_a_jump_of_500_m(tmp_path, mode):
    """For a second: rejected. For good: flagged, and followed."""
    log = survey(400, interval=0.5)
    spike = {**log, "x": log["x"].copy()}
    spike["x"][200:202] += 500.0
    track = run(tmp_path, spike, "--mode", mode)
    assert (track.verdict[200:202] == "rejected").all()
    truth = survey(400, interval=0.5, sigma=0.0)["x"]
    assert np.abs(track.x - truth)[5:].max() < 5.0
    lasting = {**log, "x": log["x"] + 500.0 * (np.arange(400) >= 200)}
    track = run(tmp_path, lasting, "--mode", mode)
    told = clean(tmp_path / "log.csv", "--mode", mode, "--json").json
    moved = truth + 500.0 * (np.arange(400) >= 200)
    assert np.abs(track.x - moved)[242:].max() < 5.0  # followed within forty fixes, once it is one
    assert np.abs(track.x - moved)[5:195].max() < 5.0
    flagged = track.reason.str.startswith("jump accepted").sum()
    jumps = [e for e in told["events"] if e["kind"] in ("jump", "recovery")]
    assert flagged + len(jumps) >= 1


@pytest.mark.parametrize(
    "north",
    [
        pytest.param(
            None,
            marks=pytest.mark.xfail(
                strict=True, reason="velocities that are wrong for good are believed for longer"
            ),
        ),
        "right",
    ],
)
@pytest.mark.parametrize("mode", ["realtime", "lagged"])
def test_fault_24_recovery_while_velocities_are_accepted(tmp_path, mode, north):
    log = survey(400)
    still = survey(400, sigma=0.0)
    vn = np.gradient(still["y"]) if north == "right" else np.full(400, 0.3)
    velocity = {"ve": np.gradient(still["x"]), "vn": vn}
    x = log["x"] + 500.0 * (np.arange(400) >= 200)
    track = run(tmp_path, {**log, "x": x, **velocity}, "--mode", mode)
    truth = survey(400, sigma=0.0)["x"] + 500.0 * (np.arange(400) >= 200)
    assert np.abs(track.x - truth)[250:].max() < 5.0


@pytest.mark.parametrize("mode", MODES)
def test_fault_25_a_copy_counts_once(tmp_path, mode):
    """Five copies of every record: the track and its covariance as for one."""
    log = pd.DataFrame(survey(150))
    single = run(tmp_path, log, "--mode", mode)
    five = run(tmp_path, log.loc[log.index.repeat(5)], "--mode", mode)
    assert len(five) == 750
    assert (five.verdict == "duplicate").sum() == 600
    first = five[::5].reset_index(drop=True)
    pd.testing.assert_frame_equal(first.drop(columns="row"), single.drop(columns="row"))
    for copy in range(1, 5):
        rest = five[copy::5].reset_index(drop=True)
        pd.testing.assert_frame_equal(rest[NUMBERS], single[NUMBERS])


def test_fault_25_from_several_files(tmp_path):
    """The same file given twice is one track; its rows are told as copies."""
    log = survey(100)
    path = write(tmp_path / "log.csv", log)
    one = sf.clean(path)
    two = sf.clean([path, path])
    assert (two.verdicts.verdict == sf.Verdict.DUPLICATE).sum() == 100
    kept = two.verdicts.verdict != sf.Verdict.DUPLICATE
    np.testing.assert_allclose(two.track.sigma_position[kept], one.track.sigma_position, rtol=1e-9)
