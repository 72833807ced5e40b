"""The methods on recorded logs: made ones first, then those of real ships."""

import json

import numpy as np
import pytest

from docs.pages import ROOT, blocks, run_console
from surefix.cli import main
from surefix.errors import InputError, OptionsError
from surefix.papers.reproduce import contents, reproduce
from surefix.papers.ship_log import ShipLogOptions, run_logs
from surefix.papers.ship_methods import OURS, PAPER
from surefix.pipelines.ship_inputs import streams_of


def sentence(text):
    total = 0
    for byte in text.encode():
        total ^= byte
    return f"${text}*{total:02X}\n"


def clock(second):
    return f"{second // 3600:02d}{second // 60 % 60:02d}{second % 60:02d}"


def angle(degrees, width):
    whole = int(abs(degrees))
    return f"{whole:0{width}d}{60.0 * (abs(degrees) - whole):07.4f}"


def made_log(place, seed=1, n=600):
    """RMC, HDT and DPT of a ship that runs through north; depth has two wild values."""
    rng = np.random.default_rng(seed)
    lines = []
    for k in range(n):
        latitude, heading = 54.1 + k * 4e-5, (350.0 + k / 20.0 + rng.normal(0.0, 0.3)) % 360.0
        knots = 8.0 + rng.normal(0.0, 0.1)
        where = f"{angle(latitude, 2)},N,{angle(10.5 + rng.normal(0.0, 1e-5), 3)},E"
        lines.append(sentence(f"GPRMC,{clock(k)},A,{where},{knots:.1f},{heading:.1f},010724,,,A"))
        lines.append(sentence(f"HEHDT,{heading:.2f},T"))
        depth = 400.0 if k in (200, 400) else 30.0 + rng.normal(0.0, 0.2)
        lines.append(sentence(f"SDDPT,{depth:.2f},0.0"))
        if k % 100 == 50:
            lines.append(lines[-3])  # the same record again
    place.write_text("".join(lines))
    return place


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    log = made_log(tmp_path_factory.mktemp("log") / "made.nmea")
    return run_logs(ShipLogOptions(paths=(log,), seed=2, runs=3))


def test_streams_are_in_order_and_in_radians(tmp_path):
    streams = {s.quantity: s for s in streams_of([made_log(tmp_path / "made.nmea")])}
    assert set(streams) == {"latitude", "longitude", "speed", "course", "heading", "depth"}
    for stream in streams.values():
        assert (np.diff(stream.time) > 0.0).all()
    assert len(streams["latitude"].time) == 600
    assert np.degrees(streams["latitude"].value[0]) == pytest.approx(54.1)
    assert streams["heading"].value.max() < 2.0 * np.pi


def test_edits_seeded_errors_and_the_record(experiment):
    tables = {table.key: table for table in experiment.tables}
    assert set(tables) == {"edited_pct", "seeded_pct", "record"}
    edited = tables["edited_pct"]
    depth = edited.mean[edited.rows.index("SDDPT depth")]
    assert depth[0] == 600
    assert depth[edited.columns.index(PAPER)] == pytest.approx(100.0 * 2 / 600)
    seeded = tables["seeded_pct"]
    paper, ours = (seeded.mean[seeded.rows.index(name)] for name in (PAPER, OURS))
    assert paper[:2].min() > 99.0
    assert paper[2:].max() < 5.0
    assert ours[2:].min() > 25.0
    record = tables["record"]
    assert set(record.rows) == {"east, m", "north, m", "speed, m/s", "heading, °", "depth, m"}
    assert (record.mean[:, 1] > 90.0).all()
    json.dumps(contents(experiment), allow_nan=False)
    assert len(experiment.findings) == 1


def test_two_logs_are_compared(tmp_path):
    logs = [made_log(tmp_path / f"ship_{i}.nmea", seed=i) for i in (1, 2)]
    found = run_logs(ShipLogOptions(paths=tuple(logs), runs=1))
    table = next(table for table in found.tables if table.key == "agreement")
    row = table.mean[table.rows.index("1 SDDPT depth − 2 SDDPT depth, m")]
    assert row[0] == pytest.approx(0.2 * np.sqrt(2.0), rel=0.15)
    assert row[1] == 0.0  # wild at the same instants
    assert len(found.findings) == 2


