"""Options of the command line, and the one line that tells when they are wrong."""

import numpy as np
import pytest

from acceptance.product import (
    START,
    clean,
    read,
    surefix,
    survey,
    told_in_one_line,
    write,
)

MODES = ("realtime", "lagged", "offline")
METHODS = ("kalman", "gate", "huber", "igg1", "igg3", "igg3-yang", "student-t")


def test_options_of_a_file_and_over_them_the_command_line(log, tmp_path):
    file = tmp_path / "surefix.toml"
    file.write_text('[clean]\nmode = "realtime"\nmethod = "huber"\nsigma_position = 0.75\n')
    told = clean(log, "--options", file, "--json").json
    assert told["settings"]["mode"] == "realtime"
    assert told["settings"]["method"] == "huber"
    (noise,) = [n for n in told["noise"] if n["quantity"] == "position"]
    assert (noise["value"], noise["source"]) == (0.75, "given")
    told = clean(log, "--options", file, "--method", "igg1", "--json").json
    assert told["settings"]["mode"] == "realtime"
    assert told["settings"]["method"] == "igg1"


def test_columns_of_an_options_file(tmp_path):
    columns = survey(60)
    columns["stamp"] = (columns.pop("time") * 1e3).astype(np.int64)
    write(tmp_path / "log.csv", columns)
    (tmp_path / "o.toml").write_text('[columns]\ntime = "stamp:ms"\n')
    clean(tmp_path / "log.csv", "--options", tmp_path / "o.toml", "-o", tmp_path / "out.csv")
    assert read(tmp_path / "out.csv").time.iloc[0] == START


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[clean]\nmod = 'realtime'\n", ["'mod'", "mode"]),
        ("[cleaning]\n", ["cleaning", "[clean]"]),
        ("[sensor.usbl]\nsigmma = 1\n", ["sensor.usbl", "sigma"]),
        ("[clean]\nmode = 'fast'\n", ["'fast'", "realtime"]),
        ("[clean]\nsigma_position = 'big'\n", ["sigma_position", "number"]),
        ("[clean]\nsigma_position = 0\n", ["sigma_position", "above zero"]),
        ("[clean]\nreorder_s = 'ten'\n", ["reorder_s"]),
        ("[clean]\nheld = 'no'\n", ["held"]),
        ("[clean]\nfalse_alarm = 'x'\n", ["false_alarm"]),
        ("[clean]\nk0 = 'x'\n", ["k0"]),
        ("[clean]\nmethod = 3\n", ["method"]),
        ("[clean]\nmode = ['offline']\n", ["mode"]),
        ("[clean]\nsensor_sigma = 3\n", ["sensor_sigma"]),
        ("[clean]\nevery_s = nan\n", ["every_s"]),
        ("[columns]\ntime = 3\n", ["columns.time"]),
        ("[columns]\ntime = 'nowhere'\n", ["nowhere"]),
        ("[columns]\nwhen = 'time'\n", ["when"]),
        ("not toml", ["TOML"]),
    ],
)
def test_wrong_options_files(log, tmp_path, text, words):
    file = tmp_path / "o.toml"
    file.write_text(text)
    line = told_in_one_line(surefix("clean", log, "--options", file, "-o", tmp_path / "out.csv"))
    assert all(word in line for word in words), line
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--mode", "fast"], ["'fast'", "realtime", "lagged", "offline"]),
        (["--method", "mean"], ["'mean'", "igg3", "student-t"]),
        (["--model", "cj"], ["'cj'", "cv"]),
        (["--lag", "soon"], ["--lag", "'soon'", "200ms"]),
        (["--every", "0"], ["every", "above zero"]),
        (["--every", "-1s"], ["every"]),
        (["--recovery", "1e400"], ["recovery"]),
        (["--every", "nan"], ["--every"]),
        (["--sigma-position", "0"], ["sigma_position", "above zero"]),
        (["--sigma-position", "-1"], ["sigma_position"]),
        (["--sigma-height", "inf"], ["sigma_height"]),
        (["--sigma-velocity", "nan"], ["sigma_velocity"]),
        (["--process", "0"], ["process"]),
        (["--k0", "-1"], ["k0"]),
        (["--k0", "5", "--k1", "2"], ["k0", "k1"]),
        (["--column", "x"], ["--column x", "role=column"]),
        (["--column", "speeed=x"], ["speeed"]),
        (["--column", "x=x:kg"], ["kg"]),
        (["--column", "x=nowhere"], ["nowhere"]),
        (["-o", "track.xlsx"], [".xlsx", ".csv"]),
        (["-o", "track"], ["track", ".csv"]),
        (["-o", "track.gpx"], ["lat"]),
        (["-o", "a.csv", "-o", "./a.csv"], ["two outputs"]),
        (["--report", "report.pdf"], [".html"]),
        (["--depth", "nowhere.csv"], ["nowhere.csv", "No such file"]),
        (["--options", "nowhere.toml"], ["nowhere.toml"]),
    ],
)
def test_wrong_words_are_told_in_one_line(log, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.iterdir())
    line = told_in_one_line(surefix("clean", log, *words))
    assert all(word in line for word in told), line
    assert set(tmp_path.iterdir()) == before


def test_unknown_options_are_usage_errors(log):
    done = surefix("clean", log, "--methd", "igg3")
    assert done.code == 2
    assert "--methd" in done.err
    assert "Traceback" not in done.err


def test_the_input_is_not_overwritten(log):
    """Neither by its own name nor by a link to it."""
    before = log.read_bytes()
    done = surefix("clean", log, "-o", log)
    if done.code == 0:
        pytest.fail("the raw log was replaced by its own clean track")
    told_in_one_line(done)
    assert log.read_bytes() == before
