"""Judge each sensor: valid, doubtful or invalid, and why.

Nothing is estimated here. What a sensor is worth is the record that the filter keeps of it
(`surefix.filters.health`) and what is known of fixes that do not change
(`surefix.cleaning.duplicates`); when it last said something was heard (`surefix.service.heard`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.cleaning.duplicates import stuck
from surefix.filters.health import Health
from surefix.pipelines.state import Session
from surefix.reasons import clock
from surefix.service.heard import ATTITUDE, QUANTITIES, Heard
from surefix.service.sensors import SensorState, Validity
from surefix.types import FloatArray

__all__ = ["judge_sensors", "timeout"]

_MISSED: Final = 5.0  # usual intervals without an observation after which a sensor is stale …
_SHORTEST: Final = 3.0  # s … but never sooner …
_UNKNOWN: Final = 10.0  # s … and after so long where the interval is not known
_FEW: Final = 30  # observations from which on its record says something
_NOISY: Final = 1.5  # times the declared noise: noisy …
_CALM: Final = 1.3  # … until it is less than this
_LEANS: Final = 1.0  # standard deviations that a sensor leans to one side: biased …
_UPRIGHT: Final = 0.5  # … until it leans less than this
_REJECTED: Final = 0.3  # share of rejected observations: doubtful …
_ACCEPTED: Final = 0.2  # … until it is less than this
_CLIPPED: Final = 3.9  # standard deviations: a mean near the largest that is counted
_WORST: Final[tuple[Validity, ...]] = ("invalid", "doubtful", "valid")
_SIDES: Final = (("to the east", "to the west"), ("to the north", "to the south"), ("up", "down"))


class _Record(NamedTuple):
    """What the session knows of one sensor.

    Parameters
    ----------
    rejected, innovation
        As in `SensorState`.
    lean, others
        (3,) standard deviations that it leans to one side, and that the others do on average, but
        for suspect ones: a motion that nobody follows at once makes all of them lean; NaN where
        there is nothing.
    suspect
        Whether the filter left most of its observations out, and does not use most of them since.
    stuck, lively
        s, Unix: since when it gives the same again; and whether its digits do not explain that.
    """

    rejected: float = math.nan
    innovation: float = math.nan
    lean: FloatArray = np.full(3, np.nan)
    others: FloatArray = np.full(3, np.nan)
    suspect: bool = False
    stuck: float = math.nan
    lively: bool = False


def timeout(heard: Heard) -> float:
    """Seconds without an observation after which a sensor is stale."""
    if math.isnan(heard.interval):
        return _UNKNOWN
    return max(_SHORTEST, _MISSED * heard.interval)


def judge_sensors(
    before: Sequence[SensorState],
    heard: Sequence[Heard],
    session: Session,
    inputs: Sequence[tuple[str, str]],
    now: float,
) -> tuple[SensorState, ...]:
    """Judge all sensors that were heard, and tell the inputs that never brought anything.

    Parameters
    ----------
    before
        How they were judged the last time; empty at first.
    heard
        What came of each.
    session
        The newest observations included.
    inputs
        Name and role of each.
    now
        s, Unix, by the clock of arrivals; NaN for recorded logs, where the newest time counts.
    """
    old = {(state.input, state.name): state for state in before}
    newest = max((each.latest for each in heard), default=math.nan)
    after = []
    for each in heard:
        name = inputs[each.source][0]
        record, *others = _records(session, each)
        state = SensorState(
            each.name,
            name,
            each.quantity,
            observed=each.latest if len(each.time) else math.nan,
            rate=each.rate,
            latency=each.latency,
            rejected=record.rejected,
            innovation=record.innovation,
        )
        past = old.get((name, each.name))
        by_arrival = math.isfinite(now) and math.isfinite(each.arrived)
        age = now - each.arrived if by_arrival else newest - state.observed
        word = "" if past is None else past.word
        told = [_judged(each, one, age, word) for one in (record, *others)]
        validity, reason = min(told, key=lambda verdict: _WORST.index(verdict[0]))
        after.append(_since(state._replace(validity=validity, reason=reason), past, now, newest))
    there = {each.source for each in heard}
    for source, (name, role) in enumerate(inputs):
        if source not in there:
            quantity = "position" if role in ("fixes", "ship") else role
            silent = SensorState(name, name, quantity, "invalid", "silent: nothing came yet")
            after.append(_since(silent, old.get((name, name)), now, newest))
    return tuple(after)


def _judged(heard: Heard, record: _Record, age: float, word: str) -> tuple[Validity, str]:
    """Judge one sensor; ``word`` is the first one of the reason before."""
    if not len(heard.time) or age > timeout(heard):
        if heard.marked > heard.latest:
            return "invalid", "stale: it calls its fixes invalid itself"
        return "invalid", f"stale: nothing since {clock(heard.latest)}"
    still = heard.latest - record.stuck > timeout(heard)
    if still and (record.lively or record.suspect or record.rejected > _ACCEPTED):
        return "invalid", f"frozen: the same since {clock(record.stuck)}"
    share = f"{record.rejected:.0%} of its last observations rejected"
    least = _UPRIGHT if word == "biased" else _LEANS
    away = np.minimum(np.abs(record.lean), np.abs(record.lean - record.others))
    if np.any(away > least):
        side = f"biased against the others: {_side(record.lean, away)}"
        return ("invalid", f"{side}, {share}") if record.suspect else ("doubtful", side)
    if record.suspect:
        kept = word if word in ("biased", "frozen") else "jumping"
        return "invalid", f"{kept}: {share}"
    if record.rejected > (_ACCEPTED if word == "jumping" else _REJECTED):
        return "doubtful", f"jumping: {share}"
    if record.innovation > (_CALM if word == "noisy" else _NOISY):
        return "doubtful", f"noisy: {record.innovation:.1f} × what was declared or settled"
    return "valid", ""


def _side(lean: FloatArray, away: FloatArray) -> str:
    """Say how far, and to which side, in standard deviations."""
    axis = int(np.nanargmax(away))
    size = abs(float(lean[axis]))
    about = "more than 3 σ" if size > _CLIPPED else f"{size:.1f} σ"
    return f"{about} {_SIDES[axis][int(lean[axis] < 0.0)]}"


def _since(state: SensorState, past: SensorState | None, now: float, newest: float) -> SensorState:
    """Say since when it is judged so."""
    if past is not None and past.validity == state.validity and past.word == state.word:
        return state._replace(since=past.since)
    return state._replace(since=now if math.isfinite(now) else newest)


def _records(session: Session, heard: Heard) -> list[_Record]:
    """What the session knows of a sensor, series by series; nothing before it is settled.

    Of roll and pitch only whether they move: how much they do is the sea's affair, and a figure
    that was settled at the quay says nothing of a sensor out there.
    """
    if heard.name in session.sensors:
        found = _of(session.health, session.sensors.index(heard.name))
        return [found if session.repeats is None else _still(found, session, heard)]
    records = []
    for (sensor, name), state in session.channels.items():
        if sensor == heard.name and name in QUANTITIES and state.repeats is not None:
            since, lively = stuck(state.repeats)
            found = _Record() if QUANTITIES[name] == ATTITUDE else _of(state.health, 0)
            records.append(found._replace(stuck=float(since[0]), lively=bool(lively[0])))
    return records or [_Record()]


def _still(record: _Record, session: Session, heard: Heard) -> _Record:
    assert session.repeats is not None
    since, lively = stuck(session.repeats)
    index = session.sensors.index(heard.name)
    if index >= len(since):
        return record
    return record._replace(stuck=float(since[index]), lively=bool(lively[index]))


def _of(health: Health | None, index: int) -> _Record:
    if health is None or index >= len(health.seen) or health.seen[index] < _FEW:
        return _Record()
    lean = np.where((health.seen >= _FEW)[:, None], health.lean, np.nan)
    others = np.delete(lean, index, axis=0)[~np.delete(health.suspect, index)]
    known = np.isfinite(others).sum(axis=0)
    average = np.where(known > 0, np.nansum(others, axis=0) / np.maximum(known, 1), np.nan)
    return _Record(
        float(health.rejected[index]),
        math.sqrt(health.square[index]) if health.used[index] >= _FEW else math.nan,
        lean[index],
        average,
        bool(health.suspect[index]),
    )
