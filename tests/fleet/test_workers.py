"""Processes that work off tasks."""

import os
import signal
from contextlib import closing

import pytest

import surefix
from surefix.fleet.workers import worked_off


def work(task):
    if task == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    return task, os.getpid()


def test_a_process_that_dies_costs_its_task_only():
    tasks = ["a", "die", "b", "c", "d"]
    with closing(worked_off(work, tasks, 2)) as results:
        found = dict(results)
    assert set(found) == set(tasks)
    error = found.pop("die")
    assert isinstance(error, surefix.OutputError)
    assert "signal 9" in str(error)
    assert {result[0] for result in found.values()} == {"a", "b", "c", "d"}
    assert os.getpid() not in {result[1] for result in found.values()}


@pytest.mark.skipif(os.name != "posix", reason="asks the system for a process")
def test_processes_end_when_the_results_are_not_wanted_any_more():
    results = worked_off(work, ["a", "b", "c"], 2)
    _, (_, process) = next(results)
    os.kill(process, 0)
    results.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
