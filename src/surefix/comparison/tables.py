"""Tables of a comparison: one a figure of merit, mode and kind of log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.comparison.merit import Merit
from surefix.comparison.options import CompareOptions
from surefix.experiment import Table, gather
from surefix.pipelines.options import Mode

__all__ = ["MODE_WORDS", "SHOWN", "Runs", "tables"]

Runs = Sequence[Mapping[str, Mapping[tuple[bool, Mode, str], Merit]]]
"""A run, a scenario, whether there were velocities, the mode and the method → figures."""

MODE_WORDS: Final[Mapping[str, str]] = {
    "offline": "offline",
    "lagged": "lagged",
    "realtime": "real time",
}


class _Column(NamedTuple):
    """How one field of `Merit` is shown."""

    title: str
    unit: str
    digits: int


SHOWN: Final[Mapping[str, _Column]] = {
    "rmse_ratio": _Column("RMSE ÷ oracle", "", 3),
    "nees": _Column("Normalised NEES", "", 2),
    "rejected_gross_pct": _Column("Gross errors rejected", "%", 2),
    "rejected_good_pct": _Column("Good fixes rejected", "%", 2),
    "noise_position": _Column("Noise of the fixes, estimated ÷ true", "", 3),
    "noise_velocity": _Column("Noise of the velocities, estimated ÷ true", "", 3),
    "noise_motion": _Column("Noise of the motion, estimated ÷ true", "", 3),
    "back_s": _Column("Back beside the oracle after a true jump", "s", 1),
}
"""Fields of `Merit` in the order of the tables."""


def tables(options: CompareOptions, runs: Runs) -> tuple[Table, ...]:
    """Make a table of scenarios (rows) and methods (columns) of each figure, mode and kind of log.

    Keys are ``FIGURE-MODE-aided`` and ``FIGURE-MODE-alone``; tables without any figure are left
    out, and rows without any in a table.
    """
    made = []
    for figure in SHOWN:
        for mode in options.modes:
            for aided in (True, False):
                table = _table(figure, mode, aided, options, runs)
                if len(table.rows):
                    made.append(table)
    return tuple(made)


def _table(figure: str, mode: Mode, aided: bool, options: CompareOptions, runs: Runs) -> Table:
    shown = SHOWN[figure]
    kind = "with velocities" if aided else "fixes alone"
    missing = Merit(*[np.nan] * len(Merit._fields))
    lines = [
        {
            scenario: [
                getattr(found[scenario].get((aided, mode, method), missing), figure)
                for method in options.methods
            ]
            for scenario in options.scenarios
        }
        for found in runs
    ]
    whole = gather(
        f"{figure}-{mode}-{'aided' if aided else 'alone'}",
        f"{shown.title}, {MODE_WORDS[mode]}, {kind}",
        options.methods,
        lines,
        unit=shown.unit,
        digits=shown.digits,
    )
    known = np.isfinite(whole.values).sum(axis=(0, 2))
    kept = [row for i, row in enumerate(whole.rows) if known[i] > 0]
    return gather(
        whole.key,
        whole.title,
        options.methods,
        [{row: line[row] for row in kept} for line in lines],
        unit=shown.unit,
        digits=shown.digits,
    )
