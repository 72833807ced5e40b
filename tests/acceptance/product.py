"""surefix run as its users run it, and logs to run it on."""

from __future__ import annotations

import contextlib
import io
import json
import subprocess
import sys
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
from numpy.lib.stride_tricks import sliding_window_view

from surefix.cli import main
from surefix.types import FloatArray

START = 1_700_000_000.0
METRES_PER_DEGREE = 111_195.0
FIXED = [
    *("time", "x", "y", "z", "vx", "vy", "vz", "sigma_x", "sigma_y", "sigma_z"),
    *("verdict", "weight", "innovation_sigma", "reason"),
]
VERDICTS = {"used", "downweighted", "rejected", "missing", "duplicate", "edited"}
PROGRAM = (sys.executable, "-W", "error", "-c", "from surefix.cli import main; main()")


class Done(NamedTuple):
    """How a command ended, and what it said."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


def surefix(*words: object) -> Done:
    """Run a command in this process; a warning inside it is an internal error."""
    out, err = io.StringIO(), io.StringIO()
    before, code = sys.argv, 0
    sys.argv = ["surefix", *(str(word) for word in words)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        sys.argv = before
    return Done(code, out.getvalue(), err.getvalue())


def process(*words: object, **how: Any) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own."""
    command = [*PROGRAM, *(str(word) for word in words)]
    how = {"capture_output": True, "text": True, "timeout": 120, **how}
    return subprocess.run(command, check=False, **how)


def clean(*words: object) -> Done:
    """Run `surefix clean`, which must succeed without a word on stderr."""
    done = surefix("clean", *words)
    assert done.code == 0, done.err
    assert not done.err, done.err
    return done


def told_in_one_line(done: Done | subprocess.CompletedProcess[str]) -> str:
    """Return the one line on stderr of a command that failed as it should."""
    code, err = (done.code, done.err) if isinstance(done, Done) else (done.returncode, done.stderr)
    assert code in (1, 2), err
    assert err.startswith("surefix: ")
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    assert "internal error" not in err
    return err


def read(path: Path) -> pd.DataFrame:
    """Rows of an output file."""
    if path.suffix == ".parquet":
        return pq.read_table(path).to_pandas()
    return pd.read_csv(path)


def write(path: Path, columns: dict[str, Any]) -> Path:
    """Write a log; numbers with every digit, NaN as nothing."""
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def survey(
    n: int = 300, *, seed: int = 1, interval: float = 1.0, sigma: float = 0.5
) -> dict[str, FloatArray]:
    """Fixes of a vehicle that weaves along at a little more than 1 m/s."""
    rng = np.random.default_rng(seed)
    time = START + interval * np.arange(n)
    elapsed = time - START
    return {
        "time": time,
        "x": elapsed + 20.0 * np.sin(elapsed / 50.0) + rng.normal(0, sigma, n),
        "y": 0.3 * elapsed + 15.0 * np.cos(elapsed / 70.0) + rng.normal(0, sigma, n),
        "z": -100.0 - 5.0 * np.sin(elapsed / 90.0) + rng.normal(0, sigma, n),
    }


def geographic(
    log: dict[str, FloatArray], latitude: float, longitude: float
) -> dict[str, FloatArray]:
    """Put a local log on the globe, near enough."""
    east = METRES_PER_DEGREE * np.cos(np.radians(latitude))
    lon = longitude + log["x"] / east
    return {
        "time": log["time"],
        "lat": latitude + log["y"] / METRES_PER_DEGREE,
        "lon": (lon + 180.0) % 360.0 - 180.0,
        "depth": -log["z"],
    }


def local(lat: FloatArray, lon: FloatArray) -> FloatArray:
    """East and north of the middle of a small area, m; worked out apart from surefix."""
    middle = np.nanmedian(lat), np.nanmedian(lon)
    east = (lon - middle[1]) * METRES_PER_DEGREE * np.cos(np.radians(middle[0]))
    return np.column_stack([east, (lat - middle[0]) * METRES_PER_DEGREE])


def off_the_line(time: FloatArray, place: FloatArray, reach: int = 7) -> FloatArray:
    """Distance of each fix from the Theil–Sen line through its neighbours, ±``reach`` fixes."""
    n = len(time)
    squares = np.zeros(n)
    for i in range(n):
        near = np.r_[max(0, i - reach) : i, i + 1 : min(n, i + reach + 1)]
        a, b = np.triu_indices(len(near), 1)
        t = time[near] - time[i]
        for axis in place.T:
            y = axis[near]
            slope = np.median((y[b] - y[a]) / (t[b] - t[a]))
            squares[i] += (axis[i] - np.median(y - slope * t)) ** 2
    return np.sqrt(squares)


def running_median(values: FloatArray, reach: int = 7) -> FloatArray:
    """Median over ±``reach`` values."""
    wide = np.pad(values, reach, constant_values=np.nan)
    return np.nanmedian(sliding_window_view(wide, 2 * reach + 1), axis=1)


def step_speeds(frame: pd.DataFrame) -> FloatArray:
    """Horizontal speed from one row to the next that is later, m/s."""
    steps = np.diff(frame[["time", "x", "y"]].to_numpy(), axis=0)
    later = steps[:, 0] > 0.0
    return np.hypot(*steps[later, 1:].T) / steps[later, 0]


def sentence(body: str) -> str:
    """NMEA 0183 sentence with its checksum and line end.

    >>> sentence("GPGGA,")
    '$GPGGA,*7A\\r\\n'
    """
    return f"${body}*{reduce(xor, body.encode(), 0):02X}\r\n"


def gga(time: str, lat: float, lon: float, *, talker: str = "GP", height: float = 2.0) -> str:
    """GGA of one position; ``time`` is hhmmss."""
    ns, ew = "NS"[lat < 0], "EW"[lon < 0]
    lat, lon = abs(lat), abs(lon)
    latitude = f"{int(lat):02d}{lat % 1 * 60:010.7f}"
    longitude = f"{int(lon):03d}{lon % 1 * 60:010.7f}"
    return sentence(
        f"{talker}GGA,{time},{latitude},{ns},{longitude},{ew},1,09,0.9,{height:.2f},M,40.0,M,,"
    )


def zda(time: str, day: int, month: int, year: int) -> str:
    """ZDA of one instant; ``time`` is hhmmss."""
    return sentence(f"GPZDA,{time},{day:02d},{month:02d},{year},00,00")
