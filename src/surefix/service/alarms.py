"""Alarms: raised when something becomes wrong, acknowledged by a person, cleared when it is right.

The model is IMO MSC.252(83): an alarm stays until it is acknowledged and its cause is gone; one
that is acknowledged stays visible while its cause lasts; one whose cause is gone stays until it has
been acknowledged. A cause that comes back makes a new alarm.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

__all__ = ["Alarm", "Priority", "acknowledged", "active", "cleared", "raised"]

Priority = Literal["alarm", "warning", "caution"]
"""What is lost already, what will be lost soon, and what one should know."""


class Alarm(NamedTuple):
    """One alarm.

    Parameters
    ----------
    number
        Counts from 1 and is never used again.
    concerns
        What it is about: a sensor, ``journal``, ``position``.
    priority, text
        How urgent, and what is wrong.
    since
        s, Unix: when it was raised.
    seen, by
        s, Unix: when it was acknowledged, and by whom; NaN and empty before.
    gone
        s, Unix: when its cause was gone; NaN while it lasts.
    """

    number: int
    concerns: str
    priority: Priority
    text: str
    since: float
    seen: float = math.nan
    by: str = ""
    gone: float = math.nan

    @property
    def open(self) -> bool:
        """Whether it is still to be shown."""
        return math.isnan(self.gone) or math.isnan(self.seen)


Alarms = tuple[Alarm, ...]


def raised(alarms: Alarms, concerns: str, priority: Priority, text: str, now: float) -> Alarms:
    """Raise an alarm; one about the same whose cause lasts only takes the new words and urgency."""
    for k, each in enumerate(alarms):
        if each.concerns == concerns and math.isnan(each.gone):
            known = each._replace(priority=priority, text=text)
            if each.priority != priority:  # more or less urgent: to be acknowledged again
                known = known._replace(seen=math.nan, by="")
            return (*alarms[:k], known, *alarms[k + 1 :])
    number = max((each.number for each in alarms), default=0) + 1
    return (*alarms, Alarm(number, concerns, priority, text, now))


def cleared(alarms: Alarms, concerns: str, now: float) -> Alarms:
    """Tell that the cause is gone."""
    return tuple(
        each._replace(gone=now) if each.concerns == concerns and math.isnan(each.gone) else each
        for each in alarms
    )


def acknowledged(alarms: Alarms, number: int, by: str, now: float) -> Alarms:
    """Tell that a person has seen an alarm; the first acknowledgement counts."""
    return tuple(
        each._replace(seen=now, by=by) if each.number == number and math.isnan(each.seen) else each
        for each in alarms
    )


def active(alarms: Alarms) -> Alarms:
    """Those that are still to be shown: the most urgent first, then the newest."""
    order = {"alarm": 0, "warning": 1, "caution": 2}
    shown = [each for each in alarms if each.open]
    return tuple(sorted(shown, key=lambda each: (order[each.priority], -each.since)))
