"""Rows of a table as lines of text: words, and numbers of fixed decimals without last zeros."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from surefix.jit import lean_helper, lean_kernel

__all__ = ["MISSING", "WIDEST", "print_rows"]

MISSING: Final = -(2**63)
"""A cell that stays empty."""

WIDEST: Final = 21
"""Bytes that a number takes at the most: 19 digits, sign and point."""

_TEN: Final = np.uint64(10)
_NONE: Final = np.uint64(0)
_DIGIT: Final = np.uint64(ord("0"))
_COMMA, _POINT, _MINUS, _END = (np.uint8(ord(sign)) for sign in ",.-\n")


@lean_kernel
def print_rows(
    cells: NDArray[np.int64],
    decimals: NDArray[np.int64],
    words: NDArray[np.uint8],
    starts: NDArray[np.int64],
    out: NDArray[np.uint8],
) -> int:
    """Print rows into the end of a buffer; gives where their text begins.

    Parameters
    ----------
    cells
        (columns, n) numbers in units of their last decimal, places in the list of words, or
        `MISSING`.
    decimals
        (columns,) how many decimals the numbers of a column have; −1 where it has words.
    words, starts
        The bytes of all words, one after the other; (words + 1,) where each begins.
    out
        Is filled from its end; long enough for all rows: `WIDEST` for each number, the length of
        each word, and one for each cell.
    """
    at = len(out)
    columns, n = cells.shape
    for row in range(n - 1, -1, -1):
        for column in range(columns - 1, -1, -1):
            at -= 1
            out[at] = _END if column == columns - 1 else _COMMA
            value = cells[column, row]
            if value == MISSING:
                continue
            if decimals[column] >= 0:
                at = _print_number(value, decimals[column], out, at)
                continue
            for k in range(starts[value + 1] - 1, starts[value] - 1, -1):
                at -= 1
                out[at] = words[k]
    return at


@lean_helper
def _print_number(value: int, decimals: int, out: NDArray[np.uint8], at: int) -> int:
    """Print a number so that it ends before a place; gives where it begins."""
    left = np.uint64(abs(value))
    after = decimals
    while after > 0 and left % _TEN == _NONE:
        left //= _TEN
        after -= 1
    if after > 0:
        for _ in range(after):
            at -= 1
            out[at] = np.uint8(_DIGIT + left % _TEN)
            left //= _TEN
        at -= 1
        out[at] = _POINT
    at -= 1
    out[at] = np.uint8(_DIGIT + left % _TEN)
    left //= _TEN
    while left > _NONE:
        at -= 1
        out[at] = np.uint8(_DIGIT + left % _TEN)
        left //= _TEN
    if value < 0:
        at -= 1
        out[at] = _MINUS
    return at
