"""Is a sample possible at all? Validity, range, rate and frozen values; one code a sample.

The first stage of the chain of paper 003. Nothing is replaced here: what does not pass is left out
of what follows. Every test looks back only, so parts of a series can be judged as they come.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from surefix.cleaning.replacement import continued
from surefix.errors import OptionsError
from surefix.jit import kernel
from surefix.types import BoolArray, FloatArray, IntArray

__all__ = ["Bounds", "Check", "plausibility"]


class Check(IntEnum):
    """What a sample failed; the first in this order."""

    PASSED = 0
    MISSING = 1
    INVALID = 2
    RANGE = 3
    FROZEN = 4
    RATE = 5


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """What is possible for a quantity, in its own unit; the defaults let everything pass.

    Parameters
    ----------
    lower, upper
        Its range, both ends included.
    rate
        Greatest change per second.
    slack
        Change that noise alone may make between two samples, added to what the rate allows.
    frozen
        Samples in sequence with one and the same value after which the sensor is taken for stuck;
        0 never. Coarse digits repeat by themselves: use it only where they cannot.

    Raises
    ------
    OptionsError
        An empty range, or a negative rate, slack or count.
    """

    lower: float = -np.inf
    upper: float = np.inf
    rate: float = np.inf
    slack: float = 0.0
    frozen: int = 0

    def __post_init__(self) -> None:
        if not self.lower <= self.upper:
            raise OptionsError(f"range {self.lower} … {self.upper}", "lower ≤ upper")
        if not (self.rate >= 0.0 and self.slack >= 0.0 and self.frozen >= 0):
            given = f"rate {self.rate}, slack {self.slack}, frozen {self.frozen}"
            raise OptionsError(given, "numbers from 0")


def plausibility(
    x: ArrayLike,
    time: ArrayLike,
    bounds: Bounds,
    *,
    valid: BoolArray | None = None,
    period: float = 0.0,
) -> IntArray:
    """Judge each sample; (n,) codes of `Check`.

    The rate is that since the last sample that passed. After a jump the room that the rate allows
    grows with time, so a sensor that stays where it jumped to passes again after
    (|jump| − slack)/rate seconds at the latest, and one whose first sample was wild is not lost.

    Parameters
    ----------
    x
        (n,) samples in any unit; not finite is missing.
    time
        (n,) s; the rate is not tested where a time is unknown or does not advance.
    bounds
        What is possible.
    valid
        (n,) the sensor's own validity bit; None for all valid.
    period
        One turn for angles, else 0; the range then applies to the angle as given.

    Examples
    --------
    >>> plausibility([0.0, 1.0, 50.0, 2.0, 999.0], [0, 1, 2, 3, 4], Bounds(upper=100, rate=5))
    array([0, 0, 5, 0, 3])
    """
    raw = np.atleast_1d(np.asarray(x, dtype=np.float64))
    t = np.atleast_1d(np.asarray(time, dtype=np.float64))
    code = np.full(len(raw), int(Check.PASSED), np.int64)
    with np.errstate(invalid="ignore"):
        code[(raw < bounds.lower) | (raw > bounds.upper)] = Check.RANGE
    if valid is not None:
        code[~valid] = Check.INVALID
    code[~np.isfinite(raw)] = Check.MISSING
    turned, _ = continued(np.where(code == Check.PASSED, raw, np.nan), period)
    _look_back(turned, t, bounds.rate, bounds.slack, bounds.frozen, code)
    return code


@kernel
def _look_back(
    x: FloatArray, t: FloatArray, rate: float, slack: float, frozen: int, code: IntArray
) -> None:
    """Test what needs the samples before; fills ``code``."""
    last = last_time = before = np.nan
    same = 0
    for k in range(len(x)):
        if np.isnan(x[k]):
            continue
        same = same + 1 if x[k] == before else 1
        before = x[k]
        if 0 < frozen < same:
            code[k] = Check.FROZEN
        elif t[k] > last_time and abs(x[k] - last) > rate * (t[k] - last_time) + slack:
            code[k] = Check.RATE
        else:
            last, last_time = x[k], t[k]
