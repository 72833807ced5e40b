"""Ultra-short-baseline geometry: phase differences and travel time to a position, and back.

Three elements of an array stand on two perpendicular baselines. The travel time gives the slant
range, the phase differences along the baselines give the direction cosines of the ray:

``R = cT/2``, ``X = R λφ₁₂/(2πd)``, ``Y = R λφ₁₃/(2πd)``, ``Z = √(R² − X² − Y²)``.

Positions are in the axes of the array: x and y along the baselines, z away from the array towards
the transponder (down, for an array under a hull). Only that side is seen: Z is never negative.

Source: paper 000, eqs 1–9.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from surefix.errors import OptionsError
from surefix.types import FloatArray

__all__ = ["UsblArray", "fix", "fix_covariance", "observe"]


@dataclass(frozen=True, kw_only=True)
class UsblArray:
    """An array and the water it stands in.

    Parameters
    ----------
    baseline_m
        d, distance between the elements of a pair.
    wavelength_m
        λ of the signal in water.
    sound_speed_mps
        c.

    Raises
    ------
    OptionsError
        A figure is not a finite number above zero.
    """

    baseline_m: float = 0.03
    wavelength_m: float = 0.06
    sound_speed_mps: float = 1500.0

    def __post_init__(self) -> None:
        for name in ("baseline_m", "wavelength_m", "sound_speed_mps"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise OptionsError(f"{name} = {value}", "a finite number above zero")

    @property
    def phase_limit(self) -> float:
        """Largest phase difference a ray can have, 2πd/λ rad; beyond it there is no position."""
        return 2.0 * math.pi * self.baseline_m / self.wavelength_m

    @property
    def ambiguous(self) -> bool:
        """Whether whole turns of phase can be lost: the baseline is longer than half a wave."""
        return self.baseline_m > 0.5 * self.wavelength_m


def fix(array: UsblArray, phase: ArrayLike, travel_time: ArrayLike) -> FloatArray:
    """Locate a transponder (eqs 1, 7–9).

    Parameters
    ----------
    array
        The geometry.
    phase
        (…, 2) phase differences φ₁₂ and φ₁₃, rad, whole turns resolved.
    travel_time
        (…,) two-way travel time T, s.

    Returns
    -------
    position
        (…, 3) X, Y, Z in m. NaN where something is missing, where T is negative, and where the
        phases are impossible, φ₁₂² + φ₁₃² > (2πd/λ)²: there X² + Y² would exceed R².
    """
    cosine = np.asarray(phase, dtype=np.float64) / array.phase_limit
    T = np.asarray(travel_time, dtype=np.float64)
    rest = 1.0 - np.sum(cosine * cosine, axis=-1)
    possible = (rest >= 0.0) & (T >= 0.0)
    R = np.where(possible, 0.5 * array.sound_speed_mps * T, np.nan)
    down = np.sqrt(np.where(possible, rest, np.nan))
    return np.stack([R * cosine[..., 0], R * cosine[..., 1], R * down], axis=-1)


def observe(array: UsblArray, position: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Give the phase differences and the travel time of a transponder (eqs 1–3).

    Parameters
    ----------
    array
        The geometry.
    position
        (…, 3) m in the axes of the array; at the array itself the direction is missing.

    Returns
    -------
    phase, travel_time
        (…, 2) rad, whole turns kept, and (…,) s.
    """
    p = np.asarray(position, dtype=np.float64)
    R = np.sqrt(np.sum(p * p, axis=-1))
    direction = p[..., :2] / np.where(R > 0.0, R, np.nan)[..., None]
    return array.phase_limit * direction, 2.0 * R / array.sound_speed_mps


def fix_covariance(
    array: UsblArray,
    phase: ArrayLike,
    travel_time: ArrayLike,
    sigma_phase: float,
    sigma_time: float,
) -> FloatArray:
    """Propagate independent errors of phase and time to the position, ``J diag(σ²) Jᵀ``.

    ``∂X/∂φ₁₂ = Rλ/(2πd)``, ``∂Z/∂φ₁₂ = −(Rλ/(2πd)) X/Z``, ``∂(X, Y, Z)/∂T = (X, Y, Z)/T``.
    First order in the errors: near the plane of the array, where Z → 0, the depth is not told by
    phases and the figure grows without bound.

    Parameters
    ----------
    array, phase, travel_time
        As for `fix`.
    sigma_phase, sigma_time
        Standard deviations of a phase difference, rad, and of the two-way travel time, s.

    Returns
    -------
    covariance
        (…, 3, 3) m²; NaN where there is no position, and where Z or T is 0.
    """
    place = fix(array, phase, travel_time)
    T = np.asarray(travel_time, dtype=np.float64)
    X, Y, Z = (np.where((place[..., 2] > 0.0) & (T > 0.0), place[..., i], np.nan) for i in range(3))
    reach = 0.5 * array.sound_speed_mps * T / array.phase_limit
    J = np.stack(
        [
            np.stack([reach, 0.0 * X, X / np.where(T > 0.0, T, np.nan)], axis=-1),
            np.stack([0.0 * X, reach, Y / np.where(T > 0.0, T, np.nan)], axis=-1),
            np.stack([-reach * X / Z, -reach * Y / Z, Z / np.where(T > 0.0, T, np.nan)], axis=-1),
        ],
        axis=-2,
    )
    scaled = J * np.array([sigma_phase, sigma_phase, sigma_time])
    return np.asarray(scaled @ np.swapaxes(scaled, -1, -2) + 0.0 * X[..., None, None])
