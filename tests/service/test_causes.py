"""What alarms are raised for, beside sensors that fail; and a clock that nobody can set."""

import math
import time

import numpy as np
import pytest

from service.receivers import START, Ship, _patient, gga, sail, service_of  # noqa: F401
from surefix.service.causes import Condition, causes
from surefix.service.options import AlarmOptions
from surefix.service.sensors import SensorState
from surefix.service.station import Latest
from surefix.service.steady import SteadyClock
from surefix.types import Reason

OPTIONS = AlarmOptions(position_sigma_m=5.0, dead_reckoning_s=10.0)
GOOD = SensorState("one GNSS", "one", latency=0.2)


def shown(sigma=1.0, age=0.0):
    place = np.zeros(3)
    return Latest(100.0, place, place, np.full(3, sigma), place, place, 100.0 - age)


def concerned(*sensors, **more):
    condition = Condition(more.pop("now", 100.0), **more)
    return {
        name: cause.text.partition(":")[0]
        for name, cause in causes(sensors, condition, OPTIONS).items()
    }


def test_nothing_is_wrong():
    assert concerned(GOOD, position=shown()) == {}
    assert concerned() == {}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"position": shown(sigma=6.0)}, {"position": "uncertain"}),
        ({"position": shown(sigma=math.nan)}, {"position": "uncertain"}),
        ({"position": shown(age=11.0)}, {"position": "lost"}),
        ({"position": shown(age=math.nan)}, {"position": "lost"}),
        (
            {"journal": "the journal cannot be written: disk full"},
            {"journal": "the journal cannot be written"},
        ),
        ({"shed": 95.0}, {"load": "overload"}),
        ({"shed": 80.0}, {}),
        ({"set_by": -3600.0}, {"clock": "set"}),
        ({"set_by": 0.2}, {}),
    ],
)
def test_each_cause_has_its_word(more, said):
    assert concerned(GOOD, **more) == said


@pytest.mark.parametrize(
    ("latencies", "said"),
    [
        ([0.1, 2.0], {}),
        ([0.1, -0.6], {"clock": "early"}),
        ([8.6], {"clock": "late"}),  # 100 ppm for a day: fault 33
        ([-8.6], {"clock": "early"}),
        ([8.6, 0.3], {}),  # one source may well be late
        ([math.nan], {}),
    ],
)
def test_a_clock_that_is_wrong_shows_in_the_times_of_arrival(latencies, said):
    sensors = [GOOD._replace(name=f"{k}", latency=late) for k, late in enumerate(latencies)]
    assert concerned(*sensors) == said


def test_a_sensor_that_was_never_heard_gets_time_to_begin():
    silent = GOOD._replace(validity="invalid", reason="silent: nothing came yet", since=95.0)
    assert concerned(silent) == {}
    assert concerned(silent, now=106.0) == {"one GNSS": "silent"}
    doubtful = GOOD._replace(validity="doubtful", reason="noisy: 1.7 × what was declared")
    found = causes([doubtful], Condition(100.0), OPTIONS)
    assert found["one GNSS"].priority == "caution"


def test_the_clock_of_arrivals_goes_on_when_the_computers_is_set(monkeypatch):
    """Fault 26: a step of an hour, or of years, is told and does nothing."""
    clock = SteadyClock()
    before, real = clock(), time.time
    monkeypatch.setattr(time, "time", lambda: real() - 3600.0 * 24.0 * 365.0 * 6.0)
    assert 0.0 <= clock() - before < 60.0
    assert clock.set_by == pytest.approx(-3600.0 * 24.0 * 365.0 * 6.0, abs=60.0)


def test_what_a_silent_input_brings_from_before_is_late_and_lost_to_nobody(tmp_path):
    """Fault 27, between inputs: a counted drop."""
    ship = Ship(120.0)
    rng = np.random.default_rng(0)

    def heard(i, second):
        if i == 1 and 70 <= second < 100:
            return b""
        seconds = range(70, 101) if i == 1 and second == 100 else [second]
        times = [each + 0.1 * i for each in seconds]
        return b"".join(gga(t, ship.at(t) + rng.normal(0.0, 0.5, 2)) for t in times)

    live = service_of(tmp_path, ["one", "two"])
    late = []
    recorder = type("Recorder", (), {"add": staticmethod(late.extend), "flush": lambda self: None})
    live.recorders.append(recorder())
    told = sail(live, ship, 118, heard)
    rows = [
        (float(t), int(r))
        for b in late
        for t, r in zip(b.track.time, b.verdicts.reason, strict=True)
    ]
    dropped = [t - START for t, r in rows if r == Reason.LATE]
    assert min(dropped) == pytest.approx(70.1, abs=1e-3)
    assert len(dropped) >= 10
    assert dropped == sorted(dropped)  # those up to what had been let go, and no other
    kept = [t - START for t, r in rows if r != Reason.LATE and 70.0 <= t - START < 99.5]
    assert len(kept) + len(dropped) == 60
    assert abs(told[-1].error).max() < 5.0 * told[-1].sigma
