"""How fast logs are read and tracks written, on one core.

Run ``python bench/reading.py [--json FILE]``. Sentences or rows per second of processor time,
median of several rounds, through the doors that `surefix clean` uses. The NMEA log is simulated:
GGA, RMC, VTG and HDT at 10 Hz, all with checksums. Its speed with the kernel stands beside that
without it, where each line goes the way that only unusual lines go otherwise.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from measured import conclude
from surefix.io import nmea_lines
from surefix.io.nmea import checksum
from surefix.io.nmea_log import read_nmea
from surefix.io.nmea_scan import DECLINED, Lines, scan
from surefix.io.table import read_table
from surefix.io.writers import track_writer
from surefix.types import Reason, Track, Verdict, Verdicts

EPOCHS = 20_000
ROWS = 1_000_000
ROUNDS = 5


def main() -> None:
    """Print a row per format and direction."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--json", type=Path)
    options.add_argument("--rows", type=int, default=ROWS)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as name:
        conclude(list(_rows(Path(name), given.rows)), given.json)


def _rows(folder: Path, n: int) -> Iterator[dict[str, str]]:
    nmea = folder / "log.nmea"
    nmea.write_bytes(b"".join(sentences(EPOCHS)))
    count = 4 * EPOCHS
    fast = seconds(lambda: list(read_nmea(nmea)))
    nmea_lines.scan = _declined
    slow = seconds(lambda: list(read_nmea(nmea)))
    nmea_lines.scan = scan
    yield _row("read NMEA", count / fast, ratio=f"{slow / fast:.1f} × line by line")
    table = fixes(n)
    pacsv.write_csv(table, folder / "log.csv")
    pq.write_table(table, folder / "log.parquet")
    for kind in ("csv", "parquet"):
        taken = seconds(lambda kind=kind: list(read_table(folder / f"log.{kind}")))
        yield _row(f"read {kind}", n / taken)
    track, verdicts = result(n)
    for kind in ("csv", "parquet"):
        taken = seconds(lambda kind=kind: _write(folder / f"track.{kind}", track, verdicts))
        yield _row(f"write {kind}", n / taken)


def _row(what: str, rate: float, **more: str) -> dict[str, str]:
    return {"what": f"{what:14}", "per second": f"{rate:12,.0f}", **more}


def _declined(piece: bytes) -> Lines:
    lines = scan(piece)
    lines.code[:] = DECLINED
    return lines


def sentences(epochs: int) -> Iterator[bytes]:
    """GGA, RMC, VTG and HDT at 10 Hz, as a receiver writes them."""
    for k in range(epochs):
        hour, second = divmod(0.1 * k, 3600.0)
        minute, second = divmod(second, 60.0)
        clock = f"{int(hour):02d}{int(minute):02d}{second:05.2f}"
        place = f"54{10 + 1e-5 * k:010.7f},N,010{20 + 2e-5 * k:010.7f},E"
        for body in (
            f"GPGGA,{clock},{place},4,12,0.8,3.21,M,44.10,M,1.0,0001",
            f"GPRMC,{clock},A,{place},5.32,{k % 360:05.1f},010524,,,R",
            f"GPVTG,{k % 360:05.1f},T,,M,5.32,N,9.85,K,R",
            f"HEHDT,{k % 360:05.1f},T",
        ):
            text = body.encode()
            yield b"$%s*%02X\r\n" % (text, checksum(text))


def fixes(n: int) -> pa.Table:
    """A log of positions at 100 Hz with millimetre digits."""
    random = np.random.default_rng(1)
    time = np.round(1.7e9 + 0.01 * np.arange(n), 2)
    x, y = (np.round(random.normal(0.0, 0.5, n) + 0.01 * np.arange(n), 3) for _ in range(2))
    return pa.table({"time": time, "x": x, "y": y})


def result(n: int) -> tuple[Track, Verdicts]:
    """A track of which one fix in ten is down-weighted and one in twenty rejected."""
    random = np.random.default_rng(2)
    wide = random.normal(0.0, 10.0, (n, 3))
    verdict = np.where(random.random(n) < 0.1, int(Verdict.DOWNWEIGHTED), int(Verdict.USED))
    verdict[random.random(n) < 0.05] = int(Verdict.REJECTED)
    reason = np.where(verdict == Verdict.USED, int(Reason.AGREES), int(Reason.OFF))
    empty = np.full(n, np.nan)
    judged = Verdicts(
        verdict,
        random.random(n),
        4.0 * random.random(n),
        wide,
        reason,
        empty,
        np.full((n, 3), np.nan),
    )
    return Track(1.7e9 + 0.01 * np.arange(n), wide, wide, abs(wide), abs(wide), None), judged


def _write(place: Path, track: Track, verdicts: Verdicts) -> None:
    n = len(track.time)
    with track_writer(place, geographic=False) as writer:
        writer.write(
            track, verdicts, sensors=("log",), sensor=np.zeros(n, np.int64), row=np.arange(n)
        )


def seconds(call: Callable[[], object]) -> float:
    """Processor time of one call, median of several; the first compiles and does not count."""
    call()
    taken = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        call()
        taken.append(time.process_time() - begun)
    return float(np.median(taken))


if __name__ == "__main__":
    main()
