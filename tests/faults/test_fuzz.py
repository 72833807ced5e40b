"""Mutated sentences and options: a counted problem or an error in words, never an exception."""

import math
import random

import numpy as np
import pytest

from faults import fuzz
from faults.mutations import FIGURES, mutated
from service.test_station import CLEAN, recorded, station_of
from surefix.errors import SurefixError
from surefix.io.journal import Received
from surefix.service.options import read_live
from surefix.service.station import latest, receive

OPTIONS = b"""
[clean]
settle_rows = 120
reorder_s = 2.0
method = "igg3"
sigma_position = 0.5
k0 = 2.5

[columns]
time = "t:ms"

[sensor.gnss]
sigma = 1.2
delay_s = 0.4

[[input]]
name = "gnss"
from = "udp://0.0.0.0:10110"
role = "fixes"
allow = ["192.168.1.0/24"]
require_checksum = true

[[input]]
name = "depth"
from = "serial:///dev/ttyUSB0?baud=4800"
role = "depth"

[[output]]
to = "tcp-listen://127.0.0.1:10111"
sentences = ["GGA", "RMC"]
talker = "IN"

[journal]
url = "sqlite:///mission.db"
snapshot_s = 10.0
"""


def test_a_million_sentences():
    before = fuzz.memory()
    for seed in range(100):
        fuzz.read(seed)
    assert fuzz.memory() < before + 150.0


def test_as_files(tmp_path):
    for seed in range(500, 504):
        fuzz.read(seed, tmp_path)


def test_what_it_has_found():
    """A NUL for a letter was taken for an empty field by the kernel alone."""
    data = b"$HCHDG,101.1,2.5,\x00,7.1,E*07\r\n"
    assert fuzz.told(fuzz.by_kernel(data)) == fuzz.told(fuzz.by_stream(data))


def test_the_checks_can_fail(monkeypatch):
    """A reader that loses one record in ten thousand is found out."""
    whole = fuzz.by_kernel

    def losing(data, cuts=()):
        return whole(data.partition(b"\n")[2])

    monkeypatch.setattr(fuzz, "by_kernel", losing)
    with pytest.raises(AssertionError):
        fuzz.read(0)


def test_a_live_station_lives_on():
    """Good sentences among thousands of bad ones: positions go on, and are sane."""
    source = random.Random(3)
    station, number, seen = station_of("boat", clean=CLEAN), 0, []
    for line in recorded(400).splitlines(keepends=True):
        bad = b"".join(mutated(source) for _ in range(8)) if source.random() < 0.5 else b""
        for data in (bad + b"\r\n", line):
            number += 1
            piece = [Received(number, 0, 1_785_585_600.0 + number / 6.0, data)]
            station, _ = receive(station, piece)
        if number % 40 == 0:
            seen.append(latest(station))
    positions = [now.geodetic for now in seen if now is not None]
    assert len(positions) > 10
    assert all(math.isfinite(now.time) for now in seen if now is not None)
    assert np.isfinite(np.array(positions)[:, :2]).all()  # a height may be lost in between


def test_options_that_are_mutated(tmp_path):
    place, source = tmp_path / "live.toml", random.Random(4)
    good = 0
    for _ in range(4000):
        text = bytearray(OPTIONS)
        for _ in range(source.choice((1, 1, 2, 4))):
            at = source.randrange(len(text))
            kind = source.randrange(5)
            if kind == 0:
                text[at] = source.randrange(256)
            elif kind == 1:
                del text[at : at + source.choice((1, 5, 40))]
            elif kind == 2:
                begin = text.find(b"= ", at) + 2
                end = text.find(b"\n", begin)
                text[begin:end] = source.choice(FIGURES)
            elif kind == 3:
                text[at:at] = source.choice(FIGURES)
            else:
                begin = text.find(b"\n", at)
                text[begin:begin] = text[begin : begin + 60]
        place.write_bytes(text)
        try:
            read_live(place)
        except SurefixError:
            continue
        except Exception as error:
            raise AssertionError(bytes(text)) from error
        good += 1
    assert 0 < good < 4000
