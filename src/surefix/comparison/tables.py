"""Tables of a comparison: one a figure of merit, mode and kind of log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from surefix.comparison.merit import ORACLE, Merit, Outcome, Outcomes
from surefix.comparison.options import CompareOptions
from surefix.experiment import Table, gather
from surefix.pipelines.options import Mode

__all__ = ["KIND_WORDS", "MODE_WORDS", "SHOWN", "tables"]

MODE_WORDS: Final[Mapping[str, str]] = {
    "offline": "offline",
    "lagged": "lagged",
    "realtime": "real time",
}


KIND_WORDS: Final[Mapping[str, str]] = {"aided": "with velocities", "alone": "fixes alone"}


class _Column(NamedTuple):
    """How one field of `Merit` is shown: ``once``, in the first mode, if no mode changes it."""

    title: str
    unit: str = ""
    digits: int = 3
    once: bool = False


SHOWN: Final[Mapping[str, _Column]] = {
    "rmse_ratio": _Column("RMSE ÷ oracle"),
    "nees": _Column("Normalised NEES", digits=2),
    "rejected_gross_pct": _Column("Gross errors rejected", "%", 2),
    "rejected_good_pct": _Column("Good fixes rejected", "%", 2),
    "noise_position": _Column("Noise of the fixes, estimated ÷ true", once=True),
    "noise_velocity": _Column("Noise of the velocities, estimated ÷ true", once=True),
    "noise_motion": _Column("Noise of the motion, estimated ÷ true", once=True),
    "back_fixes": _Column("Back beside the oracle after a true jump", "fixes", 0),
}
"""Fields of `Merit` in the order of the tables."""


def tables(options: CompareOptions, runs: Sequence[Mapping[str, Outcomes]]) -> tuple[Table, ...]:
    """Make a table of scenarios (rows) and methods (columns) of each figure, mode and kind of log.

    Keys are ``FIGURE-MODE-aided`` and ``FIGURE-MODE-alone``; tables without any figure are left
    out, and rows without any in a table. The NEES has the oracle's beside it: it tells how much the
    figure scatters by itself.

    Parameters
    ----------
    options
        What was compared.
    runs
        Outcomes by scenario, of every run.
    """
    made = []
    for figure, shown in SHOWN.items():
        for mode in options.modes[:1] if shown.once else options.modes:
            for kind in KIND_WORDS:
                table = _table(figure, mode, kind, options, runs)
                if len(table.rows):
                    made.append(table)
    return tuple(made)


def _table(
    figure: str,
    mode: Mode,
    kind: str,
    options: CompareOptions,
    runs: Sequence[Mapping[str, Outcomes]],
) -> Table:
    shown = SHOWN[figure]
    columns = (*options.methods, ORACLE) if figure == "nees" else options.methods
    missing = Outcome(Merit(*[np.nan] * len(Merit._fields)), np.empty(0))
    lines = [
        {
            scenario: [
                getattr(run[scenario].get((kind, mode, method), missing).merit, figure)
                for method in columns
            ]
            for scenario in options.scenarios
        }
        for run in runs
    ]
    kept = [row for row in options.scenarios if any(np.isfinite(line[row]).any() for line in lines)]
    return gather(
        f"{figure}-{mode}-{kind}",
        f"{shown.title}, {MODE_WORDS[mode]}, {KIND_WORDS[kind]}",
        columns,
        [{row: line[row] for row in kept} for line in lines],
        unit=shown.unit,
        digits=shown.digits,
        of="Scenario",
    )
