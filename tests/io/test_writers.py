from __future__ import annotations

import json
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import gpxpy
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose

from surefix.errors import OutputError
from surefix.io.atomic import replacing
from surefix.io.table import read_table
from surefix.io.write_csv import escaped
from surefix.io.writers import SUFFIXES, TrackWriter, resampled_writer, track_writer, write_channel
from surefix.types import CleanedChannel, Reason, Track, Verdict, Verdicts

FIXED = "time,x,y,z,vx,vy,vz,sigma_x,sigma_y,sigma_z,verdict,weight,innovation_sigma,reason"
T0 = 1_699_643_598.720397


def write_track(path, track, **form):
    with resampled_writer(path, geographic=track.geodetic is not None, **form) as write:
        write(track)


def track(n: int, lon: float = -122.0, start: int = 0) -> Track:
    k = np.arange(start, start + n)
    position = np.c_[k * 1.00004, -k, np.full(n, np.nan)]
    geodetic = np.c_[36 + k * 1e-5, (lon + k * 1e-5 + 180) % 360 - 180, -500.0 - k]
    return Track(
        T0 + k, position, np.ones((n, 3)), np.full((n, 3), 2e-5), np.ones((n, 3)), geodetic
    )


def verdicts(n: int) -> Verdicts:
    reason = np.full(n, Reason.AGREES)
    verdict = np.full(n, Verdict.USED)
    sigma = np.full(n, 0.5)
    reason[1::3], verdict[1::3], sigma[1::3] = Reason.OFF, Verdict.REJECTED, 9.25
    reason[2::3], verdict[2::3] = Reason.OFF, Verdict.DOWNWEIGHTED
    return Verdicts(
        verdict, np.ones(n), sigma, np.zeros((n, 3)), reason, np.zeros(n), np.full((n, 3), 2.0)
    )


def put(writer: TrackWriter, n: int, start: int = 0, **lon: float) -> None:
    made = track(n, start=start, **lon)
    assert made.geodetic is not None
    raw = made.geodetic + 1e-4
    raw[0] = np.nan
    writer.write(
        made,
        verdicts(n),
        sensors=("usbl", "=gps"),
        sensor=np.arange(n) % 2,
        row=np.arange(start, start + n),
        coordinates=raw,
    )


def interrupted(file: Path, error: type[BaseException]) -> None:
    with track_writer(file, geographic=True) as writer:
        put(writer, 3)
        raise error


