"""What is wrong at present: the causes of alarms, from what is known, by what they concern."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from surefix.reasons import clock
from surefix.service.alarms import Cause, Priority
from surefix.service.options import AlarmOptions
from surefix.service.sensors import SensorState
from surefix.service.station import Latest

__all__ = ["Condition", "causes"]

_GRACE: Final = 10.0  # s that an input may be silent from the start
_EARLY: Final = -0.5  # s between validity and arrival that are possible at least …
_LATE: Final = 5.0  # … and at most
_STEPPED: Final = 1.0  # s by which a clock that was set differs from one that goes on


class Condition(NamedTuple):
    """How the service is, beside its sensors.

    Parameters
    ----------
    now
        s, Unix.
    position
        Where the vehicle is, and with which σ; None as long as nothing is settled.
    journal
        Why the journal cannot be written; empty if it can.
    shed
        s, Unix: when something was last given up because too much came; −∞ before.
    set_by
        s by which the computer's clock was set since the service began.
    """

    now: float
    position: Latest | None = None
    journal: str = ""
    shed: float = -math.inf
    set_by: float = 0.0


def causes(
    sensors: Sequence[SensorState], condition: Condition, options: AlarmOptions
) -> dict[str, Cause]:
    """Tell what is wrong, by what it concerns: a sensor, position, journal, load, clock."""
    found: dict[str, Cause] = {}
    for sensor in sensors:
        young = sensor.word == "silent" and condition.now - sensor.since < _GRACE
        if sensor.validity != "valid" and not young:
            priority: Priority = "warning" if sensor.validity == "invalid" else "caution"
            found[sensor.name] = Cause(priority, sensor.reason)
    if condition.position is not None and (lost := _lost(condition.position, options)):
        found["position"] = Cause("alarm", lost)
    if condition.journal:
        found["journal"] = Cause("warning", condition.journal)
    if condition.now - condition.shed < _GRACE:
        text = "overload: more came than could be taken; the oldest was given up"
        found["load"] = Cause("warning", text)
    if said := _clock(sensors, condition.set_by):
        found["clock"] = Cause("caution", said)
    return found


def _lost(position: Latest, options: AlarmOptions) -> str:
    """Why there is no position to rely on."""
    sigma = float(max(position.sigma_position[:2]))
    if not position.time - position.observed <= options.dead_reckoning_s:
        return f"lost: dead reckoning since {clock(position.observed)}"
    if not sigma <= options.position_sigma_m:
        return f"uncertain: σ {sigma:.1f} m is above {options.position_sigma_m:g} m"
    return ""


def _clock(sensors: Sequence[SensorState], set_by: float) -> str:
    """What is wrong with the clock, of this computer or of a receiver."""
    if abs(set_by) > _STEPPED:
        return f"set: by {set_by:+.1f} s while the service ran; times of arrival go on as before"
    for sensor in sensors:
        if sensor.quantity == "position" and sensor.latency < _EARLY:
            return f"early: {sensor.name} arrives {-sensor.latency:.1f} s before the time it says"
    late = [each for each in sensors if each.quantity == "position" and each.latency > _EARLY]
    best = min(late, key=lambda each: each.latency, default=None)
    if best is not None and best.latency > _LATE:
        return f"late: {best.name} arrives {best.latency:.1f} s after the time it says"
    return ""
