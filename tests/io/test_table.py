from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from surefix.errors import InputError, ParseError
from surefix.io.table import from_frame, read_table
from surefix.types import Edit, Fixes, Log, Problem


def write(path: Path, text: str | bytes, name: str = "log.csv") -> Path:
    file = path / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


def read(file: Path, **options: object) -> Log:
    logs = list(read_table(file, **options))  # type: ignore[arg-type]
    assert len(logs) == 1
    return logs[0]


def fixes(log: Log) -> Fixes:
    assert log.fixes is not None
    return log.fixes


def problems(log: Log) -> dict[str, Problem]:
    return {problem.kind: problem for problem in log.problems}


@pytest.mark.parametrize(
    "text",
    [
        "time,x,y\n1,2.5,3\n2,4,5\n",
        "time,x,y\n1,2.5,3\n2,4,5",
        "\ufefftime,x,y\r\n1,2.5,3\r\n2,4,5\r\n",
        "time;x;y\n1;2,5;3\n2;4;5\n",
        "time\tx\ty\n1\t2.5\t3\n2\t4\t5\n",
        "time,x,y\r1,2.5,3\r2,4,5\r",
        "# by hand\n\n# twice\ntime,x,y\n1,2.5,3\n2,4,5\n",
        "# time,x,y\n1,2.5,3\n2,4,5\n",
        '"time","x","y"\n"1","2.5","3"\n"2","4","5"\n',
        "time,x,y\n1,2.5,3,\n2,4,5,\n",
        "time,x,y,\n1,2.5,3\n2,4,5\n",
        "time,x,y\n\n1, 2.5,+3\n\n2,4 ,5\n\n",
        "time,x,y\n1,2.5,3\n# pause\n2,4,5\n",
    ],
)
def test_the_same_table_in_many_hands(tmp_path: Path, text: str) -> None:
    log = read(write(tmp_path, text))
    assert_allclose(fixes(log).time, [1, 2])
    assert_allclose(fixes(log).position, [[2.5, 3, np.nan], [4, 5, np.nan]])
    assert fixes(log).row.tolist() == [0, 1]
    assert log.problems == ()
    assert log.counts == {"row": 2}


def test_missing_cells_are_no_problem(tmp_path: Path) -> None:
    cells = ["", "NaN", "--.--", "nan", "null", "NA", "-", "inf", "-inf", "N/A", " none "]
    text = "time,x,y\n" + "".join(f"{i},{cell},1\n" for i, cell in enumerate(cells))
    log = read(write(tmp_path, text))
    assert np.isnan(fixes(log).position[:, 0]).all()
    assert log.problems == ()


def test_unreadable_cells_are_counted_with_line_and_column(tmp_path: Path) -> None:
    log = read(write(tmp_path, "# c\ntime,x,y\n1,2,3\n2,oops,4\n3,0x1F,4\nlater,1,1\n"))
    assert_allclose(fixes(log).position[:, 0], [2, np.nan, np.nan, 1])
    assert_allclose(fixes(log).time, [1, 2, 3, np.nan])
    assert problems(log)["cell"].total == 3
    assert "line 6, time: later" in problems(log)["cell"].example


def test_records_with_a_wrong_number_of_fields_stay_as_missing(tmp_path: Path) -> None:
    log = read(write(tmp_path, "time,x,y\n1,2,3\n2,4\n3,5,6,7\nnoise\n5,6,7\n6"))
    assert_allclose(fixes(log).time, [1, 2, 3, np.nan, 5, np.nan])
    assert_allclose(fixes(log).position[:, 0], [2, np.nan, np.nan, np.nan, 6, np.nan])
    assert problems(log)["row"].total == 4
    assert problems(log)["row"].example == "line 3: 2,4"


def test_time_of_a_long_record_is_trusted_in_the_first_column_only(tmp_path: Path) -> None:
    log = read(write(tmp_path, "x,time,y\n1,2,3\n9,1,2,3\n"))
    assert_allclose(fixes(log).time, [2, np.nan])


def test_stray_quotes_and_bytes_lose_no_record(tmp_path: Path) -> None:
    text = b'time,x,y,note\n1,2,3,"open\n2,3,4,caf\xe9\n3,4,5,a"b\n4,5,6,"q,q"\n5,\0,7,\n'
    log = read(write(tmp_path, text))
    assert_allclose(fixes(log).time, [1, 2, 3, 4, 5])
    assert_allclose(fixes(log).position[:4, 0], [2, 3, 4, 5])


