"""Faults 48 to 50 of files: none is unpacked, none is run, none becomes a formula."""

import io
import pickle
import re
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import surefix
from acceptance.product import clean, survey, told_in_one_line, write
from acceptance.product import surefix as run

SOURCES = Path(surefix.__file__).parent

XXE = b"""<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY x SYSTEM "file:///etc/hostname">]>
<gpx version="1.1"><trk><name>&x;</name><trkseg><trkpt lat="1" lon="2"/></trkseg></trk></gpx>"""
LAUGHS = (
    b'<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a0 "ha">'
    + b"".join(b'<!ENTITY a%d "%s">' % (n, b"&a%d;" % (n - 1) * 10) for n in range(1, 10))
    + b"]><gpx><name>&a9;</name></gpx>"
)


def zipped(name, content):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return out.getvalue()


class Evil:
    """Leaves a trace if it is unpickled."""

    def __init__(self, trace):
        self.trace = trace

    def __reduce__(self):
        return Path.touch, (self.trace,)


FILES = {
    "xxe.gpx": lambda _: XXE,
    "laughs.gpx": lambda _: LAUGHS,
    "bomb.kmz": lambda _: zipped("doc.kml", bytes(200 << 20)),
    "slip.kmz": lambda _: zipped("../../evil.kml", b"<kml/>"),
    "bomb.csv.zip": lambda _: zipped("log.csv", b"0" * (200 << 20)),
    "evil.pkl": lambda trace: pickle.dumps(Evil(trace)),
    "evil.parquet": lambda trace: b"PAR1" + pickle.dumps(Evil(trace)) + b"PAR1",
    "evil.nmea": lambda trace: pickle.dumps(Evil(trace)),
}


def evil_npy(trace):
    out = io.BytesIO()
    np.save(out, np.array([Evil(trace)], dtype=object), allow_pickle=True)
    return out.getvalue()


FILES["evil.npy"] = evil_npy


@pytest.mark.parametrize("name", FILES)
def test_fault_48_49_a_file_that_is_a_trap(tmp_path, name):
    """Refused in one line, in little memory, nothing beside it written, nothing run."""
    trace = tmp_path / "trace"
    (tmp_path / name).write_bytes(FILES[name](trace))
    before = sorted(tmp_path.rglob("*"))
    run("clean", tmp_path / "none.csv")  # what is loaded once is loaded
    tracemalloc.start()
    try:
        done = run("clean", tmp_path / name)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    told_in_one_line(done)
    assert peak < 100e6
    assert sorted(tmp_path.rglob("*")) == before
    assert not trace.exists()


def test_fault_49_nothing_that_runs_what_it_reads():
    pattern = re.compile(r"\b(pickle|marshal|shelve|dill)\b|allow_pickle=True|\b(eval|exec)\(")
    for place in SOURCES.rglob("*.py"):
        for number, line in enumerate(place.read_text().splitlines(), 1):
            assert not pattern.search(line), f"{place}:{number}: {line}"


def test_fault_50_text_is_no_formula_and_numbers_stay(tmp_path):
    """The name of a sensor, or of a file, that a spreadsheet would run."""
    log = pd.DataFrame(survey(60))
    log["x"] -= 1000.0
    write(tmp_path / "=HYPERLINK(evil).csv", log)
    clean(tmp_path / "=HYPERLINK(evil).csv", "-o", tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text()
    assert not re.search(r'(^|,)"?[=+@]', text, re.MULTILINE)
    track = pd.read_csv(tmp_path / "out.csv")
    assert (track.x < -500.0).all()
    assert '"-' not in text
