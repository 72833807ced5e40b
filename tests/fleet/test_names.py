"""Names of the outputs of a fleet."""

from pathlib import Path

import pytest

from surefix.fleet.names import output_names


def named(*logs, **known):
    paths = [Path(log) for log in logs]
    return list(output_names(paths, {f"/{k}": v for k, v in known.items()}).values())


@pytest.mark.parametrize(
    ("logs", "names"),
    [
        (["/d/one.csv", "/d/two.csv"], ["one", "two"]),
        (["/d/a/usbl.csv", "/d/b/usbl.csv"], ["a-usbl", "b-usbl"]),
        (["/x/a/usbl.csv", "/y/a/usbl.csv"], ["x-a-usbl", "y-a-usbl"]),
        (["/d/usbl.csv", "/d/usbl.nmea"], ["usbl-csv", "usbl-nmea"]),
        (["/d/USBL.csv", "/e/usbl.csv"], ["d-USBL", "e-usbl"]),
        (["/a-b/c.csv", "/a/b-c.csv", "/x/c.csv"], ["a-b-c", "b-c", "x-c"]),
    ],
)
def test_names_differ_and_say_where_they_come_from(logs, names):
    assert named(*logs) == names


def test_a_log_keeps_its_name_when_another_comes():
    assert named("/b/usbl.csv", "/a/usbl.csv", **{"a/usbl.csv": "usbl"}) == ["b-usbl", "usbl"]


def test_no_name_is_given_twice():
    logs = [f"/{a}/{b}{s}" for a in "ab" for b in ("x", "a-x", "b-x") for s in (".csv", ".nmea")]
    names = named(*logs)
    assert len({name.casefold() for name in names}) == len(logs)
