"""Faults 1–15 of bad input: a counted problem, the rest of the log unharmed."""

import numpy as np
import pandas as pd
import pytest

from acceptance.product import clean, gga, read, sentence, survey, write, zda
from surefix.io import nmea_log
from surefix.pipelines import inputs

N = 40
BAD = 20  # the epoch that a fault befalls


def place(i: int) -> tuple[float, float]:
    return 60.0 + 1e-5 * i, 5.0 + 2e-5 * i


def epoch(i: int, talker: str = "GP") -> str:
    return gga(f"1200{i:02d}", *place(i), talker=talker)


def log(tmp_path, *, instead=None, words=(), lines=None):
    """What comes of a log in which one epoch was replaced: the summary, and the track."""
    if lines is None:
        lines = [epoch(i) for i in range(N)]
        if instead is not None:
            lines[BAD] = instead
        lines.insert(0, zda("120000", 1, 5, 2024))
    path = tmp_path / "gps.log"
    content = b"".join(line if isinstance(line, bytes) else line.encode() for line in lines)
    path.write_bytes(content)
    told = clean(path, "-o", tmp_path / "out.csv", "--json", *words).json
    track = read(tmp_path / "out.csv")
    assert told["fixes"] == len(track)
    good = track.dropna(subset=["lat"])
    assert (good.lat.between(59.9, 60.1) & good.lon.between(4.9, 5.1)).all()  # never 0, 0
    return {p["kind"]: p["total"] for p in told["problems"]}, track


def seconds(track: pd.DataFrame) -> list[int]:
    return (track.time % 60).round().astype(int).tolist()


WITHOUT = [i for i in range(N) if i != BAD]


def test_fault_01_no_checksum(tmp_path):
    bare = epoch(BAD).partition("*")[0] + "\r\n"
    problems, track = log(tmp_path, instead=bare)
    assert (problems, seconds(track)) == ({"no-checksum": 1}, WITHOUT)
    problems, track = log(tmp_path, instead=bare, words=["--no-checksum"])
    assert (problems, seconds(track)) == ({}, list(range(N)))


def test_fault_02_wrong_checksum(tmp_path):
    wrong = epoch(BAD).replace("1200", "1201", 1)
    problems, track = log(tmp_path, instead=wrong)
    assert (problems, seconds(track)) == ({"checksum": 1}, WITHOUT)
    problems, track = log(tmp_path, instead=wrong, words=["--no-checksum"])
    assert (problems, seconds(track)) == ({"checksum": 1}, WITHOUT)


def test_fault_03_checksum_of_nought(tmp_path):
    (lat, lon), bodies = place(BAD), []
    lat, lon = f"{int(lat):02d}{lat % 1 * 60:09.6f}", f"{int(lon):03d}{lon % 1 * 60:09.6f}"
    for i in range(1000):
        speed, course = f"2.{i % 10}", ("45", "45.", "45.5")[i % 3]
        figures = f"{speed},{course},010524,{i // 10}.{i % 7}"
        bodies.append(f"GPRMC,1200{BAD},A,{lat},N,{lon},E,{figures},E,A")
    line = next(line for line in map(sentence, bodies) if line.endswith("*00\r\n"))
    problems, track = log(tmp_path, instead=line)
    assert (problems, seconds(track)) == ({}, list(range(N)))


def test_fault_04_stream_split_at_every_byte(tmp_path, monkeypatch):
    problems, whole = log(tmp_path)
    content = (tmp_path / "gps.log").read_bytes()
    assert problems == {}
    blocks = [name for name in ("_BLOCK", "BLOCK", "CHUNK", "_CHUNK") if hasattr(nmea_log, name)]
    for size in (1, 2, 3, 7, 64):
        for name in blocks:
            monkeypatch.setattr(nmea_log, name, size)
        monkeypatch.setattr(inputs, "_HEAD", max(size, 512))
        (tmp_path / "gps.log").write_bytes(content)
        clean(tmp_path / "gps.log", "-o", tmp_path / "again.csv")
        pd.testing.assert_frame_equal(read(tmp_path / "again.csv"), whole)


@pytest.mark.parametrize("kept", [7, 15, 25, 30, 44, 60, 70])
def test_fault_05_truncated_gga(tmp_path, kept):
    problems, track = log(tmp_path, instead=epoch(BAD)[:kept] + "\r\n")
    assert sum(problems.values()) == 1
    assert seconds(track) == WITHOUT


def test_fault_06_two_sentences_glued(tmp_path):
    """The first lost its end, the second is whole."""
    glued = epoch(BAD)[:30] + epoch(BAD + 1)
    lines = [zda("120000", 1, 5, 2024), *(epoch(i) for i in range(N) if i not in (BAD, BAD + 1))]
    lines.insert(BAD + 1, glued)
    problems, track = log(tmp_path, lines=lines)
    assert sum(problems.values()) == 1
    assert seconds(track) == WITHOUT


