"""Work shared among processes, with results in the order of the tasks."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

__all__ = ["shared"]

Task = TypeVar("Task")
Result = TypeVar("Result")


def shared(run: Callable[[Task], Result], tasks: Iterable[Task], jobs: int) -> Iterator[Result]:
    """Run tasks and give their results in the order of the tasks.

    Parameters
    ----------
    run
        A function of a module, so that another process finds it.
    tasks
        Plain records.
    jobs
        Processes; with one it is this process that works.
    """
    if jobs == 1:
        yield from map(run, tasks)
        return
    context, deaf = get_context("spawn"), (signal.SIGINT, signal.SIG_IGN)  # this process will tell
    with ProcessPoolExecutor(jobs, context, initializer=signal.signal, initargs=deaf) as pool:
        yield from pool.map(run, tasks)
