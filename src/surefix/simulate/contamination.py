"""Logs of position fixes whose every fault is known, for methods to be compared on.

A `World` is the vehicle and its sensors, a `Scenario` what goes wrong; `draw` makes a `Trial` of
both. All sizes are in units of the noise and all durations in intervals between fixes, so that any
noise and any rate make sense.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from surefix.errors import OptionsError
from surefix.simulate.errors import GROSS, Drag, directions, pull_of, scatter, velocity_errors
from surefix.simulate.vehicles import Vehicle, drive
from surefix.types import AXES, BoolArray, FloatArray

__all__ = [
    "SCENARIOS",
    "Scenario",
    "Trial",
    "World",
    "alone",
    "columns",
    "columns_beside",
    "draw",
    "draw_world",
]

_GOOD_BEFORE = 5  # fixes at the beginning without errors, unless the first is to be bad
_BURST = 30  # fixes of the longest run of errors
_GAP = (10.0, 60.0)  # intervals a dropout lasts


@dataclass(frozen=True, kw_only=True)
class World:
    """A vehicle and its sensors.

    Parameters
    ----------
    epochs
        Number of fixes, at least 200.
    axes
        1 … 3: x, then y, then z.
    interval_s
        Between fixes, s.
    sigma_m
        Noise of the fixes, each axis.
    agility
        Root density of the acceleration that drives the vehicle, in σ per interval^1.5.
    velocity_noise
        Noise of the velocities, in σ per interval.

    Raises
    ------
    OptionsError
        A figure that cannot be.
    """

    epochs: int = 2400
    axes: int = 3
    interval_s: float = 1.0
    sigma_m: float = 0.3
    agility: float = 0.2
    velocity_noise: float = 0.1

    def __post_init__(self) -> None:
        if self.epochs < 200:
            raise OptionsError(f"epochs {self.epochs}", "a whole number from 200")
        if not 1 <= self.axes <= 3:
            raise OptionsError(f"axes {self.axes}", "1, 2 or 3")
        for name in ("interval_s", "sigma_m", "agility", "velocity_noise"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise OptionsError(f"{name} = {getattr(self, name)}", "a finite number above zero")

    @property
    def process(self) -> float:
        """Root density of the acceleration, m/s^1.5."""
        return self.agility * self.sigma_m * float(self.interval_s**-1.5)

    @property
    def sigma_mps(self) -> float:
        """Noise of the velocities, m/s."""
        return self.velocity_noise * self.sigma_m / self.interval_s


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """What goes wrong.

    Parameters
    ----------
    share
        Share of the fixes that err by themselves.
    size
        Least and greatest length of an error, in σ; uniform between them, in a random direction.
    one_axis
        Each error strikes one axis, and the others are good.
    run
        Whether 30 fixes on end err too: with one ``common`` offset, or each ``independent`` of the
        others.
    drag
        How the fixes wander off: an error that begins without any step. ``vertical`` is along the
        last axis alone.
    beside
        Another sensor with the same noise and rate and without faults: a ``source`` of fixes, or a
        ``depth`` of the last axis alone.
    first_bad
        The very first fix is a gross error.
    jump
        Length of a true jump, in σ: from an epoch on all fixes, and the truth, lie further. The
        first fix after it is good.
    misjudged
        How many times too large a noise the method is told; 1 leaves it to find the noise.
    freedom
        Degrees of freedom of the noise of the fixes (Student-t of the same variance); infinity
        is normal.
    velocity_runs
        Runs of 5 … 40 wrong velocities.
    dropouts
        Gaps of 10 … 60 intervals; the velocities go on in every other one.
    irregular
        The steps vary (gamma-distributed, of shape 2).
    vehicle
        How the vehicle moves.
    """

    share: float = 0.05
    size: tuple[float, float] = GROSS
    one_axis: bool = False
    run: Literal["common", "independent"] | None = None
    drag: Drag | None = None
    beside: Literal["source", "depth"] | None = None
    first_bad: bool = False
    jump: float = 0.0
    misjudged: float = 1.0
    freedom: float = np.inf
    velocity_runs: int = 0
    dropouts: int = 0
    irregular: bool = False
    vehicle: Vehicle = "model"


_BESIDE_BURST = 91 / 2400  # isolated errors, so that 121 of 2,400 fixes err in all

SCENARIOS: Final[Mapping[str, Scenario]] = MappingProxyType(
    {
        "clean": Scenario(share=0.0),
        "isolated-5": Scenario(),
        "isolated-20": Scenario(share=0.2),
        "isolated-40": Scenario(share=0.4),
        "burst-common": Scenario(share=_BESIDE_BURST, run="common"),
        "burst-independent": Scenario(share=_BESIDE_BURST, run="independent"),
        "drag": Scenario(drag="even"),
        "drag-slow": Scenario(drag="slow"),
        "drag-source": Scenario(drag="slow", beside="source"),
        "drag-depth": Scenario(drag="vertical", beside="depth"),
        "jump": Scenario(jump=67.0),
        "small": Scenario(share=0.2, size=(3.3, 10.0)),
        "one-axis": Scenario(share=0.2, one_axis=True),
        "first-bad": Scenario(first_bad=True),
        "noise-misjudged": Scenario(misjudged=2.0),
        "student-t3": Scenario(share=0.0, freedom=3.0),
        "dvl-faults": Scenario(velocity_runs=12),
        "dropouts": Scenario(dropouts=10),
        "irregular": Scenario(irregular=True),
        "survey": Scenario(vehicle="survey"),
        "speedboat": Scenario(vehicle="speedboat"),
        "buoy": Scenario(vehicle="buoy"),
    }
)
"""The scenarios by name. Unless it says otherwise, 5 % of the fixes are gross errors."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A log and the truth about it; n rows, d axes.

    Parameters
    ----------
    scenario, world
        What it was drawn from.
    time
        (n,) s from 0.
    position, velocity
        (n, d) truth, m and m/s; a jump is part of the position.
    fixes, velocities
        (n, d) as measured; NaN where missing.
    beside
        (n, d) positions of the sensor beside; NaN where there is none, or not on the axis.
    error
        (n, d) gross errors of the fixes, m, noise not included; zero where there is none.
    bad_velocity
        (n, d) velocities that are gross errors.
    jump
        First row after the jump; −1 without one.
    """

    scenario: Scenario
    world: World
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    fixes: FloatArray
    velocities: FloatArray
    beside: FloatArray
    error: FloatArray
    bad_velocity: BoolArray
    jump: int

    @property
    def bad_fix(self) -> BoolArray:
        """(n, d) components of the fixes that are gross errors."""
        return np.asarray(self.error != 0.0)

    @property
    def aided(self) -> bool:
        """Whether there are velocities."""
        return bool(np.isfinite(self.velocities).any())


def draw_world(seed: int | Sequence[int], *, epochs: int = 2400, axes: int = 3) -> World:
    """Draw a world: noise 0.05 … 5 m, 0.2 … 20 fixes a second, agility 0.05 … 0.3.

    Parameters
    ----------
    seed
        Of ``numpy.random.default_rng``.
    epochs, axes
        Of `World`.
    """
    rng = np.random.default_rng(seed)
    agility = _between(rng, 0.05, 0.3)
    return World(
        epochs=epochs,
        axes=axes,
        interval_s=_between(rng, 0.05, 5.0),
        sigma_m=_between(rng, 0.05, 5.0),
        agility=agility,
        velocity_noise=agility * _between(rng, 0.3, 1.5),
    )


def draw(scenario: str, world: World, seed: int | Sequence[int]) -> Trial:
    """Draw a trial; the same arguments give the same bits.

    Track and noise are the same in all scenarios of one world and seed that have the same times.

    Parameters
    ----------
    scenario
        A name of ``SCENARIOS``.
    world
        Vehicle and sensors.
    seed
        Of ``numpy.random.default_rng``.

    Raises
    ------
    OptionsError
        There is no such scenario.
    """
    if scenario not in SCENARIOS:
        raise OptionsError(f"scenario {scenario!r}", "one of " + ", ".join(SCENARIOS))
    plan = SCENARIOS[scenario]
    streams = np.random.default_rng(seed).spawn(9)
    clock, motion, noise, dvl, where, sizes, leap, wrong, other = streams
    n, d, sigma = world.epochs, world.axes, world.sigma_m
    time, with_fix, with_row = _times(clock, plan, world)
    path = drive(plan.vehicle, motion, time / world.interval_s, d, world.agility)
    position, velocity = path.position * sigma, path.velocity * sigma / world.interval_s
    jump = int(leap.integers(int(0.4 * n), int(0.7 * n))) if plan.jump else -1
    if plan.jump:
        position[jump:] += plan.jump * sigma * directions(leap, 1, d)
    error = sigma * _errors(where, sizes, plan, n, d, jump)
    beside = position + sigma * other.standard_normal((n, d))
    beside[:, : 0 if plan.beside == "source" else d - 1 if plan.beside == "depth" else d] = np.nan
    rough = scatter(noise, plan.freedom, (n, d))
    slips = velocity_errors(wrong, plan.velocity_runs, n, d)
    fixes = position + sigma * rough + error
    fixes[~with_fix] = np.nan
    error[~with_fix] = 0.0
    trial = Trial(
        scenario=plan,
        world=world,
        time=time,
        position=position,
        velocity=velocity,
        fixes=fixes,
        velocities=velocity + world.sigma_mps * (dvl.standard_normal((n, d)) + slips),
        beside=beside,
        error=error,
        bad_velocity=slips != 0.0,
        jump=jump,
    )
    return _rows(trial, with_row)


def alone(trial: Trial) -> Trial:
    """Give the same trial without velocities; rows that had nothing else are left out."""
    lost = np.full_like(trial.velocities, np.nan)
    good = np.zeros_like(trial.bad_velocity)
    bare = replace(trial, velocities=lost, bad_velocity=good)
    return _rows(bare, np.asarray(np.isfinite(trial.fixes).any(axis=1)))


def columns(trial: Trial) -> dict[str, FloatArray]:
    """Columns of the log: ``time``, ``x, y, z`` and, where there are any, ``vx, vy, vz``."""
    table = {"time": trial.time}
    table |= dict(zip(AXES, trial.fixes.T, strict=False))
    if trial.aided:
        table |= dict(zip(("vx", "vy", "vz"), trial.velocities.T, strict=False))
    return table


def columns_beside(trial: Trial) -> dict[str, NDArray[np.generic]] | None:
    """Columns of the log of the sensor beside the fixes; None where there is none."""
    match trial.scenario.beside:
        case "source":
            own = dict(zip(AXES, trial.beside.T, strict=False))
            return {"time": trial.time, "sensor": np.full(len(trial.time), "beside"), **own}
        case "depth":
            return {"time": trial.time, "depth": -trial.beside[:, -1]}
    return None


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(low * (high / low) ** rng.uniform())


def _rows(trial: Trial, kept: BoolArray) -> Trial:
    """Keep some rows; the jump is where the first kept row after it is."""
    names = "time", "position", "velocity", "fixes", "velocities", "beside", "error", "bad_velocity"
    jump = int(kept[: trial.jump].sum()) if trial.jump >= 0 else -1
    return replace(trial, jump=jump, **{name: getattr(trial, name)[kept] for name in names})


def _times(
    rng: np.random.Generator, plan: Scenario, world: World
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Times, which rows have a fix, and which rows there are."""
    n = world.epochs
    step = rng.gamma(2.0, 0.5, n).clip(min=0.05) if plan.irregular else np.ones(n)
    time = (np.cumsum(step) - step[0]) * world.interval_s
    with_fix, with_row = np.ones(n, np.bool_), np.ones(n, np.bool_)
    for gap in range(plan.dropouts):
        first = int(rng.integers(_GOOD_BEFORE + 20, n - int(_GAP[1])))
        lost = slice(first, first + int(rng.uniform(*_GAP)))
        with_fix[lost] = False
        if gap % 2:
            with_row[lost] = False
    return time, with_fix, with_row


