from __future__ import annotations

import io

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pytest

from surefix.io.write_csv import write_table


def written(table: pa.Table) -> str:
    file = io.BytesIO()
    write_table(file, table, header=True)
    return file.getvalue().decode()


@pytest.mark.parametrize(("name", "decimals"), [("time", 6), ("lat", 9), ("weight", 4), ("x", 4)])
@pytest.mark.parametrize("size", [1e-7, 1e-3, 1.0, 3e2, 1e6, 1.7e9, 1e12])
def test_numbers_are_rounded_and_read_back(name: str, decimals: int, size: float) -> None:
    random = np.random.default_rng([decimals, int(np.log10(size)) + 9])
    half = np.round(random.normal(0.0, size, 2000), decimals) + 0.5 * 10.0**-decimals
    values = pa.array(np.concatenate([random.normal(0.0, size, 20_000), half, np.arange(-9.0, 9)]))
    text = written(pa.table({name: values}))
    read = pacsv.read_csv(io.BytesIO(text.encode()))[name].to_numpy()
    meant = pc.add(pc.round(values, decimals), 0.0).to_numpy()
    ulp = np.spacing(np.abs(meant))  # the rounded number itself may be one off its own decimals
    assert (np.abs(read - meant) <= ulp).all()
    cells = text.split("\n")[1:-1]
    assert "-0" not in cells
    if size * 10.0**decimals < 1e15:  # else as the library writes them
        assert np.mean(read == meant) > 0.999
        fractions = [cell.split(".")[1] for cell in cells if "." in cell]
        assert max(map(len, fractions), default=0) <= decimals
        assert not any(part.endswith("0") for part in fractions)


def test_unusual_cells() -> None:
    table = pa.table(
        {
            "x": pa.array([np.inf, -0.00001, None, np.nan, 1e300, -12.5]),
            "single": pa.array([0.1, 1 / 3, None, 2.0, -1.5, 16.5], pa.float32()),
            "huge": pa.array([1e308, 0.5, None, 1.0, 2.0, 3.0]),
            "row": pa.array([0, -(2**62), None, 10, 7, 100]),
            "many": pa.array([2**64 - 1, 1, 2, None, 4, 5], pa.uint64()),
            "right": pa.array([True, False, None, True, True, True]),
            "large": pa.array(["a", "=b", None, "c", "d", "e"], pa.large_string()),
            "said": pa.array(['a "b"', "ü, °", None, "", "=1+1", "two\nlines"]),
            "none": pa.array([None] * 6, pa.string()),
        }
    )
    assert written(table).split("\n") == [
        "x,single,huge,row,many,right,large,said,none",
        'inf,0.1,1e+308,0,18446744073709551615,true,"a","a ""b""",',
        '0,0.3333,0.5,-4611686018427387904,1,false,"\'=b","ü, °",',
        ",,,,2,,,,",
        ',2,1,10,,true,"c","",',
        '1e+300,-1.5,2,7,4,true,"d","\'=1+1",',
        '-12.5,16.5,3,100,5,true,"e","two lines",',
        "",
    ]


def test_many_rows_are_the_rows_one_by_one() -> None:
    n = 20_001
    random = np.random.default_rng(3)
    said = np.array([f"{k} σ" for k in random.integers(0, 3000, n)])
    table = pa.table({"x": random.normal(0.0, 9.0, n), "said": said, "row": np.arange(n)})
    parts = [written(table.slice(k, 1)).split("\n")[1] for k in range(0, n, 97)]
    assert written(table).split("\n")[1:-1:97] == parts
    assert len(written(table).split("\n")) == n + 2
