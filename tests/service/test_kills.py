"""Fault 35: kill -9 at named points and at any time; all 1,000 of them are `make kills`."""

import random

import pytest

from service.crashing import POINTS
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
