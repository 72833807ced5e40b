"""What an experiment gives: tables of figures over many runs, pictures, and findings in words.

Each paper's pipeline ends in one `Experiment`; the command line, the JSON file, the report and the
pictures of the documentation are views of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from surefix.errors import OptionsError
from surefix.types import FloatArray

__all__ = ["Experiment", "Figure", "Panel", "Progress", "Table", "Trace", "check_least", "gather"]

Progress = Callable[[int], None]
"""Told the number of finished runs."""

Kind = Literal["truth", "raw", "bad", "line", "points"]


@dataclass(frozen=True, kw_only=True)
class Table:
    """One table of figures: a row per method, a column per quantity, repeated over runs.

    Parameters
    ----------
    key
        Name in the JSON file, with its unit as suffix: ``rmse_m``.
    title
        Heading, without the unit.
    unit
        ``m``, ``%`` … or empty.
    columns
        Names of the columns.
    rows
        Names of the rows.
    values
        (runs, rows, columns); NaN where a run has no such figure.
    printed
        What the paper printed, row → one figure a column; NaN where it printed none.
    digits
        Decimals to show.
    note
        What a reader must know, or empty.
    of
        What a row is.
    """

    key: str
    title: str
    unit: str = ""
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    values: FloatArray
    printed: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    digits: int = 3
    note: str = ""
    of: str = "Method"

    @property
    def mean(self) -> FloatArray:
        """(rows, columns) mean over the runs that have the figure."""
        known = np.isfinite(self.values)
        count = known.sum(axis=0)
        total = np.where(known, self.values, 0.0).sum(axis=0)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    @property
    def spread(self) -> FloatArray:
        """(rows, columns) standard deviation over the runs; NaN with fewer than two."""
        known = np.isfinite(self.values)
        count = known.sum(axis=0)
        off = np.where(known, self.values - self.mean, 0.0)
        square: FloatArray = (off * off).sum(axis=0) / np.maximum(count - 1, 1)
        return np.where(count > 1, np.sqrt(square), np.nan)


@dataclass(frozen=True)
class Trace:
    """One line or cloud of points of a panel.

    Parameters
    ----------
    name
        In the legend; traces of one name have one colour and one entry.
    x, y
        (n,) each; NaN breaks a line.
    kind
        ``truth`` a dark line, ``raw`` grey dots, ``bad`` crosses (gross errors, rejected fixes),
        ``line`` a coloured line, ``points`` a coloured line with a mark at each point.
    """

    name: str
    x: FloatArray
    y: FloatArray
    kind: Kind = "line"


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One pair of axes.

    Parameters
    ----------
    title
        Above the panel, or empty.
    x_label, y_label
        Quantity and unit.
    traces
        In drawing order.
    y_range
        What is shown of y, where not everything should be; None for all.
    log_y
        Logarithmic y axis.
    equal
        One metre is as long on both axes.
    x_names
        Names of x = 0, 1, 2 …, where these count things; empty where x is a quantity.
    """

    title: str = ""
    x_label: str
    y_label: str
    traces: tuple[Trace, ...]
    y_range: tuple[float, float] | None = None
    log_y: bool = False
    equal: bool = False
    x_names: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Panels in a grid, filled row by row.

    Parameters
    ----------
    key
        Name in file names and anchors: letters, digits and hyphens.
    title
        What it shows, and which figure of the paper it stands beside.
    panels
        At least one.
    columns
        Panels in a row of the grid.
    """

    key: str
    title: str
    panels: tuple[Panel, ...]
    columns: int = 1


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A paper's experiment, run again.

    Parameters
    ----------
    paper
        Name on the command line.
    title
        What is estimated from what.
    source
        The paper.
    seed, runs
        What it was drawn from, and how often.
    tables, figures
        The figures of merit over all runs, and pictures of one run (the first) or of all.
    findings
        Sentences that follow from the figures of this very run; computed, never fixed.
    """

    paper: str
    title: str
    source: str
    seed: int
    runs: int
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...]
    findings: tuple[str, ...] = ()


def check_least(options: object, **least: float) -> None:
    """Check that fields of options are not too small.

    Parameters
    ----------
    options
        A record.
    least
        The least value of each field; a whole number where the field is one.

    Raises
    ------
    OptionsError
        A field is smaller, or NaN.
    """
    for name, value in least.items():
        given = getattr(options, name)
        if not given >= value:
            kind = "a whole number" if isinstance(value, int) else "a number"
            raise OptionsError(f"{name} {given}", f"{kind} from {value}")


def gather(
    key: str,
    title: str,
    columns: Sequence[str],
    runs: Sequence[Mapping[str, Sequence[float] | FloatArray]],
    *,
    unit: str = "",
    printed: Mapping[str, tuple[float, ...]] | None = None,
    digits: int = 3,
    note: str = "",
    of: str = "Method",
) -> Table:
    """Make a table of what every run gave.

    Parameters
    ----------
    key, title, unit, printed, digits, note, of
        Of `Table`.
    columns
        Names of the columns.
    runs
        One mapping a run, row → one figure a column; all with the same rows.

    Examples
    --------
    >>> table = gather("rmse_m", "RMSE", ["X"], [{"KF": [1.0]}, {"KF": [3.0]}], unit="m")
    >>> table.mean
    array([[2.]])
    """
    rows = tuple(runs[0])
    values = np.array(
        [[np.asarray(run[row], dtype=np.float64) for row in rows] for run in runs],
        dtype=np.float64,
    ).reshape(len(runs), len(rows), len(columns))
    return Table(
        key=key,
        title=title,
        unit=unit,
        columns=tuple(columns),
        rows=rows,
        values=values,
        printed=dict(printed or {}),
        digits=digits,
        note=note,
        of=of,
    )