def test_csv_columns_and_decimals(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    with track_writer(file, geographic=True, has_depth=True) as writer:
        put(writer, 3)
        put(writer, 2, start=3)
    lines = file.read_text().splitlines()
    assert lines[0] == f"{FIXED},lat,lon,depth,sensor,row"
    assert lines[1] == (
        '1699643598.720397,0,0,,1,1,1,0.00002,0.00002,0.00002,"used",1,0.5,"agrees",'
        '36,-122,500,"usbl",0'
    )
    assert lines[2].startswith("1699643599.720397,1,-1,,")
    assert '"rejected",1,9.25,"9.2 σ off",36.00001,-121.99999,501,"\'=gps",1' in lines[2]
    assert '"0.5 σ off, weight 1.00"' in lines[3]
    assert len(lines) == 6


@pytest.mark.parametrize(
    ("geographic", "has_depth", "more"),
    [
        (False, False, ["sensor", "row"]),
        (False, True, ["sensor", "row"]),
        (True, False, ["lat", "lon", "height", "sensor", "row"]),
    ],
)
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_columns_follow_the_input(
    tmp_path: Path, suffix: str, geographic: bool, has_depth: bool, more: list[str]
) -> None:
    file = tmp_path / f"out{suffix}"
    with track_writer(file, geographic=geographic, has_depth=has_depth):
        pass  # even a log without any fix has its header
    found = pd.read_csv(file) if suffix == ".csv" else pq.read_table(file).to_pandas()
    assert list(found.columns) == [*FIXED.split(","), *more]
    assert len(found) == 0


def test_parquet_keeps_full_precision(tmp_path: Path) -> None:
    file = tmp_path / "out.parquet"
    with track_writer(file, geographic=True) as writer:
        put(writer, 4)
        put(writer, 4, start=4)
    found = pq.read_table(file)
    assert found["x"].to_pylist() == (np.arange(8) * 1.00004).tolist()
    assert found["z"].null_count == 8
    assert found["verdict"].to_pylist()[:3] == ["used", "rejected", "downweighted"]
    assert found["time"].to_pylist() == (T0 + np.arange(8)).tolist()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_what_is_written_can_be_read(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"out{suffix}"
    for iso in (False, True):
        with track_writer(file, geographic=True, has_depth=True, iso=iso) as writer:
            put(writer, 5)
        (log,) = read_table(file)
        assert log.fixes is not None
        assert log.depth_positive_down
        assert_allclose(log.fixes.time, T0 + np.arange(5), rtol=0, atol=1e-6)
        assert_allclose(log.fixes.position, track(5).geodetic, atol=1e-9)
        assert_allclose(log.fixes.sigma_position, 2e-5)
        assert log.problems == ()


def test_iso_times(tmp_path: Path) -> None:
    with track_writer(tmp_path / "out.csv", geographic=False, iso=True) as writer:
        put(writer, 1)
    assert '"2023-11-10T19:13:18.720397Z"' in (tmp_path / "out.csv").read_text()
    with track_writer(tmp_path / "out.parquet", geographic=False, iso=True) as writer:
        put(writer, 1)
    kind = pq.read_schema(tmp_path / "out.parquet").field("time").type
    assert kind == pa.timestamp("us", tz="UTC")


def test_formulas_are_escaped_and_numbers_are_not(tmp_path: Path) -> None:
    cells = ["=HYPERLINK(1)", "+1", "-1", "@a", "usbl", "a=b", "two\nlines", None]
    expected = ["'=HYPERLINK(1)", "'+1", "'-1", "'@a", "usbl", "a=b", "two lines", None]
    assert escaped(pa.chunked_array([cells])).to_pylist() == expected
    with track_writer(tmp_path / "out.csv", geographic=False) as writer:
        put(writer, 3)
    assert ",-1," in (tmp_path / "out.csv").read_text()


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OSError])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_nothing_is_left_of_an_interrupted_file(
    tmp_path: Path, suffix: str, error: type[BaseException]
) -> None:
    file = tmp_path / f"out{suffix}"
    file.write_text("before")
    with pytest.raises(error):
        interrupted(file, error)
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


def test_the_old_file_stands_until_the_new_one_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    file.write_text("before")
    with replacing(file) as out:
        out.write(b"after")
        assert file.read_text() == "before"
    assert file.read_text() == "after"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_full_disk_is_an_output_error(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("surefix.io.atomic.io.FileIO", lambda *_: open("/dev/full", "wb", 0))  # noqa: PTH123, SIM115
    with (
        pytest.raises(OutputError, match="No space left"),
        track_writer(tmp_path / f"out{suffix}", geographic=True) as writer,
    ):
        put(writer, 20_000)
    assert list(tmp_path.iterdir()) == []


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "dir.csv").mkdir()
    for place, said in [("dir.csv", "directory"), ("none/out.csv", "No such file")]:
        with (
            pytest.raises(OutputError, match=said),
            track_writer(tmp_path / place, geographic=True),
        ):
            pass


def test_suffixes(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match=r"\.csv, \.parquet, \.geojson, \.gpx"),
        track_writer(tmp_path / "out.xlsx", geographic=True),
    ):
        pass
    for suffix in (".geojson", ".gpx"):
        with (
            pytest.raises(OutputError, match=r"write \.csv or \.parquet"),
            track_writer(tmp_path / f"out{suffix}", geographic=False),
        ):
            pass


