"""How long after its validity an observation arrives: by sensor, over the last minute.

It holds what the instrument, its line and the network add, and by how much the clock of this
machine is off. What a sentence says is compared with the time of its reception; sentences that do
not tell the time of their validity are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.types import Channel

__all__ = ["Delay", "delays_told", "with_delays"]

_MINUTE: Final = 60.0
_MOST: Final = 600  # observations of a sensor that are kept, at most


class Delay(NamedTuple):
    """The delay of a sensor.

    Parameters
    ----------
    sensor
        Its name.
    median, high
        s: the median of the last minute, and what 95 of 100 do not exceed.
    total
        Of how many observations, 600 at most.
    """

    sensor: str
    median: float
    high: float
    total: int


def with_delays(known: tuple[Channel, ...], new: Sequence[Channel]) -> tuple[Channel, ...]:
    """Add what was measured to what is known, and forget what is older than a minute."""
    if not new:
        return known
    by_sensor = {each.sensor: each for each in known}
    for each in new:
        before = by_sensor.get(each.sensor)
        time, value = each.time, each.value
        if before is not None:
            time, value = np.concatenate([before.time, time]), np.concatenate([before.value, value])
        kept = np.flatnonzero(time > np.max(time) - _MINUTE)[-_MOST:]
        by_sensor[each.sensor] = each._replace(time=time[kept], value=value[kept])
    return tuple(by_sensor.values())


def delays_told(known: Sequence[Channel]) -> tuple[Delay, ...]:
    """Tell the delay of each sensor.

    >>> series = Channel("delay_s", "usbl B01", np.arange(4.0), np.array([1.0, 1.2, 1.1, 9.0]), 0.0)
    >>> delays_told([series])
    (Delay(sensor='usbl B01', median=1.15, high=9.0, total=4),)
    """
    return tuple(
        Delay(
            each.sensor,
            float(np.median(each.value)),
            float(np.quantile(each.value, 0.95, method="higher")),
            len(each.value),
        )
        for each in known
    )
