"""A dive with every instrument on a line of its own: live it is what `clean` says of the logs."""

import asyncio
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from service.dives import DAY, START, Dive
from service.test_station import table
from surefix.cli import app
from surefix.errors import OptionsError
from surefix.pipelines.clean import clean_sources
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.joining import join
from surefix.pipelines.options import CleanOptions
from surefix.service.addresses import Address
from surefix.service.live import begin_live, run_live
from surefix.service.options import InputOptions, LiveOptions, read_live
from surefix.service.station import begin_station, latest, receive, resumed, stored
from surefix.types import Reason

CLEAN = CleanOptions(mode="realtime", settle_rows=80, reorder_s=2.0)
ROLES = {
    "usbl": "fixes", "gnss": "ship", "gyro": "ship", "depth": "depth", "compass": "heading",
    "dvl": "velocity",
}  # fmt: skip


def options(names=tuple(ROLES), kind="udp", clean=CLEAN, **roles):
    inputs = [
        InputOptions(
            name=name,
            address=Address(kind),
            role={**ROLES, **roles}[name],
            target="B01" if name == "usbl" else None,
        )
        for name in names
    ]
    return LiveOptions(clean=clean, inputs=tuple(inputs))


def live_of(dive, names=tuple(ROLES), kind="udp", delay=None, seed=0, every=0, clean=CLEAN):
    """What a service says for good of all that arrives; begun anew at every so many pieces."""
    how = options(names, kind, clean)
    station, given = begin_station(how), []
    for piece in dive.arriving(names, delay, seed):
        if every and piece.number % every == 0:
            content = stored(station)
            station = resumed(how, content)
            assert stored(station) == content
        station, batches = receive(station, [piece])
        given += batches
    return join(given)


def clean_of(folder, dive, names=tuple(ROLES), clean=CLEAN):
    logs = {name: dive.log(folder, name) for name in names}
    ship = [logs[name] for name in names if ROLES[name] == "ship"]
    one = {ROLES[name]: logs[name] for name in names if ROLES[name] not in ("fixes", "ship")}
    return clean_sources(open_inputs([logs["usbl"]], ship=ship, **one), clean)


def same(live, whole):
    pd.testing.assert_frame_equal(table(live), table(whole), check_exact=True)
    np.testing.assert_array_equal(live.raw_coordinates, whole.raw_coordinates)
    told = [{(c.sensor, c.name): c for c in one.channels} for one in (live, whole)]
    assert told[0].keys() == told[1].keys()
    for key, series in told[0].items():
        np.testing.assert_array_equal(series.value, told[1][key].value)
    assert counted(live) == counted(whole)


def counted(cleaned):
    found = {}
    for problem in cleaned.problems:
        found[problem.kind] = found.get(problem.kind, 0) + problem.total
    return found


@pytest.mark.parametrize(("seed", "kind"), [(0, "udp"), (2, "file")])
def test_it_is_what_clean_says_of_the_logs(tmp_path, seed, kind):
    """However the lines are cut and mixed, and begun again in between."""
    dive = Dive(seed)
    whole = clean_of(tmp_path, dive)
    assert len(whole.track.time) == dive.seconds
    assert {"usbl B01", "dvl DVL", "depth SDDPT"} == {*whole.sensors}
    same(live_of(dive, kind=kind, seed=seed, every=97), whole)


@pytest.mark.parametrize("seed", range(2))
def test_the_ship_in_a_log_of_its_own_places_as_in_the_same_one(tmp_path, seed):
    dive = Dive(seed)
    apart = clean_of(tmp_path, dive, ("usbl", "gnss", "gyro"))
    one = clean_sources(open_inputs([dive.log(tmp_path, "usbl", "gnss", "gyro")]), CLEAN)
    pd.testing.assert_frame_equal(table(apart), table(one), check_exact=True)
    assert np.isfinite(apart.raw_coordinates).all()
    one_by_one = clean_of(tmp_path, dive, ("usbl", "gyro", "gnss"))
    pd.testing.assert_frame_equal(table(one_by_one), table(one), check_exact=True)


