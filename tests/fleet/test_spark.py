"""On Spark in local mode: the numbers of one machine, to the last bit.

Spark starts slowly: all tests share a session, and there are few of them.
"""

import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import surefix
from fleet.tracks import START, expected, in_time, one, tracks
from surefix.fleet.spark import clean_tracks, is_laid_out, stream_tracks
from surefix.fleet.spark_batch import _whole

pytestmark = [
    pytest.mark.xdist_group("spark"),
    pytest.mark.filterwarnings("ignore:PySpark does not yet fully support pandas:FutureWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
SCHEMA = "track_id string, time double, x double, y double"
LIVE = {"mode": "realtime", "method": "igg3", "settle_rows": 40}
PROVIDER = "spark.sql.streaming.stateStore.providerClass"


def write(folder, table, *cuts):
    folder.mkdir(exist_ok=True)
    for k, (first, last) in enumerate(zip([0, *cuts], [*cuts, table.num_rows], strict=True)):
        part = table.slice(first, last - first)
        pq.write_table(part, folder / f"{k}.parquet", row_group_size=50)
    return str(folder)


def agree(found, table, **options):
    """Hold every track of a result against a call on its rows alone."""
    for name in sorted(set(table.column("track_id").to_pylist())):
        alone = expected(table, name, **options).sort_by("row")
        mine = one(found, name).sort_by("row")
        assert mine.column("error").null_count == mine.num_rows
        assert mine.drop_columns(["error"]).cast(alone.schema).equals(alone), name


def shuffles(frame):
    return "Exchange" in frame._jdf.queryExecution().executedPlan().toString()


@pytest.mark.parametrize("options", [{"method": "igg3"}, {"method": "huber", "mode": "realtime"}])
def test_tracks_that_are_laid_out_are_cleaned_without_a_shuffle(spark, tmp_path, options):
    table = tracks(5)
    frame = spark.read.parquet(write(tmp_path / "in", table, 60 + 67))
    assert is_laid_out(frame)
    cleaned = clean_tracks(frame, surefix.CleanOptions(**options))
    assert not shuffles(cleaned)
    agree(cleaned.toArrow(), table, **options)


def test_mixed_tracks_are_brought_together(spark, tmp_path):
    table = in_time(tracks(5))
    frame = spark.read.parquet(write(tmp_path / "in", table, 100))
    assert not is_laid_out(frame)
    cleaned = clean_tracks(frame, surefix.CleanOptions(method="igg3"))
    assert shuffles(cleaned)
    agree(cleaned.toArrow(), table, method="igg3")


def test_a_track_in_two_files_is_not_laid_out(spark, tmp_path):
    assert not is_laid_out(spark.read.parquet(write(tmp_path / "in", tracks(2), 30)))


def test_a_table_in_buckets_needs_no_shuffle(spark):
    table = tracks(4)
    frame = spark.createDataFrame(table)
    writer = frame.repartition(2, "track_id").write.bucketBy(2, "track_id")
    writer.sortBy("track_id", "time").saveAsTable("bucketed")
    stored = spark.table("bucketed")
    cleaned = clean_tracks(stored, surefix.CleanOptions(method="igg3"))
    assert not shuffles(cleaned)
    agree(cleaned.toArrow(), table, method="igg3")


def test_a_bad_track_is_one_row_that_says_why(spark, tmp_path):
    table = tracks(3)
    time = [str(v) for v in table.column("time").to_pylist()]
    time = ["yesterday" if 60 <= i < 127 else v for i, v in enumerate(time)]
    table = table.set_column(1, "time", pa.array(time))
    frame = spark.read.parquet(write(tmp_path / "in", table))
    found = clean_tracks(frame, surefix.CleanOptions(method="igg3"), shuffle=False).toArrow()
    bad = one(found, "t001").to_pylist()
    assert len(bad) == 1
    assert "expected" in bad[0]["error"]
    assert bad[0]["time"] is None
    assert found.num_rows == table.num_rows - 67 + 1


def test_a_broken_promise_fails_and_a_kept_one_does_not():
    table = tracks(3)
    pieces = [batch for k in range(0, 201, 50) for batch in table.slice(k, 50).to_batches()]
    assert pa.concat_tables(_whole(pieces, "track_id")).equals(table)
    with pytest.raises(surefix.InputError, match="t000 comes back after other tracks"):
        list(_whole(in_time(table).to_batches(), "track_id"))


def streamed(spark, folder, options, **how):
    """Let a stream run over what is there, and stop it: each call is a restart."""
    source = spark.readStream.schema(SCHEMA).option("maxFilesPerTrigger", 1)
    found = stream_tracks(source.parquet(str(folder / "in")), options, **how)
    query = (
        found.writeStream.format("parquet")
        .option("path", str(folder / "out"))
        .option("checkpointLocation", str(folder / "notes"))
        .trigger(availableNow=True)
        .start()
    )
    query.awaitTermination()


def arrive(folder, name, table):
    """A file appears whole, later than those before."""
    (folder / "in").mkdir(exist_ok=True)
    pq.write_table(table, folder / "draft")
    os.utime(folder / "draft", (START + name, START + name))
    (folder / "draft").rename(folder / "in" / f"{name}.parquet")


def test_a_stream_is_restarted_and_gives_the_numbers_of_one_machine(spark, tmp_path):
    table = tracks(4)
    late = table.slice(20, 1)  # of the first track
    usual = in_time(pa.concat_tables([table.slice(0, 20), table.slice(21)]))
    rng = np.random.default_rng(3)
    arrival = usual.column("time").to_numpy() + rng.uniform(0.0, 5.0, usual.num_rows)
    mixed = usual.take(pa.array(np.argsort(arrival)))
    assert (np.diff(mixed.column("time").to_numpy()) < -3.0).any()
    end = pa.table({"track_id": ["end"], "time": [START + 1e4], "x": [0.0], "y": [0.0]})
    half = mixed.num_rows // 2
    for name, part in enumerate([mixed.slice(0, half), mixed.slice(half)]):
        arrive(tmp_path, name, part)
        streamed(spark, tmp_path, surefix.CleanOptions(**LIVE), late_s=6.0, idle_s=200.0)
    early = spark.read.parquet(str(tmp_path / "out"))
    assert 0 < early.count() < usual.num_rows
    arrive(tmp_path, 2, pa.concat_tables([late, end]))
    streamed(spark, tmp_path, surefix.CleanOptions(**LIVE), late_s=6.0, idle_s=200.0)
    found = spark.read.parquet(str(tmp_path / "out")).toArrow()
    assert found.num_rows == table.num_rows
    agree(found, pa.concat_tables([usual, late]), **LIVE)
    verdicts = one(found, "t000").filter(pa.compute.equal(one(found, "t000")["row"], 59))
    assert verdicts.column("reason")[0].as_py().startswith("arrived after the fix of")


def test_what_a_stream_cannot_do_is_said_before_it_begins(spark, tmp_path):
    (tmp_path / "in").mkdir()
    live = surefix.CleanOptions(**LIVE)
    frame = spark.readStream.schema(SCHEMA).parquet(str(tmp_path / "in"))
    for given, options, said in (
        (frame, surefix.CleanOptions(), "expected mode realtime"),
        (frame.drop("track_id"), live, "no column track_id"),
        (frame.drop("x", "y"), live, "no position columns"),
        (frame.withColumn("time", frame.time.cast("string")), live, "a timestamp, or a number"),
    ):
        with pytest.raises(surefix.SurefixError, match=said):
            stream_tracks(given, options)
    kept = spark.conf.get(PROVIDER)
    spark.conf.unset(PROVIDER)
    spark.conf.set(PROVIDER, kept.replace("RocksDB", "HDFSBacked"))
    try:
        with pytest.raises(surefix.OptionsError, match="expected the state store of RocksDB"):
            stream_tracks(frame, live)
    finally:
        spark.conf.set(PROVIDER, kept)
