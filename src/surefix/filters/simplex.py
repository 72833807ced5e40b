"""The simplex search of Nelder and Mead, for a few noise figures.

It takes the steps of ``scipy.optimize.minimize`` with that method and gives its numbers to the last
bit (the tests compare them); but loading that package takes longer than cleaning a small log.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from surefix.types import FloatArray

__all__ = ["Lowest", "descend"]


class Lowest(NamedTuple):
    """Where a function is lowest, as far as the search came: ``x`` (n,) and the value there."""

    x: FloatArray
    value: float


def descend(
    cost: Callable[[FloatArray], float],
    simplex: FloatArray,
    *,
    near: float,
    level: float,
    most: int,
) -> Lowest:
    """Go down from the corners of a simplex.

    Parameters
    ----------
    cost
        Of a point (n,).
    simplex
        (n + 1, n) corners to begin with.
    near, level
        The search ends when no corner is further than ``near`` from the best along any axis, and
        none higher than it by more than ``level``.
    most
        Steps at most.

    Source: J. A. Nelder and R. Mead, A simplex method for function minimization, Computer Journal
    7 (1965) 308–313.

    >>> found = descend(
    ...     lambda x: float(x @ x), np.array([[2.0], [1.0]]), near=1e-6, level=1e-9, most=100
    ... )
    >>> bool(abs(found.x[0]) < 1e-4)
    True
    """
    corner = np.array(simplex, dtype=np.float64)
    value = np.array([cost(x) for x in corner])
    corner, value = _sorted(corner, value)
    for _ in range(most - 1):
        apart = np.abs(corner[1:] - corner[0]).max()
        if apart <= near and np.abs(value[0] - value[1:]).max() <= level:
            break
        _step(cost, corner, value)
        corner, value = _sorted(corner, value)
    return Lowest(corner[0], float(value.min()))


def _sorted(corner: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    order = np.argsort(value)
    return corner[order], value[order]


def _step(cost: Callable[[FloatArray], float], corner: FloatArray, value: FloatArray) -> None:
    """Move the worst corner through the middle of the others, or draw all towards the best."""
    middle = np.add.reduce(corner[:-1], 0) / corner.shape[1]
    mirrored = 2.0 * middle - corner[-1]
    reached = cost(mirrored)
    if reached < value[0]:
        further = 3.0 * middle - 2.0 * corner[-1]
        beyond = cost(further)
        better = beyond < reached
        corner[-1], value[-1] = (further, beyond) if better else (mirrored, reached)
        return
    if reached < value[-2]:
        corner[-1], value[-1] = mirrored, reached
        return
    outside = reached < value[-1]
    between = 1.5 * middle - 0.5 * corner[-1] if outside else 0.5 * middle + 0.5 * corner[-1]
    found = cost(between)
    if found <= reached if outside else found < value[-1]:
        corner[-1], value[-1] = between, found
        return
    for j in range(1, len(corner)):
        corner[j] = corner[0] + 0.5 * (corner[j] - corner[0])
        value[j] = cost(corner[j])
