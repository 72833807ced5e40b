"""A stream of many tracks with the state of each kept by Spark, by ``transformWithStateInPandas``.

Rows wait until the watermark has passed their time, and are then pushed in the order of time into
`surefix.pipelines.session`, whose snapshot is the state. What comes later than the watermark allows
is not lost: it is pushed late, and judged as a late row of a log is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from surefix.errors import OptionsError
from surefix.fleet.outcome import failed_outcome
from surefix.fleet.spark_plan import plan_frame, result_schema, told, with_error
from surefix.fleet.tracks import TrackPlan, track_log, track_rows
from surefix.io.columns import recognise
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.session import advance, begin_session
from surefix.pipelines.snapshot import restored, snapshot
from surefix.pipelines.state import Session
from surefix.types import Cleaned

if TYPE_CHECKING:
    import pandas as pd
    from pyspark.sql import DataFrame

__all__ = ["Tracks", "stream_tracks"]

_PROVIDER = "spark.sql.streaming.stateStore.providerClass"
_EVENT = "surefix_event_us"
_SCALE = {"": 1_000_000, "s": 1_000_000, "ms": 1_000, "us": 1}
_NEVER = -(1 << 62)  # µs: event of a row without a time


def stream_tracks(
    frame: DataFrame,
    options: CleanOptions,
    *,
    track: str = "track_id",
    columns: Mapping[str, str] | None = None,
    late_s: float = 10.0,
    idle_s: float = 3600.0,
) -> DataFrame:
    """Clean the tracks of a stream, each in real time.

    The rows of a track are those of `surefix.clean` with the same options on its rows in the order
    of time. They come once ``settle_rows`` of them are there, or the track has ended.

    Parameters
    ----------
    frame
        A streaming data frame: columns as of a single log, and one that names the track. Rows may
        be in any order. The time is a timestamp or a number, s since 1970 unless its unit is
        given, and later than 1970.
    options
        Of mode ``realtime``. ``settle_rows`` decides when the first rows come.
    track, columns
        As for `surefix.fleet.spark.clean_tracks`.
    late_s
        How much later than the latest row of the stream a row may come and still be put in its
        place: the delay of the watermark, and of the output. A later one is judged as late.
    idle_s
        A track ends when nothing was heard of it for so long; what comes then begins a new one.

    Returns
    -------
    DataFrame
        As of `surefix.fleet.spark.clean_tracks`, in append mode. A track that fails has a row that
        says why, and begins anew.

    Raises
    ------
    MissingExtraError, ParseError, OptionsError
        PySpark is missing, columns or options are wrong, or the state store is not RocksDB.
    """
    if options.mode != "realtime":
        raise OptionsError(
            f"mode {options.mode} for a stream", "mode realtime", "the others look ahead"
        )
    plan = plan_frame(frame, track, options, columns)
    for name, value in (("late_s", late_s), ("idle_s", idle_s)):
        if value < 0.0:
            raise OptionsError(f"{name} = {value}", "seconds, zero or more")
    given = frame.sparkSession.conf.get(_PROVIDER, "")
    if "RocksDB" not in given:
        raise OptionsError(
            f"{_PROVIDER} = {given}",
            "the state store of RocksDB",
            "set it to org.apache.spark.sql.execution.streaming.state.RocksDBStateStoreProvider",
        )
    from pyspark.sql import functions as F
    from pyspark.sql.pandas.types import from_arrow_schema, to_arrow_schema
    from pyspark.sql.types import TimestampType

    stamped = [f.name for f in frame.schema if isinstance(f.dataType, TimestampType)]
    kinds = to_arrow_schema(frame.schema)
    for name in stamped:
        kinds = kinds.set(kinds.names.index(name), pa.field(name, pa.timestamp("us", tz="UTC")))
    event = _event(frame, plan, stamped)
    marked = frame.withColumn("surefix_event", event).withWatermark(
        "surefix_event", f"{round(1e3 * late_s)} milliseconds"
    )
    # Spark would drop late rows by the marked column: only its copy goes on.
    plain = [F.unix_micros(name).alias(name) if name in stamped else name for name in frame.columns]
    rows = marked.select(*plain, F.unix_micros("surefix_event").alias(_EVENT))
    return rows.groupBy(track).transformWithStateInPandas(
        Tracks(plan, kinds, idle_s),
        from_arrow_schema(result_schema(plan)),
        "append",
        "EventTime",
    )


def _event(frame: DataFrame, plan: TrackPlan, stamped: list[str]) -> Any:
    """The time of a row as a timestamp."""
    from pyspark.sql import functions as F

    names = [name for name in frame.columns if name != plan.track]
    time = recognise(names, chosen=plan.columns, source="the data frame").time
    if time.name in stamped:
        return F.col(time.name)
    if time.unit not in _SCALE or frame.schema[time.name].dataType.typeName() == "string":
        raise OptionsError(
            f"the time {time.name} of a stream",
            "a timestamp, or a number of s, ms or us",
            "cast it before",
        )
    number = F.col(time.name).cast("double")
    return F.timestamp_micros(F.floor(number * _SCALE[time.unit]).cast("long"))


class _State(NamedTuple):
    """What Spark keeps of a track beside the rows that wait.

    Parameters
    ----------
    waiting
        How many rows wait.
    latest
        µs, time of the latest row.
    timer
        ms, when the track is looked at again; −1 for never.
    records
        How many rows were pushed.
    stored
        Snapshot of the session; empty before it begins.
    """

    waiting: int = 0
    latest: int = _NEVER
    timer: int = -1
    records: int = 0
    stored: bytes = b""


class Tracks:
    """The processor of a stream of tracks; Spark calls it with the rows of one track at a time.

    Parameters
    ----------
    plan
        How tracks are cleaned.
    kinds
        Columns of the input with their types.
    idle_s
        After which a track ends.
    """

    def __init__(self, plan: TrackPlan, kinds: pa.Schema, idle_s: float) -> None:
        self._plan, self._idle = plan, round(1e6 * idle_s)
        self._kinds = kinds.append(pa.field(_EVENT, pa.int64()))

    def init(self, handle: Any) -> None:
        """Name the state."""
        self._handle = handle
        self._rows = handle.getListState("rows", "part binary")
        self._state = handle.getValueState(
            "state", "waiting long, latest long, timer long, records long, stored binary"
        )

    def handleInputRows(  # the name is Spark's
        self, key: Any, rows: Iterator[pd.DataFrame], timerValues: Any
    ) -> Iterator[pd.DataFrame]:
        """Take new rows of a track, and give what can be told by now."""
        state = self._load()
        for frame in rows:
            part = pa.Table.from_pandas(frame, schema=self._kinds, preserve_index=False)
            part = part.set_column(
                part.num_columns - 1, _EVENT, pc.fill_null(part.column(_EVENT), _NEVER)
            )
            self._rows.appendValue((_packed(part),))
            latest = max(state.latest, pc.max(part.column(_EVENT)).as_py())
            state = state._replace(waiting=state.waiting + part.num_rows, latest=latest)
        yield from self._go_on(key[0], state, timerValues.getCurrentWatermarkInMs())

    def handleExpiredTimer(
        self,
        key: Any,
        timerValues: Any,
        expiredTimerInfo: Any,  # noqa: ARG002
    ) -> Iterator[pd.DataFrame]:
        """Give what can be told now that time has passed; end a track that has been idle."""
        state = self._load()._replace(timer=-1)
        yield from self._go_on(key[0], state, timerValues.getCurrentWatermarkInMs())

    def close(self) -> None:
        """Nothing is open."""

    def _load(self) -> _State:
        stored = self._state.get()
        return _State() if stored is None else _State._make(stored)

    def _go_on(self, track: Any, state: _State, watermark_ms: int) -> Iterator[pd.DataFrame]:
        passed = 1000 * watermark_ms if watermark_ms > 0 else _NEVER
        ended = passed > _NEVER and state.latest + self._idle <= passed
        if state.waiting and (ended or self._enough(state)):
            ready, waiting = self._parted(passed)
            if state.stored or ended or ready.num_rows >= self._plan.options.settle_rows:
                if waiting.num_rows:
                    self._rows.put([(_packed(waiting),)])
                else:
                    self._rows.clear()
                state = state._replace(waiting=waiting.num_rows)
                state, found = self._pushed(track, state, ready)
                yield from found
        if ended:
            yield from self._ended(track, state)
            self._rows.clear()
            self._state.clear()
            return
        self._remember(state)

    def _enough(self, state: _State) -> bool:
        """Whether the rows of a track can be looked at, or are too few to settle on."""
        return bool(state.stored) or state.waiting >= self._plan.options.settle_rows

    def _remember(self, state: _State) -> None:
        """Store the state, and be called again when the rows that wait may go on."""
        soon = state.waiting and self._enough(state)
        due = state.latest if soon else state.latest + self._idle
        timer = max(-(-due // 1000), -1)
        if timer != state.timer:
            if state.timer >= 0:
                self._handle.deleteTimer(state.timer)
            if timer >= 0:
                self._handle.registerTimer(timer)
        self._state.update(tuple(state._replace(timer=timer)))

    def _parted(self, passed: int) -> tuple[pa.Table, pa.Table]:
        """Rows that nothing can precede any more, in the order of time, and the others."""
        rows = pa.concat_tables([_unpacked(part) for (part,) in self._rows.get()])
        ready = pc.less_equal(rows.column(_EVENT), passed)
        others = [name for name in rows.column_names if name != _EVENT]
        keys = [(name, "ascending") for name in (_EVENT, *others)]
        return rows.filter(ready).sort_by(keys), rows.filter(pc.invert(ready))

    def _pushed(
        self, track: Any, state: _State, rows: pa.Table
    ) -> tuple[_State, list[pd.DataFrame]]:
        if not rows.num_rows:
            return state, []
        session = self._session(track, state)
        try:
            log = track_log(rows.drop_columns([_EVENT]), self._plan, str(track))
            if log.fixes is not None:
                log = replace(log, fixes=log.fixes._replace(row=log.fixes.row + state.records))
            session, parts = advance(session, 0, log)
            found = self._shown(track, parts)
        except Exception as error:
            return state._replace(records=0, stored=b""), [self._failed(track, error)]
        records = state.records + rows.num_rows
        return state._replace(records=records, stored=snapshot(session)), found

    def _ended(self, track: Any, state: _State) -> list[pd.DataFrame]:
        if not state.stored:
            return []
        session = self._session(track, state)
        try:
            return self._shown(track, advance(session, 0, None)[1])
        except Exception as error:
            return [self._failed(track, error)]

    def _session(self, track: Any, state: _State) -> Session:
        if state.stored:
            return restored(state.stored, Session)
        return begin_session([(str(track), "fixes")], self._plan.options)

    def _shown(self, track: Any, parts: Sequence[Cleaned]) -> list[pd.DataFrame]:
        value = pa.scalar(track, self._plan.kind)
        tables = [track_rows(part, value, self._plan) for part in parts if len(part.track.time)]
        return [with_error(rows, self._plan).to_pandas() for rows in tables]

    def _failed(self, track: Any, error: Exception) -> pd.DataFrame:
        return told(track, failed_outcome(str(track), error), self._plan).to_pandas()


def _packed(rows: pa.Table) -> bytes:
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, rows.schema) as writer:
        writer.write_table(rows)
    return bytes(sink.getvalue())


def _unpacked(stored: bytes) -> pa.Table:
    with pa.ipc.open_stream(stored) as reader:
        return reader.read_all()
