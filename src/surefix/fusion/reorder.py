"""Late observations in their place: a history of states, from which what followed is replayed.

A receiver keeps the messages it has used and the state after each. A message that arrives late is
put where its time of validity belongs, and everything after it is done again from the state before
it. The result is that of a filter that got all messages in order, bit for bit, because the very
same steps are taken. Messages are ordered by time and, at one time, by source.

Source: the exact (and simplest) answer to out-of-sequence measurements; see Bar-Shalom, Update with
out-of-sequence measurements in tracking: exact solution, IEEE Trans. AES 38, 2002, for filters
that cannot keep their past.

>>> history = start(0.0)
>>> step = lambda state, message: 10.0 * state + message.content
>>> for arrived in (Message(2.0, 0, 2.0), Message(1.0, 0, 1.0), Message(3.0, 0, 3.0)):
...     history, used = absorb(history, [arrived], step)
>>> history.state
123.0
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, TypeVar

__all__ = ["Fate", "History", "Message", "absorb", "start"]

S = TypeVar("S")
M = TypeVar("M")


class Fate(IntEnum):
    """What was done with a message."""

    USED = 0
    REPEATED = 1
    TOO_LATE = 2
    UNDATED = 3


@dataclass(frozen=True)
class Message(Generic[M]):
    """What a source sent: s of validity, number of the source, and anything a step can use."""

    time: float
    source: int
    content: M

    @property
    def place(self) -> tuple[float, int]:
        """Where it belongs in the order."""
        return self.time, self.source


@dataclass(frozen=True)
class History(Generic[S, M]):
    """Messages in order and the state after each; ``states[0]`` is the state before all of them.

    Parameters
    ----------
    horizon
        Place up to which the past is forgotten; None while nothing is.
    messages, states
        k messages, k + 1 states.
    """

    horizon: tuple[float, int] | None
    messages: tuple[Message[M], ...]
    states: tuple[S, ...]

    @property
    def state(self) -> S:
        """The state after all messages."""
        return self.states[-1]


def start(state: S) -> History[S, M]:
    """Make a history that holds a state and no message."""
    return History(None, (), (state,))


def absorb(
    history: History[S, M],
    arrived: Sequence[Message[M]],
    step: Callable[[S, Message[M]], S],
    *,
    keep_s: float = math.inf,
) -> tuple[History[S, M], tuple[Fate, ...]]:
    """Take in messages that have arrived, in any order, and replay what they change.

    Parameters
    ----------
    history
        So far.
    arrived
        Any number of messages. One whose time and source are known already is a repetition; one
        whose time is NaN has no place and is left out.
    step
        Predicts a state to a message's time and updates it: state, message → state; pure.
    keep_s
        How far the history reaches back from its newest message, s. What is older is forgotten,
        and a message from before is too late.

    Returns
    -------
    history, fates
        The new history, and what was done with each message in the order given.
    """
    messages = list(history.messages)
    places = [message.place for message in messages]
    first, fates = len(messages), []
    for message in arrived:
        at = bisect_left(places, message.place)
        if math.isnan(message.time):
            fates.append(Fate.UNDATED)
        elif history.horizon is not None and message.place <= history.horizon:
            fates.append(Fate.TOO_LATE)
        elif at < len(places) and places[at] == message.place:
            fates.append(Fate.REPEATED)
        else:
            messages.insert(at, message)
            places.insert(at, message.place)
            first = min(first, at)
            fates.append(Fate.USED)
    states = list(history.states[: first + 1])
    for message in messages[first:]:
        states.append(step(states[-1], message))
    return _shortened(history.horizon, messages, states, keep_s), tuple(fates)


def _shortened(
    horizon: tuple[float, int] | None, messages: list[Message[M]], states: list[S], keep_s: float
) -> History[S, M]:
    old = 0
    while messages and messages[old].time < messages[-1].time - keep_s:
        horizon = messages[old].place
        old += 1
    return History(horizon, tuple(messages[old:]), tuple(states[old:]))
