"""Other sensors, series, edits and declared figures on the command line."""

import re

import numpy as np

from acceptance.product import (
    FIXED,
    START,
    clean,
    read,
    sentence,
    surefix,
    survey,
    told_in_one_line,
    write,
)

MODES = ("realtime", "lagged", "offline")
METHODS = ("kalman", "gate", "huber", "igg1", "igg3", "igg3-yang", "student-t")


def test_report_and_series_beside_the_output(log, tmp_path):
    columns = read(log)
    columns["heading"] = 10.0 + np.random.default_rng(1).normal(0, 1, len(columns))
    columns["speed"] = 1.0 + np.random.default_rng(2).normal(0, 0.05, len(columns))
    columns.to_csv(log, index=False)
    page = tmp_path / "report.html"
    outputs = "-o", tmp_path / "out.csv", "-o", tmp_path / "out.parquet", "--report", page
    told = clean(log, *outputs, "--json").json
    assert [c["name"] for c in told["channels"]] == ["heading_deg", "speed_mps"]
    for suffix in (".csv", ".parquet"):
        for name in ("heading_deg", "speed_mps"):
            path = tmp_path / f"out.dive.{name}{suffix}"
            assert str(path) in told["outputs"]
            beside = read(path)
            names = ["time", name, "raw", "rate", "sigma"]
            assert beside.columns.tolist() == [*names, *FIXED[-4:]]
            assert len(beside) == len(columns)
    assert str(page) in told["outputs"]
    text = page.read_text("utf-8")
    assert text.lstrip().lower().startswith("<!doctype html>")
    assert "dive" in text
    assert not re.search(r"<(?:script|link|img)[^>]+(?:src|href)=[\"']https?:", text)


def test_log_of_a_single_series(tmp_path):
    """Depths alone, as NMEA sentences: the output itself holds them."""
    rng = np.random.default_rng(1)
    value = 20.0 + np.sin(np.arange(400) / 60.0) + rng.normal(0, 0.05, 400)
    value[150] = 95.0
    lines = [
        f"2024-05-01T10:{i // 60:02d}:{i % 60:02d}Z " + sentence(f"SDDPT,{v:.2f},0.0,200.0")
        for i, v in enumerate(value)
    ]
    (tmp_path / "sounder.log").write_text("".join(lines), newline="")
    clean(tmp_path / "sounder.log", "-o", tmp_path / "out.csv")
    depth = read(tmp_path / "out.csv")
    names = ["time", "depth_m", "raw", "rate", "sigma", *FIXED[-4:]]
    assert depth.columns.tolist() == names
    assert depth.verdict[150] == "rejected"
    assert np.abs(depth.depth_m[150] - 20.0 - np.sin(2.5)) < 0.3
    assert len(list(tmp_path.iterdir())) == 2


def test_depths_alone_of_a_table(tmp_path):
    log = survey(200)
    log["z"][90] -= 30.0
    table = {"time": log["time"], "depth": -log["z"]}
    write(tmp_path / "depth.csv", table)
    clean(tmp_path / "depth.csv", "--column", "z=-depth", "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.csv")
    assert track[["x", "y"]].isna().all().all()
    assert np.isfinite(track.z).all()
    assert track.verdict[90] == "rejected"


def body_logs(tmp_path, turn=90.0):
    """A vehicle that makes 1 m/s ahead on a slowly turning heading."""
    n, rng = 600, np.random.default_rng(7)
    t = 0.5 * np.arange(n)
    heading = turn + 60.0 * np.sin(t / 60.0)
    east, north = np.sin(np.radians(heading)), np.cos(np.radians(heading))
    x, y = np.cumsum(east) * 0.5, np.cumsum(north) * 0.5
    noise = rng.normal(0, 1.5, (2, n))
    write(
        tmp_path / "usbl.csv",
        {"time": START + t[::4], "x": (x + noise[0])[::4], "y": (y + noise[1])[::4]},
    )
    body = rng.normal(0, 0.02, (2, n)) + np.array([[1.0], [0.0]])
    write(tmp_path / "dvl.csv", {"time": START + t, "forward": body[0], "starboard": body[1]})
    write(tmp_path / "gyro.csv", {"time": START + t - 0.1, "heading": heading % 360.0})
    return x[::4], y[::4]


def test_body_velocities_are_turned_by_the_heading(tmp_path, monkeypatch):
    x, y = body_logs(tmp_path, turn=350.0)
    monkeypatch.chdir(tmp_path)
    clean("usbl.csv", "-o", "plain.csv")
    clean("usbl.csv", "--velocity", "dvl.csv", "--heading", "gyro.csv", "-o", "out.csv")
    plain, track = read(tmp_path / "plain.csv"), read(tmp_path / "out.csv")

    def rmse(frame):
        return np.sqrt(np.mean((frame.x - x) ** 2 + (frame.y - y) ** 2))

    assert len(track) == len(x)
    assert rmse(track) < 0.6 * rmse(plain)
    assert np.abs(np.hypot(track.vx, track.vy) - 1.0).max() < 0.15
    assert read(tmp_path / "out.gyro.heading_deg.csv").shape[0] == 600


