"""A fleet on Apache Spark 4: data sets in batch, streams with state; the extra ``spark``.

Both run the steps of `surefix.pipelines` and give their numbers to the last bit. surefix must be
installed where Spark's Python workers run.
"""

from __future__ import annotations

from surefix.fleet.spark_batch import clean_tracks, is_laid_out
from surefix.fleet.spark_stream import stream_tracks

__all__ = ["clean_tracks", "is_laid_out", "stream_tracks"]
