"""Two radars that follow one aircraft, one of them jammed for a while: the scene of paper 004.

The aircraft flies straight and swerves weakly once, between two of its samples. Radar A is the less
exact one. What is wrong with its measurements, and known to be:

- runs of consecutive wild ones (15 in the paper): a false target that keeps a constant distance
  from the aircraft;
- isolated wild ones;
- a stretch in which its noise is several times as large as usual.

Both radars have constant errors of range, azimuth and elevation. Satellite navigation on board
gives the reference. x is east, y north, z up, in a flat frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.models.radar import Site, polar_jacobian, site, to_polar
from surefix.types import BoolArray, FloatArray

__all__ = ["RadarFlight", "RadarLog", "simulate"]


class RadarLog(NamedTuple):
    """What one radar measured, and what is true of it.

    Parameters
    ----------
    at
        Where it stands.
    polar
        (n, 3) range m, azimuth rad, elevation rad as measured.
    sigma
        (3,) its usual noise: m, rad, rad.
    bias
        (3,) its systematic errors: m, rad, rad.
    wild, burst
        (n,) which measurements are wild, and which of those belong to a run.
    noise
        (n,) how many times its usual noise it had.
    """

    at: Site
    polar: FloatArray
    sigma: FloatArray
    bias: FloatArray
    wild: BoolArray
    burst: BoolArray
    noise: FloatArray


class RadarFlight(NamedTuple):
    """The whole scene; n samples at equal steps.

    Parameters
    ----------
    dt
        s between samples.
    position, velocity
        (n, 3) truth, m and m/s.
    manoeuvre
        (n,) while the aircraft swerves.
    reference
        (n, 3) m, satellite navigation.
    radars
        A and B.
    """

    dt: float
    position: FloatArray
    velocity: FloatArray
    manoeuvre: BoolArray
    reference: FloatArray
    radars: tuple[RadarLog, RadarLog]


def simulate(
    seed: int | list[int],
    *,
    samples: int = 10_000,
    dt: float = 0.05,
    manoeuvre: tuple[int, int] = (5_500, 7_000),
    swerve_mps2: tuple[float, float, float] = (0.0, 1.5, 1.0),
    bursts: tuple[tuple[int, int], ...] = ((2_500, 15),),
    wild_share: float = 0.005,
    wild_sigma: tuple[float, float] = (10.0, 30.0),
    noisy: tuple[int, int, float] = (8_000, 9_000, 3.0),
    sigma_a: tuple[float, float, float] = (25.0, 0.02, 0.02),
    sigma_b: tuple[float, float, float] = (15.0, 0.012, 0.012),
    bias: tuple[float, float, float] = (100.0, 0.3, 0.2),
    sigma_reference_m: float = 0.5,
) -> RadarFlight:
    """Draw one flight; the same seed and options give the same bits.

    Parameters
    ----------
    seed
        Of ``numpy.random.default_rng``.
    samples, dt
        How many at which step in s.
    manoeuvre, swerve_mps2
        First sample of the swerve and the first after it; its greatest acceleration along x, y, z.
        The acceleration is one period of a sine: the aircraft ends on a parallel course.
    bursts
        First sample and length of each run of wild measurements of A.
    wild_share, wild_sigma
        Share of isolated wild measurements of A; how far, at least and at most, any wild one is off
        along each of x, y, z, in standard deviations of A's noise there. The sign is drawn.
    noisy
        First sample, first after, and factor of the noise of A.
    sigma_a, sigma_b
        Noise of range in m, azimuth and elevation in degrees.
    bias
        Greatest systematic errors in m, degrees, degrees; drawn uniformly for each radar.
    sigma_reference_m
        Noise of the reference.

    Raises
    ------
    OptionsError
        Samples, steps, sigmas or shares that cannot be.
    """
    if samples < 1 or not dt > 0.0 or min(*sigma_a, *sigma_b, sigma_reference_m) <= 0.0:
        raise OptionsError(f"{samples} samples of {dt} s", "positive numbers, noises too")
    if not 0.0 <= wild_share < 1.0 or not 0.0 <= wild_sigma[0] <= wild_sigma[1]:
        raise OptionsError(f"wild share {wild_share}, {wild_sigma} sigma", "0 … 1, in order")
    motion, faults, one, two, gnss = np.random.default_rng(seed).spawn(5)
    position, velocity = _flight(motion, samples, dt, manoeuvre, swerve_mps2)
    index = np.arange(samples)
    wild, burst, size = _faults(faults, samples, bursts, wild_share, wild_sigma)
    louder = np.where((index >= noisy[0]) & (index < noisy[1]), noisy[2], 1.0)
    quiet, never = np.ones(samples), np.zeros(samples, np.bool_)
    limit, nothing = _radians(bias), np.zeros((samples, 3))
    a = _measure(one, position, (0.0, 0.0, 50.0), sigma_a, limit, louder, size)
    b = _measure(two, position, (25e3, -10e3, 120.0), sigma_b, limit, quiet, nothing)
    return RadarFlight(
        dt,
        position,
        velocity,
        (index >= manoeuvre[0]) & (index < manoeuvre[1]),
        position + sigma_reference_m * gnss.standard_normal(position.shape),
        (RadarLog(*a, wild, burst, louder), RadarLog(*b, never, never, quiet)),
    )


def _flight(
    rng: np.random.Generator,
    samples: int,
    dt: float,
    manoeuvre: tuple[int, int],
    swerve: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray]:
    """A straight course past both radars, and the sine of the swerve integrated exactly."""
    t = dt * np.arange(samples)
    heading, speed = math.radians(rng.uniform(95.0, 105.0)), rng.uniform(210.0, 230.0)
    course = speed * np.array([math.sin(heading), math.cos(heading), 0.0])
    middle = np.array([5e3, rng.uniform(45e3, 55e3), rng.uniform(7e3, 9e3)])
    begin, end = dt * manoeuvre[0], dt * manoeuvre[1]
    w = 2.0 * math.pi / max(end - begin, dt)
    since = np.clip(t - begin, 0.0, end - begin)
    moved = since / w - np.sin(w * since) / w**2
    along = (1.0 - np.cos(w * since)) / w
    position = middle + (t - 0.5 * dt * samples)[:, None] * course + np.outer(moved, swerve)
    return position, course + np.outer(along, swerve)


def _faults(
    rng: np.random.Generator,
    samples: int,
    bursts: tuple[tuple[int, int], ...],
    share: float,
    sizes: tuple[float, float],
) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Which measurements are wild, which of them in runs, and by how many sigma."""
    burst = np.zeros(samples, np.bool_)
    isolated = rng.uniform(size=samples) < share
    size = rng.uniform(*sizes, (samples, 3)) * rng.choice([-1.0, 1.0], (samples, 3))
    for first, length in bursts:
        isolated[max(first - 40, 0) : first + length + 80] = False
        burst[first : first + length] = True
        size[first : first + length] = size[first : first + 1]
    isolated[1:] &= ~isolated[:-1]
    wild = burst | isolated
    return wild, burst, np.where(wild[:, None], size, 0.0)


def _measure(
    rng: np.random.Generator,
    position: FloatArray,
    place: ArrayLike,
    sigma: tuple[float, float, float],
    limit: FloatArray,
    louder: FloatArray,
    size: FloatArray,
) -> tuple[Site, FloatArray, FloatArray, FloatArray]:
    at, noise = site(place), _radians(sigma)
    bias = rng.uniform(-limit, limit)
    spread = polar_jacobian(to_polar(position, at), at) * noise
    false = position + size * np.sqrt(np.sum(spread**2, axis=-1))
    draws = louder[:, None] * rng.standard_normal(position.shape)
    polar = to_polar(false, at) + bias + noise * draws
    polar[:, 1] = np.mod(polar[:, 1], 2.0 * math.pi)
    return at, polar, noise, bias


def _radians(parts: tuple[float, float, float]) -> FloatArray:
    return np.array([parts[0], math.radians(parts[1]), math.radians(parts[2])])
