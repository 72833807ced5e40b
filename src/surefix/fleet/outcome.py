"""What came of one log or track of a fleet: a row of the summary."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import pyarrow as pa

from surefix.errors import InputError, OptionsError, SurefixError
from surefix.report.headline import headline
from surefix.types import Cleaned, Verdict

__all__ = ["COLUMNS", "SCHEMA", "Outcome", "cleaned_outcome", "failed_outcome"]

_LASTING = (InputError, OptionsError)


class Outcome(NamedTuple):
    """One row of the summary.

    Parameters
    ----------
    name
        The log (its path) or the track (its identity, as text).
    status
        ``cleaned`` or ``failed``.
    output
        Where the rows are, relative to the folder of the fleet; empty if they are nowhere.
    fixes, used … edited
        How many fixes, and how many had each verdict.
    start, end
        s, of the clean track.
    distance_m
        Its length.
    sigma2_horizontal_m
        Median 2σ of the horizontal position.
    events, problems
        How many events, and how many records or cells that could not be read.
    given, expected, remedy
        Of the error, where it failed.
    lasting
        Whether the error lies in the data or the options, and trying again gains nothing.
    """

    name: str
    status: str
    output: str = ""
    fixes: int = 0
    used: int = 0
    downweighted: int = 0
    rejected: int = 0
    missing: int = 0
    duplicate: int = 0
    edited: int = 0
    start: float | None = None
    end: float | None = None
    distance_m: float | None = None
    sigma2_horizontal_m: float | None = None
    events: int = 0
    problems: int = 0
    given: str = ""
    expected: str = ""
    remedy: str = ""
    lasting: bool = True


COLUMNS = Outcome._fields[:-1]
"""Columns of the summary."""

SCHEMA = pa.schema(
    [(name, pa.string()) for name in COLUMNS[:3]]
    + [(name, pa.int64()) for name in COLUMNS[3:10]]
    + [(name, pa.float64()) for name in COLUMNS[10:14]]
    + [(name, pa.int64()) for name in COLUMNS[14:16]]
    + [(name, pa.string()) for name in COLUMNS[16:]]
)
"""The same with their types."""


def cleaned_outcome(
    name: str, cleaned: Cleaned, counts: Mapping[Verdict, int], output: str = ""
) -> Outcome:
    """Sum up a result.

    Parameters
    ----------
    name
        What was cleaned.
    cleaned
        The result, perhaps thinned.
    counts
        How many fixes had each verdict.
    output
        Where the rows went.
    """
    head = headline(cleaned)
    return Outcome(
        name,
        "cleaned",
        output,
        sum(counts.values()),
        used=counts.get(Verdict.USED, 0),
        downweighted=counts.get(Verdict.DOWNWEIGHTED, 0),
        rejected=counts.get(Verdict.REJECTED, 0),
        missing=counts.get(Verdict.MISSING, 0),
        duplicate=counts.get(Verdict.DUPLICATE, 0),
        edited=counts.get(Verdict.EDITED, 0),
        start=_known(head.start),
        end=_known(head.end),
        distance_m=_known(head.distance),
        sigma2_horizontal_m=_known(head.sigma_horizontal),
        events=len(cleaned.events),
        problems=sum(problem.total for problem in cleaned.problems),
    )


def failed_outcome(name: str, error: BaseException) -> Outcome:
    """Say why something could not be cleaned; what surefix did not foresee is its own error."""
    if isinstance(error, SurefixError):
        told, lasting = (error.given, error.expected, error.remedy), isinstance(error, _LASTING)
    elif isinstance(error, MemoryError):
        told, lasting = ("not enough memory", "memory for the whole log", "fewer jobs"), False
    else:
        kind = type(error).__name__
        told, lasting = (f"internal error: {kind}: {error}", "none", "please report it"), False
    given, expected, remedy = told
    return Outcome(name, "failed", given=given, expected=expected, remedy=remedy, lasting=lasting)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
