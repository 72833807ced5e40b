"""Acoustic logs and NMEA output on the command line."""

import math

import numpy as np
import pytest

from acceptance.product import clean, read, surefix, told_in_one_line
from acoustic_logs import HOME, dvl, line, mission, received, vehicle
from surefix import api
from surefix.geo.time import parse_time
from surefix.io.nmea_log import read_nmea
from surefix.io.nmea_sentence import LAYOUTS
from surefix.io.write_nmea import LONGEST

DAY = parse_time("2024-05-14")
START = 40_000.0
WILD = 31


@pytest.fixture
def dive(tmp_path):
    """Three minutes of a transponder below a turning ship; one sighting is 60 m off."""
    chance = np.random.default_rng(3)
    lines = []
    for text in mission(DAY, START, 180):
        if b",B01," not in text:
            lines.append(text)
            continue
        head, _, rest = text.partition(b",C,H,M,")
        x, y, depth, *tail = rest.partition(b"*")[0].decode().split(",")
        off = 60.0 * (sum(b",B01," in line for line in lines) == WILD)
        x, y = (float(value) + chance.normal(0, 0.75) for value in (x, y))
        place = f"C,H,M,{x + off:.3f},{y:.3f},{depth}"
        at, _, address = head.decode().partition("$")
        lines.append(at.encode() + line(",".join([address, place, *tail])))
    path = tmp_path / "dive.log"
    path.write_bytes(b"".join(lines))
    return path


def truth(times):
    return np.array([vehicle(t - DAY - START) for t in times])


def errors(rows):
    x, y, _ = HOME.to_local(rows["lat"], rows["lon"])
    return np.column_stack([x, y]) - truth(rows["time"])[:, :2]


@pytest.mark.parametrize("mode", ["realtime", "lagged", "offline"])
def test_a_transponder_is_cleaned_below_its_ship(dive, tmp_path, mode):
    told = clean(dive, "-o", tmp_path / "out.csv", "--mode", mode, "--json").json
    rows = read(tmp_path / "out.csv")
    assert set(rows["sensor"]) == {"dive B01"}
    assert rows["verdict"][WILD] == "rejected"
    assert (rows["verdict"] == "rejected").sum() <= 2
    assert np.sqrt(np.mean(errors(rows)[20:] ** 2)) < 0.6
    np.testing.assert_allclose(rows["depth"], truth(rows["time"])[:, 2], atol=1.0)
    assert {p["kind"] for p in told["problems"]} == {"other-target"}


def test_target_on_the_command_line(dive, tmp_path):
    clean(dive, "-o", tmp_path / "out.csv", "--target", "B02")
    assert set(read(tmp_path / "out.csv")["sensor"]) == {"dive B02"}
    wrong = surefix("clean", dive, "--target", "B09")
    assert "B01, B02, ship" in told_in_one_line(wrong)
    assert api.clean(dive, target="B02").sensors == ("dive B02",)
    named = surefix("info", dive, "--target", "B02")
    assert "--target B02" in named.out


def test_a_target_needs_an_acoustic_log(log):
    assert "acoustic" in told_in_one_line(surefix("clean", log, "--target", "B01"))


def test_a_dvl_beside_the_transponder(dive, tmp_path):
    """Body velocities of the vehicle, turned by its own heading, with the accuracy it declares."""
    east, north, heading = 0.5, 0.2, 130.0
    turn = math.radians(heading)
    ahead = east * math.sin(turn) + north * math.cos(turn)
    across = east * math.cos(turn) - north * math.sin(turn)
    chance = np.random.default_rng(5)
    lines = []
    for k in range(900):
        at = DAY + START + k / 5
        lines.append(received(line(f"HEHDT,{heading:.2f},T"), at))
        vx, vy = ahead + chance.normal(0, 0.004), across + chance.normal(0, 0.004)
        lines.append(dvl(at + 0.2, at, vx=vx, vy=vy, vz=0.1, fom=0.004))
    path = tmp_path / "auv.log"
    path.write_bytes(b"".join(lines))
    told = clean(
        dive, "--velocity", path, "--heading", path, "-o", tmp_path / "out.csv", "--json"
    ).json
    rows = read(tmp_path / "out.csv")
    np.testing.assert_allclose(rows["vx"], east, atol=0.005)
    np.testing.assert_allclose(rows["vy"], north, atol=0.005)
    noise = {(n["sensor"], n["quantity"]): (n["value"], n["source"]) for n in told["noise"]}
    # and that of the heading, 1°, across: mean of both axes
    turned = [math.hypot(0.004, math.radians(1.0) * speed) for speed in (east, north)]
    assert noise["auv DVL", "velocity"] == (pytest.approx(np.mean(turned), rel=0.01), "declared")
    assert not [name for name in told["outputs"] if "velocity_sigma" in name]


def test_nmea_output_of_a_cleaned_dive(dive, tmp_path):
    clean(dive, "-o", tmp_path / "out.nmea", "-o", tmp_path / "out.csv")
    rows = read(tmp_path / "out.csv")
    text = (tmp_path / "out.nmea").read_bytes()
    assert max(map(len, text.splitlines(keepends=True))) <= LONGEST
    assert {row[3:6].decode() for row in text.splitlines()} <= set(LAYOUTS)
    (log,) = read_nmea(tmp_path / "out.nmea")
    assert log.fixes is not None
    assert log.problems == ()
    np.testing.assert_allclose(log.fixes.time, rows["time"], atol=0.00501)
    np.testing.assert_allclose(log.fixes.position[:, 0], rows["lat"], atol=2e-8)
    np.testing.assert_allclose(log.fixes.position[:, 1], rows["lon"], atol=2e-8)
    np.testing.assert_array_equal(log.fixes.valid, rows["verdict"] != "rejected")
    np.testing.assert_allclose(log.fixes.sigma_position[:, 0], rows["sigma_x"], atol=6e-4)


def test_regular_nmea_output(dive, tmp_path):
    clean(dive, "-o", tmp_path / "out.nmea", "--every", "0.5s")
    (log,) = read_nmea(tmp_path / "out.nmea")
    assert log.fixes is not None
    np.testing.assert_allclose(np.diff(log.fixes.time), 0.5)
    assert log.fixes.valid.all()
    assert (tmp_path / "out.fixes.nmea").exists()
