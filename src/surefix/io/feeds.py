"""What the inputs of a live service are for, and the streams and series that follow from it.

An input has one task or several: a line may carry the strings of an acoustic system and those of a
Doppler log. Its bytes are read once, and what is read goes to the cleaning once for each task.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from surefix.io.nmea_stream import NmeaStream
from surefix.types import Log

__all__ = ["ROLES", "Feed", "Task", "again", "feeds", "streams", "task_of"]

ROLES: Final = ("fixes", "ship", "depth", "velocity", "heading", "attitude")
"""What an input can be for."""


class Task(NamedTuple):
    """What one input is for.

    Parameters
    ----------
    roles
        One or more of `ROLES`, in that order.
    target
        Of an acoustic positioning system: whose sightings are the fixes; None: the receivers'.
    """

    roles: tuple[str, ...]
    target: str | None = None

    def __str__(self) -> str:
        """The task as a journal has it.

        >>> str(Task(("fixes", "velocity"), "B01"))
        'fixes+velocity of B01'
        """
        roles = "+".join(self.roles)
        return roles if self.target is None else f"{roles} of {self.target}"


def task_of(text: str) -> Task:
    """Read what ``str`` gave of a task."""
    roles, _, target = text.partition(" of ")
    return Task(tuple(roles.split("+")), target or None)


class Feed(NamedTuple):
    """One series of parts that goes to the cleaning.

    Parameters
    ----------
    source
        Number of the input it comes from.
    role
        As `surefix.pipelines.merging.begin_merging` takes it.
    """

    source: int
    role: str


def feeds(tasks: Sequence[Task]) -> tuple[Feed, ...]:
    """The series that follow from the tasks of the inputs: first one for each, then the others.

    >>> feeds([Task(("fixes", "heading")), Task(("depth",))])
    (Feed(source=0, role='fixes'), Feed(source=1, role='depth'), Feed(source=0, role='turning'))
    """
    first = [Feed(i, task.roles[0]) for i, task in enumerate(tasks)]
    more = []
    for i, task in enumerate(tasks):
        for role in task.roles[1:]:
            lies = role in ("heading", "attitude")
            cleaned = lies and task.roles[0] == "fixes"  # beside the fixes already
            more.append(Feed(i, "turning" if cleaned else role))
    return (*first, *more)


def streams(
    names: Sequence[str], tasks: Sequence[Task], require_checksum: Sequence[bool]
) -> tuple[NmeaStream, ...]:
    """A reader for each input; arguments are one per input."""
    ship = any("ship" in task.roles for task in tasks)
    return tuple(
        NmeaStream(
            Path(name),
            checked,
            task.target,
            ship and ("ship" in task.roles or task.target is not None),
        )
        for name, task, checked in zip(names, tasks, require_checksum, strict=True)
    )


def again(log: Log) -> Log:
    """The same part of an input for another of its tasks: what is told of it is told once."""
    return replace(log, problems=(), events=(), counts={})
