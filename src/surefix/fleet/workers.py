"""Processes that work off tasks; one that dies costs its task, not the others."""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable
from multiprocessing import connection, get_context, parent_process
from multiprocessing.context import SpawnProcess
from typing import Any, NamedTuple, TypeVar

from surefix.errors import OutputError

__all__ = ["worked_off"]

Task = TypeVar("Task")
Result = TypeVar("Result")

_PATIENCE = 5.0  # s, for a process to end when told to


class _Worker(NamedTuple):
    process: SpawnProcess
    pipe: connection.Connection


def worked_off(
    run: Callable[[Task], Result], tasks: Iterable[Task], jobs: int
) -> Generator[tuple[Task, Result | Exception]]:
    """Run tasks and give each with its result as it is done, in any order.

    When the iterator is closed, or this process is interrupted or ends, the processes end too.

    Parameters
    ----------
    run
        A function of a module, so that another process finds it; it should not raise.
    tasks
        Plain records.
    jobs
        Processes; with one it is this process that works.

    Returns
    -------
    Generator
        The result is an `OutputError` where the process died over the task.
    """
    if jobs == 1:
        for task in tasks:
            yield task, run(task)
        return
    waiting = iter(tasks)
    busy: dict[connection.Connection, tuple[_Worker, Task]] = {}
    idle = [_hired(run) for _ in range(jobs)]
    try:
        while True:
            for task in itertools.islice(waiting, len(idle)):
                worker = idle.pop()
                with contextlib.suppress(OSError):  # a dead one is met below
                    worker.pipe.send(task)
                busy[worker.pipe] = worker, task
            if not busy:
                return
            for ready in connection.wait(list(busy)):
                assert isinstance(ready, connection.Connection)
                worker, task = busy.pop(ready)
                result: Result | Exception
                try:
                    result = ready.recv()
                except (EOFError, OSError):
                    worker.process.join()
                    result, worker = _death(worker.process.exitcode), _hired(run)
                idle.append(worker)
                yield task, result
    finally:
        _dismiss([*idle, *(worker for worker, _ in busy.values())])


def _hired(run: Callable[[Any], Any]) -> _Worker:
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(run, theirs), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours)


def _dismiss(workers: list[_Worker]) -> None:
    for worker in workers:
        worker.process.terminate()
    for worker in workers:
        worker.process.join(_PATIENCE)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()
        worker.pipe.close()


def _serve(run: Callable[[Any], Any], pipe: connection.Connection) -> None:
    """Life of a process: it ends when told to, or with the one that began it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # drafts are removed
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        pipe.send(run(task))


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _death(code: int | None) -> OutputError:
    how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
    return OutputError(
        f"the process that cleaned it died ({how})",
        "a process that ends its work",
        "there may be too little memory: fewer jobs, or mode realtime",
    )
