"""Sensors that fail and come back: how they are judged, what is alarmed, and how little it does."""

import math

import numpy as np
import pytest

from service.receivers import START, Ship, _patient, gga, sail, service_of  # noqa: F401
from surefix.service.alarms import active
from surefix.service.live import begin_live
from surefix.service.supervision import acknowledge

SHIP = Ship(200.0)
FIRST, LAST = 90, 140  # s, between which a receiver fails


def receivers(failing, seed=0, sigma=0.5):
    """Two receivers a second; ``failing(t, place, rng)`` gives quality and place of the first."""
    rng = np.random.default_rng(seed)
    memory = {}

    def heard(i, second):
        time = second + 0.1 * i
        quality, place = 1, SHIP.at(time) + rng.normal(0.0, sigma, 2)
        if i == 0 and FIRST <= second < LAST:
            quality, place = failing(memory, place, rng)
        return gga(time, place, quality) if quality is not None else b""

    return heard


def well(memory, place, rng):
    return 1, place


def frozen(memory, place, rng):
    return 1, memory.setdefault("place", place)


FAULTS = {
    "silent": lambda m, place, rng: (None, place),
    "without a fix": lambda m, place, rng: (0, place),
    "frozen": frozen,
    "jumping": lambda m, place, rng: (1, place + rng.normal(0.0, 30.0, 2)),
    "biased": lambda m, place, rng: (1, place + np.array([4.0, 0.0])),
    "noisy": lambda m, place, rng: (1, place + rng.normal(0.0, 1.2, 2)),
}
JUDGED = {
    "silent": ("invalid", "stale"),
    "without a fix": ("invalid", "stale"),
    "frozen": ("invalid", "frozen"),
    "jumping": ("invalid", "jumping"),
    "biased": ("invalid", "biased"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_one_of_two_receivers_fails_and_returns(fault, tmp_path):
    """Faults 32 and 34: it is judged so, the other is not, and the output makes no jump."""
    live = service_of(tmp_path, ["one", "two"])
    told = sail(live, SHIP, 190, receivers(FAULTS[fault]))
    before = [each for each in told if 60 <= each.time < FIRST]
    assert all(s.validity == "valid" for each in before for s in each.sensors.values())
    assert not any(each.alarms for each in before)
    during = [each.sensors["one GNSS"] for each in told if FIRST <= each.time < LAST]
    if fault in JUDGED:
        validity, word = JUDGED[fault]
        assert (during[-1].validity, during[-1].word) == (validity, word)
        (raised,) = [a for a in active(told[LAST - 1].alarms) if a.concerns == "one GNSS"]
        assert raised.priority == "warning"
        assert START + FIRST < raised.since < START + LAST
    assert all(each.sensors["two GNSS"].validity == "valid" for each in told[60:])
    if fault in ("silent", "without a fix", "frozen"):
        first = next(k for k, state in enumerate(during) if state.validity == "invalid")
        assert 4 <= first <= 9  # five intervals without anything new
    if fault in ("silent", "without a fix"):
        assert told[LAST + 1].sensors["one GNSS"].validity == "valid"
    settled = [each for each in told if each.time > 60]
    errors = np.array([each.error for each in settled])
    sigma = np.array([each.sigma for each in settled])
    steps = np.abs(np.diff(errors, axis=0)).max(axis=1)
    assert np.all(steps < 4.0 * np.maximum(sigma[1:], sigma[:-1]))
    assert np.all(np.abs(errors).max(axis=1) < 5.0 * sigma)


def test_a_receiver_is_judged_by_its_rate_and_its_delay(tmp_path):
    live = service_of(tmp_path, ["one", "two"])
    told = sail(live, SHIP, 80, receivers(well))
    one = told[-1].sensors["one GNSS"]
    assert one.rate == pytest.approx(1.0)
    assert one.latency == pytest.approx(0.2, abs=1e-3)
    assert one.observed == START + 79
    assert one.rejected < 0.1
    assert one.innovation == pytest.approx(1.0, abs=0.3)
    assert one.quantity == "position"
    assert one.input == "one"


def test_a_receiver_that_never_says_anything_neither_hinders_nor_is_forgotten(tmp_path):
    live = service_of(tmp_path, ["one", "two", "three"])
    heard = receivers(well)
    told = sail(live, SHIP, 80, lambda i, t: heard(i, t) if i < 2 else b"")
    assert told[-1].sensors["three"].reason.startswith("silent")
    assert [each.concerns for each in active(told[5].alarms)] == []
    assert [each.concerns for each in active(told[-1].alarms)] == ["three"]
    assert abs(told[-1].error).max() < 4.0 * told[-1].sigma
    # What is cleaned for good does not wait for it either
    assert live.station.session.last_tau > START + 70


def test_without_any_receiver_it_is_dead_reckoning_and_an_alarm(tmp_path):
    """Fault 32."""
    live = service_of(tmp_path, ["one", "two"])
    heard = receivers(well)
    told = sail(live, SHIP, 150, lambda i, t: heard(i, t) if t < 90 or t >= 120 else b"")
    sigma = [each.sigma for each in told[90:120]]
    assert np.all(np.diff(sigma[1:]) > 0.0)
    assert sigma[-1] > 5.0 * sigma[0]
    lost = {
        each.time for each in told if any(a.concerns == "position" for a in active(each.alarms))
    }
    assert min(lost) == pytest.approx(90 + 10, abs=1)
    raised = next(a for a in told[119].alarms if a.concerns == "position")
    assert raised.priority == "alarm"
    assert raised.text.startswith("lost: dead reckoning since 12:01:29")
    after = next(a for a in told[-1].alarms if a.concerns == "position")
    assert START + 120 <= after.gone < START + 122
    assert math.isnan(after.seen)
    errors = np.abs([each.error for each in told[61:]]).max(axis=1)
    assert np.all(errors < 5.0 * np.array([each.sigma for each in told[61:]]))


def test_alarms_are_what_they_were_after_a_crash(tmp_path):
    live = service_of(tmp_path, ["one", "two"])
    heard = receivers(FAULTS["silent"])
    sail(live, SHIP, 100, heard)
    (stale,) = active(live.alarms)
    assert acknowledge(live, stale.number, "mate", START + 100.0)
    assert not acknowledge(live, 99, "mate", START + 100.0)
    sail(live, SHIP, 102, heard, begin=100)
    known = live.alarms
    assert known[0].by == "mate"
    live.journal.close()  # and no more: it was killed
    again = begin_live(live.options)
    assert repr(again.alarms) == repr(known)
    told = sail(again, SHIP, 145, heard, begin=102)
    assert told[0].sensors["one GNSS"].word == "stale"
    assert repr(told[0].alarms) == repr(known)
    assert not active(told[-1].alarms)
    (closed,) = again.alarms
    assert closed.gone > START + LAST
    again.journal.close()
