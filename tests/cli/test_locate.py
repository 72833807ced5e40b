"""The command that turns ranges into positions."""

import json

import numpy as np
import pandas as pd
import pytest

from acceptance.product import clean, read, surefix, told_in_one_line
from filters.sight_worlds import FLAT, ranges


@pytest.fixture
def place(tmp_path):
    world = ranges(4, FLAT, n=60)
    columns = {f"r{i}": world.sights.z[:, i] for i in range(3)}
    pd.DataFrame({"time": world.sights.time, **columns}).to_csv(tmp_path / "log.csv", index=False)
    sights = [
        f'[[sight]]\nkind = "range"\ncolumn = "r{i}"\nat = {FLAT[i].tolist()}\nsigma = 0.05\n'
        for i in range(3)
    ]
    (tmp_path / "survey.toml").write_text("process = 0.02\n" + "".join(sights))
    return tmp_path


def test_positions_and_verdicts_are_written_and_read_by_clean(place):
    out, why = place / "positions.csv", place / "verdicts.parquet"
    arguments = ["locate", place / "log.csv", "--survey", place / "survey.toml", "-o", out]
    told = json.loads(surefix(*arguments, "--verdicts", why, "--json").out)
    assert told["positions"] == 60
    assert told["written"] == [str(out), str(why)]
    rows = read(out)
    names = ["time", "x", "y", "sigma_x", "sigma_y", "covariance_xy", "row"]
    assert rows.columns.tolist() == names
    assert len(rows) == 60
    verdicts = read(why)
    assert len(verdicts) == 180
    rejected = verdicts[verdicts["verdict"] == "rejected"]
    assert len(rejected) == told["sights"]["r0"].get("rejected", 0) + sum(
        told["sights"][name].get("rejected", 0) for name in ("r1", "r2")
    )
    assert rejected["reason"].str.contains("σ off").all()
    assert np.isfinite(verdicts["innovation_sigma"]).all()
    cleaned = clean(out, "--json").json
    assert cleaned["noise"][0]["source"] == "declared"


def test_nothing_is_written_where_something_is_wrong(place):
    log, survey = place / "log.csv", place / "survey.toml"
    for arguments, said in (
        ((log, "--survey", survey, "-o", log), "also an input"),
        ((log, "--survey", survey, "-o", place / "a.gpx"), "csv or .parquet"),
        ((log, "--survey", place / "none.toml", "-o", place / "a.csv"), "none.toml"),
        ((log, "--survey", survey, "-o", place / "a.csv", "--verdicts", place / "a.csv"), "twice"),
    ):
        assert said in told_in_one_line(surefix("locate", *arguments))
    assert sorted(p.name for p in place.iterdir()) == ["log.csv", "survey.toml"]
