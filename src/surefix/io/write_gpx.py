"""GPX 1.1 output: the clean track, and rejected fixes as waypoints where they were given.

GPX puts waypoints before tracks, so the document is built in memory (about 1 kB an epoch) and
written at the end: for logs of many million fixes use CSV or Parquet.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import BinaryIO

from gpxpy.gpx import GPX, GPXTrack, GPXTrackPoint, GPXTrackSegment, GPXWaypoint

from surefix.io.records import Batch, Form
from surefix.reasons import CALENDAR_FROM, texts
from surefix.types import Verdict, Verdicts

__all__ = ["gpx_sink"]


@contextlib.contextmanager
def gpx_sink(file: BinaryIO, _form: Form) -> Iterator[Callable[[Batch], None]]:
    """Collect batches of a track and write them to an open file at the end."""
    document = _Document()
    yield document.add
    file.write(document.xml())


class _Document:
    def __init__(self) -> None:
        self._gpx = GPX()
        self._gpx.creator = "surefix"
        self._segment = GPXTrackSegment()
        self._gpx.tracks.append(GPXTrack(name="surefix"))
        self._gpx.tracks[0].segments.append(self._segment)

    def add(self, batch: Batch) -> None:
        """Keep one batch."""
        track = batch.track
        if track.geodetic is None:
            return
        for time, (lat, lon, height) in zip(
            track.time.tolist(), track.geodetic.tolist(), strict=True
        ):
            if math.isfinite(lat) and math.isfinite(lon):
                point = GPXTrackPoint(round(lat, 9), round(lon, 9), _finite(height), _date(time))
                self._segment.points.append(point)
        self._waypoints(batch)

    def xml(self) -> bytes:
        """Return the document."""
        return bytes(self._gpx.to_xml("1.1").encode())

    def _waypoints(self, batch: Batch) -> None:
        if batch.verdicts is None or batch.coordinates is None:
            return
        chosen = batch.verdicts.verdict == Verdict.REJECTED
        reasons = texts(Verdicts(*(values[chosen] for values in batch.verdicts)))
        places = batch.coordinates[chosen].tolist()
        times = batch.track.time[chosen].tolist()
        for time, (lat, lon, height), reason in zip(times, places, reasons, strict=True):
            if math.isfinite(lat) and math.isfinite(lon):
                point = GPXWaypoint(
                    round(lat, 9), round(lon, 9), _finite(height), _date(time), "rejected", reason
                )
                self._gpx.waypoints.append(point)


def _finite(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None


def _date(time: float) -> datetime | None:
    if not math.isfinite(time) or abs(time) < CALENDAR_FROM:
        return None
    return datetime.fromtimestamp(time, UTC)
