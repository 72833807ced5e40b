"""USBL geometry by angles, one ray at a time: the twin of `surefix.models.usbl`."""

import math

import numpy as np


def fix(baseline, wavelength, speed, phase_x, phase_y, travel_time):
    """Position of a transponder from the angles its ray makes with the axes (paper 000, 1–6).

    The depth is the range times the cosine of the third angle, from the spherical identity of the
    direction cosines. None where no ray has such phases.
    """
    slant = speed * travel_time / 2
    cosines = [phase * wavelength / (2 * math.pi * baseline) for phase in (phase_x, phase_y)]
    if any(abs(c) > 1 for c in cosines) or math.hypot(*cosines) > 1:
        return None
    first, second = (math.acos(c) for c in cosines)
    off_axis = math.asin(math.hypot(*cosines))
    return np.array([slant * math.cos(first), slant * math.cos(second), slant * math.cos(off_axis)])


def observe(baseline, wavelength, speed, position):
    """Phases and travel time from the delays of a plane wave between the elements of each pair."""
    slant = math.dist(position, (0, 0, 0))
    period = wavelength / speed
    delays = [baseline * position[i] / slant / speed for i in range(2)]
    return np.array([2 * math.pi * delay / period for delay in delays]), 2 * slant / speed


def covariance(baseline, wavelength, speed, phase, travel_time, sigma_phase, sigma_time):
    """First-order covariance with the derivatives taken by central differences of `fix`."""
    sigmas = (sigma_phase, sigma_phase, sigma_time)
    at = np.array([*phase, travel_time])
    total = np.zeros((3, 3))
    for i, sigma in enumerate(sigmas):
        step = 1e-6 * max(abs(at[i]), 1e-3)
        ahead, behind = at.copy(), at.copy()
        ahead[i] += step
        behind[i] -= step
        slope = fix(baseline, wavelength, speed, *ahead) - fix(baseline, wavelength, speed, *behind)
        slope /= 2 * step
        total += sigma**2 * np.outer(slope, slope)
    return total
