"""Acoustic streams cut anywhere give the same records; damaged ones never an exception."""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acoustic_logs import dvl, evologics, gga, hdt, line, mission, received, ssb
from surefix.geo.time import parse_time
from surefix.io.acoustic_line import read_line
from surefix.io.acoustic_plan import is_acoustic
from surefix.io.acoustic_record import Attitude, BodyVelocity, Sighting
from surefix.io.nmea import parse
from surefix.io.nmea_frame import START, finish, frame
from surefix.io.nmea_log import read_nmea
from surefix.io.nmea_record import REMEDIES, Position, Refused
from surefix.types import Fixes

DAY = parse_time("2024-05-14")
LINES = [
    gga(1.0, 40_000.0),
    hdt(1.0),
    ssb(1.0, 40_000.0),
    received(ssb(2.0, 40_000.0, "B02", "V,NRy"), DAY),
    line("PSIMSSB,121826.836,M21,A,,D,N,F,1814.33567,N,06847.28996,W,0.000,20.000,N,,"),
    line("PSIMSSB,121826.836,M21,A,,P,H,M,10.0,20.0,0.000,20.000,N,,"),
    line("PSIMSNS,075617.446,,1,1,-1.27,-1.13,-0.04,250.87,,a0,0.000,,M121"),
    line("PTSAG,#16068,124544.449,18,12,2017,1,4305.25355,N,00631.76852,E,F,1013.10,1,9999.00"),
    line("PTSAH,0,359.671,0.000"),
    line(
        "PSONLLD,170004.53,ALVIN 914,A,28.8114807,-87.80925696,1951.156,13.96,13.96,0.00,2.62,,,,"
    ),
    line("PSONALL,2401,Transducer,134446.178,650778.88,5688917.56,1000.09,,,G,,,,7.521,0.606"),
    evologics(20.5, 20.0, 1.0, 2.0, -3.0),
    received(dvl(DAY + 0.2, DAY), DAY),
    b"+++AT:13:DELIVEREDIM,3\r\n",
]
STREAM = b"".join(LINES)


def records(pieces: list[bytes]) -> list[object]:
    out: list[object] = []
    state = START
    for piece in pieces:
        state, frames = frame(state, piece)
        out += [told(item.text, item.problem) for item in frames]
    return out + [told(item.text, item.problem) for item in finish(state)]


def told(text: bytes, problem: str | None) -> object:
    if problem is None:
        return parse(text)
    found = read_line(text) if problem == "not-nmea" else None
    return repr(found[1] if found is not None else (problem, text))


def test_the_stream_has_a_record_of_every_kind() -> None:
    whole = records([STREAM])
    assert len(whole) == len(LINES)
    kinds = {type(parse(text.split(b" ")[-1])) for text in LINES if b"$" in text}
    assert kinds == {Position, Sighting, Attitude, Refused, type(parse(hdt(1.0)))}


@pytest.mark.parametrize("wide", [1, 2, 3, 7, 64])
def test_cut_into_pieces(wide: int) -> None:
    pieces = [STREAM[at : at + wide] for at in range(0, len(STREAM), wide)]
    assert repr(records(pieces)) == repr(records([STREAM]))


def test_cut_once_at_every_byte() -> None:
    whole = repr(records([STREAM]))
    for at in range(len(STREAM) + 1):
        assert repr(records([STREAM[:at], STREAM[at:]])) == whole, at


def test_chunks_of_a_log_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "dive.log"
    path.write_bytes(b"".join(mission(DAY, seconds=30)))
    (whole,) = read_nmea(path)
    assert whole.fixes is not None
    for size in (1, 3):
        parts = list(read_nmea(path, chunk_fixes=size))
        assert len(parts) > 3
        found = [log.fixes for log in parts if log.fixes is not None]
        for name in Fixes._fields[:-1]:
            joined = np.concatenate([getattr(fixes, name) for fixes in found])
            np.testing.assert_array_equal(joined, getattr(whole.fixes, name))
        assert sum(p.total for log in parts for p in log.problems) == whole.problems[0].total


