"""What the treatments of the ends do: bias of a ramp, a wild end sample, noise."""

from __future__ import annotations

import numpy as np

from surefix.cleaning.tukey53h import DELAY, Ends, tukey53h
from surefix.papers.ship_run import Rows
from surefix.types import FloatArray

__all__ = ["ENDS", "end_rows"]

ENDS: dict[str, Ends] = {
    "none": "none",
    "reversal (paper)": "reversal",
    "odd reflection": "odd",
    "line (default)": "line",
}
"""Names of the rows, and the treatment of each."""

_SERIES, _SAMPLES, _WILD = 200, 32, 1000.0


def end_rows(rng: np.random.Generator) -> Rows:
    """Rows of the tables about the first four samples.

    ``end_bias``: x₃ − x on a ramp, in samples of its slope. ``end_wild_pct``: what is left of a
    wild first sample after cleaning, at samples 1 … 4, in percent of it. ``end_noise``: standard
    deviation of x₃ at samples 1 … 4 on white noise of standard deviation 1.
    """
    ramp = np.arange(float(_SAMPLES))
    wild = np.zeros(_SAMPLES)
    wild[0] = _WILD
    noise = rng.standard_normal((_SERIES, _SAMPLES))
    rows: Rows = {"end_bias": {}, "end_wild_pct": {}, "end_noise": {}}
    for name, ends in ENDS.items():
        estimate = np.array([_first(tukey53h(x, np.inf, ends=ends).estimate) for x in noise])
        cleaned = tukey53h(wild, 1.0, ends=ends).value
        rows["end_bias"][name] = _first(tukey53h(ramp, np.inf, ends=ends).estimate - ramp).tolist()
        rows["end_wild_pct"][name] = (100.0 * _first(np.abs(cleaned)) / _WILD).tolist()
        rows["end_noise"][name] = np.sqrt(np.mean(estimate**2, axis=0)).tolist()
    return rows


def _first(x: FloatArray) -> FloatArray:
    return x[:DELAY]
