"""The cleaners that paper 003 names, its own, and ours, under one roof for comparison."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from surefix.cleaning.hampel import hampel
from surefix.cleaning.lagrange import lagrange
from surefix.cleaning.least_squares import five_point_cubic, sliding_least_squares
from surefix.cleaning.plausibility import Bounds, Check, plausibility
from surefix.cleaning.replacement import Replaced
from surefix.cleaning.tukey53h import DELAY, tukey53h
from surefix.papers.ship_hypotheses import edit_by_hypotheses
from surefix.types import FloatArray

__all__ = [
    "DELAYS",
    "FIGURES_SHOW",
    "METHODS",
    "OURS",
    "PAPER",
    "SEVERAL",
    "SMOOTHERS",
    "Series",
]

_WINDOW, _LONG, _MARGIN = 11, 61, 2.0

PAPER = "improved 53H (paper)"
OURS = "rate check + 53H (line)"
SEVERAL = "multi-hypothesis, offline"
FIGURES_SHOW = ("weighted least squares", "five-point cubic", PAPER)
"""The three methods of the paper's Figures 5 and 6."""


class Series(NamedTuple):
    """What a cleaner is given.

    Parameters
    ----------
    value
        (n,) NaN is missing.
    time, threshold
        (n,) s, and T in the unit of the value.
    period
        One turn for angles, else 0.
    """

    value: FloatArray
    time: FloatArray
    threshold: FloatArray
    period: float


def _rate_and_53h(series: Series) -> Replaced:
    """Leave out what breaks the rate; then 53H. What is left out is NaN and counts as replaced."""
    steps = np.diff(series.time)
    known = series.threshold[np.isfinite(series.threshold)]
    if not (steps > 0.0).any() or not known.size:
        return tukey53h(series.value, series.threshold, period=series.period)
    rate = _MARGIN * float(np.median(known)) / float(np.median(steps[steps > 0.0]))
    check = plausibility(series.value, series.time, Bounds(rate=rate), period=series.period)
    refused = check == Check.RATE
    possible = np.where(refused, np.nan, series.value)
    cleaned = tukey53h(possible, series.threshold, period=series.period)
    return cleaned._replace(replaced=cleaned.replaced | refused)


SMOOTHERS = ("five-point cubic", "weighted least squares")
"""Methods that edit every sample."""

METHODS: Mapping[str, Callable[[Series], Replaced]] = MappingProxyType(
    {
        "five-point cubic": lambda s: five_point_cubic(s.value, period=s.period),
        "weighted least squares": lambda s: sliding_least_squares(
            s.value, window=_WINDOW, period=s.period
        ),
        "Lagrange, 3 points": lambda s: lagrange(s.value, s.time, s.threshold, period=s.period),
        "53H": lambda s: tukey53h(s.value, s.threshold, ends="none", period=s.period),
        PAPER: lambda s: tukey53h(s.value, s.threshold, ends="reversal", period=s.period),
        "improved 53H (odd)": lambda s: tukey53h(s.value, s.threshold, ends="odd", period=s.period),
        "improved 53H (line)": lambda s: tukey53h(s.value, s.threshold, period=s.period),
        "Hampel, 11 samples": lambda s: hampel(s.value, window=_WINDOW, period=s.period),
        "Hampel, 61 samples": lambda s: hampel(s.value, window=_LONG, period=s.period),
        OURS: _rate_and_53h,
        SEVERAL: lambda s: edit_by_hypotheses(*s),
    }
)
"""By name, in the order of the tables."""

DELAYS: Mapping[str, float] = MappingProxyType(
    {
        "five-point cubic": 2,
        "weighted least squares": _WINDOW // 2,
        "Lagrange, 3 points": 0,
        "53H": DELAY,
        PAPER: DELAY,
        "improved 53H (odd)": DELAY,
        "improved 53H (line)": DELAY,
        "Hampel, 11 samples": _WINDOW // 2,
        "Hampel, 61 samples": _LONG // 2,
        OURS: DELAY,
        SEVERAL: np.nan,
    }
)
"""Samples after which each decides; NaN for one that looks at the whole series."""