def test_wrong_logs(tmp_path):
    with pytest.raises(OptionsError):
        ShipLogOptions(paths=())
    short = made_log(tmp_path / "short.nmea", n=20)
    with pytest.raises(InputError, match="no series"):
        reproduce("ship", runs=1, logs=[short])
    with pytest.raises(InputError):
        reproduce("ship", runs=1, logs=[tmp_path / "nothing"])


@pytest.mark.parametrize("name", ["irene_20140628_NMEA0000", "psaros33_20140822_NMEA0000"])
def test_yachts(data, name):
    found = run_logs(ShipLogOptions(paths=(data / "ship_yachts" / f"{name}.TXT",), runs=2))
    tables = {table.key: table for table in found.tables}
    seeded = tables["seeded_pct"]
    paper = seeded.mean[seeded.rows.index(PAPER)]
    assert paper[0] > 97.0
    assert paper[3] < 2.0
    edited = tables["edited_pct"]
    by_name = dict(zip(edited.rows, edited.mean[:, edited.columns.index(PAPER)], strict=True))
    assert max(share for row, share in by_name.items() if "depth" not in row) < 0.5
    assert by_name["IIDPT depth"] < 10.0  # the sounder lost the bottom
    assert tables["record"].mean[:2, 1].min() > 90.0


@pytest.mark.parametrize(("folder", "log"), [("ship_yachts", "irene"), ("ship_palmer", "NBP1406")])
def test_recorded_example_gives_the_figures_of_the_page(data, monkeypatch, folder, log):
    monkeypatch.chdir(data / folder)
    page = ROOT / "docs" / "papers" / "ship.md"
    (block,) = (block for block in blocks(page) if f"--log {log}" in block.text)
    run_console(block.text, f"{page.name}:{block.line}")


def test_receivers_of_a_research_vessel_agree(data):
    names = ("s330", "seap", "PCOD", "gyr1")
    logs = [data / "ship_palmer" / f"NBP1406_{name}-2014-08-01" for name in names]
    found = run_logs(ShipLogOptions(paths=tuple(logs), runs=1))
    table = next(table for table in found.tables if table.key == "agreement")
    latitude = table.mean[table.rows.index("s330 IN latitude − PCOD GNSS latitude, m")]
    assert latitude[0] < 1.5
    assert latitude[1:].max() < 1.0
    record = next(table for table in found.tables if table.key == "record")
    assert (record.mean[:, 3] < 1.0).all()


def test_two_echo_sounders_check_each_other(data, tmp_path):
    """The second one is no NMEA; its depths are put into sentences."""
    folder, second = data / "ship_palmer", tmp_path / "knud.nmea"
    lines = (folder / "NBP1406_knud-2014-08-01").read_text().splitlines()
    pairs = (line.split(",")[:2] for line in lines)
    second.write_text(
        "".join(f"{head.split()[0]} {sentence(f'SDDPT,{depth},0.0')}" for head, depth in pairs)
    )
    logs = (folder / "NBP1406_mbdp-2014-08-01", second)
    found = run_logs(ShipLogOptions(paths=logs, runs=1))
    table = next(table for table in found.tables if table.key == "agreement")
    (row,) = table.mean
    logged, paper, ours = row[1], row[2], row[4]
    assert logged > 10.0
    assert paper < 0.95 * logged
    assert ours < 0.95 * logged


def test_command_line(tmp_path, monkeypatch, capsys):
    log, report = made_log(tmp_path / "made.nmea"), tmp_path / "made.html"
    words = ["surefix", "reproduce", "ship", "--runs", "1", "--log", str(log)]
    monkeypatch.setattr("sys.argv", [*words, "--report", str(report)])
    with pytest.raises(SystemExit) as done:
        main()
    assert done.value.code == 0
    said = capsys.readouterr().out
    assert "On-line cleaning of recorded navigation data" in said
    assert "SDDPT depth" in said
    assert "The series, as logged and cleaned" in report.read_text(encoding="utf-8")
    monkeypatch.setattr("sys.argv", [*words, "--json", str(log)])
    with pytest.raises(SystemExit) as done:
        main()
    assert done.value.code == 1
    assert "also an input" in capsys.readouterr().err
