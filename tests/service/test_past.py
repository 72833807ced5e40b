"""What sensors and alarms were at a moment is what was noted last before it."""

import math

from surefix.service.alarms import acknowledged, cleared, raised
from surefix.service.noted import as_text, from_text
from surefix.service.past import Note, Past, news
from surefix.service.sensors import SensorState

WELL = SensorState("boat GP", "boat", since=0.0, observed=0.0)
STALE = WELL._replace(validity="invalid", reason="stale: nothing since 12:00", since=30.0)


def of_an_hour(most):
    """An alarm that comes, is seen and goes, while a sensor fails and returns every minute."""
    past, alarms = Past(most), ()
    for second in range(0, 3600, 30):
        past.add(Note(second, (WELL, STALE)[second // 30 % 2]))
        before = alarms
        if second == 600:
            alarms = raised(alarms, "position", "alarm", "lost: dead reckoning", second)
        if second == 900:
            alarms = acknowledged(alarms, 1, "ann", second)
        if second == 1200:
            alarms = cleared(alarms, "position", second)
        for alarm in alarms:
            if alarm not in before:
                past.add(Note(second, alarm))
    return past


def test_any_moment_of_an_hour():
    past = of_an_hour(10_000)
    for moment in range(0, 3600, 7):
        sensors, alarms = past.at(moment)
        assert sensors == ((WELL, STALE)[moment // 30 % 2],)
        assert len(alarms) == (600 <= moment < 1200)
        assert all((each.by == "ann") == (moment >= 900) for each in alarms)
    assert past.at(-1.0) == ((), ())


def test_of_the_oldest_only_what_they_led_to():
    whole, short = of_an_hour(10_000), of_an_hour(60)
    for moment in range(1830, 3600, 11):
        assert short.at(moment) == whole.at(moment)
    last = raised((), "position", "alarm", "lost: dead reckoning", 5.0)[0]
    past = Past(10)
    past.add(Note(5.0, last))
    for second in range(100):
        past.add(Note(10.0 + second, WELL))
    assert past.at(100.0) == ((WELL,), (last,))  # it still lasts


def test_a_sensor_is_noted_when_it_changes_and_once_a_minute():
    noted, times = (), []
    for second in range(300):
        state = (WELL, STALE)[100 <= second < 110]._replace(observed=float(second))
        noted, fresh = news(noted, [state, WELL._replace(quantity="velocity")], float(second))
        times += [second for each in fresh if each.what.quantity == "position"]
        assert len(noted) == 2
    assert times == [0, 60, 100, 110, 170, 230, 290]


def test_before_a_replayed_log_has_a_time():
    noted, fresh = news((), [WELL], math.nan)
    assert [each.what for each in fresh] == [WELL]
    noted, fresh = news(noted, [WELL], math.nan)
    assert not fresh
    noted, fresh = news(noted, [WELL], 5.0)
    assert len(fresh) == 1
    past = Past()
    past.add(Note(math.nan, STALE))
    assert past.at(-1e9) == ((STALE,), ())


def test_notes_are_the_same_after_the_journal():
    state = STALE._replace(name='"gyro" ü', rejected=1.0 / 3.0)
    back = from_text(as_text(state), SensorState)
    assert as_text(back) == as_text(state)
    assert back.rejected == 1.0 / 3.0
    assert math.isnan(back.rate)
    for text in ("", "[]", "null", "{}", '{"name": "x"}', '{"name": "x", "input": "y", "z": 1}'):
        assert from_text(text, SensorState) is None
