"""`surefix live`: the words of the live service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["live"]


def live(
    options: Annotated[
        Path,
        typer.Option(help="TOML file: inputs, outputs, journal, and how to clean.", exists=False),
    ],
) -> None:
    """Clean live sources and hand on the position, with a journal of all that came and went."""
    import asyncio
    import signal

    from surefix.service.live import begin_live, run_live
    from surefix.service.options import read_live

    service = begin_live(read_live(options))
    before = f", after {service.taken:,} pieces in the journal" if service.taken else ""
    typer.echo(f"{len(service.lines)} inputs, {len(service.options.outputs)} outputs{before}")

    async def serve() -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop.set)
        await run_live(service, stop)

    asyncio.run(serve())
    typer.echo(f"stopped after {service.taken:,} pieces received and {service.said:,} things told")
