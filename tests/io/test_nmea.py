import math
import random
from functools import reduce
from operator import xor

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from surefix.io.nmea import checksum, parse
from surefix.io.nmea_frame import MAX_LINE, START, Frame, finish, frame
from surefix.io.nmea_record import (
    REMEDIES,
    AlongSpeed,
    Clock,
    Depth,
    Heading,
    Motion,
    Position,
    Record,
    Refused,
    Sigma,
    WaterSpeed,
)

KNOT = 1852.0 / 3600.0

GOOD = [
    "GPGGA,123519.25,4807.0380,N,01131.0000,W,1,08,0.9,545.4,M,46.9,M,,",
    "GNGNS,123519.00,4807.038,N,01131.000,E,ANNN,08,0.9,545.4,46.9,,",
    "GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W,A",
    "GPGLL,4916.45,N,12311.12,W,225444,A,A",
    "GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,A",
    "HEHDT,218.53,T",
    "HCHDG,101.1,1.0,W,7.1,E",
    "HCHDM,101.1,M",
    "INTHS,77.5,A",
    "VWVHW,120.0,T,118.0,M,5.0,N,9.3,K",
    "VDVBW,4.0,-0.1,A,-3.0,0.2,A",
    "SDDPT,76.1,0.7,100",
    "SDDBT,7.7,f,2.3,M,1.3,F",
    "GPZDA,160012.71,11,03,2004,-1,00",
    "GPGST,172814.0,0.006,0.023,0.020,273.6,0.023,0.020,0.031",
    "IIMWV,273,R,03.2,N,A",
]


def sentence(body: str, start: str = "$") -> bytes:
    raw = body.encode()
    return start.encode() + raw + b"*%02X" % reduce(xor, raw, 0)


def read(body: str) -> Record | Refused:
    return parse(sentence(body))


def kind(raw: bytes, **options: bool) -> str:
    record = parse(raw, **options)
    return record.kind if isinstance(record, Refused) else "good"


def test_checksum_of_any_length() -> None:
    rng = random.Random(1)
    for length in [*range(140), 255, 256, 257, 511, 512, 513, 1023, 1024]:
        body = rng.randbytes(length)
        assert checksum(body) == reduce(xor, body, 0)


def test_gga() -> None:
    fix = read(GOOD[0])
    assert isinstance(fix, Position)
    assert (fix.talker, fix.type, fix.second) == ("GP", "GGA", 45319.25)
    assert (fix.latitude, fix.longitude) == (48 + 7.038 / 60, -(11 + 31 / 60))
    assert (fix.height, fix.valid, fix.decimals) == (545.4, True, 4)
    assert math.isnan(fix.speed)
    assert fix.day is None


def test_gns() -> None:
    fix = read(GOOD[1])
    assert isinstance(fix, Position)
    assert (fix.talker, fix.valid, fix.height) == ("GN", True, 545.4)
    assert not read(GOOD[1].replace("ANNN", "NNNN")).valid


def test_rmc() -> None:
    fix = read(GOOD[2])
    assert isinstance(fix, Position)
    assert fix.speed == pytest.approx(22.4 * KNOT)
    assert (fix.course, fix.day, fix.second) == (84.4, 8847, 45319.0)


def test_gll() -> None:
    fix = read(GOOD[3])
    assert (fix.latitude, fix.longitude) == (49 + 16.45 / 60, -(123 + 11.12 / 60))
    short = read("GPGLL,4916.45,N,12311.12,W")
    assert short.valid
    assert math.isnan(short.second)


def test_vtg_new_and_old() -> None:
    assert read(GOOD[4]) == Motion("GP", "VTG", pytest.approx(5.5 * KNOT), 54.7)
    assert read("GPVTG,054.7,034.4,005.5,010.2") == read(GOOD[4])
    assert read("GPVTG,054.7,T,,M,,N,18.0,K").speed == pytest.approx(5.0)
    assert math.isnan(read("GPVTG,054.7,T,034.4,M,005.5,N,010.2,K,N").speed)


