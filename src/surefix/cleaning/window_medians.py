"""Kernels of the running median over whole series: one for narrow windows, one for the rest.

Both give the medians of the known ones of w neighbouring samples, for every place where w
neighbours are given; NaN is missing.

**Narrow** windows are sorted by comparing and exchanging in a fixed order, which needs no branches,
so many windows are sorted at once in vector registers. **Wide** ones go by ranks: a stretch of a
few windows' length is sorted once, and the window is then a row of marks in the order of rank,
along which the median moves by a mark or two when a sample enters and another leaves. Source of the
second idea: Suomela, Median filtering is equivalent to sorting, 2014, who links ranks in lists.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from surefix.jit import helper, kernel
from surefix.types import FloatArray, IntArray

__all__ = ["NARROW", "narrow_medians", "wide_medians"]

NARROW = 7
"""Samples up to which a window is narrow."""

_LANES = 64  # windows sorted at once
_SHARE = 3  # windows' lengths in a stretch, at least; the next power of 2 is sorted soonest
_LEAST = 64  # samples in a stretch
_AT_ONCE = 1 << 15  # samples in the stretches of one call: they stay in the cache


def narrow_medians(x: FloatArray, size: int) -> FloatArray:
    """Medians of ``size`` neighbours, 1 … `NARROW`; for n samples n − size + 1 medians."""
    medians = np.empty(max(len(x) - size + 1, 0))
    _narrow(x, size, medians)
    return medians


def wide_medians(x: FloatArray, size: int) -> FloatArray:
    """Medians of ``size`` neighbours, any number; for n samples n − size + 1 medians."""
    wanted = max(len(x) - size + 1, 0)
    length = max(1 << (_SHARE * size - 1).bit_length(), _LEAST)
    length = min(length, max(len(x), size))
    each = length - size + 1
    medians = np.empty(wanted)
    group = max(_AT_ONCE // length, 1) * each
    for begin in range(0, wanted, group):
        part = medians[begin : begin + group]
        count = -(-len(part) // each)
        stretch = np.full(count * each + size - 1, np.nan)
        given = x[begin : begin + len(stretch)]
        stretch[: len(given)] = given
        stretches = np.ascontiguousarray(sliding_window_view(stretch, length)[::each])
        _wide(stretches, np.argsort(stretches, axis=1), size, part)
    return medians


@kernel
def _narrow(x: FloatArray, size: int, medians: FloatArray) -> None:
    lanes = np.empty((size, _LANES))
    few = np.empty(size)
    low, high = (size - 1) // 2, size // 2
    n = len(medians)
    for begin in range(0, n, _LANES):
        some = min(_LANES, n - begin)
        known = some == _LANES
        for i in range(begin, begin + some + size - 1):
            known = known and not np.isnan(x[i])
        if not known:
            for k in range(begin, begin + some):
                medians[k] = _median(x, k, size, few)
            continue
        for i in range(size):
            for k in range(_LANES):
                lanes[i, k] = x[begin + i + k]
        for i in range(high + 1):
            for j in range(i + 1, size):
                for k in range(_LANES):
                    a, b = lanes[i, k], lanes[j, k]
                    lanes[i, k] = a if a < b else b
                    lanes[j, k] = b if a < b else a
        for k in range(_LANES):
            a, b = lanes[low, k], lanes[high, k]
            medians[begin + k] = a if low == high else 0.5 * (a + b)


@helper
def _median(x: FloatArray, start: int, size: int, few: FloatArray) -> float:
    """Median of the known ones of ``size`` samples; NaN where none is."""
    count = 0
    for i in range(start, start + size):
        value = x[i]
        if np.isnan(value):
            continue
        place = count
        while place > 0 and few[place - 1] > value:
            few[place] = few[place - 1]
            place -= 1
        few[place] = value
        count += 1
    if count == 0:
        return np.nan
    half = count // 2
    return float(few[half] if count % 2 else 0.5 * (few[half - 1] + few[half]))


@kernel
def _wide(x: FloatArray, order: IntArray, size: int, medians: FloatArray) -> None:
    """Fill ``medians`` from stretches (count, length) of which ``order`` is the argsort."""
    count, length = x.shape
    rank = np.empty(length, np.int32)
    inside = np.empty(length + 1, np.bool_)  # of the window, by rank
    inside[length] = True
    at = 0
    for s in range(count):
        for r in range(length):
            rank[order[s, r]] = r
            inside[r] = False
        known = below = place = 0  # samples in the window; those of a rank below ``place``
        for i in range(length):
            if not np.isnan(x[s, i]):
                inside[rank[i]] = True
                known += 1
                below += int(rank[i] < place)
            if i >= size and not np.isnan(x[s, i - size]):
                inside[rank[i - size]] = False
                known -= 1
                below -= int(rank[i - size] < place)
            if i < size - 1 or at == len(medians):
                continue
            if known == 0:
                medians[at] = np.nan
                at += 1
                continue
            wanted = (known - 1) >> 1
            while below > wanted:
                place -= 1
                while not inside[place]:
                    place -= 1
                below -= 1
            while below < wanted:
                while not inside[place]:
                    place += 1
                place += 1
                below += 1
            while not inside[place]:
                place += 1
            middle = x[s, order[s, place]]
            if not known & 1:
                above = place + 1
                while not inside[above]:
                    above += 1
                middle = 0.5 * (middle + x[s, order[s, above]])
            medians[at] = middle
            at += 1
