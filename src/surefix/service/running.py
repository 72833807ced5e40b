"""The service as it runs: what its parts look at, and what changes from step to step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from surefix.io.journal import Journal, Received, Told
from surefix.service.alarms import Alarm
from surefix.service.history import History
from surefix.service.inbox import Arrived
from surefix.service.inputs import Line
from surefix.service.keeper import Keeper
from surefix.service.options import LiveOptions, OutputOptions
from surefix.service.outputs import Output
from surefix.service.past import Note, Past
from surefix.service.recorder import Recorder
from surefix.service.sensors import SensorState
from surefix.service.station import Ahead, Latest, Station

__all__ = ["Live"]


@dataclass
class Live:
    """The service as it runs: the only state of it that changes.

    Parameters
    ----------
    options
        What it does.
    journal, keeper
        Where it is written, and what has not got there yet.
    station, now
        What is known, and where the vehicle is; None as long as nothing is settled.
    lines, outputs, recorders
        The inputs and the outputs, as they are.
    taken, said
        Numbers of the last bytes received, and of the last thing put out.
    unwritten
        What was received and told since the journal was last written.
    sensors
        How each is judged.
    alarms
        Those that are open, and those that were closed not long ago.
    set_by
        s by which the computer's clock was set since the service began.
    past, noted
        How the sensors and the alarms were, and what was noted last of each sensor.
    history
        The last rows that were cleaned for good; as many as the web side keeps.
    watchers
        Told of every step after what it led to is out, with what it took in.
    """

    options: LiveOptions
    journal: Journal
    keeper: Keeper
    station: Station
    lines: list[Line]
    outputs: list[tuple[OutputOptions, Output]] = field(default_factory=list)
    recorders: list[Recorder] = field(default_factory=list)
    now: Latest | None = None
    taken: int = 0
    said: int = 0
    unwritten: list[Received | Told] = field(default_factory=list)
    sensors: tuple[SensorState, ...] = ()
    alarms: tuple[Alarm, ...] = ()
    set_by: float = 0.0
    ahead: Ahead | None = None
    fixed_at: tuple[float, float] = (math.nan, math.nan)  # validity of the last row, and when seen
    stored_at: float = -math.inf
    shown_at: float = -math.inf
    begun: tuple[int, float] = (0, -math.inf)  # fixes that were begun, and when that was looked at
    shed_at: float = -math.inf
    past: Past = field(default_factory=Past)
    noted: tuple[Note, ...] = ()
    history: History = field(default_factory=lambda: History(0))
    watchers: list[Callable[[Sequence[Arrived]], None]] = field(default_factory=list)

    @property
    def recorded(self) -> bool:
        """Whether a recorded log is replayed, whose time is not the present one."""
        return any(line.address.kind == "file" for line in self.lines)

    def told(self, at: float, kind: str, text: str) -> Told:
        """Number something that is put out, s, Unix; whoever asks puts it among the unwritten."""
        self.said += 1
        return Told(self.said, self.taken, at, kind, text)

    @property
    def unsaved(self) -> list[Received | Told]:
        """What the journal has not got yet, the oldest first."""
        return [*self.keeper.waiting, *self.unwritten]
