"""Paper 001: what its tables say, in sentences made from the figures of the run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surefix.experiment import Table
from surefix.fusion.information_gain import gain_weights
from surefix.papers.cooperative_rows import BEST, BOUND, BY_SEVERAL, SEVERAL, SMOOTHED
from surefix.papers.cooperative_tracks import CENTRAL, GAIN, TRACKLETS
from surefix.types import FloatArray

__all__ = ["PRINTED_GAINS", "PRINTED_WEIGHTS", "findings"]

PRINTED_GAINS = (0.1385, 0.1764, 0.1421)
"""Table 2 of the paper, nats."""
PRINTED_WEIGHTS = (0.3031, 0.3860, 0.3109)

_MEAN = "mean of estimates"
_CI = "covariance intersection"
_BSC = "Bar-Shalom–Campo"


def findings(tables: Mapping[str, Table]) -> tuple[str, ...]:
    """Say what the figures of this run say.

    Parameters
    ----------
    tables
        By key.
    """
    return (
        *_printed(tables["table_2"]),
        *_fusion(tables["rmse_m"], tables["ratio"]),
        _honesty(tables["nees"]),
        *_elsewhere(tables),
        *_ours(tables),
    )


def _printed(table: Table) -> tuple[str, ...]:
    off = np.abs(gain_weights(np.array(PRINTED_GAINS)) - PRINTED_WEIGHTS).max()
    means, spreads = table.mean[:3, 4], table.spread[:3, 4]
    ours = ", ".join(f"{mean:.4f}" for mean in means)
    away = np.abs(means - PRINTED_GAINS) / spreads
    spread = (
        f", {away.min():.1f} to {away.max():.1f} spreads away" if np.isfinite(away).all() else ""
    )
    theirs = ", ".join(f"{gain:.4f}" for gain in PRINTED_GAINS)
    return (
        f"The printed gains give the printed weights to {off:.5f}.",
        f"Our gains at iteration 70 are {ours}; the printed ones {theirs}{spread}.",
    )


def _fusion(rmse: Table, ratio: Table) -> tuple[str, ...]:
    def at(table: Table, row: str, column: str) -> float:
        return float(table.mean[table.rows.index(row), table.columns.index(column)])

    noise = [column for column in rmse.columns if "noise" in column]
    by_gain = [at(ratio, GAIN, column) for column in noise]
    equal = [at(ratio, GAIN, c) / at(ratio, _MEAN, c) - 1.0 for c in rmse.columns]
    on_path = at(ratio, GAIN, "1 path")
    beaten = all(at(rmse, GAIN, f"{c} path") < at(rmse, BEST, f"{c} path") for c in (1, 2))
    cases = "; ".join(
        f"case {case}: {at(rmse, GAIN, f'{case} path'):.2f} m against "
        f"{at(rmse, BEST, f'{case} path'):.2f} m for the best master and "
        f"{at(rmse, 'mean of observations', f'{case} path'):.2f} m for the mean of observations"
        for case in (1, 2)
    )
    why = (
        ": the filters expect a Q that is not there, and the mean of slow filters suffers less "
        "from it than one fast filter"
    )
    return (
        f"Fusion {'beats' if beaten else 'does not beat'} every single master; {cases}.",
        f"The gain weights change the RMSE of equal weights by {min(equal):+.1%} to "
        f"{max(equal):+.1%}.",
        f"Where Q is in the truth, the gain weights are {min(by_gain):.2f} to {max(by_gain):.2f} "
        f"times the centralised filter. Where the slave keeps to its path, as in the paper, they "
        f"are {on_path:.2f} times it in case 1{why if on_path < 1.0 else ''}.",
    )


def _honesty(nees: Table) -> str:
    noise = [i for i, column in enumerate(nees.columns) if "noise" in column]

    def span(row: str) -> str:
        values = nees.mean[nees.rows.index(row), noise]
        return f"{values.min():.2f} to {values.max():.2f}"

    return (
        "NEES per axis where the model is right: gain weights with cross-covariances "
        f"{span(GAIN)}, without them (the bound) {span(BOUND)}, {_BSC} {span(_BSC)}, {CENTRAL} "
        f"{span(CENTRAL)}, {_CI} {span(_CI)}, inverse covariance {span('inverse covariance')}."
    )


def _elsewhere(tables: Mapping[str, Table]) -> tuple[str, ...]:
    def at(key: str, row: str, column: int) -> float:
        return float(tables[key].mean[tables[key].rows.index(row), column])

    ratio = tables["axes"].columns[-1]
    scaled = tables["axes_scaled"].mean[tables["axes_scaled"].rows.index(GAIN)]
    share = tables["gross_m"].columns[-1]
    return (
        f"Masters that are good along one axis each ({ratio}): gain weights "
        f"{at('axes', GAIN, -1):.2f} times the centralised filter, {_CI} "
        f"{at('axes', _CI, -1):.2f}, {_BSC} {at('axes', _BSC, -1):.2f}. By how the noise is scaled "
        f"to 1:8, the gain weights lie between {scaled.min():.2f} and {scaled.max():.2f}.",
        f"With {share} gross errors the gain-weighted fusion errs by "
        f"{at('gross_m', GAIN, -1):.1f} m, with threshold weighting "
        f"{at('gross_m', f'{GAIN}, thresholds', -1):.1f} m (without any gross error "
        f"{at('gross_m', GAIN, 0):.1f} m).",
        f"With messages late, lost and out of order the timely update errs by "
        f"{at('late_ratio', 'timely, as printed', -1):.1f} times the centralised filter as "
        f"printed, {at('late_ratio', 'timely, gain weights', -1):.2f} times with propagation to a "
        f"common time; waiting for all of one instant costs "
        f"{at('late_ratio', 'in order, as printed', -1):.1f} and "
        f"{at('late_ratio', 'in order, propagated', -1):.2f} times. Replay of the observations: "
        f"{at('late_ratio', 'replay of observations', -1):.2f} times, and "
        f"{at('late_ratio', 'replay of observations', 0):.2f} times where they come at once.",
    )


def _ours(tables: Mapping[str, Table]) -> tuple[str, ...]:
    def row(key: str, name: str) -> FloatArray:
        return np.asarray(tables[key].mean[tables[key].rows.index(name)])

    noise = [i for i, column in enumerate(tables["ratio"].columns) if "noise" in column]
    best = row("ratio", _BSC)[noise]
    summed = row("ratio", TRACKLETS)
    share = tables["gross_m"].columns[-1]
    return (
        "Weights cannot close the gap of fused estimates to the centralised filter: the best there "
        f"are, {_BSC}, leave {best.min():.2f} to {best.max():.2f} times where Q is in the truth. "
        f"Sums of what each observation added (tracklets) are {summed.min():.3f} to "
        f"{summed.max():.3f} times the centralised filter in all scenarios.",
        f"With {share} gross errors the centralised filter with the decisions of several "
        "hypotheses errs by "
        f"{row('gross_ratio', BY_SEVERAL)[-1]:.3f} times as much as one told all gross "
        f"errors, with thresholds {row('gross_ratio', f'{CENTRAL}, thresholds')[-1]:.3f} times; "
        f"the multi-hypothesis filter itself {row('gross_ratio', SEVERAL)[-1]:.3f} times in real "
        f"time and {row('gross_ratio', SMOOTHED)[-1]:.3f} times offline, where it knows the future "
        "too.",
    )
