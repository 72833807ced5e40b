"""Logs of real ships: positions, speeds, headings and depths, several receivers at once."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from acceptance.product import (
    clean,
    local,
    read,
    running_median,
    step_speeds,
    surefix,
    told_in_one_line,
)

YACHTS = (
    "irene_20140628_NMEA0000",
    "irene_flensburg_20130802_NMEA0005",
    "irene_flensburg_20130803_NMEA0004",
    "psaros33_20140822_NMEA0000",
)


def palmer(data: Path, name: str) -> Path:
    return data / "ship_palmer" / f"NBP1406_{name}-2014-08-01"


def series(out: Path, sensor: str, name: str) -> pd.DataFrame:
    """The cleaned series that lies beside an output."""
    (path,) = out.parent.glob(f"{out.stem}.*{sensor}.{name}{out.suffix}")
    return read(path)


@pytest.fixture(scope="module", params=YACHTS)
def yacht(request, data, tmp_path_factory):
    out = tmp_path_factory.mktemp("yacht") / "track.parquet"
    clean(data / "ship_yachts" / f"{request.param}.TXT", "-o", out)
    return out


def test_yacht_positions(yacht):
    track = read(yacht)
    good = track.verdict.isin(["used", "downweighted"])
    assert good.mean() > 0.9
    assert np.hypot(track.vx, track.vy).max() < 7.5
    # a receiver that finds a new solution is followed in one step; that must stay rare
    assert (step_speeds(track) > 7.5).mean() < 0.001
    assert (np.diff(track.time) >= 0).all()


def test_yacht_speed_is_finite_and_plausible(yacht):
    sog = series(yacht, "IIRMC", "speed_mps")
    assert np.isfinite(sog.speed_mps).all()
    assert sog.speed_mps.min() > -0.5
    assert sog.speed_mps.max() < 7.5
    assert np.abs(sog.rate).max() < 1.5


def test_yacht_depth_stays_among_what_was_measured(yacht):
    """Also where the sounder lost the bottom: there it is unknown, not somewhere else."""
    depth = series(yacht, "IIDPT", "depth_m")
    assert depth.depth_m[depth.verdict == "used"].notna().all()
    assert depth.depth_m.notna().mean() > 0.85
    assert depth.depth_m.min() > max(depth.raw.min() - 5.0, -0.5)
    assert depth.depth_m.max() < depth.raw.max() + 5.0
    assert np.abs(depth.raw - depth.depth_m).median() < 1.0


def test_yacht_depth_has_no_spikes(yacht):
    depth = series(yacht, "IIDPT", "depth_m").dropna(subset=["depth_m"])

    def spikes(name):
        value = depth[name].to_numpy()
        return (np.abs(value - running_median(value)) > 25.0).sum()

    assert spikes("depth_m") <= 4
    assert spikes("depth_m") <= 0.05 * spikes("raw")


def test_yacht_headings_stay_on_the_circle(yacht):
    for path in yacht.parent.glob("*heading*.parquet"):
        heading = read(path)
        name = heading.columns[1]
        value = heading[name].dropna()
        if len(heading) < 100:  # a talker that appears in a few damaged sentences
            continue
        assert value.between(0.0, 360.0, inclusive="left").all()
        used = heading[heading.verdict == "used"].dropna(subset=[name])
        off = (used.raw - used[name] + 180.0) % 360.0 - 180.0
        assert off.abs().quantile(0.99) < 20.0


def sounder(data: Path, name: str, tmp_path: Path) -> pd.DataFrame:
    """Time, raw and clean depth of one of the two echo sounders."""
    out = tmp_path / f"{name}.csv"
    if name == "mbdp":
        clean(palmer(data, name), "-o", out)
        return read(out).rename(columns={"depth_m": "clean"})
    lines = palmer(data, name).read_text().splitlines()
    records = [(line.split()[0], line.split(",")[1]) for line in lines]
    raw = pd.DataFrame(records, columns=["time", "depth"])
    raw.to_csv(tmp_path / "raw.csv", index=False)
    clean(tmp_path / "raw.csv", "--column", "z=-depth", "-o", out)
    track = read(out)
    return track.assign(raw=raw.depth.astype(float).to_numpy()[track.row], clean=-track.z)


@pytest.fixture(scope="module")
def sounders(data, tmp_path_factory):
    return {
        name: sounder(data, name, tmp_path_factory.mktemp("sounder")) for name in ("mbdp", "knud")
    }


@pytest.mark.parametrize(("name", "spikes"), [("mbdp", 700), ("knud", 500)])
def test_spikes_of_an_echo_sounder_are_gone(sounders, name, spikes):
    depth = sounders[name]
    off = np.abs(depth.raw - running_median(depth.raw.to_numpy()))
    assert (off > 100.0).sum() >= spikes
    assert np.isfinite(depth.clean).all()
    assert (np.abs(depth.clean - running_median(depth.clean.to_numpy())) > 100.0).sum() <= 1
    assert np.abs(depth.raw - depth.clean).median() < 20.0  # it is still the sea bed
    assert (depth.verdict[off > 400.0] == "rejected").mean() > 0.95


def test_two_echo_sounders_agree_when_cleaned(sounders):
    one, other = sounders["mbdp"], sounders["knud"]
    inside = one.time.between(other.time.min(), other.time.max())

    def disagree(column):
        at = np.interp(one.time[inside], other.time, other[column])
        return (np.abs(one[column][inside] - at) > 100.0).mean()

    assert disagree("raw") > 0.2
    assert disagree("clean") < 0.5 * disagree("raw")


@pytest.fixture(scope="module")
def bridge(data, tmp_path_factory):
    """Three receivers, the gyro and the sounder together."""
    out = tmp_path_factory.mktemp("bridge") / "track.parquet"
    logs = [palmer(data, name) for name in ("s330", "seap", "PCOD", "mbdp")]
    done = clean(*logs, "--heading", palmer(data, "gyr1"), "-o", out, "--json")
    return done.json, read(out), out


def test_receivers_are_one_track(bridge, data, tmp_path):
    told, track, _ = bridge
    assert told["fixes"] == len(track) == 625 + 715 + 1000
    assert track.sensor.nunique() == 3
    assert (np.diff(track.time) >= 0).all()
    assert np.hypot(track.vx, track.vy).between(2.0, 7.5).all()
    best = tmp_path / "best.parquet"
    clean(palmer(data, "s330"), "-o", best)
    alone = read(best)
    both = track[track.time.between(alone.time.iloc[0], alone.time.iloc[-1])]
    here = local(np.r_[alone.lat, both.lat].astype(float), np.r_[alone.lon, both.lon].astype(float))
    n = len(alone)
    at = [np.interp(both.time, alone.time, here[:n, axis]) for axis in (0, 1)]
    assert np.hypot(here[n:, 0] - at[0], here[n:, 1] - at[1]).max() < 3.0


def test_headings_and_depth_lie_beside_the_track(bridge):
    told, _, out = bridge
    names = {(c["sensor"].split()[-1], c["name"]) for c in told["channels"]}
    assert {("HEHDT", "heading_deg"), ("KIDPT", "depth_m"), ("INHDT", "heading_deg")} <= names
    gyro = series(out, "HEHDT", "heading_deg")
    assert len(gyro) == 5000
    assert np.abs(gyro.rate).max() < 5.0


def test_dates_of_1994_are_mended_and_flagged(data, tmp_path):
    out = tmp_path / "track.csv"
    done = clean(palmer(data, "PCOD"), "-o", out, "--iso", "--json")
    assert [e["kind"] for e in done.json["events"]].count("week-rollover") == 1
    times = pd.to_datetime(read(out).time)
    received = pd.Timestamp("2014-08-01T00:00:00", tz="UTC")
    assert times.min() > received - pd.Timedelta(seconds=5)
    assert times.max() < received + pd.Timedelta(minutes=17)
    assert (times.diff().dropna() >= pd.Timedelta(0)).all()


def test_sentences_without_checksum_only_when_asked(data, tmp_path):
    log, out = palmer(data, "gp02"), tmp_path / "track.csv"
    line = told_in_one_line(surefix("clean", log, "-o", out))
    assert all(word in line for word in ("5000 × no-checksum", "--no-checksum"))
    assert not out.exists()
    done = clean(log, "--no-checksum", "-o", out, "--json").json
    assert done["fixes"] == len(read(out)) == 1667
    assert done["speed_mps"]["clean"]["max"] < 7.5


def test_a_deep_sea_sounder_is_not_the_depth_of_the_ship(data, tmp_path):
    """Given as the depth sensor it must not pull the ship 4 km down without a word."""
    out = tmp_path / "track.parquet"
    done = surefix(
        "clean", palmer(data, "s330"), "--depth", palmer(data, "mbdp"), "-o", out, "--json"
    )
    if done.code == 0:
        text = " ".join(event["text"] for event in done.json["events"])
        assert "depth sensor" in text
        assert np.isfinite(read(out)[["x", "y"]]).all().all()
        assert (read(out).verdict == "used").mean() > 0.5
    else:
        assert done.code == 1
        assert done.err.count("\n") == 1
