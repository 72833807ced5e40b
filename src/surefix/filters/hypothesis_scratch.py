"""What a step of the multi-hypothesis filter writes before it reads it."""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np

from surefix.filters.hypothesis_branches import BRANCHES
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["Scratch", "rows_of", "scratch_for"]


class Scratch(NamedTuple):
    """Memory for one step with k hypotheses; nothing in it outlasts the step.

    Parameters
    ----------
    score, parent, code
        (k·`BRANCHES`,) log-weight of each candidate, where it comes from, and what it says.
    chosen
        (k,) candidates that are kept, best first.
    origin, said
        (k,) of each hypothesis, its place after the last epoch, and what it says of this one.
    before, spoken
        (k,) the same of the hypotheses that the candidates come from.
    claims, spare, row
        (k,) how many come from each, rows that are free, and rows that are given.
    keep, apart
        (k,) hypotheses left by merging, and those that one of them is not merged with.
    r, noise
        (2·axes,) variances of the components, and (axes,) their share of those of innovations.
    share
        (k,) probabilities.
    middle, width
        (axes, k) positions and their variances.
    parts
        (4, 3) terms of the densities of each axis.
    """

    score: FloatArray
    parent: IntArray
    code: IntArray
    chosen: IntArray
    origin: IntArray
    said: IntArray
    before: IntArray
    spoken: IntArray
    claims: IntArray
    spare: IntArray
    row: IntArray
    keep: BoolArray
    apart: BoolArray
    r: FloatArray
    noise: FloatArray
    share: FloatArray
    middle: FloatArray
    width: FloatArray
    parts: FloatArray


def scratch_for(axes: int, most: int) -> Scratch:
    """Make it for so many axes and hypotheses."""
    return Scratch(
        np.empty(most * BRANCHES),
        np.empty(most * BRANCHES, np.int64),
        np.empty(most * BRANCHES, np.int64),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        rows_of(most),
        rows_of(most),
        np.empty(most, np.bool_),
        np.empty(most, np.bool_),
        np.empty(2 * axes),
        np.zeros(axes),
        np.empty(most),
        np.empty((axes, most)),
        np.empty((axes, most)),
        np.empty((4, 3)),
    )


def rows_of(most: int) -> IntArray:
    """Rows 0 … ``most`` − 1, as numbers without sign: such an index is never counted from the end.

    >>> rows_of(3)
    array([0, 1, 2], dtype=uint64)
    """
    return cast(IntArray, np.arange(most, dtype=np.uint64))