def test_body_velocities_need_a_heading(tmp_path, monkeypatch):
    body_logs(tmp_path)
    monkeypatch.chdir(tmp_path)
    line = told_in_one_line(surefix("clean", "usbl.csv", "--velocity", "dvl.csv"))
    assert "--heading" in line


def test_delay_of_a_sensor_is_taken_out(tmp_path):
    """A USBL that is a second late beside a depth and a velocity that are not."""
    n, rng = 400, np.random.default_rng(3)
    t = START + np.arange(n)
    x = 50.0 * np.sin(np.arange(n) / 25.0)
    v = 2.0 * np.cos(np.arange(n) / 25.0)
    late = {"time": t + 1.0, "x": x + rng.normal(0, 0.3, n), "y": rng.normal(0, 0.3, n)}
    write(tmp_path / "usbl.csv", late)
    write(
        tmp_path / "dvl.csv",
        {"time": t, "ve": v + rng.normal(0, 0.02, n), "vn": rng.normal(0, 0.02, n)},
    )
    file = tmp_path / "o.toml"
    errors = {}
    for delay in (0.0, 1.0):
        file.write_text(f"[sensor.usbl]\ndelay_s = {delay}\n")
        words = "--velocity", tmp_path / "dvl.csv", "--options", file
        clean(tmp_path / "usbl.csv", *words, "-o", tmp_path / "out.csv")
        track = read(tmp_path / "out.csv")
        np.testing.assert_allclose(track.time, t + 1.0 - delay, atol=1e-6)
        errors[delay] = np.sqrt(np.mean((track.x - np.interp(track.time, t, x)) ** 2))
    assert errors[1.0] < 0.2
    assert errors[1.0] < 0.3 * errors[0.0]


def test_edits_of_the_user_win(log, tmp_path):
    columns = read(log)
    columns["edit"] = ""
    columns.loc[40, "edit"] = "accept"
    columns.loc[60, "edit"] = "reject"
    columns.to_csv(log, index=False)
    for mode in MODES:
        clean(log, "--mode", mode, "-o", tmp_path / "out.csv")
        by_row = read(tmp_path / "out.csv").set_index("row")
        assert by_row.verdict[[40, 60]].tolist() == ["edited", "edited"]
        assert by_row.weight[[40, 60]].tolist() == [1.0, 0.0]
        reasons = by_row.reason[[40, 60]].tolist()
        assert reasons == ["accepted by the user", "rejected by the user"]
        assert by_row.verdict[111] == "rejected"
        line = columns.x[39:42].mean()
        assert by_row.x[40] - columns.x[[39, 41]].mean() > 5.0, line


def test_declared_sigmas_are_believed(tmp_path):
    log = survey(300, sigma=0.5)
    noisy = np.arange(300) % 2 == 0
    rng = np.random.default_rng(9)
    log["x"] = log["x"] + np.where(noisy, rng.normal(0, 8, 300), 0)
    declared = np.where(noisy, 8.0, 0.5)
    sigmas = {"sigma_x": declared, "sigma_y": np.full(300, 0.5), "sigma_z": np.full(300, 0.5)}
    told = clean(write(tmp_path / "log.csv", {**log, **sigmas}), "-o", tmp_path / "o.csv", "--json")
    assert "declared" in {n["source"] for n in told.json["noise"]}
    track = read(tmp_path / "o.csv")
    assert (track.verdict == "rejected").mean() < 0.02
    truth = survey(300, sigma=0.0)["x"]
    assert np.sqrt(np.mean((track.x - truth) ** 2)) < 0.6


def test_delay_of_a_sensor_on_the_command_line(tmp_path, monkeypatch):
    n, rng = 400, np.random.default_rng(5)
    t = START + np.arange(n)
    angle = np.arange(n) / 25.0
    x = 50.0 * np.sin(angle) + rng.normal(0, 0.3, n)
    write(tmp_path / "usbl.csv", {"time": t + 1.0, "x": x, "y": rng.normal(0, 0.3, n)})
    noise = rng.normal(0, 0.02, (2, n))
    write(tmp_path / "dvl.csv", {"time": t, "ve": 2 * np.cos(angle) + noise[0], "vn": noise[1]})
    monkeypatch.chdir(tmp_path)
    words = "usbl.csv", "--velocity", "dvl.csv", "-o", "out.csv"
    told = clean(*words).out
    assert "s late against the velocity of dvl" in told
    assert "late" not in clean(*words, "--sensor-delay", "usbl=1000ms").out
    np.testing.assert_allclose(read(tmp_path / "out.csv").time, t, atol=1e-6)
    assert "; removed" in clean(*words, "--latency", "remove").out
    for wrong in ("usbl", "usbl=", "=1s", "usbl=soon"):
        assert "--sensor-delay" in told_in_one_line(
            surefix("clean", *words, "--sensor-delay", wrong)
        )
