"""Faults of an acoustic log, drawn from a seeded generator: which fixes err, and how much."""

from __future__ import annotations

import numpy as np

from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["error_vectors", "irregular_times", "isolated", "outside"]


def irregular_times(
    rng: np.random.Generator, start: float, stop: float, interval: float, jitter: float
) -> FloatArray:
    """Instants about ``interval`` s apart whose own steps vary: no drift, always increasing.

    Parameters
    ----------
    start, stop
        s; every instant lies between them.
    interval
        s between the nominal instants.
    jitter
        Half-width of the uniform scatter round the nominal instant, as a share of ``interval``;
        below 0.5 the order is kept.
    """
    nominal = np.arange(start + interval, stop - interval, interval)
    return np.asarray(nominal + rng.uniform(-jitter, jitter, nominal.size) * interval)


def outside(time: FloatArray, gaps: FloatArray) -> BoolArray:
    """Tell which instants lie in none of the gaps.

    Parameters
    ----------
    time
        (n,) s.
    gaps
        (k, 2) s, begin and end of each.

    >>> outside(np.array([0.0, 5.0, 9.0]), np.array([[4.0, 8.0]])).tolist()
    [True, False, True]
    """
    inside = (time[:, None] >= gaps[:, 0]) & (time[:, None] < gaps[:, 1])
    return np.asarray(~inside.any(axis=1))


def isolated(rng: np.random.Generator, among: IntArray, count: int) -> IntArray:
    """Choose ``count`` of the rows ``among``, no two of them neighbours where that is possible.

    Rows are taken in random order; one beside a row already taken waits until no other is left.
    """
    order = rng.permutation(among)
    taken: set[int] = set()
    later: list[int] = []
    for row in order.tolist():
        if len(taken) == count:
            break
        if row - 1 in taken or row + 1 in taken:
            later.append(row)
        else:
            taken.add(row)
    taken.update(later[: count - len(taken)])
    return np.array(sorted(taken), dtype=np.int64)


def error_vectors(
    rng: np.random.Generator, count: int, smallest: float, largest: float
) -> FloatArray:
    """Errors of log-uniform length and random direction, (count, 3) m.

    A multipath error lies mostly across the line of sight: the directions are uniform in bearing
    and within 25° of the horizontal.
    """
    length = smallest * (largest / smallest) ** rng.uniform(0.0, 1.0, count)
    bearing = rng.uniform(0.0, 2.0 * np.pi, count)
    slope = np.radians(rng.uniform(-25.0, 25.0, count))
    flat = length * np.cos(slope)
    return np.column_stack((flat * np.sin(bearing), flat * np.cos(bearing), length * np.sin(slope)))
