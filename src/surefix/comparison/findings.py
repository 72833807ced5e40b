"""What a comparison found, in sentences made of its own figures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surefix.comparison.methods import works_in
from surefix.comparison.options import CompareOptions
from surefix.comparison.tables import KIND_WORDS, MODE_WORDS
from surefix.experiment import Table
from surefix.pipelines.options import Mode

__all__ = ["findings"]


def findings(options: CompareOptions, tables: Mapping[str, Table]) -> tuple[str, ...]:
    """Say for each mode and method how far it usually is from the oracle, and where farthest.

    Parameters
    ----------
    options
        What was compared.
    tables
        All tables by key.
    """
    return tuple(
        _sentence(method, mode, tables)
        for mode in options.modes
        for method in options.methods
        if works_in(method, mode)
    )


def _sentence(method: str, mode: Mode, tables: Mapping[str, Table]) -> str:
    ratios = _of("rmse_ratio", method, mode, tables)
    if not ratios:
        return f"{method}, {MODE_WORDS[mode]}: no track anywhere."
    scenario, kind = max(ratios, key=lambda where: ratios[where])
    honest = list(_of("nees", method, mode, tables).values())
    gross = list(_of("rejected_gross_pct", method, mode, tables).values())
    good = list(_of("rejected_good_pct", method, mode, tables).values())
    wild = f"{min(gross):.1f} % of the gross errors at least, and " if gross else ""
    return (
        f"{method}, {MODE_WORDS[mode]}: RMSE ÷ oracle {np.median(list(ratios.values())):.2f} in the"
        f" median, at worst {max(ratios.values()):.2f} ({scenario}, {KIND_WORDS[kind]}); NEES"
        f" {min(honest):.2f} … {max(honest):.2f}; rejects {wild}{max(good):.1f} % of the"
        " good fixes at most."
    )


def _of(
    figure: str, method: str, mode: Mode, tables: Mapping[str, Table]
) -> dict[tuple[str, str], float]:
    """Means of one figure by scenario and kind of log, where there are any."""
    found: dict[tuple[str, str], float] = {}
    for kind in KIND_WORDS:
        table = tables.get(f"{figure}-{mode}-{kind}")
        if table is not None:
            column = table.mean[:, table.columns.index(method)]
            found |= {(row, kind): float(v) for row, v in zip(table.rows, column, strict=True)}
    return {where: value for where, value in found.items() if np.isfinite(value)}
