"""One Spark for all tests that need it."""

import logging
import os
import sys

import pytest

from needs import package, tool


@pytest.fixture(scope="session")
def spark(tmp_path_factory):
    """A session of Spark in local mode on two threads, as CI runs it."""
    tool("java")
    sql = package("pyspark.sql")
    places = [path for path in (os.environ.get("PYTHONPATH"), *sys.path) if path]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYSPARK_PYTHON", sys.executable)
        patch.setenv("PYTHONPATH", os.pathsep.join(places))  # Spark's Python workers inherit it
        patch.setenv("SPARK_LOCAL_IP", "127.0.0.1")
        logging.getLogger("py4j").setLevel(logging.ERROR)
        folder = tmp_path_factory.mktemp("spark")
        session = (
            sql.SparkSession.builder.master("local[2]")
            .config("spark.ui.enabled", "false")
            .config("spark.driver.memory", "1g")
            .config("spark.sql.shuffle.partitions", "1")  # each takes a Python process of its own
            .config("spark.sql.warehouse.dir", str(folder / "tables"))
            .config("spark.local.dir", str(folder / "local"))
            .config(
                "spark.sql.streaming.stateStore.providerClass",
                "org.apache.spark.sql.execution.streaming.state.RocksDBStateStoreProvider",
            )
            .getOrCreate()
        )
        session.sparkContext.setLogLevel("OFF")
        yield session
        session.stop()
