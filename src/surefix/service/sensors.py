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
        ``position``, ``velocity``, ``depth`` or ``heading``.
    validity, reason
        The judgement, and why: stale, frozen, jumping, biased, noisy; empty when valid.
    since
        s, Unix: since when it is judged so.
    observed
        s, Unix: validity of its last observation.
    rate
        Hz, of the last minute.
    latency
        s, median between validity and arrival in the last minute; NaN without times of arrival.
    rejected
        Share of its observations of the last minute that were rejected.
    innovation
        RMS of its normalised innovations of the last minute; 1 is as declared.
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
