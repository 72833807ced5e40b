"""A fleet gives what single logs give, goes on where it was, and isolates what is bad."""

import os

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
import pytest

import surefix
from acceptance.product import surefix as run
from fleet.tracks import expected, in_time, one, tracks
from surefix.fleet.ledger import open_ledger
from surefix.fleet.options import FleetOptions
from surefix.fleet.outcome import COLUMNS
from surefix.fleet.run import clean_fleet

FAST = FleetOptions(clean=surefix.CleanOptions(method="igg3"))


@pytest.fixture
def logs(tmp_path):
    table = tracks(3)
    for place, name in (("a", "t000"), ("b", "t001"), ("c", "t002")):
        (tmp_path / "in" / place).mkdir(parents=True)
        pacsv.write_csv(one(table, name), tmp_path / "in" / place / "usbl.csv")
    return tmp_path / "in"


def track_set(folder, table, split=200):
    folder.mkdir(exist_ok=True)
    pq.write_table(table.slice(0, split), folder / "a.parquet")
    pq.write_table(table.slice(split), folder / "b.parquet")
    return folder


def result(place):
    parts = sorted((place / "tracks").glob("*.parquet"))
    return pa.concat_tables([pq.read_table(part) for part in parts])


def stamps(place):
    files = [path for path in place.rglob("*.*") if not path.name.startswith(("summary", "fleet"))]
    return {str(path.relative_to(place)): path.stat().st_mtime_ns for path in files}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_every_log_has_the_file_that_clean_writes(logs, tmp_path, suffix):
    done = clean_fleet([logs], tmp_path / "out", FleetOptions(clean=FAST.clean, suffix=suffix))
    assert (done.cleaned, done.failed, done.units) == (3, 0, 3)
    for place in "abc":
        alone = tmp_path / f"alone{suffix}"
        run("clean", logs / place / "usbl.csv", "--method", "igg3", "-o", alone)
        got = tmp_path / "out" / f"{place}-usbl{suffix}"
        if suffix == ".csv":
            assert got.read_bytes() == alone.read_bytes()
        else:
            assert pq.read_table(got).equals(pq.read_table(alone))


@pytest.mark.parametrize("mode", ["offline", "realtime"])
@pytest.mark.parametrize("mixed", [False, True])
def test_every_track_has_the_rows_of_a_call_on_it_alone(tmp_path, mode, mixed):
    table = in_time(tracks(5)) if mixed else tracks(5)
    options = surefix.CleanOptions(method="igg3", mode=mode)
    place = tmp_path / "out"
    done = clean_fleet([track_set(tmp_path / "in", table)], place, FleetOptions(clean=options))
    assert (done.cleaned, done.failed, done.fixes) == (5, 0, table.num_rows)
    got = result(place)
    for name in sorted(set(table.column("track_id").to_pylist())):
        assert one(got, name).equals(expected(table, name, method="igg3", mode=mode))
    assert not (place / ".arranged").exists()


def test_the_default_is_several_hypotheses_here_too(tmp_path):
    table = tracks(1)
    clean_fleet([track_set(tmp_path / "in", table)], tmp_path / "out")
    assert one(result(tmp_path / "out"), "t000").equals(expected(table, "t000"))


def test_summary_has_a_row_for_each(tmp_path):
    table = tracks(3)
    place = tmp_path / "out"
    clean_fleet([track_set(tmp_path / "in", table)], place, FAST)
    summary, text = pd.read_parquet(place / "summary.parquet"), pd.read_csv(place / "summary.csv")
    assert summary.columns.tolist() == text.columns.tolist() == list(COLUMNS)
    assert summary.name.tolist() == ["t000", "t001", "t002"]
    got = result(place).to_pandas()
    for row in summary.itertuples():
        mine = got[got.track_id == row.name]
        counted = mine.verdict.value_counts()
        assert (row.fixes, row.rejected) == (len(mine), counted.get("rejected", 0))
        assert (row.start, row.end) == (mine.time.min(), mine.time.max())
        assert (place / row.output).is_file()


def bad_set(folder):
    """Three tracks; the times of the second are words, and five rows have no track."""
    table = tracks(3)
    names = np.array(table.column("track_id").to_pylist(), dtype=object)
    times = [str(v) for v in table.column("time").to_pylist()]
    times = ["yesterday" if n == "t001" else t for n, t in zip(names, times, strict=True)]
    names[-5:] = None
    table = table.set_column(0, "track_id", pa.array(names, pa.string()))
    return track_set(folder, table.set_column(1, "time", pa.array(times)))


def test_a_bad_track_is_told_and_the_others_go_on(tmp_path):
    place = tmp_path / "out"
    done = clean_fleet([bad_set(tmp_path / "in")], place, FAST)
    assert (done.cleaned, done.failed) == (2, 2)
    rows = pd.read_csv(place / "summary.csv", keep_default_na=False).set_index("name")
    assert rows.status.to_dict() == {
        "t000": "cleaned",
        "t001": "failed",
        "t002": "cleaned",
        "None": "failed",
    }
    assert "time" in rows.loc["t001", "given"]
    assert rows.loc["t001", "expected"]
    assert rows.loc["t001", "remedy"]
    assert rows.loc["None", "given"] == "5 rows without track_id"
    assert set(result(place).column("track_id").to_pylist()) == {"t000", "t002"}
    again = clean_fleet([tmp_path / "in"], place, FAST)
    assert (again.kept, again.failed) == (again.units, 2)