def test_geojson(tmp_path: Path) -> None:
    file = tmp_path / "out.geojson"
    with track_writer(file, geographic=True, has_depth=True) as writer:
        put(writer, 3)
        put(writer, 3, start=3)
    *points, line = json.loads(file.read_text())["features"]
    assert line["geometry"]["type"] == "LineString"
    assert line["geometry"]["coordinates"][1] == [-121.99999, 36.00001, -501.0]
    assert len(line["geometry"]["coordinates"]) == len(points) == 6
    assert points[0]["geometry"] is None
    assert points[1]["geometry"]["coordinates"] == [-121.99989, 36.00011, -500.9999]
    properties = points[1]["properties"]
    assert properties["reason"] == "9.2 σ off"
    assert (properties["verdict"], properties["depth"], properties["row"]) == ("rejected", 501, 1)


@pytest.mark.parametrize("lon", [179.99998, -179.99998])
def test_geojson_is_cut_at_the_antimeridian(tmp_path: Path, lon: float) -> None:
    file = tmp_path / "out.geojson"
    made = track(6, lon=179.999975)
    if lon < 0:
        made = Track(made.time, *(values[::-1] for values in made[1:]))  # type: ignore[index]
    write_track(file, made)
    (line,) = json.loads(file.read_text())["features"]
    parts = line["geometry"]["coordinates"]
    assert line["geometry"]["type"] == "MultiLineString"
    assert [len(part) for part in parts] == [4, 4]
    assert parts[0][-1][0] == -parts[1][0][0] == (180.0 if lon > 0 else -180.0)
    assert all(abs(b[0] - a[0]) < 1 for part in parts for a, b in pairwise(part))
    assert parts[0][-1][1] == pytest.approx(36.000025, abs=1e-9)


def test_geojson_of_nothing(tmp_path: Path) -> None:
    with track_writer(tmp_path / "out.geojson", geographic=True):
        pass
    assert json.loads((tmp_path / "out.geojson").read_text())["features"] == []


def test_gpx(tmp_path: Path) -> None:
    file = tmp_path / "out.gpx"
    with track_writer(file, geographic=True) as writer:
        put(writer, 6)
    found = gpxpy.parse(file.read_text())
    (segment,) = found.tracks[0].segments
    assert (len(segment.points), segment.points[1].elevation) == (6, -501.0)
    assert segment.points[0].time.timestamp() == pytest.approx(T0, abs=1e-3)
    assert [(w.name, w.description) for w in found.waypoints] == [("rejected", "9.2 σ off")] * 2
    assert found.waypoints[0].latitude == 36.00011


@pytest.mark.skipif(shutil.which("ogrinfo") is None, reason="ogrinfo (gdal-bin) is not installed")
@pytest.mark.parametrize("suffix", [".geojson", ".gpx"])
def test_another_program_reads_it(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"out{suffix}"
    with track_writer(file, geographic=True) as writer:
        put(writer, 6)
    told = subprocess.run(
        ["ogrinfo", "-ro", "-al", "-so", str(file)], capture_output=True, text=True, check=True
    )
    assert "ERROR" not in told.stdout + told.stderr
    assert f"Feature Count: {7 if suffix == '.geojson' else 6}" in told.stdout


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_resampled_track(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"out{suffix}"
    write_track(file, track(4), has_depth=True)
    if suffix == ".csv":
        header = file.read_text().splitlines()[0]
        assert header == "time,x,y,z,vx,vy,vz,sigma_x,sigma_y,sigma_z,lat,lon,depth"
    assert file.stat().st_size > 0


def test_channel(tmp_path: Path) -> None:
    values = np.array([10.0, 20.0, 30.0])
    channel = CleanedChannel(
        "depth_m", "ctd", T0 + np.arange(3), values, values, values, values, 0.0, verdicts(3), ()
    )
    write_channel(tmp_path / "out.csv", channel)
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert lines[0] == "time,depth_m,raw,rate,sigma,verdict,weight,innovation_sigma,reason"
    assert lines[1] == '1699643598.720397,10,10,10,10,"used",1,0.5,"agrees"'
    write_channel(tmp_path / "out.parquet", channel)
    assert pq.read_table(tmp_path / "out.parquet")["depth_m"].to_pylist() == [10, 20, 30]
    with pytest.raises(OutputError, match=r"\.csv, \.parquet;"):
        write_channel(tmp_path / "out.gpx", channel)