def test_fault_07_absurd_counts(tmp_path):
    absurd = sentence(epoch(BAD).split("*")[0][1:].replace(",1,09,", ",1,9999999,"))
    problems, track = log(tmp_path, instead=absurd)
    assert sum(problems.values()) <= 1
    assert set(WITHOUT) <= set(seconds(track))
    many = sentence("GPGSV,99999999,4,99999999,01,40,083,46")
    problems, track = log(tmp_path, instead=many)
    assert seconds(track) == WITHOUT


def test_fault_08_ten_megabytes_without_a_newline(tmp_path):
    problems, track = log(tmp_path, instead=b"$GPGGA," + b"1" * 10_000_000 + b"\r\n")
    assert sum(problems.values()) >= 1
    assert seconds(track) == WITHOUT


def test_fault_09_binary_nul_and_bad_utf8(tmp_path):
    noise = np.random.default_rng(1).integers(0, 256, 5000, dtype=np.uint8).tobytes()
    rubbish = b"\x00\x00" + noise.replace(b"$", b"") + b"\xff\xfe\xc3\x28\r\n"
    problems, track = log(tmp_path, instead=rubbish)
    assert problems
    assert seconds(track) == WITHOUT


@pytest.mark.parametrize(
    "body",
    [
        "GPGGA,120020,,N,00500.0000,E,1,09,0.9,2.0,M,40.0,M,,",
        "GPGGA,120020,6000.0000,,00500.0000,E,1,09,0.9,2.0,M,40.0,M,,",
        "GPGGA,120020,6000.0000,E,00500.0000,N,1,09,0.9,2.0,M,40.0,M,,",
        "GPGGA,120020,6000.0000,n,00500.0000,e,1,09,0.9,2.0,M,40.0,M,,",
        "GPGGA,120020,-6000.0000,N,00500.0000,E,1,09,0.9,2.0,M,40.0,M,,",
    ],
)
def test_fault_10_hemispheres(tmp_path, body):
    _, track = log(tmp_path, instead=sentence(body))
    believed = track[track.verdict.isin(["used", "downweighted"])]
    assert BAD not in seconds(believed)
    assert set(WITHOUT) == set(seconds(believed))


@pytest.mark.parametrize(
    ("lat", "lon"),
    [("9100.0000", "00500.0000"), ("6060.0000", "00500.0000"), ("6000.0000", "18100.0000")],
)
def test_fault_11_impossible_coordinates(tmp_path, lat, lon):
    body = f"GPGGA,120020,{lat},N,{lon},E,1,09,0.9,2.0,M,40.0,M,,"
    problems, track = log(tmp_path, instead=sentence(body))
    assert sum(problems.values()) == 1
    assert seconds(track) == WITHOUT


def test_fault_12_valid_checksum_shuffled_fields(tmp_path):
    body = "GPGGA,00500.0000,N,120020,6000.0000,E,09,1,0.9,2.0,M,40.0,M,,"
    problems, track = log(tmp_path, instead=sentence(body))
    assert sum(problems.values()) == 1
    assert seconds(track) == WITHOUT


def test_fault_13_several_systems_for_one_epoch(tmp_path):
    lines = [zda("120000", 1, 5, 2024)]
    for i in range(N):
        lines += [epoch(i, talker) for talker in ("GP", "GN", "GL")]
    problems, track = log(tmp_path, lines=lines)
    assert (problems, seconds(track)) == ({}, list(range(N)))
    assert track.sensor.nunique() == 1


def test_fault_14_ais_fragments_never_completed(tmp_path):
    body = "AIVDM,2,1,{},A,55NPNT81VV5=`uQ3;OM1HDp4pMT4r2222222220,0"
    fragments = [sentence(body.format(i % 10)).replace("$", "!") for i in range(20_000)]
    problems, track = log(tmp_path, instead="".join(fragments))
    assert sum(problems.values()) in (0, 20_000)
    assert seconds(track) == WITHOUT


@pytest.mark.parametrize("mode", ["realtime", "offline"])
def test_fault_15_large_table_without_a_final_newline(tmp_path, mode):
    n = 60_000
    path = write(tmp_path / "log.csv", survey(n, interval=0.5))
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    assert path.stat().st_size > 4e6
    told = clean(path, "--mode", mode, "-o", tmp_path / "out.csv", "--json").json
    assert (told["fixes"], told["problems"]) == (n, [])
    track = read(tmp_path / "out.csv")
    assert track.row.tolist() == list(range(n))
    assert track.verdict.iloc[-1] == "used" or track.weight.iloc[-1] > 0.0


def test_fault_50_no_formula_in_the_output(tmp_path):
    columns = pd.DataFrame(survey(30))
    columns["sensor"] = '=HYPERLINK("http://example.org","x")'
    columns.to_csv(tmp_path / "log.csv", index=False)
    clean(tmp_path / "log.csv", "-o", tmp_path / "out.csv")
    track = read(tmp_path / "out.csv")
    assert track.sensor.str.startswith("'=HYPERLINK").all()
    assert (track.z < 0).all()