def test_a_bad_log_is_told_and_the_others_go_on(logs, tmp_path):
    (logs / "bad.csv").write_text("u,v\n1,2\n")
    (logs / "torn.parquet").write_bytes(b"PAR1 torn")
    done = clean_fleet([logs, logs / "none.csv"], tmp_path / "out", FAST)
    assert (done.cleaned, done.failed) == (3, 3)
    said = {outcome.name.rpartition(os.sep)[2]: outcome for outcome in done.failures}
    assert "no time column" in said["bad.csv"].given
    assert said["bad.csv"].remedy
    assert "not a sound Parquet file" in said["torn.parquet"].given
    assert "No such file" in said["none.csv"].given


def test_what_is_done_is_not_done_again(logs, tmp_path):
    clean_fleet([logs], tmp_path / "out", FAST)
    before = stamps(tmp_path / "out")
    again = clean_fleet([logs], tmp_path / "out", FAST)
    assert (again.kept, again.units, again.outdated) == (3, 3, 0)
    assert stamps(tmp_path / "out") == before


def test_a_changed_log_is_done_again_alone(logs, tmp_path):
    clean_fleet([logs], tmp_path / "out", FAST)
    before = stamps(tmp_path / "out")
    pacsv.write_csv(one(tracks(1, rows=90), "t000"), logs / "b" / "usbl.csv")
    again = clean_fleet([logs], tmp_path / "out", FAST)
    assert (again.kept, again.outdated) == (2, 1)
    after = stamps(tmp_path / "out")
    assert {name for name in after if after[name] != before[name]} == {"b-usbl.parquet"}
    assert pq.read_metadata(tmp_path / "out" / "b-usbl.parquet").num_rows == 90


def test_a_new_log_leaves_the_others_and_their_names(logs, tmp_path):
    clean_fleet([logs / "a" / "usbl.csv"], tmp_path / "out", FAST)
    again = clean_fleet([logs], tmp_path / "out", FAST)
    assert (again.kept, again.cleaned) == (1, 3)
    names = {path.name for path in (tmp_path / "out").glob("*usbl*")}
    assert names == {"usbl.parquet", "b-usbl.parquet", "c-usbl.parquet"}


def test_other_options_do_everything_again(logs, tmp_path):
    clean_fleet([logs], tmp_path / "out", FAST)
    other = FleetOptions(clean=surefix.CleanOptions(method="huber"), suffix=".csv")
    again = clean_fleet([logs], tmp_path / "out", other)
    assert (again.kept, again.outdated) == (0, 3)
    assert not list((tmp_path / "out").glob("*usbl.parquet"))


def test_an_output_that_was_removed_is_made_again(logs, tmp_path):
    clean_fleet([logs], tmp_path / "out", FAST)
    (tmp_path / "out" / "a-usbl.parquet").unlink()
    assert clean_fleet([logs], tmp_path / "out", FAST).kept == 2


def test_parts_of_a_data_set_that_shrank_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr("surefix.fleet.dataset._UNIT_ROWS", ((np.inf, 50),))
    clean_fleet([track_set(tmp_path / "in", tracks(4))], tmp_path / "out", FAST)
    again = clean_fleet([track_set(tmp_path / "in", tracks(2))], tmp_path / "out", FAST)
    assert again.cleaned == 2
    assert result(tmp_path / "out").num_rows == tracks(2).num_rows


def test_logs_and_a_data_set_in_one_folder_do_not_remove_each_other(logs, tmp_path):
    data, place = track_set(tmp_path / "set", tracks(2)), tmp_path / "out"
    clean_fleet([logs], place, FAST)
    clean_fleet([data], place, FAST)
    before = stamps(place)
    assert len(before) == 4
    assert clean_fleet([logs], place, FAST).kept == 3
    assert clean_fleet([data], place, FAST).kept == 1
    assert stamps(place) == before


def test_supporting_logs_stand_beside_each(logs, tmp_path):
    for place in "ab":
        time = pd.read_csv(logs / place / "usbl.csv").time
        pd.DataFrame({"time": time, "depth": 5.0 + 0.1 * np.arange(len(time))}).to_csv(
            logs / place / "depth.csv", index=False
        )
    paths = [logs / place / "usbl.csv" for place in "abc"]
    options = FleetOptions(clean=FAST.clean, beside={"depth": "depth.csv"})
    done = clean_fleet(paths, tmp_path / "out", options)
    assert (done.cleaned, done.failed) == (2, 1)
    assert "depth.csv" in done.failures[0].given
    assert pd.read_parquet(tmp_path / "out" / "a-usbl.parquet").z.notna().all()


def test_two_fleets_do_not_share_a_folder(logs, tmp_path):
    with (
        open_ledger(tmp_path / "out"),
        pytest.raises(surefix.OutputError, match="another fleet is at work"),
    ):
        clean_fleet([logs], tmp_path / "out", FAST)


def test_what_makes_no_sense_is_refused(logs, tmp_path):
    data = track_set(tmp_path / "set", tracks(1))
    for inputs, options, said in (
        ([data, logs], FAST, "beside other inputs"),
        ([data], FleetOptions(clean=surefix.CleanOptions(every_s=1.0)), "leave out every_s"),
        ([data], FleetOptions(beside={"depth": "d.csv"}), "beside a data set"),
    ):
        with pytest.raises(surefix.OptionsError, match=said):
            clean_fleet(inputs, tmp_path / "out", options)
    (tmp_path / "empty").mkdir()
    with pytest.raises(surefix.OptionsError, match="no log there"):
        clean_fleet([tmp_path / "empty"], tmp_path / "out", FAST)
    with pytest.raises(surefix.OptionsError, match="jobs = 0"):
        FleetOptions(jobs=0)
    parquet = tmp_path / "set2" / "log.parquet"
    parquet.parent.mkdir()
    pq.write_table(one(tracks(1), "t000"), parquet)
    with pytest.raises(surefix.OptionsError, match="also an input"):
        clean_fleet([parquet], parquet.parent, FAST)
    assert parquet.is_file()
