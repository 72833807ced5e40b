"""Which messages a receiver has when it fuses: they come late, out of order, or never.

Every source i reports at its own instants of validity; message k is valid at ``valid[i, k]`` and
arrives at ``arrival[…, i, k]``, infinite where it is lost. Paper 001, section 3 (Figures 4–6): the
fusion runs at its own period and takes the newest posterior of each source (timely update).
"""

from __future__ import annotations

import numpy as np

from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["newest_arrived", "newest_common", "travel_time"]

SOUND_SPEED = 1500.0


def travel_time(range_m: FloatArray, speed: float = SOUND_SPEED) -> FloatArray:
    """Time in s that sound takes over a range in m.

    >>> travel_time(np.array([300.0])).tolist()
    [0.2]
    """
    return np.asarray(range_m / speed)


def newest_arrived(valid: FloatArray, arrival: FloatArray, now: FloatArray) -> IntArray:
    """Index of the newest message of each source that has arrived; −1 where none has.

    Newest is by validity, not by arrival: a message that was overtaken changes nothing.

    Parameters
    ----------
    valid
        (N, K) s; NaN where a source has no message k.
    arrival
        (…, N, K) s; NaN or infinite where a message never arrives.
    now
        (T,) s, when the receiver looks.

    Returns
    -------
    index
        (…, N, T) into the K messages.

    Examples
    --------
    >>> valid, arrival = np.array([[1.0, 2.0, 3.0]]), np.array([[1.5, 4.5, 3.5]])
    >>> newest_arrived(valid, arrival, np.array([1.0, 2.0, 4.0, 5.0])).tolist()
    [[-1, 0, 2, 2]]
    """
    return _newest(valid, arrival[..., None, :] <= now[:, None])


def newest_common(valid: FloatArray, arrival: FloatArray, now: FloatArray) -> IntArray:
    """Index of the newest message of each source up to the instant that all have reported.

    The receiver waits for the slowest: ``c = minᵢ`` of the newest validity that has arrived; of
    each source the newest message with ``valid ≤ c`` is taken. Parameters and result as
    `newest_arrived`; −1 for all sources until each has reported once.

    >>> valid = np.array([[1.0, 2.0, 3.0], [1.2, 2.2, 3.2]])
    >>> arrival = np.array([[1.5, 2.5, 3.5], [1.7, 4.7, 3.7]])  # the second one of source 2 is late
    >>> newest_common(valid, arrival, np.array([3.0, 4.0])).tolist()
    [[0, 2], [0, 0]]
    """
    newest = newest_arrived(valid, arrival, now)
    source = np.arange(valid.shape[0])[:, None]
    common = np.where(newest >= 0, valid[source, newest], -np.inf).min(axis=-2)
    arrived = arrival[..., None, :] <= now[:, None]
    return _newest(valid, arrived & (valid[:, None, :] <= common[..., None, :, None]))


def _newest(valid: FloatArray, there: BoolArray) -> IntArray:
    age = np.where(there & np.isfinite(valid[:, None, :]), valid[:, None, :], -np.inf)
    best = np.argmax(age, axis=-1)
    none = np.take_along_axis(age, best[..., None], axis=-1)[..., 0] == -np.inf
    return np.where(none, -1, best).astype(np.int64)
