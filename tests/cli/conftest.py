"""Logs that the command line is tried on."""

import numpy as np
import pandas as pd
import pytest

from acceptance.product import geographic, survey, write


@pytest.fixture
def log(tmp_path):
    """A metric log with wild fixes, a missing one, a copy, and rows out of order."""
    columns = pd.DataFrame(survey(300))
    columns.loc[[40, 111, 203], "x"] += 60.0
    columns.loc[77, ["x", "y", "z"]] = np.nan
    columns = pd.concat([columns[:151], columns[150:]], ignore_index=True)
    columns.iloc[[250, 252]] = columns.iloc[[252, 250]].to_numpy()
    columns.to_csv(tmp_path / "dive.csv", index=False)
    return tmp_path / "dive.csv"


@pytest.fixture
def globe(tmp_path):
    return write(tmp_path / "globe.csv", geographic(survey(120), 60.0, 5.0))
