"""Read mutated sentences by the million: no exception, no record lost, the same however it is cut.

``make fuzz`` reads ten million of them with a seed of the day; `make test` one million.
"""

import math
import random
import resource
import sys
import time
from itertools import pairwise
from pathlib import Path

from faults.mutations import mutated, sentence
from surefix.io.acoustic_line import read_line
from surefix.io.nmea_clock import receive_time
from surefix.io.nmea_frame import START, finish, frame
from surefix.io.nmea_lines import pieces
from surefix.io.nmea_log import read_nmea
from surefix.io.nmea_stream import NmeaStream

BATCH = 10_000
DATED = sentence(b"GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230324,003.1,W,A") + b"\r\n"
# Each log begins with a date: rows before the first one do not wait for it without end, and if one
# comes when they are gone, they have none. That depends on how the log is cut, and is said.


def batch(seed, size=BATCH):
    source = random.Random(seed)
    return [mutated(source) for _ in range(size)]


def by_kernel(data, cuts=()):
    """What is in a log by the way of files: what it says, and how often it says what is wrong."""
    stream, state = NmeaStream(Path("log")), START
    bounds = [0, *cuts, len(data)]
    for a, b in pairwise(bounds):
        for after, found in pieces(state, data[a:b]):
            state = after
            stream.add(stream.begin(found))
    stream.add(stream.begin(finish(state)))
    return [stream.chunk(last=True)]


def by_stream(data, cuts=()):
    """The same by the way of live sources."""
    stream = NmeaStream(Path("log"))
    bounds = [0, *cuts, len(data)]
    logs = [stream.read(data[a:b]) for a, b in pairwise(bounds)]
    return [*logs, stream.rest()]


def tally(logs):
    """How many records of each kind, and how many problems of each."""
    found = {}
    for log in logs:
        for kind, total in log.counts.items():
            found[kind] = found.get(kind, 0) + total
        for problem in log.problems:
            found[problem.kind, "bad"] = found.get((problem.kind, "bad"), 0) + problem.total
    return found


def told(logs):
    """All that logs say, in words that can be compared."""
    rows = [
        (log.sensors[source], *values)
        for log in logs
        if log.fixes is not None
        for source, *values in zip(
            log.fixes.sensor.tolist(), log.fixes.time.tolist(), log.fixes.position.tolist(),
            log.fixes.velocity.tolist(), strict=True,
        )
    ]  # fmt: skip
    series = {}
    for log in logs:
        for each in log.channels:
            known = series.setdefault((each.sensor, each.name), [])
            known += zip(each.time.tolist(), each.value.tolist(), strict=True)
    return repr((rows, sorted(series.items()))), tally(logs)


def expected(data):
    """How many records and problems there must be in all: one for each frame, and its forewords."""
    state, frames = frame(START, data)
    frames += finish(state)
    forewords = 0
    for _, prefix, text, problem in frames:
        message = read_line(text) if problem == "not-nmea" else None
        for words in (prefix, message[0].strip() if message else b""):
            forewords += bool(words) and math.isnan(receive_time(words))
    return len(frames) + forewords, {each.line for each in frames}


def memory():
    """Resident memory at its highest, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def read(seed, folder=None):
    """Read one batch by one of the ways, and hold it against what must be."""
    source = random.Random(~seed)
    data = DATED + b"".join(batch(seed))
    cuts = sorted(source.randrange(len(data)) for _ in range(source.choice((1, 10, 1000))))
    by = (by_kernel, by_stream)[seed % 2]
    logs = by(data, cuts)
    total, lines = expected(data)
    assert sum(tally(logs).values()) == total, seed
    shown = {n for n, line in enumerate(data.splitlines(), 1) if line.strip(b" \t\r\n\0")}
    assert shown <= lines, seed
    if seed % 16 < 2:
        assert told(logs) == told(by_stream(data)), seed
    if folder is not None:  # as a file, whose acoustic target is looked for
        place = folder / "log.nmea"
        place.write_bytes(data)
        assert sum(tally(read_nmea(place)).values()) >= total, seed


def main(total=10_000_000, first=None):
    """Read so many, and say how many were read."""
    first = int(time.time()) // 86_400 * 1_000_000 if first is None else first
    print(f"seeds from {first}", flush=True)
    began, early = time.process_time(), 0.0
    for number in range(total // BATCH):
        read(first + number)
        if number == min(20, total // BATCH // 2):
            early = memory()
        if number % 100 == 99:
            spent = time.process_time() - began
            print(
                f"{(number + 1) * BATCH:,} sentences, {spent:.0f} s, {memory():.0f} MB", flush=True
            )
    print(f"{total:,} mutated sentences, no exception; memory {early:.0f} -> {memory():.0f} MB")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
