"""Paper 003: improved 53H against least-squares smoothing, on a ship's navigation data.

Lü and Geng: INS, GNSS, gyro, log and sounder of a trial ship, 1 Hz, about 11 hours, cleaned by
sliding weighted least squares, by the five-point cubic and by the improved 53H. The paper prints
no figures but pictures; the data are not published. The voyage is simulated here, with known
faults, so that there is a truth to hold every method against.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surefix.experiment import Experiment, Figure, Progress, Table, check_least, gather
from surefix.papers.ship_ends import end_rows
from surefix.papers.ship_figures import figures
from surefix.papers.ship_methods import DELAYS, OURS, PAPER, SEVERAL
from surefix.papers.ship_run import (
    CHANNELS,
    FACTORS,
    UNITS,
    Rows,
    chain_rows,
    editing_rows,
    isolated_rows,
)
from surefix.simulate.ship import simulate
from surefix.simulate.ship_faults import BURSTS

__all__ = ["SOURCE", "ShipPaperOptions", "run"]

SOURCE = "Lü Wu and Geng Jianning, ship navigation data smoothed by improved 53H (in Chinese)"

_RECORD = ("east", "north", "speed", "heading", "depth")
_WITH_UNITS = tuple(f"{name.replace('_', ' ')}, {UNITS[name][0]}" for name in CHANNELS)
_NAMES = tuple(name.replace("_", " ") for name in CHANNELS)


@dataclass(frozen=True, kw_only=True)
class ShipPaperOptions:
    """How often the experiment is run, and from what.

    Parameters
    ----------
    seed
        Everything is drawn from it; run i draws from ``[seed, i]``.
    runs
        Independent voyages, at least 1.
    hours
        Length of a voyage, at least 0.5.

    Raises
    ------
    OptionsError
        A figure is too small.
    """

    seed: int = 1
    runs: int = 20
    hours: float = 11.0

    def __post_init__(self) -> None:
        check_least(self, seed=0, runs=1, hours=0.5)


def run(options: ShipPaperOptions, progress: Progress | None = None) -> Experiment:
    """Run the experiment: every method on the INS, the treatments of the ends, the whole chain.

    Parameters
    ----------
    options
        Seed, number of runs, and length.
    progress
        Told the number of finished runs.
    """
    found: list[Rows] = []
    drawn: tuple[Figure, ...] = ()
    for i in range(options.runs):
        log = simulate([options.seed, i], hours=options.hours)
        alone = simulate([options.seed, i], hours=options.hours, bursts=(1,))
        chain, record = chain_rows(log)
        ends = end_rows(np.random.default_rng([options.seed, i, 1]))
        delays = {name: [float(delay)] for name, delay in DELAYS.items()}
        more = {"rmse_isolated": isolated_rows(alone), "delay_samples": delays}
        found.append(editing_rows(log) | ends | more | chain)
        if i == 0:
            drawn = figures(alone, log, record, found[0]["removed_pct"])
        if progress is not None:
            progress(i + 1)
    tables = _tables(found)
    return Experiment(
        paper="ship",
        title="On-line cleaning of a ship's navigation data by improved 53H",
        source=SOURCE,
        seed=options.seed,
        runs=options.runs,
        tables=tables,
        figures=drawn,
        findings=_findings({table.key: table for table in tables}),
    )


def _tables(found: list[Rows]) -> tuple[Table, ...]:
    def made(
        key: str,
        title: str,
        columns: tuple[str, ...],
        *,
        unit: str = "",
        digits: int = 2,
        note: str = "",
    ) -> Table:
        rows = [each[key] for each in found]
        return gather(key, title, columns, rows, unit=unit, digits=digits, note=note)

    lengths = tuple(f"{length} long" if length > 1 else "alone" for length in BURSTS)
    samples = tuple(f"sample {i}" for i in range(1, 5))
    return (
        made(
            "rmse_isolated",
            "Velocity of the INS with isolated gross errors only, as in the paper: RMSE",
            ("v east", "v north"), unit="m/s", digits=3,
        ),
        made(
            "removed_pct",
            "Gross errors of the INS brought within T of the intact series, by length of the burst",
            lengths, unit="%", digits=1,
            note="Mean of the seven channels. What is left out altogether counts as removed.",
        ),
        made(
            "found_pct",
            "Gross errors of the INS edited, by length of the burst, in %; and good samples edited "
            "in the worst of the seven channels, of 10,000",
            (*lengths, "good"), digits=1,
        ),
        made("altered_pct", "Good samples altered", _NAMES, unit="%"),
        made(
            "distortion", "RMS change of the good samples", _WITH_UNITS,
            note="Against what the INS would have logged without faults.",
        ),
        made("rmse", "RMSE of good samples and gross errors together", _WITH_UNITS),
        made(
            "threshold_pct",
            f"53H with other thresholds, {FACTORS[0]:g} … {FACTORS[-1]:g} T: "
            "isolated errors removed, and good samples altered",
            ("removed", *_NAMES), unit="%", digits=1,
        ),
        made(
            "end_bias", "Bias of a ramp at the first samples, in samples of its slope" , samples,
            note="Closed form for the reversal: 3.5, 1, 0.25, 0.",
        ),
        made(
            "end_wild_pct", "What is left of a wild first sample", samples, unit="%", digits=1
        ),
        made("end_noise", "σ of x₃ at the first samples, on white noise of σ = 1", samples,
             digits=2),
        made("delay_samples", "Samples until a sample is decided", ("delay",), digits=0),
        made(
            "record_rmse", "RMSE of the sensors and of the integrated record",
            ("position, m", "speed, m/s", "heading, °", "depth, m"), digits=3,
        ),
        made("within_pct", "Errors of the record within 2σ", _RECORD, unit="%", digits=1),
        made("quality_pct", "Epochs by mark of the record", _RECORD, unit="%"),
        made(
            "jump_m", "Greatest step of the position's error as GNSS goes and returns",
            ("goes", "returns"), unit="m", digits=2,
        ),
        made(
            "check_pct", "Faults found by the checks of the chain, and good samples refused",
            ("found", "refused"), unit="%", digits=2, note="All thirteen series.",
        ),
    )  # fmt: skip


def _findings(made: Mapping[str, Table]) -> tuple[str, ...]:
    def mean(key: str, row: str, column: int) -> float:
        table = made[key]
        return float(table.mean[table.rows.index(row), column])

    east = CHANNELS.index("v_east")
    least, cubic = "weighted least squares", "five-point cubic"
    short = min(mean("removed_pct", PAPER, i) for i in (0, 1))
    long = max(mean("removed_pct", PAPER, i) for i in range(2, len(BURSTS)))
    return (
        "With isolated gross errors only, as in the paper, the RMSE of the east velocity is "
        f"{mean('rmse_isolated', 'as logged', 0):.2f} m/s as logged, "
        f"{mean('rmse_isolated', cubic, 0):.2f} by the five-point cubic, "
        f"{mean('rmse_isolated', least, 0):.2f} by weighted least squares and "
        f"{mean('rmse_isolated', PAPER, 0):.3f} by improved 53H.",
        f"Improved 53H removes {short:.1f} % of the gross errors that come alone or in pairs, and "
        f"{long:.1f} % of those in bursts of three and more: a median of five gives way to three.",
        f"The five-point cubic leaves {100.0 - mean('removed_pct', cubic, 0):.1f} % and weighted "
        f"least squares {100.0 - mean('removed_pct', least, 0):.1f} % of the isolated errors "
        "further than T from where they should be.",
        f"East velocity, RMSE: as logged {mean('rmse', 'as logged', east):.2f} m/s, cubic "
        f"{mean('rmse', cubic, east):.2f}, least squares {mean('rmse', least, east):.2f}, improved "
        f"53H {mean('rmse', PAPER, east):.2f}, {OURS} {mean('rmse', OURS, east):.2f}.",
        f"Of bursts of 30 a rate check before 53H removes {mean('removed_pct', OURS, 5):.0f} %, a "
        f"Hampel window of 61 samples {mean('removed_pct', 'Hampel, 61 samples', 5):.0f} %.",
        "Several hypotheses, offline, edit "
        f"{min(mean('found_pct', SEVERAL, i) for i in range(len(BURSTS) - 1)):.2f} % or more of "
        "the gross errors in bursts of up to 10, "
        f"{mean('found_pct', SEVERAL, len(BURSTS) - 1):.2f} % of those of 30, and "
        f"{mean('found_pct', SEVERAL, len(BURSTS)):.2f} of 10,000 good samples in the worst "
        "channel.",
        f"At the first sample the paper's reversal biases a ramp by "
        f"{mean('end_bias', 'reversal (paper)', 0):.2f} samples of its slope, the line by "
        f"{mean('end_bias', 'line (default)', 0):.2f}; of a wild first sample odd reflection "
        f"leaves {mean('end_wild_pct', 'odd reflection', 0):.0f} %, the line "
        f"{mean('end_wild_pct', 'line (default)', 0):.0f} %.",
        f"The record errs by {mean('record_rmse', 'record', 0):.1f} m, where it is marked valid by "
        f"{mean('record_rmse', 'record, where valid', 0):.1f} m; GNSS as logged by "
        f"{mean('record_rmse', 'GNSS, logged', 0):.0f} m, cleaned by "
        f"{mean('record_rmse', 'GNSS, cleaned', 0):.1f} m.",
        f"When GNSS goes and returns the record steps by at most {mean('jump_m', 'record', 0):.1f} "
        f"and {mean('jump_m', 'record', 1):.1f} m, a switch between the sensors by "
        f"{mean('jump_m', 'switch to the INS', 0):.0f} and "
        f"{mean('jump_m', 'switch to the INS', 1):.0f} m.",
    )