def test_half_of_the_ship_may_come_with_the_sightings(tmp_path):
    """The compass on the line of the acoustic system, the receiver on another one."""
    dive = Dive(3)
    one = clean_sources(open_inputs([dive.log(tmp_path, "usbl", "gnss", "gyro")]), CLEAN)
    for apart, beside in (("gnss", "gyro"), ("gyro", "gnss")):
        together = dive.log(tmp_path, "usbl", beside)
        ship = [dive.log(tmp_path, apart)]
        cleaned = clean_sources(open_inputs([together], ship=ship), CLEAN)
        pd.testing.assert_frame_equal(table(cleaned), table(one), check_exact=True)


def test_velocities_support_the_track(tmp_path):
    names = ("usbl", "gnss", "gyro")
    square = []
    for seed in range(2):
        dive = Dive(seed)
        for beside in ((), ("compass", "dvl")):
            for clean in (CLEAN, replace(CLEAN, mode="offline")):
                track = clean_of(tmp_path, dive, (*names, *beside), clean).track
                square.append(np.mean(dive.errors(track) ** 2))
    now, later, aided_now, aided_later = np.sqrt(np.mean(np.reshape(square, (2, 4)), axis=0))
    assert aided_now < 0.85 * now
    assert aided_later < 0.7 * later
    assert aided_later < 0.25


def test_a_ship_without_position_for_a_while(tmp_path):
    """No sighting is lost: those that cannot be placed say so, and velocities carry the track."""
    dive = Dive(4, outages={"gnss": (50, 70)})
    whole = clean_of(tmp_path, dive)
    missing = np.isnan(whole.raw_coordinates[:, 0])
    time = whole.track.time - DAY - START
    assert len(time) == dive.seconds
    np.testing.assert_array_equal(missing, (time > 49.0) & (time < 70.0))
    assert counted(whole)["unplaced"] == missing.sum() == 21
    bare = clean_of(tmp_path, dive, ("usbl", "gnss", "gyro"))
    assert np.isnan(bare.raw_coordinates[missing, 0]).all()
    errors = dive.errors(whole.track, 0.0)
    assert np.max(errors[missing]) < 2.5
    assert np.max(dive.errors(bare.track, 0.0)[missing]) > 5.0
    same(live_of(dive), whole)


def test_a_sighting_without_place_is_no_fix_to_rely_on():
    """Its depth is used, but the position is dead reckoned, and says so."""
    dive, told = Dive(4, outages={"gnss": (50, 70)}), []
    names = ("usbl", "gnss", "gyro")
    station = begin_station(options(names, clean=replace(CLEAN, settle_rows=40)))
    for piece in dive.arriving(names):
        station, _ = receive(station, [piece])
        if 68.0 < piece.time - DAY - START < 69.0 and (now := latest(station)) is not None:
            told.append(now)
    assert told
    assert all(now.dead_reckoned for now in told)
    assert {round(now.observed - DAY - START, 2) for now in told} == {48.37}


def test_a_compass_that_falls_silent_turns_nothing(tmp_path):
    dive = Dive(5, outages={"compass": (50, 70)})
    whole = clean_of(tmp_path, dive)
    # two seconds are bridged, of the other eighteen the velocities that are valid are left out
    assert 0.8 * 18 * 2 <= counted(whole)["no-heading"] <= 18 * 2 + 1
    same(live_of(dive), whole)


def test_late_ship_data_are_waited_for_as_long_as_rows_are(tmp_path):
    dive = Dive(6)
    whole = clean_of(tmp_path, dive)
    same(live_of(dive, delay={"gnss": 0.6, "gyro": 0.3}), whole)
    late = live_of(dive, delay={"gnss": 60.0})  # not waited for: no more than reorder_s
    assert len(late.track.time) == dive.seconds
    assert counted(late)["unplaced"] > 30
    assert (late.verdicts.reason == Reason.LATE).sum() == 0


def test_the_newest_position_is_near_the_vehicle():
    dive = Dive(7)
    station, off = begin_station(options()), []
    for piece in dive.arriving(ROLES):
        station, _ = receive(station, [piece])
        if piece.number % 53 == 0 and math.isfinite(piece.time):
            now = latest(station)
            if now is not None:
                off.append((dive.errors(track_of(now), -1.0)[0], now.depth, piece.time - now.time))
    errors, depth, age = np.array(off).T
    assert len(off) > 15
    assert np.sqrt(np.mean(errors[5:] ** 2)) < 1.0
    assert np.abs(depth - 100.0).max() < 6.0
    assert np.median(age) < 1.7  # the sightings come 0.6 s late, once a second


