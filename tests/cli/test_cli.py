"""What `surefix clean` promises: columns, rows, files, words, and one line when it fails."""

import json
import subprocess
import sys
from importlib.metadata import version

import gpxpy
import numpy as np
import pandas as pd
import pytest

from acceptance.product import (
    FIXED,
    VERDICTS,
    clean,
    geographic,
    process,
    read,
    sentence,
    surefix,
    survey,
    told_in_one_line,
    write,
)

MODES = ("realtime", "lagged", "offline")
METHODS = ("kalman", "gate", "huber", "igg1", "igg3", "igg3-yang", "student-t")


def test_columns_and_order(log, tmp_path):
    clean(log, "-o", tmp_path / "out.csv")
    assert read(tmp_path / "out.csv").columns.tolist() == [*FIXED, "sensor", "row"]


@pytest.mark.parametrize("vertical", ["depth", "height", None])
def test_columns_of_geographic_input(tmp_path, vertical):
    columns = geographic(survey(80), 60.0, 5.0)
    depth = columns.pop("depth")
    if vertical:
        columns[vertical] = depth if vertical == "depth" else -depth
    clean(write(tmp_path / "log.csv", columns), "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.csv")
    expected = [*FIXED, "lat", "lon", vertical or "height", "sensor", "row"]
    assert track.columns.tolist() == expected
    if vertical:
        sign = -1.0 if vertical == "depth" else 1.0
        np.testing.assert_allclose(track[vertical], sign * track.z, atol=1e-3)
        assert np.abs(track[vertical] - columns[vertical]).median() < 0.5
    else:
        assert track[["z", "vz", "sigma_z", "height"]].isna().all().all()


def test_one_row_per_fix_in_the_order_of_time(log, tmp_path):
    clean(log, "-o", tmp_path / "out.csv")
    track, raw = read(tmp_path / "out.csv"), read(log)
    assert sorted(track.row) == list(range(len(raw)))
    assert (np.diff(track.time) >= 0).all()
    np.testing.assert_allclose(track.time, raw.time[track.row], atol=1e-6)
    assert not (np.diff(track.row) > 0).all()
    assert set(track.verdict) <= VERDICTS
    assert track.weight.between(0, 1).all()
    by_row = track.set_index("row").verdict
    assert (by_row[[40, 111]] == "rejected").all()
    assert (by_row[77], by_row[151]) == ("missing", "duplicate")
    assert track.reason.notna().all()
    used = track[track.verdict == "used"]
    assert (used.weight > 0.97).all()
    assert (track[track.verdict == "rejected"].weight < 0.03).all()
    assert np.isfinite(track[["x", "y", "z", "vx", "vy", "sigma_x"]]).all().all()


def test_every_format_says_the_same(globe, tmp_path):
    names = ("t.csv", "t.parquet", "t.geojson", "t.gpx")
    outputs = [word for name in names for word in ("-o", tmp_path / name)]
    done = clean(globe, *outputs)
    table, exact = read(tmp_path / "t.csv"), read(tmp_path / "t.parquet")
    assert table.columns.tolist() == exact.columns.tolist()
    assert table.verdict.tolist() == exact.verdict.tolist()
    np.testing.assert_allclose(table.lat, exact.lat, atol=1e-9)
    np.testing.assert_allclose(table.x, exact.x, atol=6e-5)
    features = json.loads((tmp_path / "t.geojson").read_text())["features"]
    lines = [f["geometry"] for f in features if f["geometry"]["type"].endswith("LineString")]
    places = [tuple(place[:2]) for line in lines for place in line["coordinates"]]
    assert len(places) == len(table)
    np.testing.assert_allclose(places, table[["lon", "lat"]], atol=1e-7)
    assert len(features) - len(lines) == len(table)
    gpx = gpxpy.parse((tmp_path / "t.gpx").read_text())
    points = [p for t in gpx.tracks for s in t.segments for p in s.points]
    assert len(points) == len(table)
    np.testing.assert_allclose([p.latitude for p in points], table.lat, atol=1e-7)
    assert all(str(tmp_path / name) in done.out for name in names)


def test_json_agrees_with_the_file(log, tmp_path):
    out = tmp_path / "out.csv"
    told = clean(log, "-o", out, "--json").json
    track = read(out)
    assert told["surefix"] == version("surefix")
    assert told["inputs"] == ["dive.csv"]
    assert told["outputs"] == [str(out)]
    assert told["fixes"] == len(track)
    counted = {word: total for word, total in told["verdicts"].items() if total}
    assert counted == track.verdict.value_counts().to_dict()
    assert (told["start"], told["end"]) == (track.time.min(), track.time.max())
    speed = np.hypot(track.vx, track.vy)
    assert told["speed_mps"]["clean"]["max"] == pytest.approx(speed.max(), abs=1e-3)
    assert told["settings"]["mode"] == "offline"
    assert told["settings"]["method"] == "multi-hypothesis"
    assert {n["quantity"] for n in told["noise"]} >= {"position", "height"}


