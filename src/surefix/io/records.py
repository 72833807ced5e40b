"""The columns of the output, in their fixed order, as an Arrow table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike

from surefix.reasons import texts
from surefix.types import (
    AXES,
    BoolArray,
    CleanedChannel,
    FloatArray,
    IntArray,
    Reason,
    Track,
    Verdict,
    Verdicts,
)

__all__ = ["Batch", "Form", "believed", "channel_table", "empty", "parts", "table"]

_WITH_A_PART = (Verdict.USED, Verdict.DOWNWEIGHTED, Verdict.EDITED)
_WORDS = [verdict.name.lower() for verdict in Verdict]


class Form(NamedTuple):
    """What an output carries beside the fixed columns.

    Parameters
    ----------
    geographic
        Whether there are latitude and longitude.
    has_depth
        Whether the vertical is called ``depth``, positive down, or ``height``.
    iso
        Whether times are calendar times (ISO 8601, UTC) or Unix seconds.
    verdicts
        Whether there is a verdict, a sensor and a record number beside each epoch.
    """

    geographic: bool
    has_depth: bool = False
    iso: bool = False
    verdicts: bool = True


class Batch(NamedTuple):
    """Some epochs of a track, and for each the verdict, sensor name and record number of its fix.

    ``coordinates`` (n, 3) are the fixes as they were given: latitude, longitude, height. ``known``
    (n,) is False where no fix supports a track at times of its own; the others are None for one.
    """

    track: Track
    verdicts: Verdicts | None = None
    sensors: tuple[str, ...] = ()
    sensor: IntArray | None = None
    row: IntArray | None = None
    coordinates: FloatArray | None = None
    known: BoolArray | None = None


def believed(verdicts: Verdicts) -> BoolArray:
    """(n,) True where the fix had a part in the track, be it that the user wanted it so."""
    part = np.isin(verdicts.verdict, _WITH_A_PART)
    return np.asarray(part & (verdicts.weight > 0.0), dtype=np.bool_)


def parts(batch: Batch, rows: int) -> Iterator[Batch]:
    """Cut a batch into parts of so many epochs, so that little of it is in words at one time."""
    for at in range(0, max(len(batch.track.time), 1), rows):
        some = slice(at, at + rows)
        yield Batch._make(
            value[some]
            if isinstance(value, np.ndarray)
            else value._make(None if column is None else column[some] for column in value)
            if isinstance(value, Track | Verdicts)
            else value
            for value in batch
        )


def table(batch: Batch, form: Form) -> pa.Table:
    """Return the columns of a batch; NaN becomes null."""
    track = batch.track
    columns: dict[str, pa.Array] = {"time": _time(track.time, form)}
    for prefix, values in (
        ("", track.position),
        ("v", track.velocity),
        ("sigma_", track.sigma_position),
    ):
        columns |= {f"{prefix}{axis}": _floats(values[:, i]) for i, axis in enumerate(AXES)}
    if batch.verdicts is not None:
        columns |= _verdicts(batch.verdicts)
    if form.geographic:
        unknown = np.full_like(track.position, np.nan)
        columns |= _globe(unknown if track.geodetic is None else track.geodetic, form)
    if batch.sensor is not None:
        columns["sensor"] = _words(batch.sensor, batch.sensors)
    if batch.row is not None:
        columns["row"] = pa.array(batch.row, pa.int64())
    return pa.table(columns)


def empty(form: Form) -> pa.Table:
    """Return the columns of an output without rows: its schema."""
    none, axes, codes = np.empty(0), np.empty((0, 3)), np.empty(0, dtype=np.int64)
    track = Track(none, axes, axes, axes, axes, axes)
    if not form.verdicts:
        return table(Batch(track), form)
    verdicts = Verdicts(codes, none, none, axes, codes, none, axes)
    return table(Batch(track, verdicts, (), codes, codes), form)


def channel_table(channel: CleanedChannel, *, iso: bool) -> pa.Table:
    """Return the columns of a cleaned scalar series; the value goes by the series' name."""
    return pa.table(
        {
            "time": _time(channel.time, Form(False, iso=iso)),
            channel.name: _floats(channel.value),
            "raw": _floats(channel.raw),
            "rate": _floats(channel.rate),
            "sigma": _floats(channel.sigma),
            **_verdicts(channel.verdicts),
        }
    )


def _floats(values: ArrayLike) -> pa.Array:
    return pa.array(np.ascontiguousarray(values), pa.float64(), from_pandas=True)


def _time(time: FloatArray, form: Form) -> pa.Array:
    if not form.iso:
        return _floats(time)
    known = np.isfinite(time)
    ticks = np.round(np.where(known, time, 0.0) * 1e6).astype(np.int64)
    return pa.array(ticks, pa.int64(), mask=~known).cast(pa.timestamp("us", tz="UTC"))


def _verdicts(verdicts: Verdicts) -> dict[str, pa.Array]:
    return {
        "verdict": _words(verdicts.verdict, _WORDS),
        "weight": _floats(verdicts.weight),
        "innovation_sigma": _floats(verdicts.innovation_sigma),
        "reason": _reasons(verdicts),
    }


def _reasons(verdicts: Verdicts) -> pa.Array:
    """Put the verdicts into words; those that agree, nearly all, share one text."""
    others = np.flatnonzero(verdicts.reason != Reason.AGREES)
    agrees = np.flatnonzero(verdicts.reason == Reason.AGREES)[:1]
    shown = np.concatenate([agrees, others])
    index = np.zeros(len(verdicts.reason), dtype=np.int64)
    index[others] = np.arange(len(agrees), len(shown))
    return _words(index, texts(Verdicts(*(values[shown] for values in verdicts))))


def _words(index: IntArray, words: Sequence[str]) -> pa.Array:
    """Text by its place in a list."""
    coded = pa.DictionaryArray.from_arrays(
        pa.array(index, pa.int64()), pa.array(words, pa.string())
    )
    return coded.cast(pa.string())


def _globe(geodetic: FloatArray, form: Form) -> dict[str, pa.Array]:
    height = geodetic[:, 2]
    vertical = {"depth": _floats(-height)} if form.has_depth else {"height": _floats(height)}
    return {"lat": _floats(geodetic[:, 0]), "lon": _floats(geodetic[:, 1]), **vertical}
