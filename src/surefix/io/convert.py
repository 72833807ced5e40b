"""Columns of cells to a `Log`: SI units, NaN for what is missing, faults counted."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pyarrow as pa

from surefix.errors import ParseError
from surefix.geo.angle import wrap
from surefix.geo.time import unix_seconds, unix_unit
from surefix.io.attitude_sentence import STEEPEST
from surefix.io.cells import Cells, edits, flags, names, numbers, texts, times
from surefix.io.columns import Layout, Picks
from surefix.io.match import Pick
from surefix.types import BoolArray, Channel, Edit, Fixes, FloatArray, IntArray, Log, Problem

__all__ = ["Converter"]

Columns = Mapping[int, pa.ChunkedArray]
Place = Callable[[int], str]
_TILTS = ("roll_deg", "pitch_deg")


class Converter:
    """Turns the chunks of one table into logs; what runs on from chunk to chunk is kept here.

    Parameters
    ----------
    source
        Name of the table.
    layout
        Where everything is.
    sensor
        Name of the sensor where no column names it.
    decimal_comma
        Whether numbers are written ``1,5``.
    """

    def __init__(
        self, source: str, layout: Layout, sensor: str, *, decimal_comma: bool = False
    ) -> None:
        self.row = 0
        self._source, self._layout, self._default = source, layout, sensor
        self._comma = decimal_comma
        self._sensors = [sensor] if layout.sensor is None else []
        self._unit = layout.time.unit
        self._problems: dict[str, Problem] = {}
        self._notes = layout.notes
        self._columns: Columns = {}
        self._rows = 0
        self._place: Place = self._record

    def count(self, kind: str, total: int, example: str, remedy: str = "") -> None:
        """Add to the problems of the chunk; the first example of a kind stays."""
        before = self._problems.get(kind, Problem(kind, 0, example, remedy))
        self._problems[kind] = before._replace(total=before.total + total)

    def log(self, columns: Columns, rows: int, place: Place | None = None) -> Log:
        """Convert one chunk.

        Parameters
        ----------
        columns
            Cells by column number: every column of the layout, all of one length.
        rows
            That length.
        place
            Says where a record of the chunk stands, for examples of problems.

        Raises
        ------
        ParseError
            The time column of the first chunk holds no times at all.
        """
        self._columns, self._rows, self._place = columns, rows, place or self._record
        time = self._time()
        valid = self._valid()
        fixes = self._fixes(time, valid) if self._layout.has_fixes else None
        channels = self._channels(time, valid if fixes is None else None)
        problems, notes = tuple(self._problems.values()), self._notes
        self._problems, self._notes, self._columns = {}, (), {}
        self.row += rows
        return Log(
            source=self._source,
            sensors=tuple(self._sensors),
            fixes=fixes,
            channels=channels,
            problems=problems,
            events=notes,
            counts={"row": rows},
            depth_positive_down=self._layout.depth_positive_down,
        )

    def _record(self, record: int) -> str:
        return f"record {self.row + record}"

    def _time(self) -> FloatArray:
        pick, date = self._layout.time, self._layout.date
        cells, unix = times(
            self._columns[pick.column],
            self._columns[date.column] if date else None,
            decimal_comma=self._comma,
            calendar=pick.unit == "iso",
        )
        if self.row == 0 and len(cells.bad) and not np.isfinite(cells.values).any():
            raise self._no_times(pick, int(cells.bad[0]))
        self._count_bad(cells, pick)
        values = np.where(np.isfinite(cells.values), cells.values, np.nan)
        if unix:
            return values
        if not self._unit and np.isfinite(values).any():
            self._unit = unix_unit(values)
        return np.asarray(pick.factor * unix_seconds(values, self._unit or "s"))

    def _no_times(self, pick: Pick, record: int) -> ParseError:
        cell = self._cell(pick, record)
        return ParseError(
            f"{self._source}, {self._place(record)}: {pick.name} holds {cell!r}, which is no time",
            "seconds, Unix time, or ISO 8601 (2024-05-01T12:00:00Z)",
            "name another column with --column time=NAME, or put the date beside a time of day"
            " in a column date",
        )

    def _fixes(self, time: FloatArray, valid: BoolArray) -> Fixes:
        layout, n = self._layout, self._rows
        sensor = self._sensor()
        position = self._axes(layout.position)
        if layout.geographic:
            self._to_globe(position)
        return Fixes(
            time=time,
            position=position,
            velocity=self._axes(layout.velocity),
            sigma_position=self._sigmas(layout.sigma_position, sensor),
            sigma_velocity=self._sigmas(layout.sigma_velocity, sensor),
            sensor=sensor,
            edit=self._edits(),
            valid=valid,
            row=np.arange(self.row, self.row + n, dtype=np.int64),
            geographic=layout.geographic,
        )

    def _channels(self, time: FloatArray, valid: BoolArray | None) -> tuple[Channel, ...]:
        """Read the scalar series; those of a table without fixes heed its validity column."""
        found = []
        for name, period, pick in self._layout.channels:
            value = self._numbers(pick)
            kept = np.isfinite(value) if valid is None else np.isfinite(value) & valid
            value = np.where(kept, value, np.nan)
            value = np.mod(value, period) if period else value
            value = self._tilt(value, pick) if name in _TILTS else value
            found.append(Channel(name, self._default, time, value, period))
        return tuple(found)

    def _tilt(self, value: FloatArray, pick: Pick) -> FloatArray:
        """Roll or pitch, of which 358° is −2°, and more than 90° to a side is none."""
        value = wrap(value)
        wrong = np.abs(value) > STEEPEST
        if wrong.any():
            example = self._example(pick, int(np.argmax(wrong)))
            self.count("range", int(wrong.sum()), example, "the angle was taken as missing")
        return np.where(wrong, np.nan, value)

    def _sensor(self) -> IntArray:
        pick = self._layout.sensor
        if pick is None:
            return np.zeros(self._rows, dtype=np.int64)
        return names(self._columns[pick.column], self._sensors, self._default)

    def _valid(self) -> BoolArray:
        pick = self._layout.valid
        if pick is None:
            return np.ones(self._rows, dtype=np.bool_)
        return flags(self._columns[pick.column], status="status" in pick.name.lower())

    def _edits(self) -> IntArray:
        pick = self._layout.edit
        if pick is None:
            return np.full(self._rows, Edit.NONE, dtype=np.int64)
        codes, bad = edits(self._columns[pick.column])
        if len(bad):
            self.count("edit", len(bad), self._example(pick, int(bad[0])), "say accept or reject")
        return codes

    def _axes(self, picks: Picks) -> FloatArray:
        """Read three axes, (n, 3); an axis without a column is NaN."""
        values = np.full((self._rows, 3), np.nan)
        for axis, pick in enumerate(picks):
            if pick is not None:
                values[:, axis] = self._numbers(pick)
        values[~np.isfinite(values)] = np.nan
        return values

    def _to_globe(self, position: FloatArray) -> None:
        """Take out impossible positions and bring longitudes to −180 … 180, in place."""
        lat, lon = position[:, 0], position[:, 1]
        wrong = (np.abs(lat) > 90.0) | (np.abs(lon) > 360.0)
        if wrong.any():
            first = int(np.argmax(wrong))
            example = f"{self._place(first)}: latitude {lat[first]:g}, longitude {lon[first]:g}"
            self.count("range", int(wrong.sum()), example, "the position was taken as missing")
        position[wrong] = np.nan
        beyond = np.abs(lon) > 180.0
        lon[beyond] = (lon[beyond] + 180.0) % 360.0 - 180.0
        position[np.isnan(lat) | np.isnan(lon), :2] = np.nan

    def _sigmas(self, picks: Picks, sensor: IntArray) -> FloatArray:
        values = np.full((self._rows, 3), np.nan)
        read: dict[Pick, FloatArray] = {}
        for axis, pick in enumerate(picks):
            if pick is None:
                continue
            if pick not in read:
                read[pick] = self._sigma(pick, sensor)
            values[:, axis] = read[pick]
        return values

    def _sigma(self, pick: Pick, sensor: IntArray) -> FloatArray:
        values = self._numbers(pick)
        wrong = ~np.isnan(values) & ~((values > 0.0) & np.isfinite(values))
        if wrong.any():
            first = int(np.argmax(wrong))
            who = self._sensors[sensor[first]]
            example = f"{self._example(pick, first)} of sensor {who}"
            self.count("sigma", int(wrong.sum()), example, "it was taken as not declared")
        return np.where(wrong, np.nan, values)

    def _numbers(self, pick: Pick) -> FloatArray:
        cells = numbers(self._columns[pick.column], decimal_comma=self._comma)
        self._count_bad(cells, pick)
        return np.asarray(cells.values * pick.factor if pick.factor != 1.0 else cells.values)

    def _count_bad(self, cells: Cells, pick: Pick) -> None:
        if len(cells.bad):
            example = self._example(pick, int(cells.bad[0]))
            self.count("cell", len(cells.bad), example, "the cell was taken as missing")

    def _example(self, pick: Pick, record: int) -> str:
        return f"{self._place(record)}, {pick.name}: {self._cell(pick, record)}"

    def _cell(self, pick: Pick, record: int) -> str:
        return str(texts(self._columns[pick.column].slice(record, 1))[0].as_py())[:60]
