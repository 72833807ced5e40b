"""What a fleet costs: cleaning per track, processes, bringing tracks together, state of a stream.

Run ``python bench/fleet.py [FILE.json]`` (with the extra ``spark`` and Java for the second half).
Everything is measured in one run, in turns, medians of several rounds. CPU time is that of the
process and its children; the machine may do other things meanwhile.
"""

from __future__ import annotations

import json
import os
import platform
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from statistics import median

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import surefix
from surefix.fleet.options import FleetOptions
from surefix.fleet.run import clean_fleet
from surefix.io.table import from_frame
from surefix.pipelines.session import advance, begin_session
from surefix.pipelines.snapshot import snapshot

TRACKS, ROWS = 12, 500  # that are cleaned
MANY = 4_000  # tracks that are only moved
ROUNDS = 3
MILLION = 1_000_000


def main() -> None:
    """Measure, print, and write the JSON file if one is named."""
    with tempfile.TemporaryDirectory() as folder:
        found = {"machine": machine(), **local(Path(folder))}
        if find_spec("pyspark") is not None and shutil.which("java"):
            found |= on_spark(Path(folder))
    found["million_tracks"] = arithmetic(found)
    text = json.dumps(found, indent=2)
    print(text)
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(text + "\n", encoding="utf-8")


def machine() -> dict[str, object]:
    """What it was measured on."""
    return {
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "tracks": TRACKS,
        "rows_per_track": ROWS,
        "rounds": ROUNDS,
    }


def tracks(count: int) -> pa.Table:
    """Walks with noise and five per cent wild fixes, one after the other."""
    rng = np.random.default_rng(1)
    n = count * ROWS
    wild = rng.random((n, 1)) < 0.05
    position = np.cumsum(rng.normal(0.0, 0.3, (count, ROWS, 2)), axis=1).reshape(n, 2)
    position += rng.normal(0.0, 0.5, (n, 2)) + wild * rng.uniform(20.0, 60.0, (n, 2))
    names = np.repeat([f"t{k:06d}" for k in range(count)], ROWS)
    seconds = 1.7e9 + np.tile(np.arange(ROWS, dtype=float), count)
    return pa.table({"track_id": names, "time": seconds, "x": position[:, 0], "y": position[:, 1]})


def write(folder: Path, table: pa.Table, files: int = 4) -> Path:
    """Write a data set of a few files."""
    folder.mkdir(parents=True)
    size = table.num_rows // files
    for k in range(files):
        pq.write_table(table.slice(k * size, size), folder / f"{k}.parquet")
    return folder


def in_time(table: pa.Table) -> pa.Table:
    """The same rows by time: no two of a track stand together."""
    return table.take(pa.array(np.argsort(table["time"].to_numpy(), kind="stable")))


def cost(run: Callable[[], object]) -> tuple[float, float]:
    """Wall and CPU seconds."""
    began, used = time.perf_counter(), cpu()
    run()
    return time.perf_counter() - began, cpu() - used


def cpu() -> float:
    """Seconds of this process and the children that have ended."""
    whom = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(sum(resource.getrusage(each)[:2]) for each in whom)


def rounds(runs: dict[str, Callable[[], object]]) -> dict[str, dict[str, float]]:
    """Run all in turn, several times; medians."""
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in runs}
    for run in runs.values():
        run()  # kernels are compiled, files are read
    for _ in range(ROUNDS):
        for name, run in runs.items():
            taken[name].append(cost(run))
    return {
        name: {
            "wall_s": round(median(wall for wall, _ in each), 3),
            "wall_spread_s": round(max(w for w, _ in each) - min(w for w, _ in each), 3),
            "cpu_s": round(median(used for _, used in each), 3),
        }
        for name, each in taken.items()
    }


