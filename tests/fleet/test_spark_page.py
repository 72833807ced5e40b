"""The programs for Spark on the page about fleets run as they stand."""

import pandas as pd
import pytest

from docs.pages import ROOT, blocks
from fleet.tracks import tracks

pytestmark = [
    pytest.mark.xdist_group("spark"),
    pytest.mark.filterwarnings("ignore:PySpark does not yet fully support pandas:FutureWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture
def programs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = [b for b in blocks(ROOT / "docs" / "fleet.md") if b.info.startswith("file=")]
    return {block.info.removeprefix("file="): block.text for block in found}


def test_the_batch_of_the_page_runs(spark, programs, tmp_path):
    table = tracks(2)
    table.to_pandas().to_parquet(tmp_path / "tracks.parquet")
    exec(compile(programs["batch.py"], "batch.py", "exec"), {})
    assert len(pd.read_parquet(tmp_path / "cleaned.parquet")) == table.num_rows


def test_the_stream_of_the_page_runs(spark, programs, tmp_path):
    (tmp_path / "incoming").mkdir()
    exec(compile(programs["stream.py"], "stream.py", "exec"), {})
    assert (tmp_path / "outgoing" / "_spark_metadata").exists()
    assert (tmp_path / "notes" / "metadata").exists()
