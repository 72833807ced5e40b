"""`surefix live`: the words of the live service."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from surefix.service.station import Latest

__all__ = ["live"]


def live(
    options: Annotated[
        Path,
        typer.Option(help="TOML file: inputs, outputs, journal, and how to clean.", exists=False),
    ],
    log_json: Annotated[
        bool, typer.Option("--log-json", help="Write what happens to stderr, JSON lines.")
    ] = False,
) -> None:
    """Clean live sources and hand on the position, with a journal of all that came and went."""
    import asyncio
    import math
    import signal

    from surefix.service.live import begin_live, run_live
    from surefix.service.logbook import Logbook, Watchdog
    from surefix.service.options import read_live

    service = begin_live(read_live(options))
    if service.journal.aside:
        typer.echo(f"the journal was damaged: it is kept as {service.journal.aside}", err=True)
    for line in service.lines:
        typer.echo(f"from {line.address}")
    for output in service.options.outputs:
        typer.echo(f"to {output.address}")
    if service.options.web is not None:
        typer.echo(f"dashboard at http://{service.options.web.address}")
    if service.taken:
        typer.echo(f"going on after {service.taken:,} pieces in the journal")

    log = Logbook(service, lambda line: typer.echo(line, err=True)) if log_json else None
    watchdog = Watchdog()

    def stepped(_: object) -> None:
        watchdog.alive()
        if log is not None:
            log.note()

    service.watchers.append(stepped)

    async def serve() -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()

        def ask() -> None:
            watchdog.stopping()
            stop.set()

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, ask)
        await run_live(service, stop)

    asyncio.run(serve())
    if log is not None:
        log.end()
    known = service.now
    told = "no position yet" if known is None else f"the last position has σ {_sigma(known):.2f} m"
    for sensor in service.station.heard:
        if math.isfinite(sensor.latency):
            typer.echo(
                f"{sensor.name}: heard {sensor.latency:.2f} s after it was valid, "
                f"95 of 100 within {sensor.slowest:.2f} s"
            )
    typer.echo(f"stopped after {service.taken:,} pieces received; {told}")


def _sigma(known: Latest) -> float:
    """The larger of the horizontal standard deviations, m."""
    return float(max(known.sigma_position[:2]))