def test_binary_noise_in_the_middle_is_one_bad_record(tmp_path: Path) -> None:
    good = b"".join(b"%d,1,2\n" % i for i in range(60_000))
    text = b"time,x,y\n" + good + b"\0\1\2\xff" * 5 + b"\n60000,1,2\n"
    logs = list(read_table(write(tmp_path, text), chunk=1 << 16))
    assert sum(len(fixes(log).time) for log in logs) == 60_002
    assert sum(problem.total for log in logs for problem in log.problems) == 1
    assert fixes(logs[-1]).time[-1] == 60_000


def test_an_endless_line_is_capped(tmp_path: Path) -> None:
    text = b"time,x,y\n1,2,3\n" + b"z" * (40 << 20) + b"\n2,3,4\n"
    logs = list(read_table(write(tmp_path, text)))
    times = np.concatenate([fixes(log).time for log in logs])
    assert_allclose(times, [1, np.nan, 2])


def test_impossible_coordinates_and_longitudes_beyond_180(tmp_path: Path) -> None:
    text = "time,lat,lon,height\n1,91,10,5\n2,10,361,5\n3,10,350,5\n4,10,-180,5\n5,,10,5\n"
    log = read(write(tmp_path, text))
    assert np.isnan(fixes(log).position[:2]).all()
    assert_allclose(fixes(log).position[2], [10, -10, 5])
    assert_allclose(fixes(log).position[3], [10, -180, 5])
    assert_allclose(fixes(log).position[4], [np.nan, np.nan, 5])
    assert problems(log)["range"].total == 2
    assert "line 2: latitude 91" in problems(log)["range"].example


def test_impossible_sigmas_name_the_sensor(tmp_path: Path) -> None:
    text = "time,x,y,sensor,sigma\n1,0,0,usbl,2\n2,0,0,usbl,0\n3,0,0,gps,-1\n4,0,0,gps,inf\n"
    log = read(write(tmp_path, text))
    assert_allclose(fixes(log).sigma_position[:, 0], [2, np.nan, np.nan, np.nan])
    assert problems(log)["sigma"].total == 3
    assert "sensor usbl" in problems(log)["sigma"].example


def test_sensors_edits_and_validity(tmp_path: Path) -> None:
    text = (
        "time,x,y,sensor,edit,status\n"
        "1,0,0,a,accept,A\n2,0,0,b,Reject,V\n3,0,0,,,\n4,0,0,a,maybe,0\n"
    )
    log = read(write(tmp_path, text), sensor="usbl")
    assert log.sensors == ("a", "b", "usbl")
    assert fixes(log).sensor.tolist() == [0, 1, 2, 0]
    assert fixes(log).edit.tolist() == [Edit.ACCEPT, Edit.REJECT, Edit.NONE, Edit.NONE]
    assert fixes(log).valid.tolist() == [True, False, True, True]
    assert problems(log)["edit"].total == 1


def test_times_of_every_kind(tmp_path: Path) -> None:
    seconds = 1_699_643_598.720397
    texts = {
        "time": f"{seconds}",
        "time_ms": f"{seconds * 1e3}",
        "timestamp": "1699643598720397",
        "timestamp (ns)": "1699643598720397056",
        "utc": "2023-11-10T19:13:18.720397Z",
        "Time (UTC)": "2023-11-10 19:13:18.720397",
        "datetime": "2023-11-10T20:13:18.720397+01:00",
        "Timestamp": "2023/11/10 19:13:18.720397",
        "t": "20231110T191318.720397",
    }
    for name, cell in texts.items():
        log = read(write(tmp_path, f"{name},x\n{cell},1\n,2\n"))
        assert_allclose(fixes(log).time, [seconds, np.nan], atol=1e-6, rtol=0, err_msg=name)


def test_date_beside_a_time_of_day(tmp_path: Path) -> None:
    log = read(write(tmp_path, "Date;Time;x;y\n10.11.2023;19:13:18,5;1;2\n"))
    assert_allclose(fixes(log).time, [1_699_643_598.5])