def mutated(chance: random.Random, text: bytes) -> bytes:
    """A line with a few bytes changed, lost, doubled, or fields exchanged."""
    out = bytearray(text)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(out) + 1)
        kind = chance.randrange(6)
        if kind == 0:
            out[at : at + 1] = bytes([chance.randrange(256)])
        elif kind == 1:
            del out[at : at + chance.randint(1, 20)]
        elif kind == 2:
            out[at:at] = out[max(at - chance.randint(1, 20), 0) : at]
        elif kind == 3:
            fields = bytes(out).split(b",")
            chance.shuffle(fields)
            out = bytearray(b",".join(fields))
        elif kind == 4:
            out[at:at] = chance.choice([b"-", b".", b"e9", b"nan", b"9" * 30, b",,", b"*", b"\0"])
        else:
            out = out[:at]
    return bytes(out)


def sealed(text: bytes) -> bytes:
    """The same with a right checksum, so that its fields are looked at."""
    body = text.partition(b"$")[2].partition(b"*")[0]
    total = 0
    for byte in body:
        total ^= byte
    return b"$%s*%02X" % (body, total)


@pytest.mark.parametrize("seed", range(4))
def test_twenty_thousand_mutated_lines_never_raise(seed: int) -> None:
    chance = random.Random(seed)
    seen: set[str] = set()
    for count in range(5_000):
        text = mutated(chance, LINES[count % len(LINES)])
        for record in (parse(sealed(text)), parse(text, require_checksum=False)):
            seen.add(getattr(record, "kind", type(record).__name__))
            check(record)
        found = read_line(text)
        if found is not None:
            check(found[1])
    assert {"field", "range", "Sighting", "unknown-type"} <= seen


def check(record: object) -> None:
    if isinstance(record, Refused):
        assert record.kind in REMEDIES
    elif isinstance(record, Sighting):
        there = not math.isnan(record.x) and not math.isnan(record.y)
        assert there or not record.valid
        if record.place == "globe" and there:
            assert abs(record.x) <= 90.0
            assert abs(record.y) <= 180.0
        assert not any(map(math.isinf, (record.x, record.y, record.depth, record.sigma_x)))
    elif isinstance(record, BodyVelocity):
        assert not any(map(math.isinf, record[2:]))


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    seed=st.integers(0, 10_000),
    rubbish=st.lists(st.binary(max_size=80), max_size=5),
    chunk=st.integers(1, 9),
)
def test_damaged_logs_never_raise_and_lose_no_row(
    tmp_path: Path, seed: int, rubbish: list[bytes], chunk: int
) -> None:
    chance = random.Random(seed)
    lines = [*mission(DAY, seconds=6), *LINES]
    damaged = [mutated(chance, text) if chance.random() < 0.2 else text for text in lines]
    for text in rubbish:
        damaged.insert(chance.randrange(len(damaged)), text)
    path = tmp_path / "damaged.log"
    path.write_bytes(b"".join(damaged))
    numbers: list[int] = []
    for log in read_nmea(path, require_checksum=False, chunk_fixes=chunk):
        if log.fixes is not None:
            numbers += log.fixes.row.tolist()
            assert log.fixes.sensor.max() < len(log.sensors)
    assert numbers == list(range(len(numbers)))


def test_what_waits_is_bounded(tmp_path: Path) -> None:
    """A ship that falls silent does not make sightings wait for ever."""
    lines = [gga(0.0, 40_000.0), hdt(0.0), *[ssb(0.0, 40_000.0)] * 6_000]
    path = tmp_path / "silent.log"
    path.write_bytes(b"".join(lines[:2] * 2 + lines[2:] + lines[:2]))
    total = sum(len(log.fixes.time) for log in read_nmea(path, chunk_fixes=500) if log.fixes)
    assert total == 6_000


@pytest.mark.parametrize(
    "text", [text for text in LINES if b"$GP" not in text and b"$HE" not in text]
)
def test_messages_are_found_wherever_they_lie(tmp_path: Path, text: bytes) -> None:
    path = tmp_path / "long.log"
    for before in (0, 1, (1 << 20) - 5, (1 << 20) - 4, (1 << 21) + 7):
        filler = (gga(1.0, 40_000.0) * (before // 60 + 1))[:before]
        path.write_bytes(filler + text)
        assert is_acoustic(path)
        path.write_bytes(filler)
        assert not is_acoustic(path)
