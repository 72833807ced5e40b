"""What is carried from one part of a log to the next."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from surefix.cleaning.duplicates import RepeatState
from surefix.filters.health import Health
from surefix.filters.liveliness import Lively
from surefix.filters.records import Epochs, Estimate, Motion, Recovery
from surefix.pipelines.channels import ChannelState
from surefix.pipelines.judge import FilterState
from surefix.pipelines.merging import Chunk, Merging
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.setup import Setup
from surefix.types import BoolArray, Channel

__all__ = ["Estimator", "Session"]

Estimator = Callable[[Motion, Recovery, Epochs, object], tuple[object, Estimate]]
"""Estimates a series in the place of the method: takes and gives what it remembers, None at first.

What it gets is prepared as for the method that the options name, and judged in the same way.
"""


@dataclass(frozen=True, kw_only=True)
class Session:
    """Where the cleaning of a log stands; begun by `surefix.pipelines.session.begin_session`.

    It is never modified, so that an old one can be kept, and gone on from again.

    Parameters
    ----------
    options
        How the log is cleaned.
    names
        Of the inputs.
    merging
        The inputs, on their way to one series of rows.
    estimator, memory
        One that is not among the methods, or None; and what it remembers.
    waiting
        What was read while there is too little to settle the log on.
    setup
        What is settled; None before.
    idle, repeats
        Axes that nobody measured, and what is known of fixes polled again; None before.
    filter, lively, health
        Of the track, how its process noise follows in real time, and the records of the sensors;
        None before.
    last_tau, next_grid
        Time of the last epoch, s, and number of the next regular time, if they are asked for.
    channels, arrived
        The scalar series by sensor and name: those begun, and values that wait.
    has_depth
        Whether a vertical was given as depth.
    held
        Fixes so far that were polled again.
    """

    options: CleanOptions
    names: tuple[str, ...]
    merging: Merging
    estimator: Estimator | None = None
    memory: object = None
    waiting: tuple[Chunk, ...] = ()
    setup: Setup | None = None
    idle: BoolArray | None = None
    repeats: RepeatState | None = None
    filter: FilterState | None = None
    lively: Lively | None = None
    health: Health | None = None
    last_tau: float = -np.inf
    next_grid: int | None = None
    channels: Mapping[tuple[str, str], ChannelState] = field(
        default_factory=lambda: MappingProxyType({})
    )
    arrived: Mapping[tuple[str, str], tuple[Channel, ...]] = field(
        default_factory=lambda: MappingProxyType({})
    )
    has_depth: bool = False
    held: int = 0

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the inputs; what is read again for its headings is one."""
        pairs = zip(self.names, self.merging.inflows, strict=True)
        return tuple(name for name, inflow in pairs if inflow.role != "turning")

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors met so far."""
        return self.merging.sensors
