"""GeoJSON output (RFC 7946): a point per fix where it was given, and the clean track as a line.

The points, with verdict and reason, come first; the line comes last and waits in a temporary file,
so that a log of any length needs little memory. A fix without position has a null geometry.
"""

from __future__ import annotations

import contextlib
import json
import math
import tempfile
from collections.abc import Callable, Iterator
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa

from surefix.io.records import Batch, Form, table
from surefix.types import FloatArray

__all__ = ["geojson_sink", "split_at_antimeridian"]

_SKIPPED = ("x", "y", "z", "vx", "vy", "vz")
_DECIMALS = {"time": 6, "lat": 9, "lon": 9}

Point = tuple[float, float, float]


@contextlib.contextmanager
def geojson_sink(file: BinaryIO, form: Form) -> Iterator[Callable[[Batch], None]]:
    """Write batches of a track to an open file."""
    with tempfile.TemporaryFile() as line:
        sink = _Sink(file, line, form)
        yield sink.add
        sink.close()


class _Sink:
    """The open document: its features so far, and the line that waits."""

    def __init__(self, file: BinaryIO, line: BinaryIO, form: Form) -> None:
        self._file, self._line, self._form = file, line, form
        self._last: Point | None = None
        self._vertices, self._parts, self._features = 0, 1, 0
        file.write(b'{"type":"FeatureCollection","features":[')

    def add(self, batch: Batch) -> None:
        """Write the points of one batch and keep its part of the line."""
        geodetic = batch.track.geodetic
        if geodetic is None:
            return
        if batch.verdicts is not None:
            self._points(batch, geodetic if batch.coordinates is None else batch.coordinates)
        self._vertices_of(geodetic)

    def close(self) -> None:
        """Write the line."""
        if self._vertices > 1:
            kind = "MultiLineString" if self._parts > 1 else "LineString"
            head, tail = ("[[", "]]") if self._parts > 1 else ("[", "]")
            self._separate()
            start = f'{{"type":"Feature","geometry":{{"type":"{kind}","coordinates":{head}'
            self._file.write(start.encode())
            self._line.seek(0)
            while part := self._line.read(1 << 20):
                self._file.write(part)
            self._file.write(f'{tail}}},"properties":{{"name":"track"}}}}'.encode())
        self._file.write(b"\n]}\n")

    def _separate(self) -> None:
        self._file.write(b",\n" if self._features else b"\n")
        self._features += 1

    def _points(self, batch: Batch, where: FloatArray) -> None:
        for point, properties in zip(_places(where), _properties(batch, self._form), strict=True):
            geometry = None if point is None else {"type": "Point", "coordinates": _listed(point)}
            feature = {"type": "Feature", "geometry": geometry, "properties": properties}
            self._separate()
            text = json.dumps(feature, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
            self._file.write(text.encode())

    def _vertices_of(self, geodetic: FloatArray) -> None:
        for point in _places(geodetic):
            if point is None:
                continue
            for vertex, new_part in split_at_antimeridian(self._last, point):
                mark = "],[" if new_part else "," if self._vertices else ""
                self._parts += new_part
                self._vertices += 1
                self._line.write((mark + json.dumps(_listed(vertex))).encode())
            self._last = point


def split_at_antimeridian(last: Point | None, point: Point) -> Iterator[tuple[Point, bool]]:
    """Give the vertices that lead from one point to the next; True where a new part begins.

    RFC 7946, 3.1.9: a line that crosses longitude ±180° is cut there.

    >>> list(split_at_antimeridian((179.0, 0.0, 0.0), (-179.0, 2.0, 0.0)))[:2]
    [((180.0, 1.0, 0.0), False), ((-180.0, 1.0, 0.0), True)]
    """
    if last is not None and abs(point[0] - last[0]) > 180.0:
        side = math.copysign(180.0, last[0])
        ahead = point[0] + 2.0 * side
        share = (side - last[0]) / (ahead - last[0]) if ahead != last[0] else 0.0
        lat, height = (a + share * (b - a) for a, b in zip(last[1:], point[1:], strict=True))
        yield (side, lat, height), False
        yield (-side, lat, height), True
    yield point, False


def _places(geodetic: FloatArray) -> Iterator[Point | None]:
    """Longitude, latitude, height; None where the position is missing."""
    for lat, lon, height in geodetic.tolist():
        yield (lon, lat, height) if math.isfinite(lat) and math.isfinite(lon) else None


def _listed(point: Point) -> list[float]:
    lon, lat, height = point
    flat = [round(lon, 9), round(lat, 9)]
    return [*flat, round(height, 4)] if math.isfinite(height) else flat


def _properties(batch: Batch, form: Form) -> Iterator[dict[str, Any]]:
    rows = table(batch, form)
    columns = {
        name: _values(name, rows.column(name)) for name in rows.column_names if name not in _SKIPPED
    }
    for values in zip(*columns.values(), strict=True):
        yield dict(zip(columns, values, strict=True))


def _values(name: str, column: pa.ChunkedArray) -> list[Any]:
    if pa.types.is_timestamp(column.type):
        return [text and text.replace(" ", "T") for text in column.cast(pa.string()).to_pylist()]
    if not pa.types.is_floating(column.type):
        return list(column.to_pylist())
    numbers = np.round(np.asarray(column, dtype=np.float64), _DECIMALS.get(name, 4)).tolist()
    return [number if math.isfinite(number) else None for number in numbers]