def _errors(
    where: np.random.Generator,
    sizes: np.random.Generator,
    plan: Scenario,
    n: int,
    d: int,
    jump: int,
) -> FloatArray:
    """(n, d) gross errors in σ."""
    error = np.zeros((n, d))
    pull = pull_of(sizes, plan.drag)
    length = _BURST if plan.run else len(pull)
    first = int(where.integers(_GOOD_BEFORE + 20, n - length)) if length else n
    stretch = np.arange(first, first + length)
    others = np.setdiff1d(np.arange(_GOOD_BEFORE, n), [*stretch, jump])
    rows = where.choice(others, min(round(plan.share * n), len(others)), replace=False)
    if plan.first_bad:
        rows = np.append(rows, 0)
    error[rows] = _lengths(sizes, plan, len(rows)) * _strikes(sizes, plan, len(rows), d)
    if plan.run == "common":
        error[stretch] = _lengths(sizes, plan, 1) * directions(sizes, 1, d)
    elif plan.run == "independent":
        error[stretch] = _lengths(sizes, plan, len(stretch)) * directions(sizes, len(stretch), d)
    elif plan.drag == "vertical":
        error[stretch, -1] = pull
    elif plan.drag:
        error[stretch] = pull[:, None] * directions(sizes, 1, d)
    return error


def _lengths(rng: np.random.Generator, plan: Scenario, count: int) -> FloatArray:
    return np.asarray(rng.uniform(*plan.size, (count, 1)))


def _strikes(rng: np.random.Generator, plan: Scenario, count: int, d: int) -> FloatArray:
    """Directions in space, or along one axis either way."""
    if not plan.one_axis:
        return directions(rng, count, d)
    struck = np.eye(d)[rng.integers(0, d, count)]
    return np.asarray(struck * rng.choice([-1.0, 1.0], (count, 1)))
