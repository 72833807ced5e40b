"""The live service: take what arrives, journal it with what follows from it, hand it on.

One step after the other: all that waits in the inbox goes through the station, is written to the
journal together with what it led to, and only then is anything put out. While the journal cannot be
written the service goes on, keeps what is to be written, and says so.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from surefix.errors import InputError, OutputError
from surefix.io.journal import Journal, Received, Told, open_journal
from surefix.io.write_nmea import Epoch, sentences
from surefix.service.alarms import Alarms, acknowledged, cleared, raised
from surefix.service.history import History, packed, unpacked
from surefix.service.inbox import Arrived, Inbox
from surefix.service.inputs import Line, listen
from surefix.service.options import LiveOptions, OutputOptions
from surefix.service.outputs import Output, open_output
from surefix.service.sensors import SensorState
from surefix.service.station import (
    Latest,
    Station,
    begin_station,
    latest,
    receive,
    resumed,
    stored,
)
from surefix.types import Cleaned

__all__ = ["Live", "acknowledge", "begin_live", "run_live", "step"]

_TICK: Final = 1.0  # s without a fix after which the track is carried on by dead reckoning
_KEPT: Final = 64 << 20  # bytes that are kept for a journal that cannot be written


@dataclass
class Live:
    """The service as it runs: the only state of it that changes.

    Parameters
    ----------
    options
        What it does.
    journal
        Where it is written.
    station, now
        What is known, and where the vehicle is; None as long as nothing is settled.
    lines, outputs
        The inputs and the outputs, as they are.
    taken, said
        Numbers of the last bytes received, and of the last thing put out.
    unwritten
        Received and told things that the journal has not got yet.
    lost
        Bytes that it will never get: they are a gap of the mission.
    alarms
        What is wrong at present, by what it concerns.
    history
        The last rows that were cleaned for good; as many as the web side keeps.
    watchers
        Told of every step after what it led to is out, with what it took in.
    """

    options: LiveOptions
    journal: Journal
    station: Station
    lines: list[Line]
    outputs: list[tuple[OutputOptions, Output]] = field(default_factory=list)
    now: Latest | None = None
    taken: int = 0
    said: int = 0
    unwritten: list[Received | Told] = field(default_factory=list)
    lost: int = 0
    alarms: Alarms = ()
    sensors: tuple[SensorState, ...] = ()
    stored_at: float = -math.inf
    shown_at: float = -math.inf
    history: History = field(default_factory=lambda: History(0))
    watchers: list[Callable[[Sequence[Arrived]], None]] = field(default_factory=list)


def begin_live(options: LiveOptions) -> Live:
    """Open the journal, and stand where the service stood when it was last written.

    Raises
    ------
    InputError, OutputError, OptionsError
        The journal cannot be opened, or is of other inputs.
    """
    journal = open_journal(options.journal)
    journal.begin([(each.name, each.role) for each in options.inputs])
    station = begin_station(options)
    for _, snapshot in journal.snapshots():
        try:
            station = resumed(options, snapshot)
            break
        except InputError:
            continue  # damaged: the one before it, and more of the journal, do as well
    for piece in journal.received(station.after):
        station, _ = receive(station, [piece])
    taken, said = journal.last()
    lines = [Line(each.address) for each in options.inputs]
    live = Live(options, journal, station, lines, taken=taken, said=said)
    if options.web is not None:
        live.history = History(options.web.history_rows)
        live.history.extend(unpacked(journal.newest("rows", options.web.history_rows)))
        live.history.sensors = station.session.sensors
    return live


async def run_live(
    live: Live, stop: asyncio.Event, *, clock: Callable[[], float] = time.time
) -> None:
    """Serve until ``stop`` is set, or all inputs are recorded logs that have ended.

    Raises
    ------
    InputError, OutputError
        A port is taken, or a log is not there.
    """
    inbox, web = Inbox(), None
    try:
        if live.options.web is not None:
            from surefix.service.web_server import open_web

            web = open_web(live, live.options.web, clock)
        for wanted in live.options.outputs:
            live.outputs.append((wanted, await open_output(wanted.address)))
        async with asyncio.TaskGroup() as tasks:
            reading = [
                tasks.create_task(listen(i, live.lines[i], inbox, allow=each.allow, clock=clock))
                for i, each in enumerate(live.options.inputs)
            ]
            if web is not None:
                live.watchers.append(web.notice)
                tasks.create_task(web.run())
            while not stop.is_set() and not live.station.session.merging.ended:
                arrived = await _next(inbox, stop)
                _noticed(live, inbox)
                await step(live, arrived, clock())
            for task in reading:
                task.cancel()
            if web is not None:
                web.stop()
    except* (InputError, OutputError) as group:
        raise group.exceptions[0] from None
    finally:
        await _write(live, whole=True)
        for _, output in live.outputs:
            await output.close()
        live.journal.close()


async def step(live: Live, arrived: Sequence[Arrived], now: float) -> None:
    """Take what has arrived, write it and what follows from it, and put that out."""
    received = []
    for each in arrived:
        live.taken += 1
        received.append(Received(live.taken, *each))
    live.station, batches = receive(live.station, received)
    told = [_told(live, *what) for what in _events(batches)]
    if live.options.web is not None and len(rows := live.history.add(batches)):
        told.append(_told(live, float(rows["time"][-1]), "rows", packed(rows)))
    known = _latest(live, now, fresh=bool(received))
    fresh: list[tuple[Output, bytes]] = []
    if known is not None and (live.now is None or known.time > live.now.time):
        live.now, live.shown_at = known, now
        epoch = _epoch(known)
        for wanted, output in live.outputs:
            text = sentences(epoch, talker=wanted.talker, types=wanted.sentences)
            told.append(_told(live, known.time, "nmea", text.decode("ascii")))
            fresh.append((output, text))
    live.unwritten += [*received, *told]
    await _write(live)
    for output, text in fresh:
        output.send(text)
    for watch in live.watchers:
        watch(arrived)


def acknowledge(live: Live, number: int, by: str, now: float) -> bool:
    """Tell that a person has seen an alarm; False if there is none of that number to be seen."""
    before = live.alarms
    live.alarms = acknowledged(before, number, by, now)
    if live.alarms != before:
        live.unwritten.append(_told(live, now, "alarm", f"{by} has seen {number}"))
    return live.alarms != before


def _latest(live: Live, now: float, *, fresh: bool) -> Latest | None:
    """Where the vehicle is, if that is news: at the newest fix, or by dead reckoning at a tick."""
    known = latest(live.station) if fresh else None
    behind = live.now is not None and (known is None or known.time <= live.now.time)
    if not behind or now - live.shown_at < _TICK or _recorded(live):
        return known
    return latest(live.station, now)


def _recorded(live: Live) -> bool:
    """Whether a recorded log is replayed, whose time is not the present one."""
    return any(line.address.kind == "file" for line in live.lines)


def _told(live: Live, at: float, kind: str, text: str) -> Told:
    live.said += 1
    return Told(live.said, live.taken, at, kind, text)


def _events(batches: Sequence[Cleaned]) -> list[tuple[float, str, str]]:
    return [
        (event.time, "event", f"{event.kind}: {event.text}")
        for batch in batches
        for event in batch.events
    ]


def _epoch(known: Latest) -> Epoch:
    if known.geodetic is None:
        return Epoch(known.time, known=False)
    latitude, longitude, height = known.geodetic
    east, north, _ = known.velocity
    sigma_east, sigma_north, sigma_up = known.sigma_position
    return Epoch(
        time=known.time,
        latitude=float(latitude),
        longitude=float(longitude),
        height=float(height),
        east=float(east),
        north=float(north),
        sigma_east=float(sigma_east),
        sigma_north=float(sigma_north),
        sigma_up=float(sigma_up),
        known=not known.dead_reckoned,
    )


async def _next(inbox: Inbox, stop: asyncio.Event) -> list[Arrived]:
    """What arrives next, or nothing after a tick, or at once when it is time to stop."""
    taking = asyncio.ensure_future(inbox.take(_TICK))
    stopping = asyncio.ensure_future(stop.wait())
    done, pending = await asyncio.wait({taking, stopping}, return_when=asyncio.FIRST_COMPLETED)
    for task in pending:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
    return taking.result() if taking in done else []


def _noticed(live: Live, inbox: Inbox) -> None:
    """Say that more came than could be taken."""
    if inbox.shed:
        text = f"{inbox.shed} bytes came faster than they could be taken; the oldest were given up"
        live.unwritten.append(_told(live, math.nan, "alarm", text))
        live.alarms = raised(live.alarms, "load", "warning", text, time.time())
        inbox.shed = 0


async def _write(live: Live, *, whole: bool = False) -> None:
    """Write what is not written yet, and a snapshot if it is time; without success, keep it."""
    snapshot = None
    due = time.monotonic() - live.stored_at >= live.options.snapshot_s
    if live.station.session.setup is not None and (whole or due):
        snapshot = live.station.after, stored(live.station)
    written = len(live.unwritten)
    received = [each for each in live.unwritten if isinstance(each, Received)]
    told = [each for each in live.unwritten if isinstance(each, Told)]
    if not received and not told and not whole:
        return
    try:
        await asyncio.to_thread(live.journal.write, received, told, snapshot)
    except OutputError as error:
        live.alarms = raised(live.alarms, "journal", "alarm", str(error), time.time())
        _spare(live)
        return
    if snapshot is not None:
        live.stored_at = time.monotonic()
    del live.unwritten[:written]
    live.alarms = cleared(live.alarms, "journal", time.time())
    if live.lost:
        text = f"the journal was away: {live.lost} bytes of the mission are not in it"
        live.unwritten.append(_told(live, math.nan, "alarm", text))
        live.lost = 0


def _spare(live: Live) -> None:
    """Keep no more than there is room for: the oldest goes, and is counted."""
    size = sum(_size(each) for each in live.unwritten)
    while size > _KEPT:
        gone = live.unwritten.pop(0)
        size -= _size(gone)
        live.lost += _size(gone)


def _size(each: Received | Told) -> int:
    return len(each.data) if isinstance(each, Received) else len(each.text)
