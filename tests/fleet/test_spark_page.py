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


PLACES = ("tracks.parquet", "cleaned.parquet", "incoming", "outgoing", "notes")


def run(name, folder):
    """Run a program of the page, its files in a folder: Java does not follow a change of it."""
    (text,) = [b.text for b in blocks(ROOT / "docs" / "fleet.md") if b.info == f"file={name}"]
    for place in PLACES:
        text = text.replace(f'"{place}"', repr(str(folder / place)))
    exec(compile(text, name, "exec"), {})


def test_the_batch_of_the_page_runs(spark, tmp_path):
    table = tracks(2)
    table.to_pandas().to_parquet(tmp_path / "tracks.parquet")
    run("batch.py", tmp_path)
    assert len(pd.read_parquet(tmp_path / "cleaned.parquet")) == table.num_rows


def test_the_stream_of_the_page_runs(spark, tmp_path):
    (tmp_path / "incoming").mkdir()
    run("stream.py", tmp_path)
    assert (tmp_path / "outgoing" / "_spark_metadata").exists()
    assert (tmp_path / "notes" / "metadata").exists()
