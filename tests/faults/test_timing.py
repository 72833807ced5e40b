"""Faults 26–31: clocks that lie, rows that come late."""

import numpy as np
import pandas as pd
import pytest

from acceptance.product import clean, gga, read, sentence, survey, write, zda

MODES = ("realtime", "lagged", "offline")
HOUR, YEARS = 3600.0, 6 * 365.25 * 86400.0
CLEAN = ["x", "y", "z", "vx", "vy", "vz", "sigma_x", "verdict", "weight"]


def run(tmp_path, columns, *words):
    write(tmp_path / "log.csv", columns)
    told = clean(tmp_path / "log.csv", *words, "-o", tmp_path / "out.csv", "--json").json
    return told, read(tmp_path / "out.csv")


def fast(n=400):
    """A survey at 3 m/s, with wild fixes."""
    log = pd.DataFrame(survey(n))
    log["x"] += 2.0 * np.arange(n)
    log.loc[[50, 120, 310], "y"] += 40.0
    return log


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("step", [HOUR, -HOUR, YEARS, -YEARS], ids=["+1h", "-1h", "+6y", "-6y"])
def test_fault_26_clock_steps_while_moving(tmp_path, mode, step):
    """The track is that of the log whose clock did not step."""
    log = fast()
    _, plain = run(tmp_path, log, "--mode", mode)
    stepped = log.assign(time=log.time + step * (np.arange(len(log)) >= 200))
    told, track = run(tmp_path, stepped, "--mode", mode)
    assert [e["kind"] for e in told["events"]].count("clock-step") == 1
    assert track.row.tolist() == plain.row.tolist()
    pd.testing.assert_frame_equal(track[CLEAN], plain[CLEAN], rtol=0, atol=0.02)
    recorded = stepped.time.to_numpy()
    assert (
        np.abs(track.time - recorded).max() < 1e-3
        or np.abs(track.time - log.time).max() < 1e-3
        or (np.diff(track.time) > 0).all()
    )


@pytest.mark.parametrize("mode", MODES)
def test_fault_26_clock_that_steps_and_comes_back(tmp_path, mode):
    log = fast()
    _, plain = run(tmp_path, log, "--mode", mode)
    off = (np.arange(len(log)) >= 150) & (np.arange(len(log)) < 260)
    told, track = run(tmp_path, log.assign(time=log.time + HOUR * off), "--mode", mode)
    assert "clock-step" in [e["kind"] for e in told["events"]]
    assert np.abs(track.set_index("row").x - plain.set_index("row").x).max() < 0.5


@pytest.mark.parametrize("mode", MODES)
def test_fault_27_out_of_order_by_two_seconds(tmp_path, mode):
    log = fast()
    _, plain = run(tmp_path, log, "--mode", mode)
    rng = np.random.default_rng(1)
    order = np.argsort(log.time + rng.uniform(0, 2.0, len(log)), kind="stable")
    assert (np.diff(order) < 0).any()
    _, track = run(tmp_path, log.iloc[order], "--mode", mode)
    pd.testing.assert_frame_equal(track.drop(columns="row"), plain.drop(columns="row"))


@pytest.mark.parametrize("mode", MODES)
def test_fault_27_too_late_is_a_counted_drop(tmp_path, mode):
    log = fast()
    late = pd.concat([log[:100], log[101:200], log[100:101], log[200:]])
    told, track = run(tmp_path, late, "--mode", mode)
    by_row = track.set_index("row")
    assert by_row.verdict[199] == "rejected"
    assert by_row.reason[199].startswith("arrived after")
    assert told["verdicts"]["rejected"] >= 1
    _, plain = run(tmp_path, log.drop(index=100), "--mode", mode)
    others = by_row.drop(index=199).sort_index()
    np.testing.assert_allclose(others.x, plain.x, atol=1e-3)


def nmea(tmp_path, lines, *words):
    (tmp_path / "gps.log").write_text("".join(lines), newline="")
    told = clean(tmp_path / "gps.log", *words, "-o", tmp_path / "out.csv", "--json").json
    return told, read(tmp_path / "out.csv")


