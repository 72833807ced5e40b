"""What one scalar tells of a position: a range, a bearing, an elevation, or a component itself.

The state is ``[p₁ … p_d, v₁ … v_d]``, d = 1 … 3, axes x east, y north, z up. A sight is taken from
an anchor a, which may move from epoch to epoch (a receiver under a ship); with ``o = p − a``:

- range ``|o|``,
- bearing ``atan2(o_x, o_y)``, clockwise from y,
- elevation ``atan2(o_z, √(o_x² + o_y²))``,
- component i of the state, less that of the anchor if it is one of the position.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from surefix.jit import helper, inner, kernel
from surefix.rows import (
    Size,
    add_product,
    add_row,
    angle_row,
    clear_row,
    copy_row,
    root_row,
)
from surefix.types import FloatArray, IntArray

__all__ = [
    "BEARING",
    "COMPONENT",
    "ELEVATION",
    "RANGE",
    "expected",
    "period_of",
    "sight",
    "sight_row",
]

RANGE: Final = 0
BEARING: Final = 1
ELEVATION: Final = 2
COMPONENT: Final = 3
"""Component i of the state has the code ``COMPONENT + i``."""

_TINY = 1e-9  # m, nearer than which an anchor has no direction


@helper
def sight(kind: int, anchor: FloatArray, x: FloatArray, d: int, H: FloatArray) -> float:
    """Value of a sight of state ``x`` (2d,), m or rad; its Jacobian goes to ``H`` (2d,).

    Parameters
    ----------
    kind
        A code of this module.
    anchor
        (d,) m.
    """
    for i in range(2 * d):
        H[i] = 0.0
    if kind >= COMPONENT:
        c = kind - COMPONENT
        H[c] = 1.0
        return float(x[c] - anchor[c]) if c < d else float(x[c])
    flat = 0.0
    for i in range(min(d, 2)):
        flat += (x[i] - anchor[i]) * (x[i] - anchor[i])
    up = x[2] - anchor[2] if d == 3 else 0.0
    square = flat + up * up
    flat = max(math.sqrt(flat), _TINY)
    distance = max(math.sqrt(square), _TINY)
    if kind == RANGE:
        for i in range(d):
            H[i] = (x[i] - anchor[i]) / distance
        return distance
    east, north = x[0] - anchor[0], x[1] - anchor[1]
    if kind == BEARING:
        H[0] = north / (flat * flat)
        H[1] = -east / (flat * flat)
        return math.atan2(east, north)
    H[0] = -up * east / (flat * distance * distance)
    H[1] = -up * north / (flat * distance * distance)
    H[2] = flat / (distance * distance)
    return math.atan2(up, flat)


@inner
def sight_row(
    kind: int,
    anchors: FloatArray,
    c: int,
    X: FloatArray,
    ones: FloatArray,
    off: FloatArray,
    Y: FloatArray,
    row: int,
    points: Size,
) -> None:
    """Values of a sight of many points at once, as `sight` gives them, into a row of ``Y``.

    Parameters
    ----------
    kind
        A code of this module.
    anchors, c
        (…, d) m, and which row is the anchor.
    X
        (n, points) states, which begin with the position, a point a column.
    ones, off
        (1, points) ones, and (3, points) scratch.
    Y, row
        (…, points) and the row to fill.
    points
        How many, see `surefix.rows`.
    """
    d = anchors.shape[1]
    if kind >= COMPONENT:
        i = kind - COMPONENT
        copy_row(Y, row, X, i, points)
        if i < d:
            add_row(Y, row, -anchors[c, i], ones, 0, points)
        return
    for i in range(3):
        clear_row(off, i, points)
        if i < d:
            copy_row(off, i, X, i, points)
            add_row(off, i, -anchors[c, i], ones, 0, points)
    if kind == BEARING:
        angle_row(Y, row, off, 0, off, 1, points)
        return
    clear_row(Y, row, points)
    for i in range(2 if kind == ELEVATION else 3):
        add_product(Y, row, off, i, off, i, points)
    root_row(Y, row, points)
    if kind == ELEVATION:
        angle_row(Y, row, off, 2, Y, row, points)


@helper
def period_of(kind: int) -> float:
    """One turn for a bearing, 0 for what does not wrap."""
    return 2.0 * math.pi if kind == BEARING else 0.0


@kernel
def _expected(kind: IntArray, anchor: FloatArray, state: FloatArray, out: FloatArray) -> None:
    d = state.shape[1] // 2
    H = np.empty(2 * d)
    for k in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[k, c] = sight(kind[c], anchor[k, c], state[k], d, H)


def expected(kind: IntArray, anchor: ArrayLike, state: ArrayLike) -> FloatArray:
    """Value of every sight of every state, without noise.

    Parameters
    ----------
    kind
        (c,) codes.
    anchor
        (n, c, d) m, or what broadcasts to it.
    state
        (n, 2d) m and m/s.

    Returns
    -------
    value
        (n, c) m and rad.

    Examples
    --------
    >>> expected(np.array([RANGE, BEARING]), [0.0, 0.0], [[3.0, 4.0, 0.0, 0.0]]).round(4)
    array([[5.    , 0.6435]])
    """
    states = np.ascontiguousarray(state, np.float64)
    n, d = len(states), states.shape[1] // 2
    anchors = np.ascontiguousarray(np.broadcast_to(anchor, (n, len(kind), d)), np.float64)
    out = np.empty((n, len(kind)))
    _expected(kind, anchors, states, out)
    return out
