"""Rows: observations of anything the track filter takes, in the order of a continuous time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from surefix.types import BoolArray, Fixes, FloatArray, IntArray

__all__ = [
    "METRES_PER_DEGREE",
    "Rows",
    "join_fixes",
    "join_rows",
    "take_fixes",
    "take_rows",
]

METRES_PER_DEGREE = 111_195.0
"""Of latitude, on a sphere: good enough for digits and for telling motion from rest."""


class Rows(NamedTuple):
    """Observations in the order of ``tau``.

    Parameters
    ----------
    fixes
        What was observed; an auxiliary row has only the components its sensor measures.
    tau, time
        (n,) continuous time for the filter and time for the output, s.
    late
        (n,) arrived too late to be put in its place.
    auxiliary
        (n,) True for rows of another sensor, which have no row of their own in the output.
    lever
        (n, 12) as `surefix.pipelines.turning.arms_at`; (n, 0) where no sensor has a lever arm.
    """

    fixes: Fixes
    tau: FloatArray
    time: FloatArray
    late: BoolArray
    auxiliary: BoolArray
    lever: FloatArray


def take_rows(rows: Rows, index: IntArray | BoolArray | slice) -> Rows:
    """Pick rows by index, mask or slice."""
    return Rows(
        take_fixes(rows.fixes, index),
        rows.tau[index],
        rows.time[index],
        rows.late[index],
        rows.auxiliary[index],
        rows.lever[index],
    )


def take_fixes(fixes: Fixes, index: IntArray | BoolArray | slice) -> Fixes:
    """Pick fixes by index, mask or slice."""
    return Fixes._make([*(column[index] for column in fixes[:-1]), fixes.geographic])


def join_rows(parts: list[Rows]) -> Rows:
    """Put rows one after the other."""
    fixes = join_fixes([part.fixes for part in parts])
    columns = zip(*(part[1:] for part in parts), strict=True)
    return Rows._make([fixes, *(np.concatenate(column) for column in columns)])


def join_fixes(parts: list[Fixes]) -> Fixes:
    """Put fixes one after the other."""
    columns = zip(*(part[:-1] for part in parts), strict=True)
    geographic = any(part.geographic for part in parts)
    return Fixes._make([*(np.concatenate(column) for column in columns), geographic])
