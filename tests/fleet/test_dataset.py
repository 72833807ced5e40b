"""Where tracks lie in a data set, and units of whole ones."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import surefix
from fleet.tracks import in_time, tracks
from surefix.fleet import dataset
from surefix.fleet.arrange import arrange, arranged
from surefix.fleet.dataset import index, read_unit, schema_of, units

TRACK = "track_id"


def written(folder, table, cuts, size=40):
    folder.mkdir(exist_ok=True)
    bounds = [0, *cuts, table.num_rows]
    for k in range(len(cuts) + 1):
        part = table.slice(bounds[k], bounds[k + 1] - bounds[k])
        pq.write_table(part, folder / f"{k:02d}.parquet", row_group_size=size)
    return [str(path) for path in sorted(folder.glob("*.parquet"))]


def found(paths, root):
    return index(paths, str(root), TRACK, pa.string())


def read(data, root):
    return [read_unit(unit, str(root), TRACK, pa.string()) for unit in units(data)]


@pytest.mark.parametrize("cuts", [[], [61], [60], [30, 90, 91, 200], [0, 0]])
def test_units_hold_whole_tracks_in_their_order(tmp_path, monkeypatch, cuts):
    monkeypatch.setattr(dataset, "_UNIT_ROWS", ((np.inf, 100),))
    table = tracks(6)
    data = found(written(tmp_path, table, cuts), tmp_path)
    assert data.laid_out
    assert data.tracks.to_pylist() == [f"t{k:03d}" for k in range(6)]
    assert data.lengths.tolist() == [60 + 7 * k for k in range(6)]
    parts = read(data, tmp_path)
    assert len(parts) == 3
    assert pa.concat_tables(parts).equals(table)
    seen = [set(part.column(TRACK).to_pylist()) for part in parts]
    assert sum(len(names) for names in seen) == 6


def test_an_appended_file_leaves_earlier_units_alone(tmp_path):
    table = tracks(40, rows=30)
    paths = written(tmp_path, table, [2_000])
    before = units(found(paths[:1], tmp_path))
    after = units(found(paths, tmp_path))
    assert after[: len(before) - 1] == before[:-1]


@pytest.mark.parametrize("buckets", [1, 4])
def test_mixed_tracks_are_brought_together_in_the_order_of_arrival(tmp_path, monkeypatch, buckets):
    table = in_time(tracks(6))
    monkeypatch.setattr("surefix.fleet.arrange._BUCKET_ROWS", table.num_rows // buckets)
    monkeypatch.setattr("surefix.fleet.arrange._READ_ROWS", 77)
    data = found(written(tmp_path / "in", table, [100, 101, 333]), tmp_path)
    assert not data.laid_out
    target = arranged(data, tmp_path / "out")
    arrange(data, target, str(tmp_path), TRACK, pa.string())
    got = pa.concat_tables(read(target, tmp_path))
    parts = [table.filter(pa.compute.equal(table[TRACK], t)) for t in target.tracks.to_pylist()]
    assert got.equals(pa.concat_tables(parts))
    assert len(target.files) >= min(buckets, 2)
    assert found([file.path for file in target.files], tmp_path).laid_out


def test_files_of_different_columns_are_brought_together(tmp_path):
    """A column may begin in a later file, and whole numbers may become broken ones."""
    table = in_time(tracks(3))
    late = table.append_column("z", pa.array(np.arange(table.num_rows) * 0.5))
    whole = table.set_column(2, "x", pa.array(np.arange(table.num_rows)))
    for folder, first, then in (("late", table, late), ("whole", whole, table)):
        place = tmp_path / folder
        place.mkdir()
        pq.write_table(first.slice(0, 90), place / "0.parquet")
        pq.write_table(then.slice(90), place / "1.parquet")
        data = found([str(place / "0.parquet"), str(place / "1.parquet")], place)
        target = arranged(data, place / "out")
        arrange(data, target, str(place), TRACK, pa.string())
        both = pa.concat_tables([first.slice(0, 90), then.slice(90)], promote_options="permissive")
        order = pa.compute.index_in(both[TRACK], value_set=target.tracks).to_numpy()
        (got,) = read(target, place)
        assert got.equals(both.take(pa.array(np.argsort(order, kind="stable"))))


def test_files_that_do_not_fit_together_are_told(tmp_path):
    table = in_time(tracks(3))
    words = table.set_column(2, "x", pa.array(["east"] * table.num_rows))
    paths = [str(tmp_path / "0.parquet"), str(tmp_path / "1.parquet")]
    pq.write_table(table.slice(0, 90), paths[0])
    pq.write_table(words.slice(90), paths[1])
    data = found(paths, tmp_path)
    with pytest.raises(surefix.InputError, match=r"do not fit together.*one kind of values"):
        arrange(data, arranged(data, tmp_path / "out"), str(tmp_path), TRACK, pa.string())


def test_the_path_may_name_the_track_and_keeps_its_zeros(tmp_path):
    table = tracks(2)
    for name in ("007", "a%20b"):
        folder = tmp_path / "day=1" / f"track_id={name}"
        folder.mkdir(parents=True)
        pq.write_table(table.slice(0, 60).drop_columns([TRACK]), folder / "part-0.parquet")
    paths = [str(path) for path in tmp_path.rglob("*.parquet")]
    assert schema_of(paths, str(tmp_path), TRACK).field(TRACK).type == pa.string()
    data = found(paths, tmp_path)
    assert data.tracks.to_pylist() == ["007", "a b"]
    (part,) = read(data, tmp_path)
    assert part.column(TRACK).to_pylist() == ["007"] * 60 + ["a b"] * 60


def test_a_damaged_file_is_told_and_the_others_are_read(tmp_path):
    paths = written(tmp_path, tracks(4), [100])
    (tmp_path / "02.parquet").write_bytes(b"PAR1 torn")
    data = found([*paths, str(tmp_path / "02.parquet")], tmp_path)
    assert [path.endswith("02.parquet") for path, _ in data.bad] == [True]
    assert "not a sound Parquet file" in str(data.bad[0][1])
    assert data.lengths.sum() == tracks(4).num_rows
    with pytest.raises(surefix.InputError, match="not a sound"):
        schema_of([str(tmp_path / "02.parquet")], str(tmp_path), TRACK)
