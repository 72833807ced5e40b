"""Plain lines by the kernel give what the definition gives, and reading by it the same logs."""

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surefix.io import nmea_lines, nmea_log
from surefix.io.nmea import checksum, parse
from surefix.io.nmea_clock import receive_time
from surefix.io.nmea_decode import TYPES
from surefix.io.nmea_frame import START
from surefix.io.nmea_lines import Plain, pieces
from surefix.io.nmea_log import read_nmea
from surefix.io.nmea_record import Record, Refused
from surefix.io.nmea_scan import DECLINED, UNKNOWN, Lines, scan
from surefix.types import Log

BODIES = (
    b"GPGGA,123519.25,4807.0380,N,01131.0001,W,4,08,0.9,-545.4,M,46.9,M,,",
    b"GNGNS,235960,4807.038,S,01131.000,E,ANNN,08,0.9,545.4,46.9,,",
    b"GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W,A",
    b"GPRMC,,V,,,,,,,290224,,,N",
    b"GPGLL,4916.45,N,12311.12,W,225444,A,D",
    b"GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,A",
    b"HEHDT,218.53,T",
    b"HCHDM,011.0,M",
    b"HETHS,127.3,A",
    b"HCHDG,101.1,2.5,W,7.1,E",
    b"IIVHW,,T,011.0,M,05.12,N,09.48,K",
    b"SDDPT,0017.6,0.5",
    b"SDDBT,17.2,f,5.2,M,2.8,F",
    b"GPZDA,201530.00,04,07,2002,00,00",
    b"GPGST,172814.0,0.006,0.023,0.020,273.6,0.023,0.0,0.031",
    b"WIMWV,214.8,R,0.1,K,A",
    b"PSXN,20,1,2,3,4",
    b"PSXN,23,0.58,-1.09,218.83,0.78",
    b"PASHR,204132.040,010.99,T,+00.41,-00.75,-00.84,0.151,0.088,0.569,1,0",
    b"PASHR,POS,0,03,183530.00,2037.76012,N,08704.07373,W,058.48,,359.4,000.0",
    b"IIXDR,A,-1.7,D,PITCH,A,3.4,D,ROLL,C,,C,AIRTEMP",
    b"IIXDR,C,,C,AIRTEMP,A,-1.0,D,HEEL",
    b"YXXDR,A,,D,Roll,A,5.2,D,ROLL",
    b"PGRME,15.0,M,45.0,M,25.0,M",
)
LETTERS = b"0123456789.,-+NSEWAVMTKZ"


def sentence(body: bytes) -> bytes:
    return b"$%s*%02X" % (body, checksum(body))


def mutated(body: bytes, source: random.Random) -> bytes:
    text = bytearray(body)
    for _ in range(source.choice([1, 1, 2, 4])):
        at = source.randrange(6, len(text))
        kind = source.randrange(3)
        text[at : at + (kind < 2)] = b"" if kind == 0 else bytes([source.choice(LETTERS)])
        if source.random() < 0.1:
            text[at:at] = b"123456789012"
    return bytes(text)


def record(lines: Lines, k: int, text: bytes) -> Record | str:
    """What the kernel says of the only sentence of a piece."""
    address = text[lines.address[k, 0] : lines.address[k, 1]].decode()
    if lines.code[k] == UNKNOWN:
        return address if address[0] == "P" else address[2:]
    talker, kind = ("", address) if address[0] == "P" else (address[:2], address[2:])
    return nmea_lines._BUILD[lines.code[k]](talker, kind, tuple(lines.values[k].tolist()))


def plain(value: Record | str) -> object:
    if isinstance(value, str):
        return value
    return tuple(float(v) if isinstance(v, float) else v for v in value)


@pytest.mark.parametrize("body", BODIES)
def test_usual_sentences_are_plain(body: bytes) -> None:
    text = sentence(body) + b"\r\n"
    lines = scan(text)
    if body[:8] == b"GNGNS,23" or body[:5] == b"PGRME":  # left to the definition: the leap second …
        assert lines.code.tolist() == [DECLINED]
        return
    said = parse(text)
    expected = said.text if isinstance(said, Refused) else plain(said)
    assert repr(plain(record(lines, 0, text))) == repr(expected)
    assert (lines.code[0] == UNKNOWN) == isinstance(said, Refused)
    assert isinstance(said, Refused) or TYPES[lines.code[0]] == said.type


@pytest.mark.parametrize("seed", range(4))
def test_what_the_kernel_reads_is_what_the_definition_reads(seed: int) -> None:
    source = random.Random(seed)
    texts = [sentence(mutated(source.choice(BODIES), source)) for _ in range(4000)]
    whole = b"".join(text + b"\n" for text in texts)
    lines = scan(whole)
    read = 0
    for k, text in enumerate(texts):
        if lines.code[k] == DECLINED:
            continue
        said = parse(text)
        expected = said.text if isinstance(said, Refused) else plain(said)
        assert repr(plain(record(lines, k, whole))) == repr(expected), text
        assert not isinstance(said, Refused) or said.kind == "unknown-type", text
        read += 1
    assert read > 1000
    assert (lines.code == DECLINED).sum() > 500