def local(folder: Path) -> dict[str, object]:
    """Cleaning by modes and processes; bringing tracks together."""
    few = tracks(TRACKS)
    data, mixed = write(folder / "few", few), write(folder / "mixed", in_time(few))

    def fleet(source: Path, mode: str, jobs: int) -> Callable[[], object]:
        options = surefix.CleanOptions(mode=mode)

        def run() -> object:
            place = folder / "out"
            shutil.rmtree(place, ignore_errors=True)
            return clean_fleet([source], place, FleetOptions(clean=options, jobs=jobs))

        return run

    found = rounds(
        {
            "offline_1_process": fleet(data, "offline", 1),
            "offline_2_processes": fleet(data, "offline", 2),
            "offline_mixed_1_process": fleet(mixed, "offline", 1),
            "realtime_1_process": fleet(data, "realtime", 1),
        }
    )
    found |= rounds({"kept_1_process": lambda: clean_fleet([data], folder / "kept")})
    alone = [few.slice(k * ROWS, ROWS).drop_columns(["track_id"]) for k in range(TRACKS)]

    def each(**how: object) -> Callable[[], object]:
        options = surefix.CleanOptions(**how)
        return lambda: [surefix.clean(rows, options=options) for rows in alone]

    found |= rounds(
        {
            "calls_multi_hypothesis": each(),
            "calls_igg3": each(method="igg3"),
            "calls_igg3_noise_given": each(method="igg3", sigma_position=0.5, process=0.3),
        }
    )
    return {"local": found, "moved_on_one_machine": moved(folder), "snapshot": snapshots()}


def moved(folder: Path) -> dict[str, object]:
    """Finding the tracks of a larger data set, and bringing mixed ones together."""
    from surefix.fleet.arrange import arrange, arranged
    from surefix.fleet.dataset import index

    table = tracks(MANY)
    laid, mixed = write(folder / "laid", table), write(folder / "all", in_time(table))

    def find(place: Path) -> object:
        paths = [str(path) for path in place.glob("*.parquet")]
        return index(paths, str(place), "track_id", pa.string())

    def together() -> object:
        data = find(mixed)
        shutil.rmtree(folder / "sorted", ignore_errors=True)
        arrange(data, arranged(data, folder / "sorted"), str(mixed), "track_id", pa.string())

    found = rounds({"find": lambda: find(laid), "bring_together": together})
    return {"rows": table.num_rows, **found}


def snapshots() -> dict[str, int]:
    """Bytes that are kept of a track in real time, once it is settled."""
    table = tracks(1).drop_columns(["track_id"])
    out = {}
    for method in ("multi-hypothesis", "igg3"):
        options = surefix.CleanOptions(mode="realtime", method=method, settle_rows=200)
        session, _ = advance(begin_session([("track", "fixes")], options), 0, from_frame(table))
        out[f"{method}_bytes"] = len(snapshot(session))
    return out


def on_spark(folder: Path) -> dict[str, object]:
    """The same on Spark in local mode on two threads."""
    from pyspark.sql import SparkSession

    from surefix.fleet.spark import clean_tracks, is_laid_out

    os.environ["PYSPARK_PYTHON"] = sys.executable
    session = (
        SparkSession.builder.master("local[2]")
        .config("spark.ui.enabled", "false")
        .config("spark.sql.shuffle.partitions", "4")
        .config("spark.driver.memory", "3g")
        .config(
            "spark.sql.streaming.stateStore.providerClass",
            "org.apache.spark.sql.execution.streaming.state.RocksDBStateStoreProvider",
        )
        .getOrCreate()
    )
    session.sparkContext.setLogLevel("OFF")
    many = {name: session.read.parquet(str(folder / name)) for name in ("laid", "all")}
    few = session.read.parquet(str(folder / "few"))

    def only_moved(name: str, *, shuffle: bool) -> Callable[[], object]:
        frame = many[name]
        if shuffle:
            frame = frame.repartition("track_id").sortWithinPartitions("track_id", "time", "x", "y")
        through = frame.mapInArrow(same, frame.schema)
        return lambda: through.write.format("noop").mode("overwrite").save()

    def cleaned(*, shuffle: bool) -> Callable[[], object]:
        found = clean_tracks(few, shuffle=shuffle)
        return lambda: found.write.format("noop").mode("overwrite").save()

    before = written(session)
    only_moved("all", shuffle=True)()
    moved_bytes = written(session) - before
    found = rounds(
        {
            "read_laid_out": only_moved("laid", shuffle=False),
            "read_and_shuffle": only_moved("all", shuffle=True),
            "is_laid_out": lambda: is_laid_out(many["laid"]),
            "clean_laid_out": cleaned(shuffle=False),
            "clean_with_shuffle": cleaned(shuffle=True),
        }
    )
    stream = streamed(session, folder)
    version = session.version
    session.stop()
    rows = MANY * ROWS
    return {
        "spark": {
            "version": version,
            "rows_moved": rows,
            "shuffle_bytes_per_row": round(moved_bytes / rows, 1),
            **{name: without(each, "cpu_s") for name, each in found.items()},
            "stream": stream,
        }
    }


