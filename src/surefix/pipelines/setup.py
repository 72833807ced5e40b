"""What is settled once, on the head of a log: frame, axes, noise, recovery."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surefix.errors import OptionsError
from surefix.filters.deciding import AHEAD
from surefix.filters.hypotheses import Prior
from surefix.filters.noise import speed_scale
from surefix.filters.records import Motion, Recovery
from surefix.filters.track import by_axis, by_block
from surefix.geo.local_frame import LocalFrame, origin_of, rotate
from surefix.models.motion import MODELS
from surefix.pipelines.noise import settle_noise
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.rows import Rows
from surefix.types import BoolArray, Event, FloatArray, Noise

__all__ = ["FARTHEST", "Setup", "localise", "settle"]

FARTHEST = 1e9
"""m: what lies beyond is as wild as what lies there, and its square is finite."""
_LAG_FIXES = 20
_FEW_HEIGHTS = 3  # heights that show an offset
_ANOTHER_DEPTH = 200.0  # m: a depth that differs more is not the vehicle's
_DISAGREE = 3.0  # standard errors beyond which a height offset is more than chance


@dataclass(frozen=True, kw_only=True)
class Setup:
    """How the rows of one log are turned into a track.

    Parameters
    ----------
    frame
        Local frame of geographic input, else None.
    origin
        (3,) m subtracted from metric input, so that the filter works on small numbers.
    axes
        Which of x, y, z are observed.
    motion, model, recovery
        Of the filter. Groups are horizontal and vertical blocks with a loss, else single axes. The
        motion model by its name.
    prior
        Of several hypotheses; None for a loss.
    interval
        Median interval between fixes, s.
    lag
        Seconds of future in the lagged mode.
    position, velocity
        (sensors, 3) standard deviations used where the records declare none.
    height_offset
        (sensors,) m subtracted from the heights of a sensor to agree with the depth sensor.
    noise, events
        The same for people.
    """

    frame: LocalFrame | None
    origin: FloatArray
    axes: tuple[int, ...]
    motion: Motion
    model: str
    recovery: Recovery
    prior: Prior | None
    interval: float
    lag: float
    position: FloatArray
    velocity: FloatArray
    height_offset: FloatArray
    noise: tuple[Noise, ...]
    events: tuple[Event, ...]

    @property
    def blocks(self) -> tuple[tuple[int, ...], ...]:
        """Axes of the filter that share their process noise: the horizontal ones, the vertical."""
        flat = tuple(k for k, axis in enumerate(self.axes) if axis != 2)
        high = tuple(k for k, axis in enumerate(self.axes) if axis == 2)
        return tuple(block for block in (flat, high) if block)


def localise(
    rows: Rows, frame: LocalFrame | None, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Position (n, 3) and velocity (n, 3) of rows in the local axes, at the reference point."""
    position, velocity = rows.fixes.position - origin, rows.fixes.velocity.copy()
    arm = rows.lever.copy()
    if frame is not None and rows.fixes.geographic:
        x, y, convergence = frame.to_local(rows.fixes.position[:, 0], rows.fixes.position[:, 1])
        position[:, 0], position[:, 1] = x, y
        turn = np.nan_to_num(convergence)
        velocity[:, 0], velocity[:, 1] = rotate(velocity[:, 0], velocity[:, 1], turn)
        for k in (0, 3) if arm.shape[1] else ():
            arm[:, k], arm[:, k + 1] = rotate(arm[:, k], arm[:, k + 1], turn)
    if arm.shape[1]:
        position -= arm[:, :3]
        velocity -= arm[:, 3:6]
    return np.clip(position, -FARTHEST, FARTHEST), np.clip(velocity, -FARTHEST, FARTHEST)


