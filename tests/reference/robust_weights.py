"""Weights of robust estimation, one line of textbook each, in plain NumPy.

A weight w divides the variance of an observation, R̄ = R/w; v is the residual in standard
deviations.
"""

import numpy as np


def huber(v, k):
    """1 up to k, then k/|v| (Huber 1964)."""
    return k / np.maximum(np.abs(v), k)


def igg1(v, k0, k1):
    """Huber's up to k1, then 0 (Zhou 1989)."""
    return np.where(np.abs(v) < k1, huber(v, k0), 0.0)


def igg3_printed(v, k0, k1):
    """1, then k0/|v| · (k1 − |v|)/(k1 − k0), then 0, as printed in paper 000, equation 19."""
    size = np.abs(v)
    middle = huber(v, k0) * (k1 - size) / (k1 - k0)
    return np.select([size <= k0, size < k1], [1.0, middle], 0.0)


def igg3_yang(v, k0, k1):
    """1, then k0/|v| · ((k1 − |v|)/(k1 − k0))², then 0 (Yang 1994)."""
    size = np.abs(v)
    middle = huber(v, k0) * ((k1 - size) / (k1 - k0)) ** 2
    return np.select([size <= k0, size < k1], [1.0, middle], 0.0)


def student_t(square, degrees, axes):
    """(ν + d)/(ν + r'R⁻¹r): expected precision of a d-axis observation with Student-t noise."""
    return (degrees + axes) / (degrees + square)


def bifactor(R, w):
    """Equivalent covariance of correlated observations: σ̄ᵢⱼ = σᵢⱼ/√(wᵢwⱼ) (Yang 2002)."""
    root = np.sqrt(w)
    return R / np.outer(root, root)
