"""Fault 35: kill -9 at named points and at any time; all 1,000 of them are `make kills`."""

import random

import pytest

from service.crashing import POINTS
from service.dives import Dive
from service.kills import Forked, Mission, restart


@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_fault_35_killed_it_loses_nothing_and_doubles_nothing(tmp_path, request, kind):
    url = "sqlite:///mission.db"
    if kind == "postgresql":
        url = request.getfixturevalue("postgres").database()
    rng = random.Random(kind)
    mission = Mission(tmp_path, url, epochs=3000)
    forked = Forked(mission)
    forked.after(1.5)
    mission.check()
    plan = [*POINTS, "any", "any"]
    rng.shuffle(plan)
    for what in plan:
        if what == "any":
            forked.after(rng.uniform(0.0, 0.4))
        else:
            forked.at(what, 1 if what.startswith("while it") else rng.randint(1, 6))
        mission.check()
    forked.close()
    restart(mission, 0.1)
    mission.check()
    assert mission.said > 20
    mission.end()


LINES = {
    "usbl": 'target = "B01"', "gnss": 'role = "ship"', "gyro": 'role = "ship"',
    "compass": 'role = "heading"', "dvl": 'role = "velocity"',
}  # fmt: skip
DIVE = """
[clean]
settle_rows = 60
reorder_s = 2.0
[[output]]
to = "udp://127.0.0.1:{port}"
[journal]
url = "{url}"
snapshot_s = 0.2
"""


class DiveMission(Mission):
    """A dive with every instrument on a line of its own."""

    def __init__(self, folder, speed=20.0):
        self.place, dive, text = folder / "live.toml", Dive(1, seconds=200), DIVE
        for name, role in LINES.items():
            dive.log(folder, name)
            text += f'[[input]]\nname = "{name}"\nfrom = "file:{name}.log?speed={{speed}}"\n'
            text += f"{role}\n"
        self.begin(text, "sqlite:///mission.db", speed)


def test_a_dive_on_several_lines_loses_nothing_either(tmp_path):
    rng = random.Random(3)
    mission = DiveMission(tmp_path)
    forked = Forked(mission)
    forked.after(2.5)
    mission.check()
    for what in ("cleaned", "between snapshot and journal", "any", "before it is put out", "any"):
        if what == "any":
            forked.after(rng.uniform(0.2, 0.6))
        else:
            forked.at(what, rng.randint(1, 4))
        mission.check()
    forked.close()
    mission.end()
    assert mission.said > 20