def heading(body: str) -> tuple[float, float]:
    record = read(body)
    assert isinstance(record, Heading)
    return record.true, record.magnetic


def test_headings() -> None:
    nan = pytest.approx(math.nan, nan_ok=True)
    assert heading("HEHDT,218.53,T") == (218.53, nan)
    assert heading("HCHDM,101.1,M") == (nan, 101.1)
    assert heading("INTHS,77.5,A") == (77.5, nan)
    assert heading("INTHS,77.5,V") == (nan, nan)
    assert heading("HCHDG,101.1,1.0,W,7.1,E") == (pytest.approx(107.2), nan)
    assert heading("HCHDG,101.1,1.0,W,,") == (nan, pytest.approx(100.1))
    assert heading("HCHDG,359.5,,,1.0,E") == (pytest.approx(0.5), nan)
    assert heading("HEHDT,,T") == (nan, nan)


def test_speeds_depths_clock_sigma() -> None:
    assert read(GOOD[9]) == WaterSpeed("VW", "VHW", pytest.approx(5 * KNOT), 120.0, 118.0)
    along = AlongSpeed("VD", "VBW", pytest.approx(4 * KNOT), pytest.approx(-3 * KNOT))
    assert read(GOOD[10]) == along
    assert math.isnan(read("VDVBW,4.0,-0.1,V,-3.0,0.2,A").water)
    assert read("SDDPT,76.1,0.7,100") == Depth("SD", "DPT", pytest.approx(76.8))
    assert read("SDDPT,76.1,-0.7") == Depth("SD", "DPT", 76.1)
    assert math.isnan(read("SDDPT,,").depth)
    assert read(GOOD[12]).depth == 2.3
    assert read("SDDBT,10.0,f,,M,,F").depth == pytest.approx(3.048)
    assert read("SDDBT,,f,,M,1.0,F").depth == pytest.approx(1.8288)
    assert read(GOOD[13]) == Clock("GP", "ZDA", pytest.approx(57612.71), 12488)
    assert read(GOOD[14]) == Sigma("GP", "GST", 62894.0, east=0.020, north=0.023, up=0.031)


