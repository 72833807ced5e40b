"""What passes between the methods of paper 004: a radar's measurements, and a fused track."""

from __future__ import annotations

from typing import NamedTuple

from surefix.types import FloatArray

__all__ = ["Cartesian", "Fusion"]


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
