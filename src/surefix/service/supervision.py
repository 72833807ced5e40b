"""Supervise the service: judge its sensors, raise and clear its alarms, and note how they were."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from surefix.service import alarms as alarm
from surefix.service.alarms import Alarm
from surefix.service.causes import Condition, causes
from surefix.service.judgement import judge_sensors
from surefix.service.noted import as_text, from_text
from surefix.service.past import Note, news
from surefix.service.sensors import SensorState

if TYPE_CHECKING:
    from surefix.service.keeper import Gap
    from surefix.service.running import Live

__all__ = ["acknowledge", "heed", "judge", "remember", "tell_gap"]


def remember(live: Live, now: float) -> None:
    """Take over from the journal which alarms are open, and how everything was."""
    told = live.journal.told("alarm")
    live.alarms = alarm.from_texts((each.text for each in told), now)
    if live.options.web is None:
        return
    kinds: dict[str, type[Alarm | SensorState]] = {"alarm": Alarm, "sensor": SensorState}
    for each in sorted([*told, *live.journal.told("sensor")]):
        what = from_text(each.text, kinds[each.kind])
        if what is not None:
            live.past.add(Note(each.time, what))


def judge(live: Live, now: float) -> None:
    """Judge the sensors by what is known now, and raise or clear the alarms that follow."""
    session = live.station.session if live.ahead is None else live.ahead.session
    inputs = [(each.name, each.roles[0]) for each in live.options.inputs]
    at = math.nan if live.recorded else now
    live.sensors = judge_sensors(live.sensors, live.station.heard, session, inputs, at)
    live.noted, fresh = news(live.noted, live.sensors, _moment(live, now))
    _note(live, fresh)
    heed(live, now)


def heed(live: Live, now: float) -> None:
    """Raise alarms for what is wrong, and clear those whose cause is gone."""
    condition = Condition(now, live.now, live.keeper.trouble, live.shed_at, live.set_by)
    found = causes(live.sensors, condition, live.options.alarms)
    _set_alarms(live, alarm.up_to_date(live.alarms, found, now), now)


def acknowledge(live: Live, number: int, by: str, now: float) -> bool:
    """Tell that a person has seen an alarm; False if there is none of that number to be seen.

    The journal has it with the next step, a second later at most.

    Parameters
    ----------
    live
        The service.
    number
        Of the alarm.
    by
        Who has seen it.
    now
        s, Unix.
    """
    before = live.alarms
    _set_alarms(live, alarm.acknowledged(before, number, by, now), now)
    return live.alarms != before


def tell_gap(live: Live, gap: Gap, now: float) -> None:
    """Tell, in an alarm, what the journal will never have."""
    text = f"gap: the journal was away, {gap.size} bytes of the mission are not in it"
    if not math.isnan(gap.first):
        first, last = (f"{datetime.fromtimestamp(at, UTC):%Y-%m-%dT%H:%M:%SZ}" for at in gap[2:])
        text = f"{text}, of {first} to {last}"
    known = alarm.raised(live.alarms, "mission", "warning", text, now)
    _set_alarms(live, alarm.cleared(known, "mission", now), now)


def _set_alarms(live: Live, after: tuple[Alarm, ...], now: float) -> None:
    """Take over alarms, and note those that are not what they were."""
    fresh = alarm.changed(live.alarms, after)
    live.alarms = after
    _note(live, [Note(_moment(live, now), each) for each in fresh])


def _note(live: Live, notes: Sequence[Note]) -> None:
    """Remember what was noted, and tell the journal."""
    for note in notes:
        kind = "alarm" if isinstance(note.what, Alarm) else "sensor"
        live.unwritten.append(live.told(note.time, kind, as_text(note.what)))
        live.past.add(note)


def _moment(live: Live, now: float) -> float:
    """The time that people look back by, s, Unix: that of a recorded log, if one is replayed."""
    if not live.recorded:
        return now
    return math.nan if live.now is None else live.now.time
