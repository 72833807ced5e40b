"""Alarms: raised, acknowledged, cleared, remembered."""

import math

import pytest

from surefix.service.alarms import (
    Alarm,
    Cause,
    acknowledged,
    active,
    changed,
    cleared,
    forgotten,
    from_texts,
    raised,
    up_to_date,
)
from surefix.service.noted import as_text

STALE = Cause("warning", "stale: nothing since 12:00:00.0")


def test_an_alarm_stays_until_it_was_seen_and_its_cause_is_gone():
    alarms = up_to_date((), {"gps": STALE}, 10.0)
    (only,) = active(alarms)
    assert only == Alarm(1, "gps", "warning", STALE.text, 10.0)
    seen = acknowledged(alarms, 1, "mate", 12.0)
    assert (active(seen)[0].seen, active(seen)[0].by) == (12.0, "mate")
    assert not active(up_to_date(seen, {}, 13.0))
    gone = up_to_date(alarms, {}, 13.0)
    assert active(gone)[0].gone == 13.0  # it is still to be seen
    assert not active(acknowledged(gone, 1, "mate", 14.0))


def test_the_first_acknowledgement_counts_and_an_unknown_number_changes_nothing():
    alarms = acknowledged(raised((), "gps", "warning", "stale", 1.0), 1, "mate", 2.0)
    assert acknowledged(alarms, 1, "master", 3.0) == alarms
    assert acknowledged(alarms, 7, "master", 3.0) == alarms


def test_a_cause_that_goes_on_is_told_once_until_it_is_another_or_more_urgent():
    alarms = up_to_date((), {"gps": STALE}, 1.0)
    again = up_to_date(alarms, {"gps": Cause("warning", "stale: nothing since 13:00")}, 2.0)
    assert not changed(alarms, again)
    alarms = acknowledged(alarms, 1, "mate", 3.0)
    other = up_to_date(alarms, {"gps": Cause("warning", "frozen: the same")}, 4.0)
    assert other[0].text == "frozen: the same"
    worse = up_to_date(alarms, {"gps": Cause("alarm", "stale: nothing")}, 4.0)
    assert worse[0].priority == "alarm"
    assert math.isnan(worse[0].seen)  # to be acknowledged again
    assert changed(alarms, worse) == worse


def test_what_comes_back_is_a_new_alarm():
    alarms = up_to_date(up_to_date((), {"gps": STALE}, 1.0), {}, 2.0)
    back = up_to_date(alarms, {"gps": STALE}, 3.0)
    assert [each.number for each in back] == [1, 2]
    assert [each.number for each in changed(alarms, back)] == [2]


def test_numbers_are_never_used_again_though_alarms_are_forgotten():
    alarms = ()
    for k in range(5):
        now = 1e4 * k
        alarms = up_to_date(alarms, {"gps": STALE}, now)
        alarms = acknowledged(up_to_date(alarms, {}, now + 1.0), k + 1, "mate", now + 2.0)
    alarms = forgotten(alarms, 1e6)
    assert [each.number for each in alarms] == [5]
    assert up_to_date(alarms, {"gps": STALE}, 1e6)[-1].number == 6


def test_a_sensor_that_comes_and_goes_without_end_fills_no_memory():
    alarms = ()
    for k in range(3000):
        alarms = up_to_date(alarms, {"gps": STALE, "position": STALE}, 2.0 * k)
        alarms = up_to_date(alarms, {"position": STALE}, 2.0 * k + 1.0)
    assert len(alarms) <= 201
    assert [each.concerns for each in alarms if math.isnan(each.gone)] == ["position"]
    assert alarms[-1].number == 3001


def test_they_are_the_same_after_the_journal():
    alarms = up_to_date((), {"gps": STALE, "position": Cause("alarm", "lost: since")}, 1.0)
    texts = [as_text(each) for each in alarms]
    after = cleared(acknowledged(alarms, 1, "Käpt'n", 2.5), "gps", 3.0)
    texts += [as_text(each) for each in changed(alarms, after)]
    assert len(texts) == 3
    back = from_texts(["no JSON", "[]", '{"number": 3}', *texts], 4.0)
    assert not changed(after, back)
    assert [each.number for each in back] == [1, 2]
    assert back[0].by == "Käpt'n"
    assert math.isnan(back[1].seen)


@pytest.mark.parametrize("priority", ["warning", "caution"])
def test_the_most_urgent_is_shown_first(priority):
    alarms = raised((), "gps", priority, "stale", 5.0)
    alarms = raised(alarms, "position", "alarm", "lost", 4.0)
    assert [each.concerns for each in active(alarms)] == ["position", "gps"]
