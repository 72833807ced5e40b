"""Times of an instrument that has a clock of its own, brought to the clock of the log."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["CALENDAR", "DeviceClock"]

CALENDAR = 1e9
"""s; a device's clock that says less counts from its start, not from 1970."""

_AGREE = 2.0  # s; clocks that agree so well are set to the same time


@dataclass(slots=True)
class DeviceClock:
    """The clock of one instrument.

    Parameters
    ----------
    reference
        s, the log's time that it was last compared with.
    offset
        s to add to its times.
    """

    reference: float = math.nan
    offset: float = math.nan

    def at(self, measured: float, told: float, now: float) -> float:
        """Instant of a measurement, s.

        A device that is set right is believed. Another one is only believed about how long ago the
        measurement was when the line was written, and that was ``now``: exact where the log says
        when each line was received, else early by what has passed since the sentence before that
        has a time.

        Parameters
        ----------
        measured, told
            s on the device's clock: of the measurement, and of the writing of the line.
        now
            s, the log's time of the line.

        >>> clock = DeviceClock()
        >>> clock.at(12.5, 13.0, 1000.0), clock.at(14.5, 15.0, 1002.0)
        (999.5, 1001.5)
        """
        if now != self.reference:
            self.reference, self.offset = now, now - told
        return measured if abs(self.offset) <= _AGREE else measured + self.offset
