"""The ship as other logs tell it: what is kept, what is waited for, and what it places."""

import math

import numpy as np
import pytest

from surefix.geo.local_frame import LocalFrame
from surefix.pipelines.placing import escorted, follow, known_until
from surefix.pipelines.rows import Rows
from surefix.types import PLACE, Channel, Fixes, Log

HOME = LocalFrame(57.0, 179.9999)  # the ship crosses the date line


def place(time):
    """East and north, m: 3 m/s to the east."""
    latitude, longitude, _ = HOME.to_geographic(3.0 * np.asarray(time), 0.0 * np.asarray(time))
    return latitude, longitude


def fixes_of(times, kind="GGA", off=0.0):
    time = np.asarray(times, dtype=float)
    latitude, longitude = place(time)
    return tuple(
        Channel(name, f"gnss GNSS {kind}", time, value, 0.0)
        for name, value in zip(PLACE, (latitude + off, longitude), strict=True)
    )


def headings_of(times, kind="HEHDT", rate=2.0, first=350.0):
    time = np.asarray(times, dtype=float)
    return (Channel("heading_deg", f"gyro {kind}", time, (first + rate * time) % 360.0, 360.0),)


def told(*channels):
    return follow((), Log(source="ship", channels=channels), -np.inf)


def seen(times, starboard=0.0, ahead=50.0):
    n = len(times)
    empty, zero = np.full((n, 3), np.nan), np.zeros(n, np.int64)
    position = np.tile([starboard, ahead, -80.0], (n, 1))
    time = np.asarray(times, dtype=float)
    fixes = Fixes(time, position, empty, empty, empty, zero, zero, zero == 0, zero, False)
    return Rows(fixes, time, time, zero != 0, zero != 0, np.empty((n, 0)))


def local(rows):
    x, y, _ = HOME.to_local(rows.fixes.position[:, 0], rows.fixes.position[:, 1])
    return np.column_stack([x, y])


def test_between_two_fixes_and_two_headings():
    """Through north and over the date line; the depth is untouched."""
    times = np.arange(0.25, 18.0, 0.5)
    series = told(*fixes_of(range(21)), *headings_of(np.arange(0.0, 21.0, 3.0)))
    rows, problems = escorted(seen(times), "ship", [series], "usbl B01")
    bow = np.radians(350.0 + 2.0 * times)
    expected = np.column_stack([3.0 * times + 50.0 * np.sin(bow), 50.0 * np.cos(bow)])
    np.testing.assert_allclose(local(rows), expected, atol=1e-3)
    assert (rows.fixes.position[:, 2] == -80.0).all()
    assert rows.fixes.geographic
    assert problems == ()


def test_sightings_to_the_north_need_no_heading():
    rows, problems = escorted(seen([4.5]), "north", [told(*fixes_of(range(10)))], "usbl")
    np.testing.assert_allclose(local(rows), [[13.5, 50.0]], atol=1e-3)
    assert problems == ()


@pytest.mark.parametrize(
    ("fixes", "headings", "lost"),
    [
        ([0.0, 10.0], [0.0, 10.0], 0),
        ([0.0, 10.1], [0.0, 10.0], 3),
        ([0.0, 10.0], [0.0, 10.1], 3),
        ([0.0, 4.0], [0.0, 10.0], 2),
        ([], [0.0, 10.0], 3),
        ([0.0, 10.0], [], 3),
    ],
)
def test_nothing_is_told_of_a_ship_that_is_not_known(fixes, headings, lost):
    series = told(*fixes_of(fixes), *headings_of(headings))
    rows, problems = escorted(seen([3.0, 5.0, 9.0, math.nan]), "ship", [series], "usbl B01")
    assert [problem.total for problem in problems] == [lost + 1]  # one has no time
    assert problems[0].kind == "unplaced"
    assert np.isnan(rows.fixes.position[:, 0]).sum() == lost + 1


def test_of_several_the_best_that_is_there():
    """GGA before RMC; a better compass before another; an input that is named first before all."""
    series = told(
        *fixes_of(range(10), "RMC", off=1.0),
        *fixes_of([0, 1, 2, 3], "GGA"),
        *headings_of(range(10), "HCHDG", first=80.0),
        *headings_of(range(5), "HEHDT"),
    )
    rows, _ = escorted(seen([2.5, 7.5]), "ship", [series], "usbl")
    assert local(rows)[0, 0] == pytest.approx(7.5 + 50.0 * np.sin(np.radians(355.0)), abs=1e-3)
    assert rows.fixes.position[1, 0] == pytest.approx(place(7.5)[0][0] + 1.0, abs=1e-3)
    other = told(*fixes_of(range(10), "GLL", off=2.0))
    rows, _ = escorted(seen([2.5]), "ship", [other, series], "usbl")
    assert rows.fixes.position[0, 0] == pytest.approx(place(2.5)[0][0] + 2.0, abs=1e-3)


@pytest.mark.parametrize("size", [1, 3, 50])
def test_the_parts_do_not_matter(size):
    """Out of order, doubled, and with a clock that was an hour ahead for a while."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 100.0) + rng.uniform(-2.0, 2.0, 100)
    time[20] = time[21]
    time[40:43] += 3600.0
    value = rng.normal(0.0, 1.0, 100)
    known = ()
    for at in range(0, 100, size):
        part = slice(at, at + size)
        channels = [Channel(name, "g GGA", time[part], value[part], 0.0) for name in PLACE]
        known = follow(known, Log(source="ship", channels=tuple(channels)), -np.inf)
    good = np.delete(time, [21, 40, 41, 42])
    order = np.argsort(good)
    np.testing.assert_array_equal(known[0].time, good[order])
    np.testing.assert_array_equal(known[0].value[:, 0], np.delete(value, [21, 40, 41, 42])[order])


def test_what_is_too_old_is_forgotten():
    known = told(*fixes_of(range(1000)))
    assert len(known[0].time) == 1000  # as long as nothing is let go
    after = follow(known, Log(source="ship", channels=fixes_of([1000])), 900.0)
    assert after[0].time[0] == 600.0


def test_how_far_it_is_known():
    assert known_until(told()) == -np.inf
    assert known_until(told(*fixes_of(range(5)), *headings_of(range(8)))) == 4.0
    # fixes have ended: none that may still come is within 10 s of the last one
    assert known_until(told(*fixes_of(range(5)), *headings_of(range(20)))) == 19.0


def test_a_table_tells_the_ship_too():
    latitude, longitude = place(np.arange(10.0))
    position = np.column_stack([latitude, longitude, np.zeros(10)])
    empty, zero = np.full((10, 3), np.nan), np.zeros(10, np.int64)
    valid = np.arange(10) != 4
    fixes = Fixes(
        np.arange(10.0), position, empty, empty, empty, zero, zero, valid, zero, geographic=True
    )
    log = Log(source="ship.csv", sensors=("ship",), fixes=fixes, channels=headings_of(range(10)))
    series = follow((), log, -np.inf)
    assert {len(each.time) for each in series} == {9, 10}
    rows, _ = escorted(seen([6.5]), "north", [series], "usbl")
    np.testing.assert_allclose(local(rows), [[19.5, 50.0]], atol=1e-3)
