"""The command ``surefix warmup``, and a first run that compiles what it needs."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from typing import TYPE_CHECKING

import typer

from surefix.cli_begin import begin

if TYPE_CHECKING:
    from surefix.pipelines.options import CleanOptions

__all__ = ["announced", "warmup"]


def warmup() -> None:
    """Compile ahead what the first run would otherwise wait for."""
    from surefix.pipelines.warmup import PARTS

    typer.echo("Compiling, once for this machine and version …")
    begun = time.perf_counter()
    total = _side_by_side(
        list(PARTS), lambda name, count: typer.echo(f"  {name}: {count} kernels compiled")
    )
    typer.echo(f"{total} kernels compiled in {time.perf_counter() - begun:.1f} s")


@contextmanager
def announced(options: CleanOptions | None = None) -> Iterator[None]:
    """Say on a terminal that compilation begins, and compile side by side what can be.

    Parameters
    ----------
    options
        With which the command cleans; without, each kernel is compiled when it is called.
    """
    from surefix.jit import compilations

    told: list[str] = []

    def tell(name: str) -> None:
        if not told and sys.stderr.isatty():
            typer.echo(
                "compiling, once for this machine and version (surefix warmup does it ahead) …",
                err=True,
            )
        told.append(name)

    due = _missing(options) if options is not None else []
    if min(len(due), _processors()) > 1:
        tell("")
        _side_by_side(due, lambda *_: None)
    with compilations(tell):
        yield


def _missing(options: CleanOptions) -> list[str]:
    from surefix.pipelines.warmup import missing, parts_for

    return missing(parts_for(options))


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _side_by_side(names: Sequence[str], told: Callable[[str, int], None]) -> int:
    """Compile parts in as many processes as there are processors; gives how many kernels.

    A process that cannot be begun, or dies, costs no more than time: what it leaves is compiled
    when it is called.
    """
    from surefix.fleet.workers import worked_off

    total, jobs = 0, min(_processors(), len(names))
    with suppress(OSError), closing(worked_off(_compile, names, jobs)) as results:
        for name, count in results:
            if isinstance(count, int):
                told(name, count)
                total += count
    return total


def _compile(name: str) -> int:
    from multiprocessing import parent_process

    if parent_process() is not None:  # it may end at once: it has no drafts to remove
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    begin()
    from surefix.pipelines.warmup import compile_part

    return compile_part(name)
