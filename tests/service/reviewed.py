"""A review of a small log, for the tests of its parts."""

import time
from pathlib import Path

import numpy as np
import pandas as pd

from acceptance.product import geographic, survey
from surefix.pipelines.inputs import open_inputs
from surefix.pipelines.options import CleanOptions
from surefix.service.review import begin_review

WILD = (40, 111, 171)
"""Records that are wild."""


def log(place: Path, count: int = 300, *, globe: bool = False) -> Path:
    """Write a log with three wild fixes, a missing one, a copy, and rows out of order."""
    columns = pd.DataFrame(survey(count))[["time", "x", "y", "z"]]
    columns.loc[[40, 111, 170], "x"] += 60.0
    columns.loc[77, ["x", "y", "z"]] = np.nan
    columns = pd.concat([columns[:151], columns[150:]], ignore_index=True)
    columns.iloc[[50, 52]] = columns.iloc[[52, 50]].to_numpy()
    if globe:
        columns = pd.DataFrame(geographic({name: columns[name] for name in columns}, 60.0, 5.0))
    columns.to_csv(place, index=False)
    return place


def begun(edits: Path, *logs: Path, require_checksum: bool = True, **options: object):
    """Begin a review."""

    def opener(told):
        return open_inputs(logs, require_checksum=require_checksum, progress=told)

    return begin_review(opener, CleanOptions(**options), edits, logs)


def again(review) -> None:
    """Clean again, and wait."""
    assert review.begin()
    deadline = time.monotonic() + 60.0
    while review.progress()["busy"]:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def row_of(review, number: int, sensor: int = 0) -> np.ndarray:
    """Row of the result that is of a record of the log."""
    shown = review.last.shown
    return np.flatnonzero((shown.row == number) & (shown.sensor == sensor))
