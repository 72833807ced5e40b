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
from datetime import UTC, datetime
from typing import Final

from surefix.errors import InputError, OutputError
from surefix.io.journal import Journal, Received, Told, open_journal
from surefix.io.write_nmea import Epoch, sentences
from surefix.service.inbox import Arrived, Inbox
from surefix.service.inputs import Line, listen
from surefix.service.keeper import Gap, Keeper
from surefix.service.options import LiveOptions, OutputOptions
from surefix.service.outputs import Output, open_output
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

__all__ = ["Live", "begin_live", "run_live", "step"]

_TICK: Final = 1.0  # s without a fix after which the track is carried on by dead reckoning
_DRAIN: Final = 0.01  # s: at the end, what has arrived is taken, and nothing waited for
_STALE: Final = 3.0  # s since the last fix used, after which a position says it is dead-reckoned


@dataclass
class Live:
    """The service as it runs: the only state of it that changes.

    Parameters
    ----------
    options
        What it does.
    journal, keeper
        Where it is written, and what has not got there yet.
    station, now
        What is known, and where the vehicle is; None as long as nothing is settled.
    lines, outputs
        The inputs and the outputs, as they are.
    taken, said
        Numbers of the last bytes received, and of the last thing put out.
    alarms
        What is wrong at present, by what it concerns.
    """

    options: LiveOptions
    journal: Journal
    keeper: Keeper
    station: Station
    lines: list[Line]
    outputs: list[tuple[OutputOptions, Output]] = field(default_factory=list)
    now: Latest | None = None
    taken: int = 0
    said: int = 0
    alarms: dict[str, str] = field(default_factory=dict)
    stored_at: float = -math.inf
    shown_at: float = -math.inf


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
    for source, size in _replayed(options, journal).items():
        lines[source].size = size
    return Live(options, journal, Keeper(journal), station, lines, taken=taken, said=said)


def _replayed(options: LiveOptions, journal: Journal) -> dict[int, int]:
    """How much of the recorded logs is in the journal already, bytes: they go on from there."""
    logs = {i for i, each in enumerate(options.inputs) if each.address.kind == "file"}
    return {i: size for i, size in journal.sizes().items() if i in logs} if logs else {}


async def run_live(
    live: Live, stop: asyncio.Event, *, clock: Callable[[], float] = time.time
) -> None:
    """Serve until ``stop`` is set, or all inputs are recorded logs that have ended.

    Raises
    ------
    InputError, OutputError
        A port is taken, or a log is not there.
    """
    inbox = Inbox()
    try:
        for wanted in live.options.outputs:
            live.outputs.append((wanted, await open_output(wanted.address)))
        async with asyncio.TaskGroup() as tasks:
            reading = [
                tasks.create_task(listen(i, live.lines[i], inbox, allow=each.allow, clock=clock))
                for i, each in enumerate(live.options.inputs)
            ]
            while not stop.is_set() and not live.station.session.merging.ended:
                arrived = await _next(inbox, stop)
                await _write(live, _noticed(live, inbox))
                await step(live, arrived, clock())
            for task in reading:
                task.cancel()
            await step(live, await inbox.take(_DRAIN), clock())
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
    known = _latest(live, now, fresh=bool(received))
    fresh: list[tuple[Output, bytes]] = []
    if known is not None and (live.now is None or known.time > live.now.time):
        live.now, live.shown_at = known, now
        epoch = _epoch(known)
        for wanted, output in live.outputs:
            text = sentences(epoch, talker=wanted.talker, types=wanted.sentences)
            told.append(_told(live, known.time, "nmea", text.decode("ascii")))
            fresh.append((output, text))
    await _write(live, [*received, *told])
    for output, text in fresh:
        output.send(text)


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
        known=known.time - known.observed <= _STALE,
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


def _noticed(live: Live, inbox: Inbox) -> list[Told]:
    """Say that more came than could be taken."""
    if inbox.shed:
        text = f"{inbox.shed} bytes came faster than they could be taken; the oldest were given up"
        live.alarms["load"], inbox.shed = text, 0
        return [_told(live, math.nan, "alarm", text)]
    return []


async def _write(
    live: Live, records: Sequence[Received | Told] = (), *, whole: bool = False
) -> None:
    """Write what is not written yet, and a snapshot if it is time; without success, keep it."""
    due = time.monotonic() - live.stored_at >= live.options.snapshot_s
    snapshot = None
    if live.station.session.setup is not None and (whole or (due and records)):

        def snapshot() -> tuple[int, bytes]:
            live.stored_at = time.monotonic()
            return live.station.after, stored(live.station)

    keeper = live.keeper
    if await keeper.keep(records, snapshot, last=whole):
        if live.alarms.pop("journal", None) is not None and keeper.gap.pieces:
            gap, keeper.gap = keeper.gap, Gap()
            await keeper.keep([_told(live, math.nan, "alarm", _missing(gap))], last=whole)
    else:
        live.alarms["journal"] = keeper.trouble


def _missing(gap: Gap) -> str:
    text = f"the journal was away: {gap.size} bytes of the mission are not in it"
    if math.isnan(gap.first):
        return text
    first, last = (f"{datetime.fromtimestamp(at, UTC):%Y-%m-%dT%H:%M:%SZ}" for at in gap[2:])
    return f"{text}, of {first} to {last}"