@pytest.mark.parametrize(
    "body",
    [
        "GPGGA,123519,4807.038,N,01131.000,E,0,00,,,M,,M,,",
        "GPGGA,,,,,,0,00,99.99,,,,,,",
        "GPRMC,123519,V,4807.038,N,01131.000,E,1.0,2.0,230394,,",
        "GPRMC,,V,,,,,,,,,,N",
        "GPRMC,123519,A,4807.038,N,01131.000,E,1.0,2.0,230394,,,N",
        "GPGLL,4807.038,N,01131.000,E,225444,V",
        "GPGLL,4807.038,N,01131.000,E,225444,A,N",
        "GNGNS,123519,4807.038,N,01131.000,E,NN,08,0.9,545.4,46.9,,",
        "GPGGA,123519,0000.000,N,00000.000,E,0,00,,,M,,M,,",
    ],
)
def test_invalid_fix_is_kept_and_marked(body: str) -> None:
    fix = read(body)
    assert isinstance(fix, Position)
    assert not fix.valid
    assert math.isnan(fix.speed)
    assert math.isnan(fix.latitude) or fix.latitude == pytest.approx(48.1173)
    assert math.isnan(fix.latitude) == math.isnan(fix.longitude)


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("GPGGA,123519,9100.000,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "range"),
        ("GPGGA,123519,9000.001,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "range"),
        ("GPGGA,123519,4860.000,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "range"),
        ("GPGGA,123519,4807.038,N,18100.000,E,1,08,0.9,545.4,M,46.9,M,,", "range"),
        ("GPGGA,126019,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "range"),
        ("GPGGA,123519,4807.038,E,01131.000,N,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,n,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,-4807.038,S,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,,,,,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,N,01131.000,E,1,9999,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,N,01131.000,E,1,-8,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,NaN,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,inf,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,1e5,M,46.9,M,,", "field"),
        ("GPGGA,4807.038,N,123519,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPGGA,123519,4807.038,N", "truncated"),
        ("GPRMC,123519,A,4807.038,N,01131.000,E,022.4,384.4,230394,003.1,W", "range"),
        ("GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,310294,003.1,W", "range"),
        ("GPRMC,123519,A,4807.038,N,01131.000,E,-22.4,084.4,230394,003.1,W", "field"),
        ("GPRMC,123519,A,,,,,022.4,084.4,230394,003.1,W", "field"),
        ("HEHDT,361,T", "range"),
        ("HEHDT,+.,T", "field"),
        ("SDDPT,.,", "field"),
        ("GPVTG,054.7,X,034.4,M,005.5,N,010.2,K", "field"),
        ("gpgga,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "field"),
        ("GPZDA,240000,11,03,2004,,", "range"),
        ("GPXYZ,1,2,3", "unknown-type"),
        ("PSXN,20,1,0,0,0", "unknown-type"),
        ("", "field"),
        (",,,,", "field"),
    ],
)
def test_bad_fields_are_refused_by_name(body: str, problem: str) -> None:
    assert kind(sentence(body)) == problem
    assert problem in REMEDIES


@pytest.mark.parametrize(
    ("raw", "problem"),
    [
        (b"$HEHDT,218.53,T*13", "checksum"),
        (b"$HEHDT,218.53,T*G2", "checksum"),
        (b"$HEHDT,218.53,T*1", "truncated"),
        (b"$HEHDT,218.53,T*", "truncated"),
        (b"$HEHDT,218.53,T", "no-checksum"),
        (b"", "not-nmea"),
        (b"HEHDT", "not-nmea"),
        (b"$" + b"A" * 2000, "too-long"),
        (b"$\xff\xfe*01", "binary"),
    ],
)
def test_bad_frames_are_refused_by_name(raw: bytes, problem: str) -> None:
    assert kind(raw) == problem


def test_checksum_nought_and_small_letters_are_right() -> None:
    body = next(b for n in range(10**4) if not checksum(b := b"HEHDT,%d,T" % n) and n < 360)
    assert kind(b"$" + body + b"*00") == "good"
    assert checksum(b"SDDPT,1.3,") == 0x7B
    assert kind(b"$SDDPT,1.3,*7b\r\n") == "good"


def test_without_checksum_only_on_request_and_whole() -> None:
    for body in GOOD[:-1]:
        raw = b"$" + body.encode()
        assert kind(raw) == "no-checksum"
        assert kind(raw, require_checksum=False) == "good"
        assert kind(raw + b"*ZZ", require_checksum=False) == "checksum"
    gga = GOOD[0].encode()
    for end in range(6, gga.rfind(b",")):
        assert kind(b"$" + gga[:end], require_checksum=False) == "truncated"


@pytest.mark.parametrize("talker", ["GP", "GN", "II", "IN", "U0"])
def test_any_talker(talker: str) -> None:
    fix = read(talker + GOOD[0][2:])
    assert isinstance(fix, Position)
    assert fix.talker == talker


@st.composite
def mutated(draw: st.DrawFn) -> bytes:
    """Build a right sentence with some bytes changed, and a checksum that is often right again."""
    body = bytearray(draw(st.sampled_from(GOOD)).encode())
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(body) - 1))
        piece = draw(st.one_of(st.binary(max_size=3), st.sampled_from([b",", b".", b"9", b"-"])))
        body[at : at + draw(st.integers(0, 3))] = piece
        body = body or bytearray(b",")
    return b"$" + bytes(body) + b"*%02X" % reduce(xor, body, 0)


def check(record: Record | Refused) -> None:
    """Whatever was read is possible."""
    if isinstance(record, Position) and not math.isnan(record.latitude):
        assert -90 <= record.latitude <= 90
        assert -180 <= record.longitude <= 180
    if isinstance(record, Position) and record.valid:
        assert not math.isnan(record.latitude)
    if isinstance(record, Heading):
        assert not record.true > 360
        assert not record.magnetic > 360
    if not isinstance(record, Refused):
        assert not any(isinstance(value, float) and math.isinf(value) for value in record)


@settings(max_examples=1500)
@given(mutated(), st.booleans())
def test_no_mutation_raises(raw: bytes, require: bool) -> None:
    check(parse(raw, require_checksum=require))
    check(parse(raw[:-3], require_checksum=require))


@given(st.binary(max_size=100), st.booleans())
@example(b"*00", False)
def test_no_bytes_raise(raw: bytes, require: bool) -> None:
    check(parse(raw, require_checksum=require))
    check(parse(b"$" + raw, require_checksum=require))


def frames(pieces: list[bytes]) -> list[Frame]:
    state, found = START, []
    for piece in pieces:
        state, more = frame(state, piece)
        found += more
        assert len(state.rest) <= MAX_LINE
    return found + finish(state)


AIS = sentence("AIVDM,1,1,,A,13u?etPv2;0n:dDPwUM1U1Cb069D,0", "!")
STREAM = b"".join(
    [
        sentence(GOOD[0]) + b"\r\n",
        b"2014-08-01T00:00:00Z " + sentence(GOOD[5]) + b"\n",
        b"\xff\x00\x01binary$\x02\n",
        b"# a comment\r\r\n",
        b"$GPGGA,123519,4807.0" + sentence(GOOD[2]) + b"\n",
        sentence(GOOD[4]) + sentence(GOOD[6]) + b"\r",
        b"x" * 5500 + b"!" + b"y" * 4100 + sentence(GOOD[7]) + b"\n",
        AIS + b"\r\n",
        sentence(GOOD[11]),
    ]
)


def test_every_split_gives_the_same_frames() -> None:
    whole = frames([STREAM])
    good = [item.text for item in whole if item.problem is None]
    assert good == [sentence(GOOD[n]) for n in (0, 5, 2, 4, 6, 7)] + [AIS, sentence(GOOD[11])]
    assert frames([STREAM[n : n + 1] for n in range(len(STREAM))]) == whole
    for at in range(len(STREAM)):
        assert frames([STREAM[:at], STREAM[at:]]) == whole


@settings(max_examples=300)
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=30),
            st.sampled_from([b"$", b"!", b"\r", b"\n", b"*", sentence(GOOD[0]), b"\0" * 2400]),
        ),
        max_size=20,
    ),
    st.data(),
)
def test_random_splits_of_random_streams(pieces: list[bytes], draw: st.DataObject) -> None:
    stream = b"".join(pieces)
    cuts = sorted(draw.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    split = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert frames(split) == frames([stream])


def test_glued_sentences() -> None:
    first, second = frames([b"$GPGGA,123519,48" + sentence(GOOD[2]) + b"\r\n"])
    assert (first.problem, second.problem) == ("truncated", None)
    assert isinstance(parse(second.text), Position)


def test_overlaid_lines_give_up_only_what_is_whole() -> None:
    found = frames([sentence(GOOD[5]) + b"0,*4E\n"])
    assert [(item.text, item.problem) for item in found] == [
        (sentence(GOOD[5]), None),
        (b"0,*4E", "not-nmea"),
    ]


def test_line_numbers_and_prefix() -> None:
    lines = [b"", b"# log", b"1406851200.5," + sentence(GOOD[5]), sentence(GOOD[5])]
    found = frames([b"\r\n".join(lines)])
    assert [item.line for item in found] == [2, 3, 4]
    assert found[1].prefix == b"1406851200.5,"


def test_ten_megabytes_without_a_newline() -> None:
    state, found = frame(START, b"\0" * 10_000_000)
    assert [item.problem for item in found] == ["too-long"]
    assert len(state.rest) <= MAX_LINE
    state, found = frame(state, sentence(GOOD[5]) + b"\r\n")
    assert found == [Frame(1, b"", sentence(GOOD[5]), None)]


def test_ten_megabytes_of_starts_without_a_newline() -> None:
    found = frames([b"$" * 3_000_000 + b"\n" + sentence(GOOD[5])])
    assert found[-1] == Frame(2, b"", sentence(GOOD[5]), None)
