"""Records of the track filter: what goes in, what it remembers, what it finds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["Epochs", "Estimate", "Filtered", "Motion", "Recovery", "TrackState"]


class Motion(NamedTuple):
    """A motion model (see `surefix.models.motion`).

    Parameters
    ----------
    order
        2 constant velocity, 3 constant acceleration.
    axes
        1 … 3.
    density
        (axes,) spectral density of the driving white noise.
    group
        (2·axes,) group of each component of the observation; position groups come first.
    groups
        How many groups there are.
    period
        Period of an angle in its own unit, or 0; for one axis.
    """

    order: int
    axes: int
    density: FloatArray
    group: IntArray
    groups: int
    period: float


class Recovery(NamedTuple):
    """When a rejected group is believed after all.

    Parameters
    ----------
    after
        Seconds of unbroken rejection; infinity for never.
    sigma_velocity
        Standard deviation of a velocity nothing is known about, m/s.
    keeps_rate
        Whether the velocity goes on over a jump that the epochs fix beforehand.
    """

    after: float
    sigma_velocity: float
    keeps_rate: bool = False


class Epochs(NamedTuple):
    """Observations in the order of time; n epochs, m = 2·axes components.

    Parameters
    ----------
    time
        (n,) s, not decreasing.
    z
        (n, m) position in m, then velocity in m/s; NaN is missing.
    variance
        (n, m) variance of each component.
    fixed
        (n, groups) weights decided beforehand (0 rejects, 1 uses); NaN lets the loss decide.
    jump
        (n,) bit mask of the groups whose state restarts before this epoch.
    sensor
        (n,) which sensor each came from, 0 … 61; empty if all came from one.
    """

    time: FloatArray
    z: FloatArray
    variance: FloatArray
    fixed: FloatArray
    jump: IntArray
    sensor: IntArray = np.empty(0, np.int64)


class TrackState(NamedTuple):
    """All the filter remembers; a plain record that can be stored and restored.

    Parameters
    ----------
    time
        s; NaN before the first epoch.
    mean, factor
        (n,) state and (n, n) factor S of its covariance S Sᵀ.
    settled
        (groups,) observations used since the group's state was last unknown.
    streak, since
        (groups,) rejections on end, and the time of the first of them.
    recent, recent_time
        (5, m) the last rejected observations of each component, and (5, groups) their times.
    """

    time: float
    mean: FloatArray
    factor: FloatArray
    settled: IntArray
    streak: IntArray
    since: FloatArray
    recent: FloatArray
    recent_time: FloatArray


class Filtered(NamedTuple):
    """What the filter found at each of n epochs.

    Parameters
    ----------
    mean, factor
        (n, states), (n, states, states) after the update.
    weight
        (n, groups); NaN where the group was not observed.
    sigma
        (n, groups) Mahalanobis distance from the prediction, as a one-axis equivalent.
    standardised
        (n, m) innovation over its standard deviation.
    nis, logdet
        (n, groups) squared Mahalanobis distance and log-determinant of the innovation covariance.
    jump
        (n,) bit mask of groups that restarted at this epoch.
    since
        (n, groups) s, the first rejection of the run that a restart ended; else NaN.
    """

    mean: FloatArray
    factor: FloatArray
    weight: FloatArray
    sigma: FloatArray
    standardised: FloatArray
    nis: FloatArray
    logdet: FloatArray
    jump: IntArray
    since: FloatArray


class Estimate(NamedTuple):
    """What a mode of estimation says of each of n epochs.

    Parameters
    ----------
    mean, sigma
        (n, states) state and its standard deviations.
    weight, distance
        (n, groups) weight of each group, and how far it lay from its prediction (real time, lagged)
        or from what all other data say (offline), as a one-axis equivalent in standard deviations.
    standardised
        (n, m) the same per component, signed.
    jump, since
        (n,) bit mask of groups that restarted here, and (n, groups) when the run began.
    run
        (n,) fixes of the run with a common offset that the epoch's fix belongs to; 0 if to none.
    offset
        (n, axes) that offset; NaN outside of runs.
    drag
        (n,) whether that run is a drag: the offset is that of the fix alone.
    scale
        (n,) factor of the variance of the epoch's position since it was settled, 1 if it stays.
    """

    mean: FloatArray
    sigma: FloatArray
    weight: FloatArray
    distance: FloatArray
    standardised: FloatArray
    jump: IntArray
    since: FloatArray
    run: IntArray
    offset: FloatArray
    drag: BoolArray
    scale: FloatArray
