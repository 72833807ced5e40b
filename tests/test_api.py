"""The library gives what the command line gives, from files and from tables; neither changes."""

import hashlib
from importlib.metadata import version

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import surefix as sf
from acceptance.product import FIXED, clean, geographic, read, surefix, survey, write
from surefix import Cleaned, CleanOptions, Verdict, to_table

MODES = ("realtime", "lagged", "offline")


@pytest.fixture
def log():
    """Fixes with wild ones, a missing one and a gap, on the globe."""
    columns = pd.DataFrame(geographic(survey(300), -17.0, 179.999))
    columns.loc[[40, 41, 111, 203], "lat"] += 5e-4
    columns.loc[77, ["lat", "lon", "depth"]] = np.nan
    return columns.drop(index=range(130, 140)).reset_index(drop=True)


def rows(cleaned: Cleaned) -> pd.DataFrame:
    return to_table(cleaned).to_pandas()


@pytest.mark.parametrize("mode", MODES)
def test_library_and_command_line_agree_to_the_last_bit(log, tmp_path, mode):
    path = write(tmp_path / "dive.csv", log)
    clean(path, "--mode", mode, "-o", tmp_path / "out.parquet")
    wanted = read(tmp_path / "out.parquet")
    options = CleanOptions(mode=mode)
    found = rows(sf.clean(path, options=options))
    pd.testing.assert_frame_equal(found, wanted, check_exact=True)
    assert found.columns.tolist() == [*FIXED, "lat", "lon", "depth", "sensor", "row"]
    table = rows(sf.clean(pd.read_csv(path), options=options))
    numbers = wanted.columns.drop("sensor")
    pd.testing.assert_frame_equal(table[numbers], wanted[numbers], check_exact=True)


def test_library_and_command_line_agree_on_supported_logs(tmp_path):
    log = survey(200)
    depth = {"time": log["time"] + 0.3, "depth": -log["z"]}
    fixes = write(tmp_path / "usbl.csv", log)
    aided = write(tmp_path / "pressure.csv", depth)
    clean(fixes, "--depth", aided, "--method", "student-t", "-o", tmp_path / "out.parquet")
    found = sf.clean(fixes, depth=aided, options=CleanOptions(method="student-t"))
    pd.testing.assert_frame_equal(rows(found), read(tmp_path / "out.parquet"), check_exact=True)
    from_tables = sf.clean(log, depth=depth, options=CleanOptions(method="student-t"))
    np.testing.assert_array_equal(from_tables.track.position, found.track.position)


@pytest.mark.parametrize("mode", MODES)
def test_every_kind_of_table_gives_the_same(log, mode):
    options = CleanOptions(mode=mode)
    wanted = rows(sf.clean(log, options=options))
    kinds = {
        "polars": pl.from_pandas(log),
        "arrow": pa.Table.from_pandas(log),
        "mapping": {name: log[name].to_numpy() for name in log},
        "lists": {name: log[name].tolist() for name in log},
        "index": log.set_index("time"),
    }
    for kind, table in kinds.items():
        found = rows(sf.clean(table, options=options))
        pd.testing.assert_frame_equal(found, wanted, check_exact=True, obj=kind)


def test_times_of_every_kind(log):
    wanted = sf.clean(log).track
    stamps = pd.to_datetime(log["time"], unit="s")
    for times in (stamps, stamps.dt.tz_localize("UTC"), stamps.dt.strftime("%Y-%m-%dT%H:%M:%SZ")):
        found = sf.clean(log.assign(time=times)).track
        np.testing.assert_allclose(found.time, wanted.time, atol=1e-6)
        np.testing.assert_allclose(found.position, wanted.position, atol=1e-6)


def checksum(table) -> str:
    parts = [table[name].tobytes() for name in table]
    return hashlib.sha256(b"".join(parts)).hexdigest()


