"""The record of each sensor: how many of its last observations were left out, and how noisy it is.

Exponential means over its observations; a pure recursion, so that one call over a series and many
over its parts give the same.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from surefix.jit import kernel
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["CHANGED", "SUSPECT", "TRUSTED", "Health", "no_health", "watch"]

SUSPECT: Final = 1
"""Most of the last observations of the sensor were left out."""
TRUSTED: Final = 2
"""… and now nearly all are used again."""
CHANGED: Final = 3
"""Its noise is not what was settled."""

_MEMORY = 30.0  # observations that count in the share of those left out
_LONG_MEMORY = 200.0  # … and in the noise
_FALLS, _RISES = 0.5, 0.2  # shares of those left out at which a sensor falls and rises
_RATIO = 2.0  # ratio of standard deviations that is told
_LARGEST = 16.0  # no single squared innovation counts for more
_MOST = _LARGEST**0.5


class Health(NamedTuple):
    """What is remembered of each of s sensors.

    Parameters
    ----------
    seen, used
        (s,) observations that were judged, and those that were used.
    rejected
        (s,) share left out of the last ones.
    square
        (s,) mean square of the standardised innovations of those used.
    lean
        (s, 3) mean of the standardised innovations of all that were judged, signed: a sensor that
        is right leans to no side, one that is biased against the others does. NaN before the first.
    suspect
        (s,) whether the sensor fell and did not rise since.
    scale
        (s,) ratio of its noise to what was settled, as last told.
    dragged
        (s,) whether its last fix was in a drag.
    """

    seen: IntArray
    used: IntArray
    rejected: FloatArray
    square: FloatArray
    lean: FloatArray
    suspect: BoolArray
    scale: FloatArray
    dragged: BoolArray


def no_health(sensors: int) -> Health:
    """Health of sensors that gave nothing yet."""
    return Health(
        np.zeros(sensors, np.int64),
        np.zeros(sensors, np.int64),
        np.zeros(sensors),
        np.ones(sensors),
        np.full((sensors, 3), np.nan),
        np.zeros(sensors, np.bool_),
        np.ones(sensors),
        np.zeros(sensors, np.bool_),
    )


def watch(
    health: Health,
    sensor: IntArray,
    out: BoolArray,
    square: FloatArray,
    standardised: FloatArray | None = None,
) -> tuple[Health, IntArray, FloatArray]:
    """Go on with the record of each sensor; ``health`` is not modified.

    Parameters
    ----------
    health
        Of at least as many sensors as are named.
    sensor, out
        (n,) which sensor an observation came from, and whether it was left out.
    square
        (n,) mean square of its standardised innovations; NaN is left aside.
    standardised
        (n, 3) the innovations themselves; NaN is left aside. None: they are not known.

    Returns
    -------
    health, what, figure
        The record after the series; (n,) 0 or one of the codes of this module, and the share left
        out or the ratio of the noise that goes with it.
    """
    after = Health._make(field.copy() for field in health)
    what = np.zeros(len(sensor), np.int64)
    figure = np.full(len(sensor), np.nan)
    if standardised is None:
        standardised = np.full((len(sensor), 3), np.nan)
    _watch(after, sensor, out, square, standardised, what, figure)
    return after, what, figure


@kernel
def _watch(
    health: Health,
    sensor: IntArray,
    out: BoolArray,
    square: FloatArray,
    standardised: FloatArray,
    what: IntArray,
    figure: FloatArray,
) -> None:
    for k in range(len(sensor)):
        s = sensor[k]
        health.seen[s] += 1
        gain = 1.0 / min(float(health.seen[s]), _MEMORY)
        health.rejected[s] += gain * ((1.0 if out[k] else 0.0) - health.rejected[s])
        for i in range(3):
            z = standardised[k, i]
            if not np.isnan(z):
                z = min(max(z, -_MOST), _MOST)
                before = health.lean[s, i]
                health.lean[s, i] = z if np.isnan(before) else before + gain * (z - before)
        if health.seen[s] < _MEMORY:
            continue
        share = health.rejected[s]
        if share > _FALLS and not health.suspect[s]:
            health.suspect[s], what[k], figure[k] = True, SUSPECT, share
        elif share < _RISES and health.suspect[s]:
            health.suspect[s], what[k], figure[k] = False, TRUSTED, share
        if out[k] or np.isnan(square[k]):
            continue
        health.used[s] += 1
        gain = 1.0 / min(float(health.used[s]), _LONG_MEMORY)
        health.square[s] += gain * (min(square[k], _LARGEST) - health.square[s])
        ratio = np.sqrt(health.square[s])
        change = ratio / health.scale[s]
        if health.used[s] >= _LONG_MEMORY and (change > _RATIO or change < 1.0 / _RATIO):
            health.scale[s] = ratio
            if what[k] == 0:
                what[k], figure[k] = CHANGED, ratio
