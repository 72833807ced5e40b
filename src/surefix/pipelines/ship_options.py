"""Options of the ship's chain: what the ship can do, and how its sensors are combined."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from surefix.cleaning.thresholds import position_thresholds, rate_threshold
from surefix.cleaning.tukey53h import Ends
from surefix.errors import OptionsError
from surefix.types import FloatArray

__all__ = ["PERIODS", "ShipOptions", "thresholds"]

PERIODS: Mapping[str, float] = MappingProxyType(
    {
        "longitude": 2.0 * math.pi,
        "heading": 2.0 * math.pi,
        "magnetic heading": 2.0 * math.pi,
        "course": 2.0 * math.pi,
    }
)
"""Quantities that wrap, and one turn of each."""

_NAMES = {"roll": "max_roll_rate", "pitch": "max_roll_rate", "depth": "max_depth_rate"}
_NAMES |= dict.fromkeys(("v_east", "v_north", "speed"), "max_acceleration")
_NAMES |= dict.fromkeys(("heading", "magnetic heading", "course"), "max_turn_rate")
_DRIFT = {"position": 0.1, "speed": 1e-3, "heading": math.radians(1e-3), "depth": 0.1}


@dataclass(frozen=True, kw_only=True)
class ShipOptions:
    """How a ship's sensors are cleaned and combined.

    Parameters
    ----------
    max_speed
        V_max, m/s: thresholds of positions.
    max_acceleration
        a_max, m/s²: thresholds of velocities.
    max_turn_rate, max_roll_rate
        ω_max of heading and of roll and pitch, rad/s.
    max_depth_rate
        Greatest change of the water depth, m/s.
    rate_margin
        The plausibility check allows so many times these rates, because both samples that it
        compares are noisy; infinite switches it off.
    frozen
        Equal samples in sequence after which a sensor is taken for stuck; 0 never.
    ends
        Treatment of the ends by 53H.
    order
        Names of sensors, the most trusted first: in each quantity the others are aligned to the
        first one there is. Sensors not named follow in the order of their streams.
    step_s
        Step of the integrated records, s.
    stale_s
        Longest gap between samples that is bridged, s, if not three of the sensor's own steps.
    evaluation_s
        Window over which a sensor's noise is evaluated, s.
    alignment_s
        Window over which a sensor's offset from the most trusted one is evaluated, s: what is
        wrong for less than half of it does not enter.
    gate
        Standard deviations at which sensors contradict each other.
    fade_s
        Time in which a difference fades out that a failure or a return would make a jump of, s.
    drift
        By quantity, how fast an aligned sensor may wander once it cannot be compared, per second.
    systematic
        By quantity, a standard deviation of the most trusted sensor that no comparison on board
        shows, added to the σ of the record.

    Raises
    ------
    OptionsError
        A figure out of range.
    """

    max_speed: float = 15.0
    max_acceleration: float = 1.0
    max_turn_rate: float = math.radians(5.0)
    max_roll_rate: float = math.radians(5.0)
    max_depth_rate: float = 2.0
    rate_margin: float = 2.0
    frozen: int = 0
    ends: Ends = "line"
    order: tuple[str, ...] = ()
    step_s: float = 1.0
    stale_s: float = 3.0
    evaluation_s: float = 120.0
    alignment_s: float = 90.0
    gate: float = 6.0
    fade_s: float = 30.0
    drift: Mapping[str, float] = field(default_factory=lambda: MappingProxyType(_DRIFT))
    systematic: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        positive = (
            "max_speed max_acceleration max_turn_rate max_roll_rate max_depth_rate rate_margin "
            "step_s stale_s evaluation_s alignment_s gate fade_s"
        )
        for name in positive.split():
            if not getattr(self, name) > 0.0:
                raise OptionsError(f"{name} {getattr(self, name)}", "a number above 0")
        if self.frozen < 0:
            raise OptionsError(f"frozen {self.frozen}", "a whole number from 0")
        if any(not sigma >= 0.0 for sigma in (*self.drift.values(), *self.systematic.values())):
            raise OptionsError("a negative drift or systematic σ", "numbers from 0")


def thresholds(
    quantity: str, time: FloatArray, latitude: FloatArray, options: ShipOptions
) -> FloatArray:
    """Thresholds of 53H for the samples of one quantity, (n,) in its unit.

    Parameters
    ----------
    quantity
        ``latitude``, ``longitude``, ``v_east``, ``v_north``, ``speed``, ``roll``, ``pitch``,
        ``heading``, ``magnetic heading``, ``course`` or ``depth``.
    time
        (n,) s.
    latitude
        (m,) rad, of the ship; used for longitudes and latitudes only.
    options
        What the ship can do.

    Raises
    ------
    OptionsError
        No such quantity.
    """
    if quantity in ("latitude", "longitude"):
        north, east = position_thresholds(time, latitude, options.max_speed)
        return north if quantity == "latitude" else east
    if quantity not in _NAMES:
        known = ", ".join(["latitude", "longitude", *_NAMES])
        raise OptionsError(f"quantity {quantity!r}", f"one of {known}")
    return rate_threshold(np.asarray(time), float(getattr(options, _NAMES[quantity])))
