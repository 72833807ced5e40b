"""Acoustic sentences: published examples, every variant of coordinates, and what is refused."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surefix.io.acoustic_record import Attitude, Sighting
from surefix.io.nmea import checksum, parse
from surefix.io.nmea_record import Refused

NAN = pytest.approx(math.nan, nan_ok=True)


def read(body: str):
    return parse(b"$%s*%02X" % (body.encode(), checksum(body.encode())))


def seen(body: str) -> Sighting:
    record = read(body)
    assert isinstance(record, Sighting), record
    return record


def ssb(place: str, status: str = "A,", tail: str = "12.5,0.75,N,,") -> str:
    return f"PSIMSSB,121826.836,B33,{status},{place},{tail}"


# Sentences that makers and users of these systems have published, with their checksums.
PUBLISHED = {
    "$PSIMSSB,180554.432,M44,A,,C,N,M,-61.300,39.017,34.026,0.072,T,0.050576,*47":
        ("M44", "north", 39.017, -61.3, 34.026, 0.072, True),
    "$PSIMSSB,083733.386,M17,A,,C,N,F,46.649,1.632,24.829,1.414,T,0.033681,*54":
        ("M17 filtered", "north", 1.632, 46.649, 24.829, 1.414, True),
    "$PSIMSSB,083733.036,M17,A,NRy,C,N,F,0.000,0.000,0.000,20.000,T,0.003731,*08":
        ("M17 filtered", "north", 0.0, 0.0, 0.0, 20.0, False),
    "$PSIMSSB,094532.523,M17,V,NRy,C,N,M,,,,,T,0.002245,*25":
        ("M17", "north", NAN, NAN, NAN, NAN, False),
    "$PSIMSSB,094532.523,M21,V,NRy,D,N,M,,,,,N,,*22":
        ("M21", "globe", NAN, NAN, NAN, NAN, False),
    "$PTSAG,#16068,124544.449,18,12,2017,1,4305.25355,N,00631.76852,E,F,1013.10,1,9999.00*23":
        ("1", "globe", 43 + 5.25355 / 60, 6 + 31.76852 / 60, 1013.1, NAN, True),
    "$PTSAG,#2374110,055648.831,05,04,2018,0,2718.19917,N,01747.61373,W,F,0005.8,1,9999.0*39":
        ("ship", "globe", 27 + 18.19917 / 60, -17 - 47.61373 / 60, 5.8, NAN, True),
    "$PTSAG,#00006,135005.00,07,02,2013,00,5301.4970,N,00852.1740,E,F,0000.0,0,0000.0*20":
        ("ship", "globe", 53 + 1.497 / 60, 8 + 52.174 / 60, NAN, NAN, True),
    "$PSONLLD,133707.52,2401,A,51.3315406,-0.83563975,999.916,5.33,5.33,0.00,0.62,,,,*2A":
        ("2401", "globe", 51.3315406, -0.83563975, 999.916, 5.33, True),
    "$PSONLLD,170004.53,ALVIN 914,A,28.8114807,-87.80925696,1951.156,13.96,13.96,0.00,2.62,,,,*6F":
        ("ALVIN 914", "globe", 28.8114807, -87.80925696, 1951.156, 13.96, True),
    "$PSONALL,2401,Transducer,134446.178,650778.88,5688917.56,1000.09,,,G,,,,7.521,0.606*3F":
        ("2401", "grid", 650778.88, 5688917.56, 1000.09, 7.521, True),
}  # fmt: skip


@pytest.mark.parametrize("sentence", PUBLISHED)
def test_published_examples(sentence: str) -> None:
    record = parse(sentence.encode())
    assert isinstance(record, Sighting)
    found = (record.target, record.place, record.x, record.y, record.depth)
    assert (*found, record.sigma_x, record.valid) == PUBLISHED[sentence]


def test_published_headings() -> None:
    sns = parse(b"$PSIMSNS,075617.446,,1,1,-1.27,-1.13,-0.04,250.87,,a0,0.000,,M121*59")
    assert sns == Attitude("", "PSIMSNS", 28577.446, 250.87)
    assert parse(b"$PTSAH,0,359.671,0.000*4D") == Attitude("", "PTSAH", NAN, 359.671)


def test_time_of_day_and_date() -> None:
    assert seen(ssb("C,H,M,1,2")).second == pytest.approx(12 * 3600 + 18 * 60 + 26.836)
    assert math.isnan(seen("PSIMSSB,,B33,A,,C,H,M,1,2,3,4,N,,").second)
    body = "PTSAG,#1,235959.9,31,12,2023,7,4305.2,N,00631.7,E,7,10.0,2,10.0"
    assert (seen(body).day, seen(body).second) == (19722, pytest.approx(86399.9))


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ("C,H,M,3.0,4.0", ("ship", 3.0, 4.0)),
        ("C,N,M,3.0,4.0", ("north", 4.0, 3.0)),
        ("C,E,M,3.0,4.0", ("north", 3.0, 4.0)),
        ("U,E,M,600000.5,6500000.25", ("grid", 600000.5, 6500000.25)),
        ("U,N,M,6500000.25,600000.5", ("grid", 600000.5, 6500000.25)),
        ("R,N,M,0.5,-1.5", ("globe", math.degrees(0.5), math.degrees(-1.5))),
        ("R,G,M,-0.5,3.1", ("globe", math.degrees(-0.5), math.degrees(3.1))),
        ("D,N,M,1814.33567,S,06847.28996,W", ("globe", -18 - 14.33567 / 60, -68 - 47.28996 / 60)),
    ],
)
def test_coordinate_systems_of_psimssb(place: str, expected: tuple[str, float, float]) -> None:
    record = seen(ssb(place))
    assert (record.place, record.x, record.y) == (expected[0], *map(pytest.approx, expected[1:]))
    assert (record.target, record.depth, record.sigma_depth) == ("B33", 12.5, 0.75)


@pytest.mark.parametrize("place", ["P,H,M,100,45", "P,N,M,100,45", "U,H,M,1,2", "C,X,M,1,2",
                                   "R,E,M,0.1,0.2", "X,H,M,1,2"])  # fmt: skip
def test_coordinates_without_a_documented_meaning_are_refused_by_name(place: str) -> None:
    assert read(ssb(place)) == Refused("coordinates", place[:3])


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        (ssb("R,N,M,1.6,0.1"), "range"),
        (ssb("D,N,M,9100.0,N,00000.0,E"), "range"),
        (ssb("D,N,M,4560.0,N,00000.0,E"), "range"),
        (ssb("D,N,M,4500.0,,00000.0,E"), "field"),
        (ssb("C,H,M,,"), "field"),  # valid, but without position
        (ssb("C,H,M,1e3,2"), "field"),
        (ssb("C,H,Q,1,2"), "field"),
        (ssb("C,H,M,nan,2"), "field"),
        (ssb("C,H,M,1,2", status="X,"), "field"),
        (ssb("C,H,M,1,2").replace("121826", "246060"), "range"),
        ("PSIMSSB,121826.8,B33,A,,C,H", "truncated"),
        ("PSIMSNS,075617.4,,1,1,-1.27,-1.13,-0.04,361.0,,a0,0.0,,", "range"),
        ("PTSAG,#1,120000.0,31,02,2023,7,4305.2,N,00631.7,E,F,10.0,1,9999.0", "range"),
        ("PTSAG,#1,120000.0,01,02,2023,7,,,,,F,10.0,1,9999.0", "field"),
        ("PTSAG,#1,120000.0,01,02,2023,7,4305.2,N,00631.7,E,G,10.0,1,9999.0", "field"),
        ("PTSAH,0,360.5,1.0", "range"),
        ("PSONLLD,120000.0,24,A,90.5,8.8,425.3,,,,,,,,", "range"),
        ("PSONLLD,120000.0,24,A,,,425.3,,,,,,,,", "field"),
        ("PSONALL,Ship,CRP,120000.0,,,0.0,180.0,,G,0.0,0.0,,0.1,0.1", "field"),
    ],
)
def test_malformed_sentences_are_refused_by_kind(body: str, kind: str) -> None:
    record = read(body)
    assert isinstance(record, Refused)
    assert record.kind == kind


def test_a_wrong_checksum_is_refused() -> None:
    record = parse(b"$PTSAH,0,359.672,0.000*4D")
    assert record == Refused("checksum", "")


@pytest.mark.parametrize("status", ["V,", "V,NRy", "A,NRy", "A,Rej"])
def test_status_and_error_code_make_it_invalid(status: str) -> None:
    assert not seen(ssb("C,H,M,1,2", status=status)).valid


def test_invalid_positions_never_become_nought() -> None:
    for body in (
        "PSONLLD,120000.0,24,V,0.0,0.0,0.0,,,,,,,,",
        "PTSAG,#1,120000.0,01,02,2023,7,0000.0,N,00000.0,E,0,0.0,0,9999.0",
        ssb("R,N,M,0.0,0.0", status="V,"),
    ):
        record = seen(body)
        assert (record.x, record.y, record.valid) == (NAN, NAN, False)


@pytest.mark.parametrize(
    ("channels", "valid"),
    [("F", True), ("7", True), ("E", True), ("3", False), ("8", False), ("0", False)],
)
def test_gaps_needs_three_hydrophones(channels: str, valid: bool) -> None:
    body = f"PTSAG,#1,120000.0,01,02,2023,7,4305.2,N,00631.7,E,{channels},10.0,1,9999.0"
    assert seen(body).valid is valid


def test_gaps_depth_counts_only_where_it_is_one() -> None:
    body = "PTSAG,#1,120000.0,01,02,2023,7,4305.2,N,00631.7,E,F,{},9999.0"
    assert seen(body.format("10.0,1")).depth == seen(body.format("10.0,2")).depth == 10.0
    assert math.isnan(seen(body.format("10.0,0")).depth)


@settings(deadline=None)
@given(st.floats(0.1, 50), st.floats(0.1, 50), st.floats(0, 180))
def test_error_ellipse_turned_to_east_and_north(major: float, minor: float, turn: float) -> None:
    body = f"PSONLLD,120000.0,24,A,50.0,8.8,425.3,{major:.6f},{minor:.6f},{turn:.6f},0.5,,,,"
    record = seen(body)
    # The trace and the determinant's bound of the covariance do not depend on the direction.
    assert math.hypot(record.sigma_x, record.sigma_y) == pytest.approx(
        math.hypot(major, minor), rel=1e-4
    )
    low, high = sorted((major, minor))
    assert low * 0.999 <= record.sigma_x <= high * 1.001
    if turn < 1.0:
        assert record.sigma_y == pytest.approx(major, rel=0.05, abs=0.05 * high)


def test_an_ellipse_towards_the_east() -> None:
    record = seen("PSONLLD,120000.0,24,A,50.0,8.8,425.3,4.0,1.0,90.0,0.5,,,,")
    assert (record.sigma_x, record.sigma_y) == (pytest.approx(4.0), pytest.approx(1.0))
    assert record.sigma_depth == 0.5


def test_declared_nought_is_no_declaration() -> None:
    record = seen(ssb("C,H,M,1,2", tail="3.0,0.0,N,,"))
    assert math.isnan(record.sigma_x)
