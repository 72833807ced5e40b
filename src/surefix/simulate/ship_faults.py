"""Faults of a ship's sensors, drawn from a seeded generator, each at a known place.

Gross errors come alone and in bursts of 2, 3, 5, 10 and 30 samples that share one wrong offset.
Beside them a value that is stuck for a minute, samples that are lost, and samples that the sensor
itself marks as invalid. They keep a distance of at least forty samples from each other, so that
what a cleaner does with one does not depend on another.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["BURSTS", "Disturbed", "Faults", "disturbed"]

BURSTS = (1, 2, 3, 5, 10, 30)
"""Lengths of the runs of gross errors, in samples."""

_SLOT = 80  # samples that one fault and the quiet after it take
_SHARE = {1: 0.24, 2: 0.1, 3: 0.13, 5: 0.16, 10: 0.17, 30: 0.2}  # of the gross samples, by run
_STUCK, _INVALID, _LOST = 60, 20, 40  # samples


class Faults(NamedTuple):
    """What is wrong with the samples of one series.

    Parameters
    ----------
    burst
        (n,) length of the run of gross errors that the sample belongs to; 0 for none.
    stuck, lost, invalid
        (n,) which samples repeat an old value, are missing, are marked as invalid (and are wrong).
    """

    burst: IntArray
    stuck: BoolArray
    lost: BoolArray
    invalid: BoolArray

    @property
    def good(self) -> BoolArray:
        """(n,) samples with nothing wrong."""
        return np.asarray((self.burst == 0) & ~self.stuck & ~self.lost & ~self.invalid)


class Disturbed(NamedTuple):
    """A series with faults: what is logged, its validity bits, and what is wrong."""

    value: FloatArray
    valid: BoolArray
    faults: Faults


def disturbed(
    rng: np.random.Generator,
    intact: FloatArray,
    gross: tuple[float, float],
    share: float,
    gone: BoolArray,
    lengths: tuple[int, ...] = BURSTS,
) -> Disturbed:
    """Put faults into a series.

    Parameters
    ----------
    intact
        (n,) the series without faults.
    gross
        Least and greatest size of a gross error, log-uniform between, of either sign.
    share
        Of gross errors among the samples; 0 leaves the series without any fault but ``gone``.
    gone
        (n,) samples that are missing anyway.
    lengths
        Runs that occur, among `BURSTS`; the others and their share are left out.
    """
    n = len(intact)
    burst = np.zeros(n, np.int64)
    stuck, invalid, lost = (np.zeros(n, np.bool_) for _ in range(3))
    value = intact.copy()
    kinds = [*_runs(n, share, lengths), *((-1, -2, -3) if share > 0.0 else ())]
    slots = rng.permutation(max(n // _SLOT - 1, 0))[: len(kinds)]
    for slot, kind in zip(slots.tolist(), kinds, strict=False):
        at = _SLOT * slot + int(rng.integers(8, 12))
        size = np.exp(rng.uniform(np.log(gross[0]), np.log(gross[1]))) * rng.choice([-1.0, 1.0])
        if kind == -1:
            stuck[at : at + _STUCK] = True
            value[at : at + _STUCK] = intact[at]
            stuck[at] = False
        elif kind == -2:
            invalid[at : at + _INVALID] = True
            value[at : at + _INVALID] += size * rng.uniform(-1.0, 1.0, _INVALID)
        elif kind == -3:
            lost[at : at + _LOST] = True
        else:
            burst[at : at + kind] = kind
            value[at : at + kind] += size
    lost |= gone
    burst[lost] = 0
    value[lost] = np.nan
    invalid &= ~lost
    return Disturbed(value, ~invalid, Faults(burst, stuck & ~lost, lost, invalid))


def _runs(n: int, share: float, lengths: tuple[int, ...]) -> list[int]:
    """Lengths of the runs of a series; with any share at least one of each length if they fit."""
    if share <= 0.0:
        return []
    counts = {length: max(round(share * n * _SHARE[length] / length), 1) for length in lengths}
    return [length for length, count in counts.items() for _ in range(count)]
