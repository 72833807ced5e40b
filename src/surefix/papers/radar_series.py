"""What passes between the methods of paper 004: a radar's measurements, and a fused track."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.filters.records import Epochs, Motion
from surefix.filters.track import by_axis
from surefix.types import FloatArray

__all__ = ["Cartesian", "Fusion", "constant_velocity", "epochs_of"]


class Cartesian(NamedTuple):
    """A registered radar's measurements in the common frame.

    Parameters
    ----------
    position
        (n, 3) m.
    variance
        (n, 3) m², of each axis by the usual noise of the radar.
    """

    position: FloatArray
    variance: FloatArray


class Fusion(NamedTuple):
    """What one way to fuse gives.

    Parameters
    ----------
    position
        (n, 3) m.
    variance
        (n, 3) m², as claimed; NaN where nothing is claimed.
    """

    position: FloatArray
    variance: FloatArray


def constant_velocity(axes: int, density: float) -> Motion:
    """Model of a target under white noise of the given density, m²/s³, axis by axis."""
    return Motion(2, axes, np.full(axes, density), by_axis(axes), 2 * axes, 0.0)


def epochs_of(series: Cartesian, dt: float, known: float) -> Epochs:
    """One radar as epochs ``dt`` s apart, the first after ``known``, or at 0 if that is NaN."""
    n, axes = series.position.shape
    first = 0.0 if np.isnan(known) else known + dt
    return Epochs(
        np.asarray(first + dt * np.arange(n), dtype=np.float64),
        np.concatenate([series.position, np.full((n, axes), np.nan)], axis=1),
        np.concatenate([series.variance, np.ones((n, axes))], axis=1),
        np.full((n, 2 * axes), np.nan),
        np.zeros(n, np.int64),
    )
