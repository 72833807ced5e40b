"""Every log of every receiver goes through: a result, or one clear line."""

import pytest

from acceptance.product import read, surefix, told_in_one_line
from surefix.io.nmea_log import read_nmea, sniff


@pytest.fixture(scope="module")
def receivers(data):
    return sorted((data / "nmea_receivers").glob("*.log"))


def test_every_receiver_log_is_cleaned(receivers, tmp_path):
    done_well = rows = bad = 0
    for path in receivers:
        out = tmp_path / "track.csv"
        done = surefix("clean", path, "-o", out, "--json")
        if done.code:
            line = told_in_one_line(done)
            assert path.name in line
            nmea = sniff(path.read_bytes()[: 1 << 16])
            assert nmea == ("no position and no series found" in line), path.name
            assert not list(tmp_path.iterdir())
            continue
        assert done.err == ""
        told = done.json
        refused = {p["kind"]: p["total"] for p in told["problems"]}
        (log,) = read_nmea(path)
        assert refused == {p.kind: p.total for p in log.problems}
        bad += refused.get("checksum", 0)
        fixes = 0 if log.fixes is None else len(log.fixes.time)
        assert told["fixes"] == sum(told["verdicts"].values()) == fixes
        if log.fixes is not None:
            assert len(read(out)) == fixes
        rows += fixes
        done_well += 1
        for written in tmp_path.iterdir():
            written.unlink()
    assert done_well >= 85
    assert rows > 2500
    assert bad > 30


def test_every_receiver_log_is_looked_at(receivers):
    looked = 0
    for path in receivers:
        done = surefix("info", path)
        if done.code:
            told_in_one_line(done)
            continue
        assert done.err == ""
        assert path.name in done.out
        assert "surefix clean" in done.out
        looked += 1
    assert looked >= 85