class track_of:
    """A position as a track of one row."""

    def __init__(self, now):
        self.time, self.geodetic = np.array([now.time]), now.geodetic[None]


def test_one_line_can_have_several_tasks(tmp_path):
    """All of it on one line but the compass of the vehicle: read once, and used for each task."""
    dive = Dive(8)
    dive.lines["usbl"] = sorted(
        each for name in ("usbl", "gnss", "gyro", "dvl") for each in dive.lines[name]
    )
    log, compass = dive.log(tmp_path, "usbl"), dive.log(tmp_path, "compass")
    whole = clean_sources(open_inputs([log], velocity=log, heading=compass), CLEAN)
    assert {"usbl B01", "usbl DVL"} == {*whole.sensors}
    how = options(("usbl", "compass"), usbl=("velocity", "fixes"))
    assert str(how.inputs[0].task) == "fixes+velocity of B01"
    station, given = begin_station(how), []
    for piece in dive.arriving(("usbl", "compass")):
        station, batches = receive(station, [piece])
        if piece.number % 301 == 0:
            station = resumed(how, stored(station))
        given += batches
    pd.testing.assert_frame_equal(table(join(given)), table(whole), check_exact=True)


LIVE = """
[clean]
settle_rows = 80
reorder_s = 2.0
[journal]
url = "sqlite:///dive.db"
snapshot_s = 0.2
"""


def live_toml(folder, names=tuple(ROLES)):
    text = LIVE
    for name in names:
        text += f'[[input]]\nname = "{name}"\nfrom = "file:{name}.log?speed=0"\n'
        text += f'role = "{ROLES[name]}"\n' + ('target = "B01"\n' if name == "usbl" else "")
    place = folder / "live.toml"
    place.write_text(text)
    return place


def test_the_mission_is_cleaned_again_from_its_journal(tmp_path):
    dive = Dive(9, seconds=60)
    whole = clean_of(tmp_path, dive)
    place = live_toml(tmp_path)
    live = begin_live(read_live(place))
    asyncio.run(run_live(live, asyncio.Event()))
    again = clean_sources(open_inputs([tmp_path / "dive.db"]), CLEAN)
    pd.testing.assert_frame_equal(table(again), table(whole), check_exact=True)
    told = {state.name: state for state in live.sensors}
    assert told["gnss GNSS"].quantity == "position"
    assert told["dvl DVL"].quantity == "velocity"
    assert told["gyro HEHDT"].rate == pytest.approx(2.0, rel=0.1)
    words = ["clean", str(tmp_path / "dive.db"), "--options", str(place)]
    done = CliRunner().invoke(app, [*words, "--mode", "realtime", "-o", str(tmp_path / "out.csv")])
    assert done.exit_code == 0, done.output
    found = pd.read_csv(tmp_path / "out.csv")
    np.testing.assert_allclose(found.lat, whole.track.geodetic[:, 0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("roles", "why"),
    [
        ({"gyro": "rudder"}, "one or several of"),
        ({"gyro": ("ship", "heading")}, "no role"),
        ({"gyro": ()}, "one or several of"),
        ({"compass": "ship"}, "role heading"),
    ],
)
def test_roles_that_cannot_be_are_told(roles, why):
    with pytest.raises(OptionsError, match=why):
        options(**roles)


def test_a_ship_without_a_target_is_told():
    inputs = [InputOptions(name=n, address=Address("udp"), role=ROLES[n]) for n in ("usbl", "gnss")]
    with pytest.raises(OptionsError, match="with a target"):
        LiveOptions(clean=CLEAN, inputs=tuple(inputs))


def test_a_log_of_velocities_without_any_is_told(tmp_path):
    dive = Dive(10, seconds=60)
    one = dive.log(tmp_path, "usbl", "gnss", "gyro")
    cleaned = clean_sources(open_inputs([one], velocity=dive.log(tmp_path, "gnss")), CLEAN)
    assert counted(cleaned)["no-velocity"] == 1
    assert cleaned.sensors == ("usbl B01",)
