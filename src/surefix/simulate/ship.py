"""A ship under way for hours: what its INS, GNSS, gyro, log and sounder say, and their faults.

The world of paper 003: sensors at 1 Hz for 11 hours. The ship runs legs with course changes, also
through north, in a seaway that moves velocities, heading, roll and pitch. Every sensor errs as its
kind does: the INS is smooth and drifts (Schuler oscillation), GNSS is noisy but does not, the log
measures through the water, which moves, the gyro has a constant error.

What is wrong with the logs, and known to be, is drawn by `surefix.simulate.ship_faults`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surefix.errors import OptionsError
from surefix.geo.local_frame import LocalFrame, rotate
from surefix.simulate.ship_faults import BURSTS, Faults, disturbed
from surefix.types import BoolArray, FloatArray

__all__ = ["QUANTITIES", "ShipLog", "ShipSensor", "simulate"]

QUANTITIES = {
    "INS": ("latitude", "longitude", "v_east", "v_north", "roll", "pitch", "heading"),
    "GNSS": ("latitude", "longitude", "speed"),
    "gyro": ("heading",),
    "log": ("speed",),
    "sounder": ("depth",),
}
"""Sensors and what each measures: angles in rad, speeds in m/s, depth in m."""

_START = 1_718_000_000.0
_ORIGIN = LocalFrame(38.4, 121.7)
_SCHULER = 2.0 * np.pi / 5064.0  # rad/s
_METRE = 1.0 / 6.37e6  # rad, for sizes of faults only
_DEG = np.pi / 180.0
# least and greatest gross error
_GROSS = {
    "latitude": (100.0 * _METRE, 5000.0 * _METRE),
    "longitude": (100.0 * _METRE, 5000.0 * _METRE),
    "v_east": (4.0, 30.0),
    "v_north": (4.0, 30.0),
    "speed": (4.0, 30.0),
    "roll": (15.0 * _DEG, 60.0 * _DEG),
    "pitch": (15.0 * _DEG, 60.0 * _DEG),
    "heading": (15.0 * _DEG, 170.0 * _DEG),
    "depth": (10.0, 200.0),
}


@dataclass(frozen=True, kw_only=True)
class ShipSensor:
    """One quantity as one sensor measured it.

    Parameters
    ----------
    sensor, quantity
        As in `QUANTITIES`.
    value
        (n,) as logged, faults included; NaN where it is missing.
    intact
        (n,) what the sensor would have logged without the faults.
    truth
        (n,) rad, m/s or m.
    valid
        (n,) the sensor's own validity bit.
    faults
        Which samples are wrong, and how.
    period
        2π for heading and longitude, else 0.
    """

    sensor: str
    quantity: str
    value: FloatArray
    intact: FloatArray
    truth: FloatArray
    valid: BoolArray
    faults: Faults
    period: float


@dataclass(frozen=True, kw_only=True)
class ShipLog:
    """A simulated voyage.

    Parameters
    ----------
    frame
        Origin of the local axes.
    time
        (n,) s Unix, every second.
    position
        (n, 2) true place in the local frame, m east and north.
    sensors
        One a sensor and quantity.
    outage
        (2,) s: GNSS is gone from … to.
    """

    frame: LocalFrame
    time: FloatArray
    position: FloatArray
    sensors: tuple[ShipSensor, ...]
    outage: FloatArray

    def sensor(self, sensor: str, quantity: str) -> ShipSensor:
        """Give one quantity of one sensor."""
        return next(s for s in self.sensors if (s.sensor, s.quantity) == (sensor, quantity))


def simulate(
    seed: int | list[int],
    *,
    hours: float = 11.0,
    gross_share: float = 0.013,
    bursts: tuple[int, ...] = BURSTS,
) -> ShipLog:
    """Draw one voyage; the same seed and options give the same bits.

    Parameters
    ----------
    seed
        Of ``numpy.random.default_rng``.
    hours
        Duration, at least 0.25.
    gross_share
        Share of gross errors among the samples, 0 … 0.05.
    bursts
        Lengths of the runs of gross errors, among `surefix.simulate.ship_faults.BURSTS`; without
        the others their share of the errors is left out. The rest of the voyage stays the same.

    Raises
    ------
    OptionsError
        A voyage too short, a share out of range, or no such length.
    """
    if not hours >= 0.25:
        raise OptionsError(f"hours {hours}", "at least 0.25")
    if not 0.0 <= gross_share <= 0.05:
        raise OptionsError(f"gross_share {gross_share}", "0 … 0.05")
    if not set(bursts) <= set(BURSTS):
        raise OptionsError(f"bursts {bursts}", f"lengths among {BURSTS}")
    motion, noise, faults = np.random.default_rng(seed).spawn(3)
    t = np.arange(round(hours * 3600.0), dtype=np.float64)
    true, place = _truth(motion, t)
    out_from = 0.55 * t[-1]
    outage = _START + np.array([out_from, out_from + min(600.0, 0.06 * t[-1])])
    sensors = []
    for sensor, quantities in QUANTITIES.items():
        measured = _measured(noise, sensor, t, true, place)
        for quantity in quantities:
            gone = (_START + t >= outage[0]) & (_START + t < outage[1]) & (sensor == "GNSS")
            wrong = disturbed(
                faults, measured[quantity], _GROSS[quantity], gross_share, gone, bursts
            )
            period = 2.0 * np.pi if quantity in ("heading", "longitude") else 0.0
            turn = period if quantity == "heading" else 0.0
            sensors.append(
                ShipSensor(
                    sensor=sensor,
                    quantity=quantity,
                    value=_reduced(wrong.value, turn),
                    intact=_reduced(measured[quantity], turn),
                    truth=_reduced(true[quantity], turn),
                    valid=wrong.valid,
                    faults=wrong.faults,
                    period=period,
                )
            )
    return ShipLog(
        frame=_ORIGIN, time=_START + t, position=place, sensors=tuple(sensors), outage=outage
    )


def _reduced(angle: FloatArray, period: float) -> FloatArray:
    return np.mod(angle, period) if period else angle


def _truth(rng: np.random.Generator, t: FloatArray) -> tuple[dict[str, FloatArray], FloatArray]:
    """Quantities and place: legs of a quarter of an hour, courses either side of north, waves."""
    legs = int(t[-1] // 900.0) + 1
    east_west = np.tile([0.6, -0.5, 2.2, -2.4], legs // 4 + 1)[:legs]
    asked = np.unwrap(east_west + rng.normal(0.0, 0.25, legs))
    leg = np.minimum((t // 900.0).astype(np.int64), legs - 1)
    yaw = sum((_wave(rng, t, 0.3 * _DEG, 9.0) for _ in range(3)), np.zeros(len(t)))
    course = _lagged(asked[leg], 1.0 / 40.0)
    speed = _lagged(rng.uniform(5.0, 7.5, legs)[leg], 1.0 / 60.0)
    surge = sum((_wave(rng, t, 0.05, 8.0) for _ in range(3)), np.zeros(len(t)))
    sway = sum((_wave(rng, t, 0.08, 8.5) for _ in range(3)), np.zeros(len(t)))
    ahead = speed + surge
    v_x = ahead * np.sin(course) + sway * np.cos(course)
    v_y = ahead * np.cos(course) - sway * np.sin(course)
    place = np.column_stack([_integral(v_x), _integral(v_y)])
    latitude, longitude, convergence = _ORIGIN.to_geographic(*place.T)
    v_east, v_north = rotate(v_x, v_y, -convergence)
    depth = 55.0 + 20.0 * np.sin(place[:, 0] / 2500.0) + 10.0 * np.cos(place[:, 1] / 1700.0)
    return {
        "latitude": np.radians(latitude),
        "longitude": np.radians(longitude),
        "v_east": v_east,
        "v_north": v_north,
        "speed": np.hypot(v_east, v_north),
        "roll": sum((_wave(rng, t, 1.2 * _DEG, 10.0) for _ in range(3)), np.zeros(len(t))),
        "pitch": sum((_wave(rng, t, 0.5 * _DEG, 8.0) for _ in range(3)), np.zeros(len(t))),
        "heading": course + yaw,
        "depth": depth,
    }, place


def _measured(
    rng: np.random.Generator,
    sensor: str,
    t: FloatArray,
    true: dict[str, FloatArray],
    place: FloatArray,
) -> dict[str, FloatArray]:
    """What the sensor logs if nothing fails."""

    def white(sigma: float) -> FloatArray:
        return np.asarray(rng.normal(0.0, sigma, len(t)))

    match sensor:
        case "INS":
            errors = [_schuler(rng, t) for _ in range(2)]
            offset = np.column_stack([_integral(e) for e in errors])
            at = place + offset + np.column_stack([white(0.05), white(0.05)])
            latitude, longitude, _ = _ORIGIN.to_geographic(*at.T)
            return {
                "latitude": np.radians(latitude),
                "longitude": np.radians(longitude),
                "v_east": true["v_east"] + errors[0] + white(0.02),
                "v_north": true["v_north"] + errors[1] + white(0.02),
                "roll": true["roll"] + white(0.02 * _DEG),
                "pitch": true["pitch"] + white(0.02 * _DEG),
                "heading": true["heading"] + rng.normal(0.0, 0.1 * _DEG) + white(0.02 * _DEG),
            }
        case "GNSS":
            slow = np.column_stack([_wander(rng, t, 1.0, 300.0) for _ in range(2)])
            at = place + slow + np.column_stack([white(1.0), white(1.0)])
            latitude, longitude, _ = _ORIGIN.to_geographic(*at.T)
            return {
                "latitude": np.radians(latitude),
                "longitude": np.radians(longitude),
                "speed": np.abs(true["speed"] + white(0.1)),
            }
        case "gyro":
            return {"heading": true["heading"] + rng.normal(0.0, 0.5 * _DEG) + white(0.05 * _DEG)}
        case "log":
            current = _wander(rng, t, 0.3, 7200.0)
            scale = 1.0 + rng.normal(0.0, 0.01)
            return {"speed": np.abs(scale * true["speed"] + current + white(0.08))}
        case _:
            return {"depth": true["depth"] + white(0.15)}


def _wave(rng: np.random.Generator, t: FloatArray, amplitude: float, period: float) -> FloatArray:
    """One component of a seaway."""
    turns = t / (period * rng.uniform(0.75, 1.35)) + rng.uniform()
    return np.asarray(amplitude * rng.uniform(0.6, 1.3) * np.sin(2.0 * np.pi * turns))


def _schuler(rng: np.random.Generator, t: FloatArray) -> FloatArray:
    """Velocity error of an INS, m/s: the Schuler oscillation and a slow drift."""
    swing = rng.uniform(0.1, 0.3) * np.sin(_SCHULER * t + rng.uniform(0.0, 2.0 * np.pi))
    return np.asarray(swing + rng.normal(0.0, 0.05))


def _wander(
    rng: np.random.Generator, t: FloatArray, sigma: float, correlation: float
) -> FloatArray:
    """A first-order Gauss–Markov process at 1 Hz."""
    from scipy.signal import lfilter

    keep = np.exp(-1.0 / correlation)
    drive = sigma * np.sqrt(1.0 - keep * keep) * rng.standard_normal(len(t))
    start = np.array([keep * sigma * rng.standard_normal()])
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, zi=start)[0])


def _lagged(asked: FloatArray, rate: float) -> FloatArray:
    """Second-order response to steps: nothing turns at once."""
    from scipy.signal import lfilter

    keep = 1.0 - rate
    out = asked
    for _ in range(2):
        out = lfilter([rate], [1.0, -keep], out, zi=np.array([keep * asked[0]]))[0]
    return np.asarray(out)


def _integral(rate: FloatArray) -> FloatArray:
    """Trapezoidal integral at 1 s, from 0."""
    return np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1])))
