"""Acoustic logs of real dives: the wild fixes go, the track stays."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from acceptance.product import clean, local, off_the_line, read, step_speeds, surefix

FOLDER = "usbl_mbari"
SURVEY, PRESSURE = "oi_survey_1913_MINIROV_USBL_LATLONG.csv", "oi_survey_1913_COMPAS_DEPTH.csv"
EARLIER = "oi_survey_1648_USBL_WINFROG.csv", "oi_survey_1648_DEPTH_KEARFOTT_COMPAS.csv"
MODES = ("realtime", "lagged", "offline")
METHODS = ("igg3", "multi-hypothesis")


def cleaned(folder: Path, fixes: str, depth: str, out: Path, *words: object) -> pd.DataFrame:
    logs = folder / fixes, "--depth", folder / depth
    clean(*logs, "--column", "time=lcm_timestamp:us", "-o", out, *words)
    return read(out)


@pytest.fixture(scope="module", params=list(product(MODES, METHODS)), ids="-".join)
def survey(request, data, tmp_path_factory):
    """The mode, the raw log and the clean track of the survey with bursts of wild fixes."""
    mode, method = request.param
    raw = pd.read_csv(data / FOLDER / SURVEY)
    out = tmp_path_factory.mktemp("survey") / "track.csv"
    words = ("--mode", mode, "--method", method)
    track = cleaned(data / FOLDER, SURVEY, PRESSURE, out, *words)
    track.attrs["method"] = method
    return mode, raw, track


def test_one_row_per_fix(survey):
    _, raw, track = survey
    assert len(track) == len(raw) == 633
    np.testing.assert_allclose(track.time, raw.lcm_timestamp / 1e6, rtol=0, atol=2e-6)


def test_no_fix_far_from_the_local_line_is_believed(survey):
    """From the past alone as well as from the whole log."""
    _, raw, track = survey
    place = local(raw.latitude.to_numpy(), raw.longitude.to_numpy())
    far = off_the_line(raw.lcm_timestamp.to_numpy() / 1e6, place) > 8.0
    assert far.sum() >= 15
    believed = far & (track.verdict != "rejected") & (track.weight >= 0.1)
    assert not believed.any()
    near = off_the_line(raw.lcm_timestamp.to_numpy() / 1e6, place) < 2.0
    few = 0.01 if track.attrs["method"] == "igg3" else 0.03  # the noise has heavy tails
    assert (track.verdict[near] == "rejected").mean() < few


def test_the_clean_track_is_never_faster_than_an_rov(survey):
    mode, raw, track = survey
    place = local(raw.latitude.to_numpy(), raw.longitude.to_numpy())
    steps = np.hypot(*np.diff(place, axis=0).T) / np.diff(raw.lcm_timestamp / 1e6)
    assert steps.max() == pytest.approx(19.0, abs=0.5)
    assert np.hypot(track.vx, track.vy).max() <= 1.5
    if mode == "realtime":  # its positions also step where it learns that it was wrong
        assert step_speeds(track).max() <= 3.0
    else:
        assert step_speeds(track).max() <= 1.5


def test_height_follows_the_pressure(data, survey):
    mode, raw, track = survey
    pressure = pd.read_csv(data / FOLDER / PRESSURE)
    at = np.interp(track.time, pressure.lcm_timestamp / 1e6, pressure.depth)
    before = -raw.altitude - at
    sigma = 1.4826 * np.median(np.abs(before - before.median()))
    assert sigma == pytest.approx(0.38, abs=0.01)
    after = -track.height - at
    rmse = np.sqrt(np.mean((after - after.median()) ** 2))
    assert rmse < sigma
    assert rmse < 0.06, mode  # the pressure is ten times better than the USBL
    assert abs(after.median()) < 0.05  # and it is the pressure's level that the track takes


def test_the_future_helps(data, tmp_path):
    """Offline is surer than real time of nearly every fix, and never much less."""
    surer = cleaned(data / FOLDER, SURVEY, PRESSURE, tmp_path / "offline.csv")
    fast = cleaned(data / FOLDER, SURVEY, PRESSURE, tmp_path / "now.csv", "--mode", "realtime")
    ratio = (surer.sigma_x / fast.sigma_x)[30:-30]
    assert ratio.median() < 0.8
    assert (ratio < 1.0).mean() > 0.95


def test_a_clean_survey_stays_whole(data, tmp_path):
    track = cleaned(data / FOLDER, *EARLIER, tmp_path / "track.csv")
    assert len(track) == 396
    assert (track.verdict == "rejected").mean() < 0.04
    assert np.hypot(track.vx, track.vy).max() <= 1.5


def test_fixes_left_out_tell_which_method_follows_wild_ones(data, tmp_path):
    told = tmp_path / "told.json"
    words = ("--methods", "kalman,igg3", "--folds", 2, "--jobs", 1, "--json", told)
    log = data / FOLDER / SURVEY
    done = surefix("compare", "--log", log, "--column", "time=lcm_timestamp:us", *words)
    assert done.code == 0, done.err
    held = json.loads(told.read_text(encoding="utf-8"))["tables"]
    for kalman, igg3 in held["score_nats-offline"].values():
        assert kalman < igg3
    ((kalman, igg3),) = held["fastest_mps-offline"].values()
    assert igg3 < 1.5 < kalman


@pytest.fixture(scope="module")
def dive(data, tmp_path_factory):
    (path,) = (data / "usbl_ugps_dive").glob("*.csv")
    out = tmp_path_factory.mktemp("dive") / "track.csv"
    clean(path, "-o", out)
    return pd.read_csv(path, na_values="--.--"), read(out)


def test_every_jump_of_the_dive_is_rejected(dive):
    """Steps of more than 15 m, and what comes back from them, up to 5 m off."""
    raw, track = dive
    place = local(raw["gps.lat"].to_numpy(), raw["gps.lon"].to_numpy())
    landed = np.flatnonzero(np.hypot(*np.diff(place, axis=0).T) > 15.0) + 1
    elapsed = (track.time - track.time[0]).to_numpy()
    assert np.round(elapsed[landed - 1]).tolist() == [705, 706, 1796, 1984, 1985]
    wild = np.hypot(*(place - track[["x", "y"]].to_numpy() - _shift(place, track)).T) > 5.0
    assert wild[landed].all()
    fresh = track.verdict != "duplicate"
    assert (track.verdict[landed] == "rejected").all()
    assert (track.verdict[wild & fresh] == "rejected").all()
    assert wild[fresh].sum() < 60


def _shift(place, track):
    return np.nanmedian(place - track[["x", "y"]].to_numpy(), axis=0)


def test_the_dive_is_never_faster_than_its_vehicle(dive):
    _, track = dive
    assert np.hypot(track.vx, track.vy).max() <= 2.0
    assert step_speeds(track).max() <= 2.0


def test_a_polled_fix_counts_once(dive):
    raw, track = dive
    place = raw[["gps.lat", "gps.lon"]].to_numpy()
    fresh = np.r_[True, (np.diff(place, axis=0) != 0).any(axis=1)]
    assert (len(raw), fresh.sum()) == (2594, 1536)
    assert (track.verdict != "duplicate").sum() == 1536
    assert ((track.verdict == "duplicate") == ~fresh).all()
    assert (track.weight[~fresh] == 0.0).all()
