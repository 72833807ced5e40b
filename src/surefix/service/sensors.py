"""What is known about each sensor: is it valid, how fast, how late, how often rejected."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

__all__ = ["SensorState", "Validity"]

Validity = Literal["valid", "doubtful", "invalid"]


class SensorState(NamedTuple):
    """One sensor, at present.

    Parameters
    ----------
    name, input
        Of the sensor, and of the input it came through.
    quantity
        ``position``, ``velocity``, ``depth``, ``heading`` or ``attitude``.
    validity, reason
        The judgement, and why; empty when valid. The reason begins with one word: ``silent``,
        ``stale``, ``frozen``, ``jumping``, ``biased`` or ``noisy``.
    since
        s, Unix: since when it is judged so.
    observed
        s, Unix: validity of its last observation.
    rate
        Hz, of the last minute.
    latency
        s, median between validity and arrival in the last minute; NaN without times of arrival.
    rejected
        Share of its last observations that were rejected; NaN before the first was judged. Like
        the next it is the record that the filter keeps, `surefix.filters.health`.
    innovation
        RMS of the normalised innovations of those used; 1 is as declared, or as was settled.
    """

    name: str
    input: str
    quantity: str = "position"
    validity: Validity = "valid"
    reason: str = ""
    since: float = math.nan
    observed: float = math.nan
    rate: float = math.nan
    latency: float = math.nan
    rejected: float = math.nan
    innovation: float = math.nan

    @property
    def word(self) -> str:
        """The first word of the reason."""
        return self.reason.partition(" ")[0].rstrip(":")
