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
from pathlib import Path
from typing import Final

from surefix.errors import InputError, OutputError
from surefix.io.journal import Journal, Received, open_journal
from surefix.io.write_nmea import sentences
from surefix.service.history import History, packed, unpacked
from surefix.service.inbox import Arrived, Inbox
from surefix.service.inputs import Line, listen
from surefix.service.keeper import Gap, Keeper
from surefix.service.options import LiveOptions
from surefix.service.outputs import Output, open_output
from surefix.service.recorder import Recorder
from surefix.service.running import Live
from surefix.service.station import (
    Latest,
    begin_station,
    fixes_begun,
    look_ahead,
    receive,
    resumed,
    stored,
)
from surefix.service.steady import SteadyClock
from surefix.service.supervision import heed, judge, remember, tell_gap
from surefix.service.telling import epoch_of
from surefix.types import Cleaned

__all__ = ["begin_live", "run_live", "step"]

_TICK: Final = 1.0  # s without a fix after which the track is carried on by dead reckoning


def begin_live(options: LiveOptions) -> Live:
    """Open the journal, and stand where the service stood when it was last written.

    Raises
    ------
    InputError, OutputError, OptionsError
        The journal cannot be opened, or is of other inputs.
    """
    journal = open_journal(options.journal)
    journal.begin([(each.name, str(each.task)) for each in options.inputs])
    station = begin_station(options)
    for _, snapshot in journal.snapshots():
        try:
            station = resumed(options, snapshot)
            break
        except InputError:
            continue  # damaged: the one before it, and more of the journal, do as well
    files = [each.address.path for each in options.outputs if each.address.kind == "file"]
    recorders = [Recorder(Path(path), station.rows) for path in files]
    for piece in journal.received(station.after):
        station, batches = receive(station, [piece])
        for recorder in recorders:
            recorder.add(batches)
    for recorder in recorders:
        recorder.ready()
    taken, said = journal.last()
    lines = [Line(each.address) for each in options.inputs]
    for source, size in _replayed(options, journal).items():
        lines[source].size = size
    live = Live(options, journal, Keeper(journal), station, lines, taken=taken, said=said)
    live.recorders = recorders
    remember(live, time.time())
    if options.web is not None:
        live.history = History(options.web.history_rows)
        live.history.sensors = station.session.sensors
        with contextlib.suppress(InputError):  # it is only looked at
            live.history.extend(unpacked(journal.newest("rows", options.web.history_rows)))
    return live


def _replayed(options: LiveOptions, journal: Journal) -> dict[int, int]:
    """How much of the recorded logs is in the journal already, bytes: they go on from there."""
    logs = {i for i, each in enumerate(options.inputs) if each.address.kind == "file"}
    return {i: size for i, size in journal.sizes().items() if i in logs} if logs else {}


async def run_live(
    live: Live, stop: asyncio.Event, *, clock: Callable[[], float] | None = None
) -> None:
    """Serve until ``stop`` is set, or all inputs are recorded logs that have ended.

    Without a ``clock`` it is one that does not step when the computer's clock is set.

    Raises
    ------
    InputError, OutputError
        A port is taken, or a log is not there.
    """
    inbox, steady, web = Inbox(), SteadyClock(), None
    clock = clock or steady
    try:
        if live.options.web is not None:
            from surefix.service.web_server import open_web

            web = open_web(live, live.options.web, clock)
        for wanted in live.options.outputs:
            if wanted.address.kind != "file":
                live.outputs.append((wanted, await open_output(wanted.address)))
        _gaps(live)
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
                _noticed(live, inbox, clock())
                live.set_by = steady.set_by if clock is steady else 0.0
                await step(live, arrived, clock())
            for task in reading:
                task.cancel()
            await step(live, await inbox.take(0.01), clock())  # what has arrived is not lost
            if web is not None:
                web.stop()
    except* (InputError, OutputError) as group:
        raise group.exceptions[0] from None
    finally:
        await _write(live, clock(), whole=True)
        for _, output in live.outputs:
            await output.close()
        live.journal.close()
        for recorder in live.recorders:
            recorder.close()