@pytest.mark.parametrize(
    "prefix",
    [
        b"2014-08-01T00:00:00Z ",
        b"2014-08-01 23:59:59.999999,",
        b"2016-02-29T12:00:00.5\t",
        b"1406851200;",
        b"1406851200.250 ",
        b"1406851200250,",
        b"[1406851200250123] ",
        b" \t",
        b"",
    ],
)
def test_times_of_reception(prefix: bytes) -> None:
    lines = scan(prefix + sentence(b"HEHDT,218.53,T") + b"\r\n")
    assert lines.code.tolist() == [TYPES.index("HDT")]
    expected = receive_time(prefix) if prefix.strip() else np.nan
    np.testing.assert_array_equal(lines.received, [expected])


@pytest.mark.parametrize(
    "line",
    [
        b"2014-02-30T00:00:00Z $HEHDT,218.53,T*12",
        b"hello $HEHDT,218.53,T*12",
        b"$HEHDT,218.53,T*13",
        b"$HEHDT,218.53,T*12 ",
        b"$HEHDT,218.53,T",
        b"!HEHDT,218.53,T*12",
        b"$HEHDT,218.53,T*12$HEHDT,218.53,T*12",
        b"$HEHDT,218.53\xff,T*12",
        b"$" + b"HEHDT," * 200 + b"*00",
        b"",
    ],
)
def test_other_lines_are_declined(line: bytes) -> None:
    assert scan(line + b"\r\n").code.tolist() == [DECLINED]


def test_a_sentence_that_only_the_definition_knows_is_left_to_it() -> None:
    body = b"VDVBW,12.3,0.07,A,11.78,0.12,A"
    found = [part for _, part in pieces(START, sentence(body) + b"\n")]
    assert not any(isinstance(part, Plain) for part in found)
    assert found[0][0].text == sentence(body)  # type: ignore[index, union-attr]


def shown(logs: list[Log]) -> str:
    with np.printoptions(threshold=10**9, floatmode="unique"):
        return repr([replace(log, counts=dict(sorted(log.counts.items()))) for log in logs])


def damaged(seed: int) -> bytes:
    """A log with sound, damaged and foreign lines, with and without times of reception."""
    source = random.Random(seed)
    lines = []
    for k in range(600):
        clock = b"%02d%02d%02d" % (k // 3600, k // 60 % 60, k % 60)
        place = b"5410.%04d,N,01020.%04d,E" % (k, 2 * k)
        body = (
            b"GPGGA," + clock + b"," + place + b",1,08,0.9,5.4,M,46.9,M,,",
            b"GPRMC," + clock + b",A," + place + b",5.1,090.0,010524,,,A",
            source.choice(BODIES),
        )[k % 3]
        text = sentence(mutated(body, source) if source.random() < 0.1 else body)
        if source.random() < 0.05:
            text = text[: source.randrange(len(text))] + source.choice([b"", b"\xfe\x01", b"\r"])
        head = b"2024-05-01T%02d:00:00Z " % source.randrange(24) if source.random() < 0.02 else b""
        lines.append(head + text + source.choice([b"\n", b"\r\n", b"\r\n", b"\n\n"]))
    return b"".join(lines)


def read_both(
    path: Path, monkeypatch: pytest.MonkeyPatch, **options: bool | int
) -> tuple[list[Log], list[Log]]:
    fast = list(read_nmea(path, **options))  # type: ignore[arg-type]

    def nothing(piece: bytes) -> Lines:
        lines = scan(piece)
        lines.code[:] = DECLINED
        return lines

    with monkeypatch.context() as patch:
        patch.setattr(nmea_lines, "scan", nothing)
        return fast, list(read_nmea(path, **options))  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("require_checksum", [True, False])
def test_reading_is_the_same_line_by_line(
    seed: int, require_checksum: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log.nmea"
    path.write_bytes(damaged(seed))
    fast, slow = read_both(path, monkeypatch, require_checksum=require_checksum)
    assert shown(fast) == shown(slow)
    assert fast[0].problems
    assert fast[0].fixes is not None


def test_reading_real_logs_is_the_same_line_by_line(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = sorted((data / "nmea_receivers").glob("*.log"))[::6]
    paths += sorted((data / "ship_palmer").glob("NBP*"))
    for path in paths:
        fast, slow = read_both(path, monkeypatch)
        assert shown(fast) == shown(slow), path.name


@pytest.mark.parametrize("size", [1, 7, 100, 1009])
def test_reading_is_the_same_however_the_bytes_are_cut(
    size: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log.nmea"
    path.write_bytes(damaged(9))
    whole = shown(list(read_nmea(path)))
    monkeypatch.setattr(nmea_log, "_BLOCK", size)
    assert shown(list(read_nmea(path))) == whole
