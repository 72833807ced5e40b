"""Alarms: raised when something becomes wrong, acknowledged by a person, cleared when it is right.

The model is IMO MSC.252(83): an alarm stays until it is acknowledged and its cause is gone; one
that is acknowledged stays visible while its cause lasts; one whose cause is gone stays until it has
been acknowledged. A cause that comes back makes a new alarm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final, Literal, NamedTuple

from surefix.service.noted import as_text, from_text

__all__ = [
    "Alarm",
    "Cause",
    "Priority",
    "acknowledged",
    "active",
    "changed",
    "cleared",
    "forgotten",
    "from_texts",
    "raised",
    "up_to_date",
]

_KEPT: Final = 3600.0  # s that a closed alarm is remembered by the service …
_MOST: Final = 200  # … and so many at most: the journal keeps them all

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


class Cause(NamedTuple):
    """Something that is wrong at present.

    Parameters
    ----------
    priority
        How urgent it is.
    text
        What is wrong: one word, a colon, and the rest. The same word is the same cause, and the
        alarm keeps its first text.
    """

    priority: Priority
    text: str


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


def up_to_date(alarms: Alarms, causes: Mapping[str, Cause], now: float) -> Alarms:
    """Raise what is wrong, clear what no longer is, and forget what is long over.

    Parameters
    ----------
    alarms
        As they were.
    causes
        All that is wrong at present, by what it concerns.
    now
        s, Unix.
    """
    lasting = {each.concerns: each for each in alarms if math.isnan(each.gone)}
    for concerns in lasting.keys() - causes.keys():
        alarms = cleared(alarms, concerns, now)
    for concerns, cause in causes.items():
        known = lasting.get(concerns)
        same = known is not None and _word(known.text) == _word(cause.text)
        if known is None or not same or known.priority != cause.priority:
            alarms = raised(alarms, concerns, cause.priority, cause.text, now)
    return forgotten(alarms, now)


def forgotten(alarms: Alarms, now: float) -> Alarms:
    """Forget those that were closed an hour ago, and the oldest that are over if there are many.

    The last one stays, for its number.
    """
    kept = [
        each
        for each in alarms
        if each is alarms[-1] or each.open or now - max(each.gone, each.seen) < _KEPT
    ]
    over = [each for each in kept[:-1] if not math.isnan(each.gone)]
    surplus = {each.number for each in over[: max(len(kept) - _MOST, 0)]}
    return tuple(each for each in kept if each.number not in surplus)


def changed(before: Alarms, after: Alarms) -> Alarms:
    """Those of ``after`` that are new or not what they were."""
    old = {each.number: as_text(each) for each in before}
    return tuple(each for each in after if old.get(each.number) != as_text(each))


def from_texts(texts: Iterable[str], now: float) -> Alarms:
    """The alarms from what the journal says of them: the last text about each counts.

    A text that is none of an alarm is passed over.
    """
    read = (from_text(text, Alarm) for text in texts)
    found = {each.number: each for each in read if each is not None}
    return forgotten(tuple(found[number] for number in sorted(found)), now)


def _word(text: str) -> str:
    return text.partition(":")[0]