@pytest.mark.parametrize("mode", MODES)
def test_inputs_are_not_modified(log, mode):
    """Nor are they kept: arrays that cannot be written to are as good."""
    fixes = {name: log[name].to_numpy().copy() for name in log}
    depth = {"time": fixes["time"] + 0.4, "depth": fixes["depth"].copy()}
    depth["depth"][5] = np.nan
    n = len(log)
    speed = {"time": fixes["time"].copy(), "ve": np.ones(n), "vn": np.full(n, 0.3)}
    heading = {"time": fixes["time"].copy(), "heading": np.full(n, 359.0)}
    tables = fixes, depth, speed, heading
    for table in tables:
        for values in table.values():
            values.flags.writeable = False
    before = [checksum(table) for table in tables]
    cleaned = sf.clean(
        fixes, depth=depth, velocity=speed, heading=heading, options=CleanOptions(mode=mode)
    )
    assert [checksum(table) for table in tables] == before
    kept = cleaned.raw_coordinates.copy()
    cleaned.track.position[:] = 0.0
    cleaned.raw_position[:] = 0.0
    assert [checksum(table) for table in tables] == before
    np.testing.assert_array_equal(cleaned.raw_coordinates, kept)
    frame = log.copy(deep=True)
    sf.clean(frame)
    pd.testing.assert_frame_equal(frame, log)


def test_the_same_again_is_the_same(log):
    first, second = sf.clean(log), sf.clean(log)
    pd.testing.assert_frame_equal(rows(first), rows(second), check_exact=True)


def test_result_in_hand(log):
    cleaned = sf.clean(log)
    n = len(log)
    assert cleaned.track.position.shape == cleaned.raw_position.shape == (n, 3)
    assert cleaned.track.geodetic.shape == (n, 3)
    assert cleaned.verdicts.standardised.shape == (n, 3)
    wild = cleaned.verdicts.verdict[[40, 41, 111]]
    assert (wild == Verdict.REJECTED).all()
    assert cleaned.verdicts.verdict[77] == Verdict.MISSING
    assert cleaned.has_depth
    assert cleaned.settings["mode"] == "offline"


@pytest.mark.parametrize(
    ("data", "error"),
    [
        ("nowhere.csv", sf.InputError),
        (["nowhere.csv"], sf.InputError),
        ([], sf.SurefixError),
        ({}, sf.SurefixError),
        ({"time": [0.0, 1.0]}, sf.InputError),
        ({"x": [0.0, 1.0]}, sf.InputError),
        ({"time": [0.0, 1.0], "x": [0.0]}, sf.SurefixError),
        (7, sf.SurefixError),
        (None, sf.SurefixError),
    ],
)
def test_what_is_no_log_is_an_error_of_ours(data, error):
    with pytest.raises(error):
        sf.clean(data)


@pytest.mark.parametrize(
    "wrong",
    [
        {"mode": "fast"},
        {"method": ""},
        {"sigma_position": 0.0},
        {"sigma_position": -1.0},
        {"sigma_height": float("nan")},
        {"process": float("inf")},
        {"sensor_sigma": {"usbl": 0.0}},
        {"sensor_sigma": {"usbl": float("inf")}},
        {"sensor_delay_s": {"usbl": float("nan")}},
        {"k0": 3.0, "k1": 2.0},
        {"reorder_s": -1.0},
        {"reorder_s": float("inf")},
        {"false_alarm": 0.0},
        {"false_alarm": 2.0},
        {"every_s": -1.0},
        {"recovery_s": 0.0},
        {"lag_s": True},
    ],
    ids=str,
)
def test_options_are_checked_when_they_are_made(wrong):
    with pytest.raises(sf.OptionsError):
        CleanOptions(**wrong)


def test_columns_say_what_a_table_means():
    log = survey(50)
    named = {"stamp": log["time"] * 1e3, "e": log["x"], "n": log["y"], "d": -log["z"]}
    columns = {"time": "stamp:ms", "x": "e", "y": "n", "depth": "d"}
    found, wanted = sf.clean(named, columns=columns), sf.clean(log)
    np.testing.assert_allclose(found.track.position, wanted.track.position, atol=1e-9)
    assert surefix("--version").code == 0


def test_the_result_names_the_versions_it_was_made_with():
    settings = sf.clean({"time": [0, 1, 2], "x": [0.0, 1.0, 2.0]}).settings
    assert settings["surefix"] == version("surefix")
    assert settings["numpy"] == np.__version__
    assert {"python", "numba", "scipy"} <= set(settings)
