"""Paper 001: fusion of several masters' estimates of one slave by information gain.

``run`` repeats both cases of the paper and its pictures, puts the other fusions beside the gain
weights, and measures what the paper leaves out: covariances, messages that come late, gross errors,
and what R may mean. See docs/papers/cooperative.md.
"""

from __future__ import annotations

import math

import numpy as np

from surefix.experiment import Experiment, Progress, Table, gather
from surefix.papers.cooperative_figures import figures
from surefix.papers.cooperative_findings import PRINTED_GAINS, PRINTED_WEIGHTS, findings
from surefix.papers.cooperative_options import CooperativeOptions
from surefix.papers.cooperative_rows import AXES, EPOCHS, GROSS, SCALES, Rows, Shown, rows_of

__all__ = ["CooperativeOptions", "run"]

_CHUNK = 20  # runs filtered at once


def run(options: CooperativeOptions, progress: Progress | None = None) -> Experiment:
    """Repeat the experiment of paper 001.

    Parameters
    ----------
    options
        See `CooperativeOptions`.
    progress
        Told the number of finished runs.
    """
    parts: list[tuple[dict[str, Rows], Shown]] = []
    for first in range(0, options.runs, _CHUNK):
        last = min(first + _CHUNK, options.runs)
        parts.append(rows_of(options, [[options.seed, i] for i in range(first, last)]))
        if progress is not None:
            progress(last)
    rows = {
        key: {row: np.concatenate([part[key][row] for part, _ in parts]) for row in table}
        for key, table in parts[0][0].items()
    }
    tables = _tables(options, rows)
    by_key = {table.key: table for table in tables}
    return Experiment(
        paper="cooperative",
        title="Cooperative positioning of AUVs: fusion of local filters by information gain",
        source="Jian and Zhu, Chinese Journal of Ship Research 17(4), 2022 (paper 001)",
        seed=options.seed,
        runs=options.runs,
        tables=tables,
        figures=figures(parts[0][1], by_key),
        findings=findings(by_key),
    )


def _tables(options: CooperativeOptions, rows: dict[str, Rows]) -> tuple[Table, ...]:
    """Put headings over the figures."""
    scenarios = tuple(options.scenarios)
    channels = tuple(options.channels)
    both = "path: the slave keeps to it, as in the paper; noise: it leaves it with the filters' Q."
    fit = ("MSE of five, m²", "deviation of five, m", "MSE of all, m²", "RMSE, m")
    return (
        _table(
            "table_2",
            "Iteration 70 of case 1 (Table 2)",
            ("x, m", "y, m", "z, m", "error, m", "gain", "weight"),
            rows,
            digits=4,
            printed={
                f"AUV{i + 1}": (*[math.nan] * 4, PRINTED_GAINS[i], PRINTED_WEIGHTS[i])
                for i in range(3)
            },
            note="Gains in nats. Of the paper's table only gains and weights are known.",
        ),
        *(
            table
            for case in (1, 2)
            for table in (
                _table(
                    f"case_{case}_m",
                    f"Absolute error at five iterations of case {case} (Table {2 * case + 1})",
                    tuple(str(epoch) for epoch in EPOCHS[case]),
                    rows,
                    unit="m",
                    digits=2,
                ),
                _table(
                    f"case_{case}_fit",
                    f"Fit to the truth in case {case} (Table {2 * case + 2})",
                    fit,
                    rows,
                    digits=2,
                    note="The five iterations above, as in the paper; and all.",
                ),
            )
        ),
        _table("rmse_m", "RMSE of the position", scenarios, rows, unit="m", digits=2, note=both),
        _table("ratio", "RMSE ÷ that of the centralised filter", scenarios, rows, digits=3),
        _table(
            "nees",
            "NEES per axis of each covariance: 1 is honest, more is too sure",
            scenarios,
            rows,
            digits=2,
            note="Under path the filters' Q is not in the truth: less than 1 is right there.",
        ),
        _table(
            "axes",
            "RMSE ÷ centralised filter where each master is good along one axis only",
            tuple(f"1:{ratio:g}" for ratio in AXES),
            rows,
            digits=2,
            note="Column: σ of the good axis (x, y, z for AUV1, 2, 3) to that of the two others. "
            "Case 1, noise.",
        ),
        _table(
            "axes_scaled",
            "The same at 1:8, by how the noise is scaled",
            tuple(SCALES),
            rows,
            digits=2,
            note="What the gain weights lose depends on how large the noise is beside Q.",
        ),
        _table(
            "readings",
            "What R may mean: case 1 under three readings",
            ("gain 1", "gain 2", "gain 3", "masters, m", "gain weights, m", "centralised, m"),
            rows,
            digits=3,
            of="Reading",
            printed={"position": (*PRINTED_GAINS, *[math.nan] * 3)},
            note="Gains at iteration 70; RMSE of single masters, of their fusion, of one filter.",
        ),
        _table(
            "gross_m",
            "RMSE with gross errors of 100 to 400 m among the observations",
            tuple(f"{share:.0%}" for share in GROSS),
            rows,
            unit="m",
            digits=2,
            note="Case 1, noise; thresholds: full weight up to "
            f"{options.thresholds[0]:g} σ, prediction only beyond {options.thresholds[1]:g} σ. "
            "Centralised filter, multi-hypothesis: with its weights, decided offline.",
        ),
        _table(
            "gross_ratio",
            "The same ÷ one filter told all gross errors",
            tuple(f"{share:.0%}" for share in GROSS),
            rows,
            note="Offline is a smoother: it knows the future too.",
        ),
        _table(
            "late_ratio",
            "Late messages: RMSE ÷ centralised filter without delay or loss",
            channels,
            rows,
            digits=2,
            note=f"Case 1, noise; masters every {', '.join(f'{t:g}' for t in options.period_s)} s, "
            f"fusion every {options.fusion_s:g} s. Columns add up: {options.delay_s:g} s and the "
            f"travel of sound, {options.loss:.0%} lost, up to {options.disorder_s:g} s more.",
        ),
        _table("late_nees", "Late messages: NEES per axis", channels, rows, digits=2),
        _table(
            "replay",
            "Replays that end in the very bits of the filter that got all in order",
            ("share",),
            rows,
            unit="%",
            digits=0,
            note="The first run of every twenty.",
        ),
    )


def _table(
    key: str,
    title: str,
    columns: tuple[str, ...],
    rows: dict[str, Rows],
    *,
    unit: str = "",
    printed: dict[str, tuple[float, ...]] | None = None,
    digits: int = 3,
    note: str = "",
    of: str = "Method",
) -> Table:
    count = len(next(iter(rows[key].values())))
    return gather(
        key,
        title,
        columns,
        [{row: values[run] for row, values in rows[key].items()} for run in range(count)],
        unit=unit,
        printed=printed,
        digits=digits,
        note=note,
        of=of,
    )
