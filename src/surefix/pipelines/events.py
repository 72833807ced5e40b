"""Events of a cleaned log: what the verdicts say of more than one fix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surefix.filters.health import SUSPECT, TRUSTED, Health, no_health, watch
from surefix.filters.liveliness import Change
from surefix.pipelines.noise import PROCESS_UNIT
from surefix.reasons import vector
from surefix.types import BoolArray, Event, FloatArray, IntArray, Reason, Verdict, Verdicts

__all__ = ["jump_events", "motion_events", "run_events", "sensor_events"]

_TOLD_FROM = 3  # fixes of a run that are worth an event
_JUDGED = (Verdict.USED, Verdict.DOWNWEIGHTED, Verdict.REJECTED)


def jump_events(judged: Verdicts) -> list[Event]:
    """Jumps of the track that were accepted."""
    return [
        Event(
            "jump",
            time,
            "the track jumps: the fixes from here on agree with each other, not with those before",
        )
        for time in judged.detail[judged.reason == Reason.JUMP].tolist()
    ]


def run_events(
    judged: Verdicts, time: FloatArray, sensor: IntArray, sensors: list[str], *, growing: bool
) -> list[Event]:
    """Runs of fixes that are wrong together.

    Parameters
    ----------
    judged
        Verdicts of n fixes.
    time, sensor
        (n,) s, and which sensor each came from.
    sensors
        Names.
    growing
        Whether each fix counts those before it (real time), or all of its run (other modes).
    """
    events = []
    before: tuple[float, ...] = ()
    for k in np.flatnonzero(judged.reason == Reason.RUN).tolist():
        count, offset = int(judged.detail[k]), judged.offset[k].tolist()
        this = (float(sensor[k]), *np.nan_to_num(offset).tolist())
        first = count == _TOLD_FROM if growing else count >= _TOLD_FROM and this != before
        before = this
        if first:
            name = sensors[sensor[k]]
            text = f"fixes of {name} are wrong together by {vector(offset)}"
            text = text if growing else f"{count} {text}"
            events.append(Event("run", float(time[k]), text))
    return events


def motion_events(changes: Sequence[Change], time: FloatArray, model: str) -> list[Event]:
    """Process noise that was raised; ``time`` (n,) of the epochs, and the motion model."""
    return [
        Event(
            "noise-changed",
            float(time[each.after]),
            f"the motion is livelier than what was settled: its noise is {each.process:.3g}, no "
            f"longer {each.before:.3g} {PROCESS_UNIT[model]}",
        )
        for each in changes
    ]


def sensor_events(
    judged: Verdicts,
    time: FloatArray,
    sensor: IntArray,
    sensors: list[str],
    scale: FloatArray,
    supporting: BoolArray,
    health: Health | None,
) -> tuple[list[Event], Health]:
    """Sensors that wander off, are mostly rejected or noisier than settled, and that recover.

    Parameters
    ----------
    judged, time, sensor, sensors
        Of n observations; as for `run_events`.
    scale
        (n,) by how much the variance of each fix was changed since it was settled.
    supporting
        (n,) True for observations of a sensor that is no position sensor.
    health
        Of the fixes before these; None at the beginning.

    Returns
    -------
    events, health
        What is to be told, and the record after these fixes.
    """
    health = _widened(health, len(sensors))
    rows = np.flatnonzero(np.isin(judged.verdict, _JUDGED))
    known = np.isfinite(judged.standardised[rows])
    total = np.where(known, judged.standardised[rows], 0.0) ** 2
    count = known.sum(axis=1)
    square = np.where(count > 0, total.sum(axis=1) / np.maximum(count, 1), np.nan) * scale[rows]
    out = judged.verdict[rows] == Verdict.REJECTED
    lean = judged.standardised[rows] * np.sqrt(scale[rows, None])
    health, what, figure = watch(health, sensor[rows], out, square, lean)
    events = []
    for i in np.flatnonzero(what).tolist():
        name, at = sensors[sensor[rows[i]]], float(time[rows[i]])
        seen = "observations" if supporting[rows[i]] else "fixes"
        if what[i] == SUSPECT:
            text = f"{figure[i]:.0%} of the last {seen} of {name} rejected"
            events.append(Event("sensor-suspect", at, text))
        elif what[i] == TRUSTED:
            text = f"the {seen} of {name} agree with the track again"
            events.append(Event("sensor-trusted", at, text))
        elif not supporting[rows[i]]:
            text = f"the noise of {name} is {figure[i]:.2g} × what was settled"
            events.append(Event("noise-changed", at, text))
    for k in rows[_begin_to_drag(health, judged, sensor, rows)].tolist():
        text = (
            f"fixes of {sensors[sensor[k]]} wander off, by {vector(judged.offset[k].tolist())} now"
        )
        events.append(Event("drag", float(time[k]), text))
    return events, health


def _begin_to_drag(health: Health, judged: Verdicts, sensor: IntArray, rows: IntArray) -> BoolArray:
    """Which of some rows are the first fix of a drag; what ``health`` knows of it is brought on."""
    dragged = judged.reason[rows] == Reason.DRAG
    told = dragged | (judged.verdict[rows] != Verdict.REJECTED)  # another error ends no drag
    first = np.zeros(len(rows), np.bool_)
    for own in np.unique(sensor[rows]).tolist():
        mine = np.flatnonzero((sensor[rows] == own) & told)
        before = np.append(health.dragged[own], dragged[mine])
        first[mine] = dragged[mine] & ~before[:-1]
        health.dragged[own] = before[-1]
    return first


def _widened(health: Health | None, sensors: int) -> Health:
    """The same with sensors added that were not known."""
    fresh = no_health(sensors)
    if health is None:
        return fresh
    for new, old in zip(fresh, health, strict=True):
        new[: len(old)] = old
    return fresh
