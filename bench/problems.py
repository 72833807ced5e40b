"""The problems that all contestants are given."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.models.motion import noise_factor, transition


class Linear(NamedTuple):
    """A constant-velocity model on three axes: z is (N, m), six states."""

    F: np.ndarray
    Q: np.ndarray
    H: np.ndarray
    R: np.ndarray
    z: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray


def constant_velocity(m: int, count: int, *, gross: float = 0.0) -> Linear:
    """Positions (m = 3), or positions and velocities (m = 6), some of them wild."""
    rng = np.random.default_rng([7, m])
    F, G = transition("cv", 3, 0.5), noise_factor("cv", 3, 0.5, 0.1)
    H, R = np.eye(6)[:m], np.diag([0.5, 0.5, 0.7, 0.02, 0.02, 0.03][:m])
    x, z = np.zeros(6), np.empty((count, m))
    for k in range(count):
        x = F @ x + G @ rng.standard_normal(6)
        z[k] = H @ x + np.sqrt(np.diag(R)) * rng.standard_normal(m)
    wild = rng.random(z.shape) < gross
    z[wild] += 30.0 * rng.standard_normal(int(wild.sum()))
    return Linear(F, G @ G.T, H, R, z, np.zeros(6), 10.0 * np.eye(6))


class Sighted(NamedTuple):
    """A target on two axes, with ranges and bearings from three platforms: z is (N, 6)."""

    F: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    platforms: np.ndarray
    z: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray


def three_platforms(count: int) -> Sighted:
    """Ranges at 2 m, bearings (clockwise from y) at 1°; no bearing crosses the seam."""
    rng = np.random.default_rng(8)
    F, G = transition("cv", 2, 0.5), noise_factor("cv", 2, 0.5, 0.002)
    platforms = np.array([[-400.0, -300.0], [-500.0, 100.0], [-350.0, 400.0]])
    R = np.diag([4.0, np.radians(1.0) ** 2] * 3)
    x, z = np.array([100.0, 0.0, 0.5, 0.2]), np.empty((count, 6))
    for k in range(count):
        x = F @ x + G @ rng.standard_normal(4)
        x[2:] -= 0.002 * (x[:2] - [100.0, 0.0]) / 10.0  # it stays about one place
        off = x[:2] - platforms
        z[k, 0::2] = np.hypot(off[:, 0], off[:, 1])
        z[k, 1::2] = np.arctan2(off[:, 0], off[:, 1])
        z[k] += np.sqrt(np.diag(R)) * rng.standard_normal(6)
    return Sighted(F, G @ G.T, R, platforms, z, np.array([100.0, 0, 0, 0]), np.eye(4) * 10.0)