async def step(live: Live, arrived: Sequence[Arrived], now: float) -> None:
    """Take what has arrived, write it and what follows from it, and put that out."""
    received = []
    for each in arrived:
        live.taken += 1
        received.append(Received(live.taken, *each))
    live.station, batches = receive(live.station, received)
    for recorder in live.recorders:
        recorder.add(batches)
    told = [live.told(*what) for what in _events(batches)]
    if live.options.web is not None and len(rows := live.history.add(batches)):
        told.append(live.told(float(rows["time"][-1]), "rows", packed(rows)))
    known = _latest(live, now, fresh=bool(received))
    fresh: list[tuple[Output, bytes]] = []
    if known is not None and (live.now is None or known.time > live.now.time):
        live.now, live.shown_at = known, now
        epoch = epoch_of(known)
        for wanted, output in live.outputs:
            text = sentences(epoch, talker=wanted.talker, types=wanted.sentences)
            told.append(live.told(known.time, "nmea", text.decode("ascii")))
            fresh.append((output, text))
    live.unwritten += [*received, *told]
    judge(live, now)
    trouble = live.keeper.trouble
    await _write(live, now)
    if live.keeper.trouble != trouble:
        heed(live, now)
    for output, text in fresh:
        output.send(text)
    for watch in live.watchers:
        watch(arrived)


def _gaps(live: Live) -> None:
    """Say of each recorded track which rows it will never have."""
    for each in live.recorders:
        if each.missing:
            text = f"note: {each.place} lacks {each.missing} rows before these"
            live.unwritten.append(live.told(math.nan, "event", text))


def _latest(live: Live, now: float, *, fresh: bool) -> Latest | None:
    """Where the vehicle is, if that is news: at the newest fix, or by dead reckoning at a tick.

    Dead reckoning goes on from the last row by the time that has passed since it was seen, so that
    a clock of this computer that is wrong does no harm.
    """
    known, news = None, fixes_begun(live.station)
    if fresh and (news != live.begun[0] or now - live.begun[1] >= _TICK):
        live.begun = news, now
        live.ahead = look_ahead(live.station)
        known = live.ahead.shown
    if known is not None and not known.time <= live.fixed_at[0]:
        live.fixed_at = known.time, now
    behind = live.now is not None and (known is None or known.time <= live.now.time)
    if not behind or now - live.shown_at < _TICK or live.recorded:
        return known
    newest, seen = live.fixed_at
    return look_ahead(live.station, newest + now - seen).shown


def _events(batches: Sequence[Cleaned]) -> list[tuple[float, str, str]]:
    return [
        (event.time, "event", f"{event.kind}: {event.text}")
        for batch in batches
        for event in batch.events
    ]


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


def _noticed(live: Live, inbox: Inbox, now: float) -> None:
    """Say that more came than could be taken."""
    if inbox.shed:
        text = f"{inbox.shed} bytes came faster than they could be taken; the oldest were given up"
        live.unwritten.append(live.told(now, "event", f"overload: {text}"))
        live.shed_at, inbox.shed = now, 0


async def _write(live: Live, now: float, *, whole: bool = False) -> None:
    """Write what is not written yet, and a snapshot if it is time; without success, keep it."""
    due = time.monotonic() - live.stored_at >= live.options.snapshot_s
    keeper, records = live.keeper, live.unwritten
    live.unwritten = []
    snapshot = None
    if live.station.session.setup is not None and (whole or (due and records)):

        def snapshot() -> tuple[int, bytes]:
            live.stored_at = time.monotonic()
            for recorder in live.recorders:  # a snapshot knows of no row that is not recorded
                recorder.flush()
            return live.station.after, stored(live.station)

    if await keeper.keep(records, snapshot, last=whole) and keeper.gap.pieces:
        gap, keeper.gap = keeper.gap, Gap()
        tell_gap(live, gap, now)
        if whole:
            await keeper.keep(live.unwritten, last=True)
