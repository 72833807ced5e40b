"""The command ``surefix warmup``, and the notice of a first run that compiles."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import typer

__all__ = ["announced", "warmup"]


def warmup() -> None:
    """Compile ahead what the first run would otherwise wait for."""
    from surefix.pipelines.warmup import warm_up

    typer.echo("Compiling, once for this machine and version …")
    begun = time.perf_counter()
    total = warm_up(lambda name, count: typer.echo(f"  {name}: {count} kernels compiled"))
    typer.echo(f"{total} kernels compiled in {time.perf_counter() - begun:.1f} s")


@contextmanager
def announced() -> Iterator[None]:
    """Say on a terminal that compilation begins, before the first kernel is compiled."""
    if not sys.stderr.isatty():
        yield
        return
    from surefix.jit import compilations

    told: list[str] = []

    def tell(name: str) -> None:
        if not told:
            typer.echo(
                "compiling, once for this machine and version (surefix warmup does it ahead) …",
                err=True,
            )
        told.append(name)

    with compilations(tell):
        yield
