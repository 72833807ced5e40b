"""The running median: of whole series, and of a window that keeps its order as samples come and go.

Whole series go by `surefix.cleaning.window_medians`. A `SortedWindow` is for samples that come one
by one: O(log n) each. Its samples are split into two heaps in one flat array: the lower half,
largest on top, grows from the front, and the upper half, smallest on top, from the back. Every slot
of the window knows its place in its heap, so the oldest sample leaves as fast as a new one enters,
and the median is read off the tops. Paper 004, section 2.2, keeps a doubly linked list in order
instead, which costs O(n) a sample; the medians are the same.

NaN is missing: it takes its turn in the window and has no say in the median. Infinities are values
like any other. An even number of samples has the mean of its two middle ones.

>>> running_median([1.0, 9.0, 2.0, np.nan, 3.0], 3)
array([5. , 2. , 5.5, 2.5, 3. ])
>>> running_median([1.0, 9.0, 2.0, np.nan, 3.0], 3, centred=False)
array([1. , 5. , 2. , 5.5, 2.5])
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from surefix.cleaning.window_medians import NARROW, narrow_medians, wide_medians
from surefix.errors import OptionsError
from surefix.jit import helper
from surefix.types import FloatArray, IntArray

__all__ = ["SortedWindow", "middle", "push", "running_median", "sorted_window"]


class SortedWindow(NamedTuple):
    """The last n samples and their order; changed in place by `push`.

    Parameters
    ----------
    value
        (n,) the samples, in a ring.
    heap
        (n,) slots of the ring: the lower half from the front, the upper half from the back.
    place
        (n,) where each slot stands in ``heap``; −1 for a missing sample.
    tally
        (3,) sizes of the lower and of the upper half, and the slot that is next.
    """

    value: FloatArray
    heap: IntArray
    place: IntArray
    tally: IntArray

    def copy(self) -> SortedWindow:
        """Copy the window, so that the copy can go its own way."""
        return SortedWindow(
            self.value.copy(), self.heap.copy(), self.place.copy(), self.tally.copy()
        )


def sorted_window(size: int) -> SortedWindow:
    """Make an empty window of ``size`` samples.

    Raises
    ------
    OptionsError
        No samples.
    """
    if size < 1:
        raise OptionsError(f"window {size}", "a whole number from 1")
    return SortedWindow(
        np.full(size, np.nan),
        np.zeros(size, np.int64),
        np.full(size, -1, np.int64),
        np.zeros(3, np.int64),
    )


def running_median(values: ArrayLike, window: int, *, centred: bool = True) -> FloatArray:
    """Median of the window around, or before, each sample.

    At the ends the window holds what there is. Where it holds nothing the median is NaN.

    Parameters
    ----------
    values
        (n,) or (n, columns) in any unit, the columns on their own; NaN is missing.
    window
        Samples in the window, at least 1.
    centred
        From ``window // 2`` samples before to ``(window − 1) // 2`` after each sample; otherwise
        the window ends with the sample itself.

    Returns
    -------
    medians
        Of the shape and in the unit of ``values``.

    Raises
    ------
    OptionsError
        The window has no samples.
    """
    if window < 1:
        raise OptionsError(f"window {window}", "a whole number from 1")
    given = np.asarray(values, dtype=np.float64)
    ahead = (window - 1) // 2 if centred else 0
    columns = np.atleast_2d(given.T)
    beyond = np.full((len(columns), window - 1), np.nan)
    before = window - 1 - ahead
    samples = np.hstack((beyond[:, :before], columns, beyond[:, before:]))
    medians_of = narrow_medians if window <= NARROW else wide_medians
    medians = [medians_of(column, window) for column in samples]
    return np.ascontiguousarray(np.transpose(medians)).reshape(given.shape)


@helper
def push(window: SortedWindow, value: float) -> None:
    """Let the newest sample in and the oldest out, in O(log n); NaN is missing."""
    slot = window.tally[2]
    window.tally[2] = slot + 1 if slot + 1 < len(window.value) else 0
    changed = window.place[slot]
    if np.isnan(value):
        changed = _remove(window, changed)
    else:
        window.value[slot] = value
        if changed < 0:
            changed = _append(window, slot)
    if changed >= 0:
        _settle(window.value, window.heap, window.place, changed, window.tally[0], window.tally[1])


@helper
def middle(window: SortedWindow) -> float:
    """Median of the samples in the window; NaN where all are missing."""
    low, high = window.tally[0], window.tally[1]
    if low == 0:
        return np.nan
    below = float(window.value[window.heap[0]])
    if low > high:
        return below
    return 0.5 * (below + float(window.value[window.heap[len(window.heap) - 1]]))


@helper
def _append(window: SortedWindow, slot: int) -> int:
    """Add a slot to the half that is due, the lower one first; gives its place."""
    tally = window.tally
    lower = tally[0] == tally[1]
    last = int(tally[0] if lower else len(window.heap) - 1 - tally[1])
    tally[0 if lower else 1] += 1
    window.heap[last] = slot
    window.place[slot] = last
    return last


@helper
def _remove(window: SortedWindow, place: int) -> int:
    """Put the last slot of the half that is due in the place of another; −1 if nothing moved."""
    if place < 0:
        return -1
    tally = window.tally
    lower = tally[0] > tally[1]
    tally[0 if lower else 1] -= 1
    last = tally[0] if lower else len(window.heap) - 1 - tally[1]
    slot = window.heap[last]
    window.place[window.heap[place]] = -1
    if place == last:
        return -1
    window.heap[place] = slot
    window.place[slot] = place
    return place


@helper
def _settle(
    value: FloatArray, heap: IntArray, place: IntArray, changed: int, low: int, high: int
) -> None:
    """Restore the order of both halves after the sample at one place has changed.

    The sample rises or sinks in its half; if it then stands on top and on the wrong side, the tops
    are exchanged and it sinks in the other half. Entry i of a half stands at ``first + step · i``.
    """
    top = len(heap) - 1
    lower = changed < low
    index = changed if lower else top - changed
    for _ in range(2):
        first, step, size = (0, 1, low) if lower else (top, -1, high)
        slot = heap[first + step * index]
        key = step * value[slot]
        while index > 0:
            above = (index - 1) >> 1
            parent = heap[first + step * above]
            if key <= step * value[parent]:
                break
            heap[first + step * index] = parent
            place[parent] = first + step * index
            index = above
        while 2 * index + 1 < size:
            below = 2 * index + 1
            child = heap[first + step * below]
            if below + 1 < size:
                other = heap[first + step * (below + 1)]
                if step * value[other] > step * value[child]:
                    below, child = below + 1, other
            if step * value[child] <= key:
                break
            heap[first + step * index] = child
            place[child] = first + step * index
            index = below
        heap[first + step * index] = slot
        place[slot] = first + step * index
        if high == 0 or value[heap[0]] <= value[heap[top]]:
            break
        heap[0], heap[top] = heap[top], heap[0]
        place[heap[0]] = 0
        place[heap[top]] = top
        lower, index = not lower, 0
