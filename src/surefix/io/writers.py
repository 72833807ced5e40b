"""Write tracks and cleaned series; the suffix of the file says in which format.

``.csv`` and ``.parquet`` hold, in this order: ``time, x, y, z, vx, vy, vz, sigma_x, sigma_y,
sigma_z, verdict, weight, innovation_sigma, reason``; for geographic input ``lat, lon`` and
``depth`` (positive down) or ``height``; then ``sensor`` and ``row``. An axis that was never
observed stays as an empty column. ``.geojson``, ``.gpx`` and ``.nmea`` need geographic input; see
their modules. Every file is written whole or not at all.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa

from surefix.errors import OutputError
from surefix.io import write_csv, write_parquet
from surefix.io.atomic import replacing
from surefix.io.records import Batch, Form, channel_table, parts
from surefix.types import Cleaned, CleanedChannel, FloatArray, IntArray, Track, Verdicts

__all__ = [
    "SUFFIXES",
    "TrackWriter",
    "channel_writer",
    "resampled_writer",
    "table_sink",
    "track_writer",
    "write_channel",
    "write_cleaned",
]

SUFFIXES = (".csv", ".parquet", ".geojson", ".gpx", ".nmea")

_ROWS = 250_000  # epochs that are put into words at a time
_Add = Callable[[Batch], None]
_AddRows = Callable[[pa.Table], None]


class TrackWriter:
    """An open output; made by `track_writer`."""

    def __init__(self, add: _Add) -> None:
        self._add = add

    def write(
        self,
        track: Track,
        verdicts: Verdicts,
        *,
        sensors: Sequence[str],
        sensor: IntArray,
        row: IntArray,
        coordinates: FloatArray | None = None,
    ) -> None:
        """Write some epochs, one per fix.

        Parameters
        ----------
        track, verdicts
            Of n fixes.
        sensors, sensor, row
            Names of the sensors; (n,) index into them; (n,) record number in the input.
        coordinates
            (n, 3) the fixes as they were given, latitude deg, longitude deg, height m: where
            GeoJSON and GPX put them. None: on the track (GeoJSON) or nowhere (GPX).
        """
        whole = Batch(track, verdicts, tuple(sensors), sensor, row, coordinates)
        for part in parts(whole, _ROWS):
            self._add(part)


@contextlib.contextmanager
def track_writer(
    path: str | Path, *, geographic: bool, has_depth: bool = False, iso: bool = False
) -> Iterator[TrackWriter]:
    """Open a file for a track with its verdicts.

    Parameters
    ----------
    path
        Its suffix is one of `SUFFIXES`.
    geographic
        Whether the track has latitude and longitude.
    has_depth
        Whether its vertical is written as depth, positive down.
    iso
        Whether times are written as ISO 8601 in UTC instead of Unix seconds.

    Raises
    ------
    OutputError
        The suffix is not known, the format needs latitude and longitude, or the file cannot be
        written.
    """
    with _opened(Path(path), Form(geographic, has_depth, iso)) as add:
        yield TrackWriter(add)


def write_cleaned(path: str | Path, cleaned: Cleaned, *, iso: bool = False) -> None:
    """Write a whole result.

    Raises
    ------
    OutputError
        As `track_writer`.
    """
    geographic = cleaned.track.geodetic is not None
    with track_writer(path, geographic=geographic, has_depth=cleaned.has_depth, iso=iso) as writer:
        writer.write(
            cleaned.track,
            cleaned.verdicts,
            sensors=cleaned.sensors,
            sensor=cleaned.sensor,
            row=cleaned.row,
            coordinates=cleaned.raw_coordinates if geographic else None,
        )


@contextlib.contextmanager
def resampled_writer(
    path: str | Path, *, geographic: bool, has_depth: bool = False, iso: bool = False
) -> Iterator[Callable[..., None]]:
    """Open a file for a track at times of its own and give the function that writes parts of it.

    The function takes a part and, for NMEA, whether a fix supports each of its epochs.

    Columns: time … sigma_z, then lat, lon, depth or height; arguments and errors as `track_writer`.
    """
    with _opened(Path(path), Form(geographic, has_depth, iso, verdicts=False)) as add:
        yield lambda track, known=None: add(Batch(track, known=known))


def write_channel(path: str | Path, channel: CleanedChannel, *, iso: bool = False) -> None:
    """Write a whole cleaned scalar series; see `channel_writer`."""
    with channel_writer(path, iso=iso) as add:
        add(channel)


@contextlib.contextmanager
def channel_writer(
    path: str | Path, *, iso: bool = False
) -> Iterator[Callable[[CleanedChannel], None]]:
    """Open a file for a cleaned scalar series and give the function that writes parts of it.

    Columns: time, value (by its name), raw, rate, sigma and the verdicts.

    Raises
    ------
    OutputError
        The suffix is neither ``.csv`` nor ``.parquet``, or the file cannot be written.
    """
    place = Path(path)
    kind = table_sink(place)
    with replacing(place) as file, contextlib.ExitStack() as stack:
        sink: _AddRows | None = None

        def add(channel: CleanedChannel) -> None:
            nonlocal sink
            rows = channel_table(channel, iso=iso)
            if sink is None:
                sink = stack.enter_context(kind(file, rows.schema))
            sink(rows)

        yield add


def table_sink(place: Path) -> Callable[..., contextlib.AbstractContextManager[_AddRows]]:
    """Choose what writes a table by the suffix of its file.

    Raises
    ------
    OutputError
        The suffix is neither ``.csv`` nor ``.parquet``.
    """
    suffix = place.suffix.lower()
    if suffix not in SUFFIXES[:2]:
        raise _unknown(place, SUFFIXES[:2])
    return write_csv.table_sink if suffix == ".csv" else write_parquet.table_sink


@contextlib.contextmanager
def _opened(place: Path, form: Form) -> Iterator[_Add]:
    suffix = place.suffix.lower()
    if suffix not in SUFFIXES:
        raise _unknown(place, SUFFIXES)
    if suffix in SUFFIXES[2:] and not form.geographic:
        raise OutputError(
            f"{place}: the input has x and y, not latitude and longitude",
            "an input with lat and lon",
            "write .csv or .parquet instead",
        )
    with replacing(place) as file, _sink(suffix, file, form) as add:
        yield add


def _sink(suffix: str, file: BinaryIO, form: Form) -> contextlib.AbstractContextManager[_Add]:
    if suffix == ".csv":
        return write_csv.csv_sink(file, form)
    if suffix == ".parquet":
        return write_parquet.parquet_sink(file, form)
    if suffix == ".geojson":
        from surefix.io.write_geojson import geojson_sink

        return geojson_sink(file, form)
    if suffix == ".nmea":
        from surefix.io.write_nmea import nmea_sink

        return nmea_sink(file, form)
    from surefix.io.write_gpx import gpx_sink

    return gpx_sink(file, form)


def _unknown(place: Path, known: Sequence[str]) -> OutputError:
    return OutputError(
        f"{place}: {place.suffix or 'no suffix'} is not a format this is written in",
        "one of " + ", ".join(known),
        "change the suffix of the output",
    )