def without(figures: dict[str, float], name: str) -> dict[str, float]:
    """All but one: the CPU time of Spark's own processes is not seen from here."""
    return {key: value for key, value in figures.items() if key != name}


def same(batches: object) -> object:
    """Hand batches through Python as they come."""
    return batches


def written(session: object) -> int:
    """Bytes that were written for shuffles so far."""
    store = session.sparkContext._jsc.sc().statusStore()  # noqa: SLF001  # there is no other way
    time.sleep(1.0)  # figures come with a heartbeat
    return int(store.executorSummary("driver").totalShuffleWrite())


def streamed(session: object, folder: Path) -> dict[str, object]:
    """A stream of all tracks at once, in micro-batches of a tenth each."""
    from surefix.fleet.spark import stream_tracks

    table = in_time(tracks(TRACKS))
    place = folder / "stream"
    place.mkdir()
    step = table.num_rows // 10
    for k in range(10):
        path = place / f"{k}.parquet"
        pq.write_table(table.slice(k * step, step), path)
        os.utime(path, (1.7e9 + k, 1.7e9 + k))
    source = session.readStream.schema("track_id string, time double, x double, y double")
    options = surefix.CleanOptions(mode="realtime", settle_rows=100, reorder_s=0.0)
    rows = source.option("maxFilesPerTrigger", 1).parquet(str(place))
    query = (
        stream_tracks(rows, options)
        .writeStream.format("noop")
        .option("checkpointLocation", str(folder / "notes"))
        .trigger(availableNow=True)
        .start()
    )
    query.awaitTermination()
    told = [each for each in query.recentProgress if each["numInputRows"]]
    steady = [each["durationMs"]["triggerExecution"] / 1e3 for each in told[4:]]
    state = query.lastProgress["stateOperators"][0]
    return {
        "tracks": TRACKS,
        "rows_per_batch": step,
        "batch_s": round(median(steady), 3),
        "rows_per_s": round(step / median(steady), 1),
        "state_bytes": state["memoryUsedBytes"],
    }


def arithmetic(found: dict[str, dict]) -> dict[str, object]:
    """What a million tracks of so many rows would take, from the figures above."""
    per_track = {
        mode: found["local"][f"{mode}_1_process"]["cpu_s"] / TRACKS
        for mode in ("offline", "realtime")
    }
    out: dict[str, object] = {
        "rows": MILLION * ROWS,
        **{f"{mode}_s_per_track": round(each, 4) for mode, each in per_track.items()},
        **{
            f"{mode}_core_hours": round(each * MILLION / 3600.0, 1)
            for mode, each in per_track.items()
        },
        "snapshots_gb": round(found["snapshot"]["multi-hypothesis_bytes"] * MILLION / 1e9, 1),
    }
    if "spark" in found:
        spark = found["spark"]
        more = spark["read_and_shuffle"]["wall_s"] - spark["read_laid_out"]["wall_s"]
        out["shuffle_gb"] = round(spark["shuffle_bytes_per_row"] * MILLION * ROWS / 1e9, 1)
        out["shuffle_core_hours"] = round(
            2 * max(more, 0.0) / spark["rows_moved"] * MILLION * ROWS / 3600.0, 2
        )
    return out


if __name__ == "__main__":
    main()
