"""The last rows that were cleaned for good, to look back at: bounded, the oldest give way."""

from __future__ import annotations

import binascii
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from surefix.errors import InputError
from surefix.report.marks import DOUBTED
from surefix.report.thin import extremes
from surefix.types import Cleaned, IntArray, Verdicts

__all__ = ["ROW", "History", "Rows", "packed", "shown", "unpacked", "verdicts_of"]

ROW: Final = np.dtype(
    [
        ("time", "<f8"),
        ("sensor", "<i2"),
        ("raw", "<f8", 3),
        ("clean", "<f8", 3),
        ("geodetic", "<f8", 3),
        ("velocity", "<f8", 3),
        ("sigma", "<f8", 3),
        ("innovation", "<f8", 3),
        ("innovation_sigma", "<f8"),
        ("weight", "<f8"),
        ("verdict", "<i2"),
        ("reason", "<i2"),
        ("detail", "<f8"),
        ("offset", "<f8", 3),
    ]
)
"""One fix: what was measured, what it became and why, as in `Track` and `Verdicts`."""

Rows = NDArray[np.void]
"""(n,) of `ROW`."""

_FORM: Final = "rows-1:"


class History:
    """A ring of rows.

    Parameters
    ----------
    most
        Rows that are kept.
    """

    def __init__(self, most: int) -> None:
        self._ring = np.zeros(most, ROW)  # memory is only taken once it is written to
        self.total = 0
        """Rows that there have been; the next has this number."""
        self.sensors: tuple[str, ...] = ()
        """Names of the sensors that rows refer to."""

    def add(self, batches: Sequence[Cleaned]) -> Rows:
        """Add what was cleaned, and tell the rows it makes."""
        for batch in batches:
            if len(batch.sensors) >= len(self.sensors):
                self.sensors = batch.sensors
        made = [_rows(batch) for batch in batches]
        rows = np.concatenate([np.zeros(0, ROW), *made])
        self.extend(rows)
        return rows

    def extend(self, rows: Rows) -> None:
        """Add rows as they are."""
        kept = rows[max(0, len(rows) - len(self._ring)) :]
        first = self.total + len(rows) - len(kept)
        self._ring[np.arange(first, first + len(kept)) % len(self._ring)] = kept
        self.total += len(rows)

    @property
    def first(self) -> int:
        """Number of the oldest row that is still there."""
        return max(0, self.total - len(self._ring))

    def take(self, numbers: IntArray) -> Rows:
        """Give a copy of the rows of some numbers, which must still be there."""
        at = numbers % len(self._ring)
        if not len(at) or at[-1] - at[0] != len(at) - 1 or not (np.diff(at) == 1).all():
            return self._ring[at]
        return self._ring[at[0] : at[-1] + 1].copy()  # ten times sooner than by indices

    def since(self, number: int) -> IntArray:
        """Numbers of the rows that have come since the one of a number, it included."""
        return np.arange(max(number, self.first), self.total)

    def between(self, since: float, until: float) -> IntArray:
        """Numbers of the rows whose time, s, lies in a span, its ends included."""
        numbers = self.since(0)
        time = self._ring["time"][numbers % len(self._ring)]
        return numbers[(time >= since) & (time <= until)]

    def span(self) -> tuple[float, float]:
        """Times of the first and the last row, s; NaN where there is none."""
        time = self._ring["time"][: self.total]
        time = time[np.isfinite(time)]
        return (float(time.min()), float(time.max())) if len(time) else (np.nan, np.nan)


def _rows(batch: Cleaned) -> Rows:
    track, verdicts = batch.track, batch.verdicts
    rows = np.zeros(len(track.time), ROW)
    columns: dict[str, NDArray[Any]] = {
        "time": track.time,
        "sensor": batch.sensor,
        "raw": batch.raw_position,
        "clean": track.position,
        "geodetic": np.full((1, 3), np.nan) if track.geodetic is None else track.geodetic,
        "velocity": track.velocity,
        "sigma": track.sigma_position,
        "innovation": verdicts.standardised,
        "innovation_sigma": verdicts.innovation_sigma,
        "weight": verdicts.weight,
        "verdict": verdicts.verdict,
        "reason": verdicts.reason,
        "detail": verdicts.detail,
        "offset": verdicts.offset,
    }
    for name, values in columns.items():
        rows[name] = values
    return rows


def verdicts_of(rows: Rows) -> Verdicts:
    """Give the verdicts of rows as the record that every view reads."""
    return Verdicts(
        rows["verdict"].astype(np.int64),
        rows["weight"],
        rows["innovation_sigma"],
        rows["innovation"],
        rows["reason"].astype(np.int64),
        rows["detail"],
        rows["offset"],
    )


def shown(rows: Rows, most: int) -> IntArray:
    """Choose rows to draw: extremes of the track and of its σ, and of what was rejected.

    Parameters
    ----------
    rows
        In the order of time.
    most
        About how many; all, if there are no more.

    Returns
    -------
    chosen
        Indices, increasing. The fixes that were rejected are all among them if they are no more
        than half of ``most``.
    """
    if len(rows) <= most:
        return np.arange(len(rows))
    rejected = np.flatnonzero(np.isin(rows["verdict"], DOUBTED))
    far = np.column_stack((rows["raw"][rejected][:, :2], rows["innovation_sigma"][rejected]))
    kept = rejected[extremes(far, max(most // 2, 2))]
    drawn = np.column_stack(
        (rows["clean"], rows["sigma"][:, 0], rows["innovation_sigma"], rows["velocity"][:, :2])
    )
    return np.unique(np.concatenate([kept, extremes(drawn, max(most - len(kept), 2))]))


def packed(rows: Rows) -> str:
    """Rows as text, to the last bit, for the journal."""
    return _FORM + binascii.b2a_base64(rows.tobytes(), newline=False).decode("ascii")


def unpacked(texts: Iterable[str]) -> Rows:
    """Rows from texts that `packed` made, one after the other.

    Raises
    ------
    InputError
        One is damaged, or of another version.
    """
    found = bytearray()
    for text in texts:
        try:
            data = binascii.a2b_base64(text.removeprefix(_FORM), strict_mode=True)
        except (ValueError, binascii.Error):
            data = b"?"
        if not text.startswith(_FORM) or len(data) % ROW.itemsize:
            raise InputError(f"rows of a journal: {text[:40]!r}", f"{_FORM}…")
        found += data
    return np.frombuffer(bytes(found), ROW)
