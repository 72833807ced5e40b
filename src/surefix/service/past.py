"""How sensors and alarms were: looked up for any moment that the service remembers."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from itertools import chain
from typing import Final, NamedTuple

from surefix.service.alarms import Alarm, active
from surefix.service.sensors import SensorState

__all__ = ["Note", "Past", "news"]

_MOST: Final = 20_000  # notes that are remembered one by one: of five sensors, for 2.7 days
_OFTEN: Final = 60.0  # s after which a sensor is noted although it is judged as before


class Note(NamedTuple):
    """How something was from a time on.

    Parameters
    ----------
    time
        s, Unix; NaN, before anything of a replayed log had a time, counts as ever.
    what
        A sensor or an alarm.
    """

    time: float
    what: SensorState | Alarm

    @property
    def key(self) -> tuple[str, ...] | int:
        """What it is about."""
        if isinstance(self.what, Alarm):
            return self.what.number
        return self.what.input, self.what.name, self.what.quantity


class Past:
    """Notes in the order they were made; of the oldest only what they led to.

    Parameters
    ----------
    most
        Notes that are remembered one by one.
    """

    def __init__(self, most: int = _MOST) -> None:
        self._most = most
        self._before: dict[tuple[str, ...] | int, Note] = {}
        self._notes: deque[Note] = deque()

    def add(self, note: Note) -> None:
        """Remember a note."""
        self._notes.append(note)
        if len(self._notes) <= self._most:
            return
        old = self._notes.popleft()
        self._before[old.key] = old
        if isinstance(old.what, Alarm) and not old.what.open:
            del self._before[old.key]

    def at(self, moment: float) -> tuple[tuple[SensorState, ...], tuple[Alarm, ...]]:
        """Tell how the sensors were at a moment, s, Unix, and which alarms were to be shown."""
        known: dict[tuple[str, ...] | int, SensorState | Alarm] = {}
        for note in chain(self._before.values(), self._notes):
            if not note.time > moment:
                known[note.key] = note.what
        sensors = tuple(each for each in known.values() if isinstance(each, SensorState))
        return sensors, active(tuple(each for each in known.values() if isinstance(each, Alarm)))


def news(
    noted: Sequence[Note], sensors: Sequence[SensorState], time: float
) -> tuple[tuple[Note, ...], tuple[Note, ...]]:
    """Note those that are judged otherwise than they were noted last, and all now and then.

    Parameters
    ----------
    noted
        The last note of each sensor.
    sensors
        As they are judged now.
    time
        s, Unix.

    Returns
    -------
    noted, fresh
        The last note of each sensor after this, and those of them that are new.
    """
    old = {note.key: note for note in noted}
    fresh, kept = [], []
    for each in sensors:
        note = Note(time, each)
        past = old.get(note.key)
        if past is None or _differs(past, each) or _old(past, time):
            past = note
            fresh.append(note)
        kept.append(past)
    return tuple(kept), tuple(fresh)


def _old(past: Note, time: float) -> bool:
    if math.isnan(past.time):
        return not math.isnan(time)
    return time - past.time >= _OFTEN


def _differs(past: Note, state: SensorState) -> bool:
    before = past.what
    assert isinstance(before, SensorState)
    return (before.validity, before.word) != (state.validity, state.word)
