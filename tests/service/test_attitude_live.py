"""An antenna on the mast of a ship that rolls, and an instrument that tells it, live."""

from dataclasses import replace

import numpy as np
import pytest

from pipelines.rolling import ARM, Rolling
from service.receivers import (  # noqa: F401
    CLEAN,
    START,
    _patient,
    cleaned_again,
    gga,
    hdt,
    sail,
    sentence,
    service_of,
)

SHIP = Rolling(200.0, seed=6)
CARRIED = replace(CLEAN, lever_arm={"mast": ARM.tolist()}, sigma_attitude_deg=0.2)


class Place:
    """What `sail` asks of a ship."""

    @staticmethod
    def at(time):
        return SHIP.at(np.array([time]))[0, :2]


def pashr(time, angles):
    """Roll and pitch, deg, as a sentence without a heading; ``time`` in s since noon."""
    clock = f"12{int(time // 60):02d}{time % 60:06.3f}"
    roll, pitch = angles
    return sentence(f"PASHR,{clock},,,{roll:+.2f},{pitch:+.2f},,,,,1,1")


def heard(i, second, *, dark=(), spikes=(), seed=0):
    """A fix and a heading a second, and an attitude five times; some spoilt, some late."""
    rng = np.random.default_rng([seed, second, i])
    if i == 0:
        time = np.array([second + 0.1])
        place = (SHIP.at(time) + SHIP.offset(time))[0, :2] + rng.normal(0.0, 0.2, 2)
        return gga(float(time[0]), place) + hdt(SHIP.heading(second + 0.3))
    said = []
    for k in range(5):
        time = second + 0.05 + 0.2 * k
        angles = np.degrees(SHIP.attitude(time)[1:]) + rng.normal(0.0, 0.05, 2)
        if second in spikes and k == 2:
            angles[0] += 60.0 if second % 2 else 200.0  # the second is no roll at all
        said.append((time + (1.5 if second % 17 == 3 else 0.03), pashr(time, angles)))
    return [] if second in dark else said


def service(folder, clean=CARRIED, role="attitude"):
    return service_of(folder, ["mast", "mru"], clean, mru={"role": role})


def errors(told, begin, end=10_000):
    return np.array([each.error for each in told if begin <= each.time < end])


def test_live_the_mast_is_carried_by_roll_and_pitch(tmp_path):
    live = service(tmp_path)
    told = sail(
        live, Place, 170, lambda i, t: heard(i, t, dark=range(120, 140), spikes=(80, 91, 100))
    )
    assert np.sqrt(np.mean(errors(told, 62, 119) ** 2)) < 0.35
    assert np.sqrt(np.mean(errors(told, 145) ** 2)) < 0.35
    sigma = {each.time: each.sigma for each in told}
    assert np.median([sigma[t] for t in range(130, 138)]) > 3.0 * sigma[115]
    seen = told[-1].sensors["mru PASHR"]
    assert (seen.quantity, seen.validity) == ("attitude", "valid")
    assert told[118].sensors["mru PASHR"].rate == pytest.approx(5.0, rel=0.1)
    assert told[139].sensors["mru PASHR"].word == "stale"
    confirmed, again = cleaned_again(live, tmp_path)
    assert len(confirmed) > 140
    assert again.track.time[0] == START + 0.1
    (problem,) = again.problems
    assert (problem.kind, problem.total) == ("range", 2)


def test_level_it_is_metres_off(tmp_path):
    live = service(tmp_path, replace(CARRIED, lever_arm={}))
    told = sail(live, Place, 100, heard)
    assert np.sqrt(np.mean(errors(told, 62) ** 2)) > 2.0