def clock(second: float) -> str:
    second %= 86400
    return f"{int(second // 3600):02d}{int(second // 60 % 60):02d}{int(second % 60):02d}"


def fixes(start: float, n: int):
    return [gga(clock(start + i), 60.0 + 1e-5 * i, 5.0 + 1e-5 * i) for i in range(n)]


def test_fault_28_a_late_second_of_yesterday(tmp_path):
    """23:59:59 that is handled after midnight belongs to the day before."""
    lines = fixes(86400 - 30, 60)
    lines[29], lines[30] = lines[30], lines[29]
    told, track = nmea(tmp_path, [zda(clock(86370), 31, 12, 2023), *lines])
    start = pd.Timestamp("2023-12-31T23:59:30Z").timestamp()
    np.testing.assert_allclose(track.time, start + np.arange(60))
    assert "clock-step" not in [e["kind"] for e in told["events"]]
    assert (track.verdict != "rejected").all()


def test_fault_29_midnight_adds_one_day_once(tmp_path):
    """RMC and GGA of the same epochs, their dates and times rolling over not quite together."""
    lines = []
    for i in range(60):
        second = 86400 - 30 + i
        date = "311223" if second < 86400 else "010124"
        lat, lon = f"60{(1e-5 * i * 60):07.4f}", f"005{(1e-5 * i * 60):07.4f}"
        body = f"GPRMC,{clock(second)},A,{lat},N,{lon},E,2.0,45.0,{date},,,A"
        pair = [sentence(body), gga(clock(second), 60.0 + 1e-5 * i, 5.0 + 1e-5 * i)]
        lines += pair if i % 2 else pair[::-1]
    _, track = nmea(tmp_path, lines)
    start = pd.Timestamp("2023-12-31T23:59:30Z").timestamp()
    np.testing.assert_allclose(track.time, start + np.arange(60))


def test_fault_30_week_rollover(tmp_path):
    """Dates of 1024 weeks ago beside the right times of reception: corrected and flagged."""
    lines = []
    for i, fix in enumerate(fixes(43200, 60)):
        received = f"2024-05-01T12:00:{i:02d}.250Z "
        lines += [received + zda(clock(43200 + i), 15, 9, 2004), received + fix]
    told, track = nmea(tmp_path, lines)
    start = pd.Timestamp("2024-05-01T12:00:00Z").timestamp()
    np.testing.assert_allclose(track.time, start + np.arange(60))
    assert [e["kind"] for e in told["events"]].count("week-rollover") == 1


@pytest.mark.parametrize("mode", MODES)
def test_fault_31_leap_second(tmp_path, mode):
    """23:59:60 gives no negative step and no speed that nothing had."""
    lines = fixes(86400 - 30, 60)
    lines[30] = lines[30].replace("000000", "235960")
    lines[30] = sentence(lines[30].split("*")[0][1:])
    lines[31:] = [
        gga(clock(86400 + i), 60.0 + 1e-5 * (31 + i), 5.0 + 1e-5 * (31 + i)) for i in range(29)
    ]
    told, track = nmea(tmp_path, [zda(clock(86370), 31, 12, 2016), *lines], "--mode", mode)
    assert len(track) == 60
    assert (np.diff(track.time) >= 0).all()
    assert np.diff(track.time).max() <= 1.001
    assert np.hypot(track.vx, track.vy)[5:].max() < 3.0
    assert "clock-step" not in [e["kind"] for e in told["events"]]
    assert (track.verdict == "rejected").sum() == 0


@pytest.mark.parametrize("mode", MODES)
def test_a_gap_is_not_a_clock_step(tmp_path, mode):
    log = fast().drop(index=range(200, 320))
    told, track = run(tmp_path, log, "--mode", mode)
    kinds = [e["kind"] for e in told["events"]]
    assert "clock-step" not in kinds
    np.testing.assert_allclose(track.time, log.time, atol=1e-6)
    assert (track.verdict[200:] != "rejected").mean() > 0.9