def test_without_output_nothing_is_written(log):
    before = set(log.parent.iterdir())
    done = clean(log)
    assert "301 fixes" in done.out
    assert set(log.parent.iterdir()) == before


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("every", ["0.5s", "250ms", "2", "1min"])
def test_regular_times(log, tmp_path, mode, every):
    step = {"0.5s": 0.5, "250ms": 0.25, "2": 2.0, "1min": 60.0}[every]
    clean(log, "--every", every, "--mode", mode, "-o", tmp_path / "out.csv")
    track, fixes = read(tmp_path / "out.csv"), read(tmp_path / "out.fixes.csv")
    assert len(fixes) == 301
    assert "verdict" not in track.columns
    np.testing.assert_allclose(np.diff(track.time), step, atol=1e-6)
    assert (np.round(track.time / step, 6) % 1 == 0).all()
    assert track.time.iloc[0] - fixes.time.iloc[0] < step
    assert fixes.time.iloc[-1] - track.time.iloc[-1] < step
    plain = tmp_path / "plain.csv"
    clean(log, "--mode", mode, "-o", plain)
    np.testing.assert_allclose(fixes[["x", "y"]], read(plain)[["x", "y"]], atol=1e-3)
    between = np.abs(track.x - np.interp(track.time, fixes.time, fixes.x))
    assert between[track.time > fixes.time.iloc[20]].max() < 2.0


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("method", METHODS)
def test_every_mode_with_every_method(log, tmp_path, mode, method):
    out = tmp_path / "out.csv"
    told = clean(log, "--mode", mode, "--method", method, "-o", out, "--json").json
    track = read(out)
    assert (told["settings"]["mode"], told["settings"]["method"]) == (mode, method)
    assert len(track) == 301
    assert np.isfinite(track[["x", "y", "z", "vx", "vy", "vz", "sigma_x"]]).all().all()
    by_row = track.set_index("row")
    wild = by_row.loc[[40, 111]]
    if method == "kalman":
        assert (wild.verdict == "used").all()
    elif method == "huber":
        assert wild.weight.between(0.0, 0.2, inclusive="neither").all()
    else:
        assert (wild.weight < 0.1).all()


@pytest.mark.parametrize("model", ["cv", "ca"])
def test_motion_models(log, tmp_path, model):
    told = clean(log, "--model", model, "-o", tmp_path / "out.csv", "--json").json
    assert told["settings"]["model"] == model
    units = {n["unit"] for n in told["noise"] if n["sensor"] == "motion"}
    assert units == {"m/s^1.5" if model == "cv" else "m/s^2.5"}
    by_row = read(tmp_path / "out.csv").set_index("row")
    assert (by_row.verdict[[40, 111]] == "rejected").all()


def test_times_in_iso(log, tmp_path):
    clean(log, "--iso", "-o", tmp_path / "iso.csv", "-o", tmp_path / "iso.parquet")
    clean(log, "-o", tmp_path / "unix.csv")
    unix, iso = read(tmp_path / "unix.csv"), read(tmp_path / "iso.csv")
    assert iso.time.str.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z").all()
    seconds = (pd.to_datetime(iso.time) - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1)
    np.testing.assert_allclose(seconds, unix.time, atol=2e-6)
    assert str(read(tmp_path / "iso.parquet").time.dt.tz) == "UTC"
    pd.testing.assert_frame_equal(iso.drop(columns="time"), unix.drop(columns="time"))


def test_iso_times_and_synonyms_are_read(tmp_path):
    plain = geographic(survey(100), 60.0, 5.0)
    clean(write(tmp_path / "log.csv", plain), "-o", tmp_path / "a.csv")
    stamps = pd.to_datetime(plain["time"], unit="s").strftime("%Y-%m-%dT%H:%M:%SZ")
    others = {
        "Timestamp": stamps,
        "Latitude [deg]": plain["lat"],
        "LONGITUDE": plain["lon"],
        "Depth (m)": plain["depth"],
    }
    write(tmp_path / "log.csv", others)
    clean(tmp_path / "log.csv", "-o", tmp_path / "b.csv")
    pd.testing.assert_frame_equal(read(tmp_path / "a.csv"), read(tmp_path / "b.csv"))


