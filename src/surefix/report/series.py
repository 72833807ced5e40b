"""Scalar series of a result: the axes of its track and its channels, as they are read."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from surefix.report.marks import fix_marks
from surefix.types import Cleaned, CleanedChannel, FloatArray, Verdicts

__all__ = ["Series", "axis_series", "channel_series", "heading_of"]

_UNITS = {"m": "m", "deg": "deg", "mps": "m/s", "rad": "rad", "s": "s", "degps": "deg/s"}


class Series(NamedTuple):
    """One panel of a figure.

    Parameters
    ----------
    title
        Quantity and unit.
    time, raw, clean, sigma
        (n,) in the order of time, in the unit of the title.
    verdicts
        (n,) what was done with each raw value.
    marks
        What each value is called, escaped: one text, or (n,).
    down
        True where greater values are drawn lower.
    period
        One turn of an angle, else 0.
    basis
        (n, k) what decides which rows are drawn.
    what
        What its marks are.
    """

    title: str
    time: FloatArray
    raw: FloatArray
    clean: FloatArray
    sigma: FloatArray
    verdicts: Verdicts
    marks: str | Sequence[str]
    down: bool
    period: float
    basis: FloatArray
    what: str = "values"


def axis_series(cleaned: Cleaned) -> list[Series]:
    """East, north and height (or depth) of a track, those that were observed."""
    vertical = "Depth, m" if cleaned.has_depth else "Height, m"
    signs = (1.0, 1.0, -1.0 if cleaned.has_depth else 1.0)
    marks = fix_marks(cleaned)
    track = cleaned.track
    return [
        Series(
            title,
            track.time,
            sign * cleaned.raw_position[:, i],
            sign * track.position[:, i],
            track.sigma_position[:, i],
            cleaned.verdicts,
            marks,
            sign < 0.0,
            0.0,
            cleaned.raw_position,
            "fixes",
        )
        for i, (title, sign) in enumerate(
            zip(("East, m", "North, m", vertical), signs, strict=True)
        )
        if np.isfinite(cleaned.raw_position[:, i]).any()
    ]


def heading_of(name: str) -> str:
    """Name of a channel in words, with its unit.

    >>> heading_of("depth_m"), heading_of("heading_deg"), heading_of("turbidity")
    ('Depth, m', 'Heading, deg', 'Turbidity')
    """
    base, _, unit = name.rpartition("_")
    if not base or unit not in _UNITS:
        return name.replace("_", " ").capitalize()
    return f"{base.replace('_', ' ').capitalize()}, {_UNITS[unit]}"


def channel_series(channel: CleanedChannel) -> Series:
    """One scalar channel; angles are brought to 0 … one turn."""
    turn = channel.period
    return Series(
        heading_of(channel.name),
        channel.time,
        np.mod(channel.raw, turn) if turn else channel.raw,
        np.mod(channel.value, turn) if turn else channel.value,
        channel.sigma,
        channel.verdicts,
        html.escape(channel.sensor),
        channel.name.startswith("depth"),
        turn,
        channel.raw[:, None],
    )