def test_unit_of_time_is_decided_once(tmp_path: Path) -> None:
    text = "time,x\n" + "".join(f"{1_699_643_598_000 + i},{i}\n" for i in range(2000))
    logs = list(read_table(write(tmp_path, text), chunk=1000))
    times = np.concatenate([fixes(log).time for log in logs])
    assert_allclose(np.diff(times), 1e-3, atol=1e-6)


def test_chunks_are_the_whole(tmp_path: Path) -> None:
    lines = [f"{i},{i * 0.5},s{i // 400}" for i in range(1000)]
    lines[500] = "500"
    file = write(tmp_path, "time,x,sensor\n" + "\n".join(lines))
    whole = read(file)
    seen: list[int] = []
    parts = list(read_table(file, chunk=997, progress=seen.append))
    assert len(parts) > 5
    for field in ("time", "position", "sensor", "row"):
        joined = np.concatenate([getattr(fixes(part), field) for part in parts])
        assert_allclose(joined, getattr(fixes(whole), field))
    assert parts[-1].sensors == whole.sensors == ("s0", "s1", "fix", "s2")
    assert [p for part in parts for p in part.problems] == list(whole.problems)
    assert seen[-1] == file.stat().st_size


def test_gzip_whole_and_broken_off(tmp_path: Path) -> None:
    text = "time,x,y\n" + "".join(f"{i},{i * 17 % 1013},{i * 31 % 997}\n" for i in range(5000))
    packed = gzip.compress(text.encode())
    assert len(fixes(read(write(tmp_path, packed, "log.csv.gz"))).time) == 5000
    with pytest.raises(InputError, match="break off"):
        read(write(tmp_path, packed[: len(packed) // 2], "cut.csv.gz"))


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        ("", InputError, "is empty"),
        ("\n\n", InputError, "is empty"),
        ("# only\n", InputError, "comments only"),
        ("time,x,y\n", InputError, "no records"),
        (b"\x7fELF\0\0\0", InputError, "is binary"),
        ("time,x\n".encode("utf-16"), InputError, "UTF-16"),
        ("1,2,3\n4,5,6\n", ParseError, "no header"),
        ("2024-01-01T00:00:00,2,3\n", ParseError, "no header"),
        ("hello world\n", ParseError, "no separator"),
        ("time,x\n12:00:00,1\n", ParseError, "no time"),
    ],
)
def test_what_is_no_table(
    tmp_path: Path, text: str | bytes, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        list(read_table(write(tmp_path, text)))


def test_missing_file_and_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_table(tmp_path / "nothing.csv")
    with pytest.raises(InputError, match="directory"):
        read_table(tmp_path)
    with pytest.raises(InputError, match="not a sound Parquet file"):
        read_table(write(tmp_path, "time,x\n", "log.parquet"))


@pytest.mark.parametrize("role", ["depth", "heading"])
def test_single_series(tmp_path: Path, role: str) -> None:
    file = write(tmp_path, f"time,{role},valid\n1,-10,1\n2,20,0\n3,x,1\n")
    log = read(file, role=role, sensor="ctd")
    (channel,) = log.channels
    first = -10.0 if role == "depth" else 350.0
    assert_allclose(channel.value, [first, np.nan, np.nan])
    assert (log.fixes, channel.sensor) == (None, "ctd")


def test_velocity_has_no_position(tmp_path: Path) -> None:
    log = read(write(tmp_path, "time,ve,vn\n1,2,3\n"), role="velocity")
    assert np.isnan(fixes(log).position).all()
    assert_allclose(fixes(log).velocity, [[2, 3, np.nan]])


def test_parquet_and_nested_columns(tmp_path: Path) -> None:
    stamps = pa.array([1_000_000, None], pa.timestamp("us"))
    place = pa.array([{"lat": 1.0, "lon": 2.0}, {"lat": None, "lon": 3.0}])
    sensor = pa.array(["a", "b"]).dictionary_encode()
    pq.write_table(
        pa.table({"time": stamps, "gps": place, "sensor": sensor, "other": [1, 2]}),
        tmp_path / "log.parquet",
    )
    log = read(tmp_path / "log.parquet")
    assert_allclose(fixes(log).time, [1.0, np.nan])
    assert_allclose(fixes(log).position, [[1, 2, np.nan], [np.nan] * 3])
    assert log.sensors == ("a", "b")


def test_damaged_parquet_is_an_input_error(tmp_path: Path) -> None:
    file = tmp_path / "log.parquet"
    pq.write_table(pa.table({"time": np.arange(9999.0), "x": np.arange(9999.0) ** 1.5}), file)
    data = bytearray(file.read_bytes())
    data[4:4000] = bytes(3996)
    file.write_bytes(data)
    with pytest.raises(InputError, match="not a sound Parquet file"):
        list(read_table(file))


@pytest.mark.parametrize("make", [dict, pd.DataFrame, pl.DataFrame, pa.table])
def test_frames(make: type) -> None:
    log = from_frame(make({"time": [1.0, 2.0], "x": [3, 4], "depth": [5.0, float("nan")]}))
    assert_allclose(fixes(log).position, [[3, np.nan, -5], [4, np.nan, np.nan]])
    assert log.depth_positive_down


def test_frame_with_a_time_index() -> None:
    index = pd.DatetimeIndex(["2023-11-10T19:13:18.5Z"], name="time")
    log = from_frame(pd.DataFrame({"lat": [1.0], "lon": [2.0]}, index=index))
    assert_allclose(fixes(log).time, [1_699_643_598.5])


def test_frames_that_are_none() -> None:
    with pytest.raises(InputError, match="no table"):
        from_frame(3)
    with pytest.raises(InputError, match="no records"):
        from_frame({"time": [], "x": []})


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(body=st.binary(max_size=300))
def test_no_bytes_after_the_header_raise(tmp_path: Path, body: bytes) -> None:
    file = write(tmp_path, b"time,x,y\n0,1,2\n" * 30_000 + body + b"\n7,8,9\n")
    last = list(read_table(file, chunk=1 << 20))[-1]
    assert_allclose(fixes(last).position[-1, :2], [8, 9])


def test_mbari_usbl(data: Path) -> None:
    file = data / "usbl_mbari" / "oi_survey_1913_MINIROV_USBL_LATLONG.csv"
    with pytest.raises(ParseError, match="--column time=lcm_timestamp:us"):
        read_table(file)
    log = read(file, mapping={"time": "lcm_timestamp:us"})
    assert len(fixes(log).time) == 633
    assert_allclose(fixes(log).position[0], [36.75276, -122.056032, -544.9], atol=1e-6)
    assert_allclose(fixes(log).time[0], 1699643598.720397, rtol=0, atol=1e-6)


def test_mbari_depth(data: Path) -> None:
    file = data / "usbl_mbari" / "oi_survey_1913_COMPAS_DEPTH.csv"
    log = read(file, mapping={"time": "lcm_timestamp"}, role="depth")
    assert (len(log.channels[0].value), log.channels[0].value[0]) == (12733, 545.563)


def test_ugps_dive(data: Path) -> None:
    (file,) = (data / "usbl_ugps_dive").glob("*.csv")
    log = read(file, mapping={"depth": "-altitudeRelative"})
    assert fixes(log).geographic
    assert log.depth_positive_down
    assert_allclose(fixes(log).position[0], [47.6197509, -122.363182, -0.1])
    assert log.channels[0].name == "heading_deg"
    assert "cell" not in problems(log)


def test_ugps_raw(data: Path) -> None:
    (file,) = (data / "usbl_ugps_raw").glob("*acoustic.csv")
    log = read(file, chunk=1 << 24)
    assert (len(fixes(log).valid), int((~fixes(log).valid).sum())) == (7168, 2684)
    (file,) = (data / "usbl_ugps_raw").glob("*HDT.csv")
    assert read(file, role="heading").channels[0].value[0] == 53.9


def test_auv(data: Path) -> None:
    log = read(data / "auv_dvl" / "GT_trajectory1.csv")
    assert_allclose(fixes(log).position[0], [32.849794, 34.892238, -19.859909], atol=1e-5)
    assert_allclose(fixes(log).velocity[0], [-0.641182, -1.929191, -0.006672])
    forward = {"forward": "DVL X [m/s]", "starboard": "DVL Y [m/s]", "down": "DVL Z [m/s]"}
    log = read(data / "auv_dvl" / "DVL_trajectory1.csv", role="velocity", mapping=forward)
    assert [channel.name for channel in log.channels] == [
        "forward_mps",
        "starboard_mps",
        "down_mps",
    ]