@pytest.mark.parametrize(
    ("separator", "decimal"), [(";", "."), ("\t", "."), (";", ",")], ids=["semicolon", "tab", "de"]
)
def test_other_separators(log, tmp_path, separator, decimal):
    clean(log, "-o", tmp_path / "a.csv")
    other = tmp_path / "sub" / "dive.csv"
    other.parent.mkdir()
    read(log).to_csv(other, index=False, sep=separator, decimal=decimal)
    done = surefix("clean", other, "-o", tmp_path / "b.csv")
    if decimal == ",":  # a decimal comma is either understood or refused, never misread
        if done.code:
            told_in_one_line(done)
            return
        assert done.code == 0
        if read(tmp_path / "b.csv").x.isna().all():
            assert "input:" in done.out
            return
    assert done.code == 0
    pd.testing.assert_frame_equal(read(tmp_path / "a.csv"), read(tmp_path / "b.csv"))


def test_several_logs_are_one_track(tmp_path):
    log = pd.DataFrame(survey(200))
    log[::2].to_csv(tmp_path / "one.csv", index=False)
    log[1::2].to_csv(tmp_path / "two.csv", index=False)
    clean(tmp_path / "one.csv", tmp_path / "two.csv", "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.csv")
    np.testing.assert_allclose(track.time, log.time)
    assert track.sensor.tolist() == ["one", "two"] * 100
    assert track.row.tolist() == [i // 2 for i in range(200)]


def test_info_and_the_command_it_proposes(log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = surefix("info", "dive.csv")
    assert (done.code, done.err) == (0, "")
    assert "dive.csv" in done.out
    told = surefix("info", "dive.csv", "--json").json
    (stream,) = told["positions"]
    assert (stream["records"], stream["interval_s"]) == (301, 1.0)
    assert told["records"]["dive.csv"]
    words = told["command"].split()
    assert words[:3] == ["surefix", "clean", "dive.csv"]
    clean(*words[2:])
    assert (tmp_path / "dive.clean.csv").exists()
    assert (tmp_path / "dive.html").exists()


@pytest.mark.parametrize("command", ["clean", "info"])
def test_a_log_with_nothing_in_it(tmp_path, command):
    """A table without records, NMEA without a position or a series."""
    (tmp_path / "log.csv").write_text("time,x,y\n")
    (tmp_path / "log.nmea").write_text(sentence("GPZDA,120000,01,05,2024,00,00"))
    for name in ("log.csv", "log.nmea"):
        assert name in told_in_one_line(surefix(command, tmp_path / name))


def test_a_log_of_invalid_fixes_keeps_its_rows(tmp_path):
    """A receiver that never had a fix: every record is a row, and none is believed."""
    lines = [sentence(f"GPGGA,1200{i:02d},,,,,0,00,,,M,,M,,") for i in range(30)]
    (tmp_path / "log.nmea").write_text("".join(lines), newline="")
    done = surefix("clean", tmp_path / "log.nmea", "-o", tmp_path / "out.csv")
    if done.code:
        told_in_one_line(done)
        return
    track = read(tmp_path / "out.csv")
    assert len(track) == 30
    assert (track.verdict == "missing").all()
    assert track[["x", "y", "lat", "lon"]].isna().all().all()


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("mode", MODES)
def test_very_short_logs(tmp_path, n, mode):
    log = {name: values[:n] for name, values in survey(10).items()}
    write(tmp_path / "log.csv", log)
    clean(tmp_path / "log.csv", "--mode", mode, "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.csv")
    assert len(track) == n
    assert (track.verdict != "rejected").all()
    assert np.abs(track.x - log["x"]).max() < 1.5


def test_demo(tmp_path):
    done = surefix("demo", "-o", tmp_path / "demo")
    assert (done.code, done.err) == (0, "")
    names = {path.name for path in (tmp_path / "demo").iterdir()}
    assert {"usbl.csv", "depth.csv", "dvl.csv"} < names
    assert any(name.endswith(".html") for name in names)


def test_help_and_version_are_quick():
    """They must not wait for the compiled kernels to load."""
    code = (
        "import sys; sys.argv = ['surefix', '--help']\n"
        "from surefix.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numba', 'scipy', 'pyarrow', 'pyproj', 'numpy'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert {"clean", "info", "demo"} <= set(done.stdout.split())
    assert surefix("--version").out.strip() == version("surefix")


def test_a_closed_pipe_is_no_failure_to_report(log):
    """As in ``surefix clean log.csv --json | head -1``."""
    import os

    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = process("clean", log, "--json", capture_output=False, stdout=writing, stderr=-1)
    finally:
        os.close(writing)
    assert "Traceback" not in done.stderr
    assert "internal error" not in done.stderr
