"""Methods compared on logs: the same from a seed, honest where the world is, robust where not."""

import json
import re

import numpy as np
import pytest

from acceptance.product import surefix, survey, told_in_one_line, write
from surefix.comparison.logs import LENGTHS, LogOptions, compare_logs
from surefix.errors import InputError, OptionsError
from surefix.papers.reproduce import contents, text_lines
from surefix.simulate.contamination import World, alone, columns, draw

KEYS = (
    "median_m",
    "q68_m",
    "q90_m",
    "score_nats",
    "within1_pct",
    "within2_pct",
    "within3_pct",
    "rejected_pct",
    "fastest_mps",
)


def log_of(scenario, seed, epochs=400):
    return columns(alone(draw(scenario, World(epochs=epochs, axes=2), [seed])))


@pytest.fixture(scope="module")
def wild():
    options = LogOptions(
        logs=(log_of("isolated-20", 1), log_of("burst-common", 2)),
        methods=("kalman", "igg3", "gnc", "wolf"),
        modes=("offline", "realtime"),
        folds=2,
    )
    return compare_logs(options)


def values(found, key):
    (table,) = (table for table in found.tables if table.key == key)
    return {row: dict(zip(table.columns, line, strict=True)) for row, line in _lines(table)}


def _lines(table):
    return zip(table.rows, table.mean, strict=True)


def test_every_figure_has_a_table_a_mode(wild):
    keys = [table.key for table in wild.tables]
    assert keys == [f"{key}-{mode}" for mode in ("offline", "realtime") for key in KEYS]
    rows = [f"table #{log} ×{length}" for log in (1, 2) for length in LENGTHS]
    assert list(values(wild, "score_nats-offline")) == rows
    assert list(values(wild, "rejected_pct-offline")) == ["table #1", "table #2"]
    assert np.isnan(values(wild, "median_m-offline")["table #1 ×1"]["wolf"])
    assert np.isnan(values(wild, "median_m-realtime")["table #1 ×1"]["gnc"])
    assert [len(panel.traces) for panel in wild.figures[0].panels] == [4, 4]


def test_a_method_that_follows_gross_errors_foretells_worse(wild):
    for row, line in values(wild, "score_nats-offline").items():
        assert line["kalman"] < line["igg3"] - 0.3, row
    for row, line in values(wild, "q68_m-offline").items():
        assert line["kalman"] > 1.5 * line["igg3"], row
    for line in values(wild, "rejected_pct-offline").values():
        assert line["kalman"] == 0.0
        assert line["igg3"] > 4.0


def test_the_farther_a_fix_is_from_others_the_worse_it_is_foretold(wild):
    for key, sign in (("median_m", 1.0), ("score_nats", -1.0)):
        for mode in ("offline", "realtime"):
            found = values(wild, f"{key}-{mode}")
            one, _, ten = (sign * found[f"table #1 ×{n}"]["igg3"] for n in LENGTHS)
            assert one < ten
    offline, now = (values(wild, f"median_m-{mode}") for mode in ("offline", "realtime"))
    assert all(offline[row]["igg3"] < now[row]["igg3"] for row in offline)


def test_findings_say_who_is_best_and_how_surely(wild):
    assert len(wild.findings) == 4
    assert wild.findings[0].startswith("table #1, offline, ")
    below = re.findall(r"([\w-]+) (\d\.\d+) ± \d\.\d+", wild.findings[0].split("nats a fix: ")[1])
    assert {name for name, _ in below} < {"kalman", "igg3", "gnc"}
    assert below[-1][0] == "kalman"
    assert [float(figure) for _, figure in below] == sorted(float(figure) for _, figure in below)


@pytest.mark.parametrize(("seed", "mode"), [(0, "offline"), (1, "realtime"), (2, "offline")])
def test_where_the_world_is_that_of_the_filter_the_shares_are_honest(seed, mode):
    options = LogOptions(
        logs=(log_of("clean", seed, 1200),), methods=("kalman",), modes=(mode,), folds=5, seed=seed
    )
    found = compare_logs(options)
    for sigmas, honest in ((1, 68.3), (2, 95.4), (3, 99.7)):
        for line in values(found, f"within{sigmas}_pct-{mode}").values():
            assert line["kalman"] == pytest.approx(honest, abs=5.0 if sigmas == 1 else 3.0)


def test_a_seed_deals_the_fixes_and_processes_change_nothing():
    log = log_of("isolated-5", 3, 250)
    one, two, other = (
        compare_logs(LogOptions(logs=(log,), methods=("igg3", "huber"), folds=1, seed=s, jobs=j))
        for s, j in ((1, 1), (1, 2), (2, 1))
    )
    assert text_lines(one) == text_lines(two)
    assert values(one, "median_m-offline") != values(other, "median_m-offline")


def test_the_command_tells_and_writes(tmp_path):
    place, page = tmp_path / "c.json", tmp_path / "c.html"
    log = write(tmp_path / "dive.csv", {"when": survey(300)["time"], **survey(300)})
    words = ["--log", log, "--methods", "kalman,igg3", "--folds", 1, "--jobs", 1]
    words += ["--column", "time=when"]
    done = surefix("compare", *words, "--json", place, "--report", page)
    assert done.code == 0, done.err
    options = LogOptions(logs=(log,), methods=("kalman", "igg3"), folds=1)
    assert json.loads(place.read_text(encoding="utf-8")) == contents(compare_logs(options))
    for title in ("Log score, offline", "90 %, offline", "Within 2 σ", "log rejected, offline"):
        assert title in done.out
    assert "Greatest speed" not in done.out
    assert "below the best" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("wrong", "choices"),
    [
        ({"methods": ("magic",)}, "sage-husa"),
        ({"modes": ("lagged",)}, "realtime"),
        ({"folds": 11}, "from 1 to 10"),
        ({"logs": ()}, "one or more"),
        ({"logs": ("a.csv", "b.csv"), "depth": "d.csv"}, "one log at a time"),
        ({"jobs": 0}, "from 1"),
    ],
)
def test_what_cannot_be_compared_is_refused(wrong, choices):
    with pytest.raises(OptionsError, match=choices):
        LogOptions(**{"logs": ("a.csv",), **wrong})


def test_a_short_log_is_refused():
    with pytest.raises(InputError, match="at least 100"):
        compare_logs(LogOptions(logs=(survey(60),), methods=("igg3",)))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--log", "a.csv", "--runs", 3), "--runs"),
        (("--log", "a.csv", "--scenarios", "clean"), "without --log"),
        (("--folds", 3), "with --log"),
        (("--no-checksum",), "--no-checksum"),
        (("--log", "none.csv"), "none.csv"),
        (("--log", "a.csv", "--json", "a.csv"), "also an input"),
    ],
)
def test_options_of_the_other_kind_are_refused(words, told, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert told in told_in_one_line(surefix("compare", *words, "--jobs", 1))