def settle(rows: Rows, usable: BoolArray, sensors: list[str], options: CleanOptions) -> Setup:
    """Settle frame, axes and noise on the head of a log.

    Parameters
    ----------
    rows
        The head; the whole log where the mode allows it.
    usable
        (n,) rows that may be learnt from: neither late nor repeated nor marked invalid.
    sensors
        Names of the sensors.
    options
        Figures given there win over estimates.

    Raises
    ------
    OptionsError
        The lag is too short for the method.
    """
    frame, origin = _frame(rows, usable)
    position, velocity = localise(rows, frame, origin)
    position[~usable], velocity[~usable] = np.nan, np.nan
    offset, offset_events = _height_offsets(rows, position, sensors)
    position[:, 2] -= np.where(rows.auxiliary, 0.0, offset[rows.fixes.sensor])
    axes = tuple(i for i in range(3) if np.isfinite(position[:, i]).any())
    interval = _interval(rows, position)
    least = AHEAD.get(options.method, 0) * interval
    if options.lag_s is not None and options.lag_s < least:
        raise OptionsError(
            f"a lag of {options.lag_s:g} s with method {options.method}",
            f"at least {least:.3g} s, the time of the fixes it looks ahead",
        )
    after = options.patience(interval)
    speed = max([*(_speed(rows, position, i) for i in axes), 1e-3])
    figures = settle_noise(rows, position, velocity, axes, sensors, options, speed, after)
    group = by_axis(len(axes)) if options.by_axis else by_block(axes)
    return Setup(
        frame=frame,
        origin=origin,
        axes=axes,
        motion=Motion(
            MODELS[figures.model],
            len(axes),
            figures.density,
            group,
            int(group.max(initial=-1)) + 1,
            0.0,
        ),
        model=figures.model,
        recovery=Recovery(after, speed),
        prior=figures.prior,
        interval=interval,
        lag=float(options.lag_s or _LAG_FIXES * interval),
        position=figures.position,
        velocity=figures.velocity,
        height_offset=offset,
        noise=figures.noise,
        events=offset_events,
    )


def _frame(rows: Rows, usable: BoolArray) -> tuple[LocalFrame | None, FloatArray]:
    seen = rows.fixes.position[usable & ~rows.auxiliary]
    if rows.fixes.geographic:
        return origin_of(seen[:, 0], seen[:, 1]), np.zeros(3)
    origin = np.zeros(3)
    for i in range(3):
        values = seen[np.isfinite(seen[:, i]), i]
        origin[i] = np.round(np.median(values)) if len(values) else 0.0
    return None, origin


def _height_offsets(
    rows: Rows, position: FloatArray, sensors: list[str]
) -> tuple[FloatArray, tuple[Event, ...]]:
    """Median difference of each sensor's height from the reference's.

    The reference is the depth sensor, where there is one, else the sensor with most heights.

    Raises
    ------
    OptionsError
        The depth sensor measures something else than the depth of the vehicle.
    """
    offset = np.zeros(len(sensors))
    events = []
    heights = np.isfinite(position[:, 2]) & np.isfinite(rows.tau)
    depth = rows.auxiliary & heights
    counts = np.bincount(rows.fixes.sensor[heights & ~rows.auxiliary], minlength=len(sensors))
    main = int(np.argmax(counts))
    reference = depth if depth.any() else heights & (rows.fixes.sensor == main)
    named = "the depth sensor" if depth.any() else sensors[main]
    for sensor in np.flatnonzero(counts >= _FEW_HEIGHTS).tolist():
        mine = heights & ~rows.auxiliary & (rows.fixes.sensor == sensor)
        if not depth.any() and sensor == main:
            continue
        expected = np.interp(rows.tau[mine], rows.tau[reference], position[reference, 2])
        differences = position[mine, 2] - expected
        middle = float(np.median(differences))
        spread = 1.4826 * float(np.median(np.abs(differences - middle)))
        if depth.any() and abs(middle) > _ANOTHER_DEPTH:
            raise OptionsError(
                f"the depth log lies {middle:.0f} m from the heights of {sensors[sensor]}",
                "the depth of the vehicle itself",
                "give a log of water depth as an input of its own",
            )
        if abs(middle) > _DISAGREE * spread / np.sqrt(mine.sum()):
            offset[sensor] = middle
            text = f"the height of {sensors[sensor]} lies {middle:+.2f} m from that of {named}"
            events.append(Event("height-offset", np.nan, text + "; subtracted"))
    return offset, tuple(events)


def _interval(rows: Rows, position: FloatArray) -> float:
    """Median interval between fixes with a position, s; 1 where there are too few."""
    seen = ~rows.auxiliary & np.isfinite(position).any(axis=1) & np.isfinite(rows.tau)
    steps = np.diff(rows.tau[seen])
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else 1.0


def _speed(rows: Rows, position: FloatArray, axis: int) -> float:
    seen = np.isfinite(position[:, axis]) & np.isfinite(rows.tau)
    if rows.auxiliary[seen].any() and (~rows.auxiliary[seen]).any():
        seen &= ~rows.auxiliary
    return speed_scale(rows.tau[seen], position[seen, axis])
