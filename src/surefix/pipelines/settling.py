"""Settle a log on its head: what repeats, which axes say something, frame, noise, lateness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surefix.cleaning.duplicates import idle_axes, start_repeats
from surefix.errors import OptionsError
from surefix.pipelines.judge import begin
from surefix.pipelines.latency import Late, find_late, late_events
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import Rows, take_rows
from surefix.pipelines.setup import Setup, localise, settle
from surefix.pipelines.state import Session
from surefix.types import BoolArray, Event, Noise

__all__ = ["begin_rows", "settle_session"]


def begin_rows(session: Session, rows: Rows) -> Session:
    """Learn from the first rows how fixes repeat, and which axes nobody measured."""
    fixes, head, sensors = rows.fixes, _head(session.options), len(session.sensors)
    again = np.diff(rows.tau, prepend=np.nan) == 0.0
    positions = np.where(again[:, None], np.nan, fixes.position)
    return replace(
        session,
        repeats=start_repeats(positions[head], fixes.sensor[head], sensors),
        idle=idle_axes(
            fixes.position[head], fixes.sensor[head], sensors, geographic=fixes.geographic
        ),
    )


def settle_session(
    session: Session, rows: Rows, usable: BoolArray
) -> tuple[Session, tuple[Event, ...], tuple[Late, ...]]:
    """Settle frame, axes and noise, and begin the filter.

    Parameters
    ----------
    session
        With `begin_rows` behind it.
    rows
        The first ones, without idle axes.
    usable
        (n,) rows that may be learnt from.

    Raises
    ------
    OptionsError
        A sensor is named that the log does not have; or as `surefix.pipelines.setup.settle`.

    Returns
    -------
    session, events, late
        Sensors that are late are given if their delay is to be removed. Then the session is as
        before `begin_rows`, but knows the delays.
    """
    options, head = session.options, _head(session.options)
    rows, usable = take_rows(rows, head), usable[head]
    unknown = sorted({*options.sensor_sigma, *options.sensor_delay_s} - {*session.sensors})
    unknown += sorted({*options.lever_arm} - {*session.sensors, *session.names})
    if unknown:
        known = ", ".join(session.sensors)
        raise OptionsError(f"options for sensor {unknown[0]!r}", f"one of {known}")
    met = int(rows.fixes.sensor.max(initial=-1)) + 1
    setup = settle(rows, usable, list(session.sensors[:met]), options)
    setup = replace(setup, noise=_in_order(setup.noise, session))
    late = _late(session, setup, rows, usable)
    removed = bool(late) and options.latency == "remove"
    events = late_events(late, removed=removed)
    if removed:
        return _in_time(session, late), tuple(events), late
    geographic = rows.fixes.geographic
    events = [*events, *setup.events, *_idle_events(session, geographic=geographic)]
    track = begin(options, setup.motion, setup.recovery, setup.prior) if setup.axes else None
    return replace(session, setup=setup, filter=track), tuple(events), ()


def _in_order(noise: tuple[Noise, ...], session: Session) -> tuple[Noise, ...]:
    """Name the sensors in the order of the inputs; each block ends with the noise of the motion."""
    homes = dict(zip(session.sensors, session.merging.homes, strict=True))
    block, keys = 0, []
    for each in noise:
        keys.append((block, homes.get(each.sensor, len(homes))))
        block += each.sensor not in homes
    return tuple(noise[i] for i in sorted(range(len(noise)), key=keys.__getitem__))


def _head(options: CleanOptions) -> slice:
    """The rows that a log is settled on."""
    return slice(options.settle_rows if options.mode == "realtime" else None)


def _late(session: Session, setup: Setup, rows: Rows, usable: BoolArray) -> tuple[Late, ...]:
    """Sensors that are late against a velocity, as far as the options ask for it."""
    if session.options.latency == "ignore":
        return ()
    position, velocity = localise(rows, setup.frame, setup.origin)
    return find_late(rows, usable, position, velocity, list(session.sensors))


def _in_time(session: Session, late: tuple[Late, ...]) -> Session:
    """Go back to where nothing was settled; the delays are known now."""
    known = dict(session.options.sensor_delay_s)
    for each in late:
        known[each.sensor] = known.get(each.sensor, 0.0) + each.found.delay
    options = replace(session.options, sensor_delay_s=known, latency="ignore")
    return replace(session, options=options, repeats=None, idle=None)


def _idle_events(session: Session, *, geographic: bool) -> list[Event]:
    if session.idle is None:
        return []
    names = ("latitude", "longitude", "height") if geographic else ("axis x", "axis y", "axis z")
    return [
        Event(
            "idle-axis",
            np.nan,
            f"{names[axis]} of {session.sensors[sensor]} never changes; left out",
        )
        for sensor, axis in zip(*np.nonzero(session.idle), strict=True)
    ]
