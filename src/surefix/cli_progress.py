"""Progress bars of the command line, on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["over_bytes", "over_runs", "over_units"]


@contextmanager
def over_bytes(files: list[Path], *, quiet: bool) -> Iterator[Callable[[int], None] | None]:
    """Show a bar over the bytes of the inputs, on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn

    size = sum(path.stat().st_size for path in files if path.is_file())
    with Progress(
        TextColumn("reading and cleaning"),
        BarColumn(),
        DownloadColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task("", total=size)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def over_runs(runs: int) -> Iterator[Callable[[int], None] | None]:
    """Show a bar over the repetitions, on a terminal only."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("runs", total=runs)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def over_units(*, quiet: bool) -> Iterator[Callable[[int, int, int], None] | None]:
    """Show a bar over the units of a fleet, and how many of them failed, on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    with Progress(
        TextColumn("cleaning"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[said]}"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    ) as bar:
        task = bar.add_task("", total=None, said="")

        def tell(done: int, total: int, failed: int) -> None:
            said = f"{failed} failed" if failed else ""
            bar.update(task, completed=done, total=total, said=said)

        yield tell
