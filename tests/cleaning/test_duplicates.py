import csv
import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surefix.cleaning.duplicates import constant_axes, find_repeats, idle_axes, start_repeats


def find(time, fields, sensor=None, cuts=(), axes=2):
    time, fields = np.asarray(time, dtype=float), np.asarray(fields, dtype=float)
    sensor = np.zeros(time.size, dtype=np.int64) if sensor is None else np.asarray(sensor)
    sensors = int(sensor.max(initial=0)) + 1
    state = start_repeats(fields[:, :axes], sensor, sensors)
    parts = []
    for begin, end in pairwise([0, *sorted(cuts), time.size]):
        here = slice(begin, end)
        out, state = find_repeats(time[here], fields[here], sensor[here], state)
        parts.append(out)
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def fine_walk(count, seed=0):
    rng = np.random.default_rng(seed)
    return np.round(np.cumsum(rng.normal(0.0, 1e-5, (count, 2)), axis=0) + 48.0, 8)


def test_five_copies_of_a_record_count_once():
    walk = fine_walk(50)
    time = np.arange(50.0)
    at = np.sort(np.append(np.arange(50), [20, 20, 20, 20]))
    repeated, held, first = find(time[at], walk[at])
    assert np.flatnonzero(repeated).tolist() == [21, 22, 23, 24]
    assert (first[21:25] == 20.0).all()
    assert not held.any()
    assert np.isnan(first[~repeated]).all()


def test_copies_need_not_follow_each_other():
    time = [0.0, 1.0, 1.0, 1.0, 1.0, 2.0]
    fields = [[1, 1], [2, 2], [3, 3], [2, 2], [3, 3], [2, 2]]
    for cuts in ((), (2,), (3,), (1, 2, 3, 4)):
        repeated, _, _ = find(time, fields, cuts=cuts)
        assert np.flatnonzero(repeated).tolist() == [3, 4]


def test_a_different_field_or_sensor_makes_a_different_record():
    fields = [[1.0, 1.0, np.nan], [1.0, 1.0, 5.0], [1.0, 1.0, np.nan], [1.0, 1.0, np.nan]]
    repeated, _, _ = find([0.0] * 4, fields, sensor=[0, 0, 1, 0])
    assert repeated.tolist() == [False, False, False, True]


def test_polled_fixes_are_held_and_know_their_first_poll():
    time = np.arange(300.0) * 0.2
    fix = np.arange(300) // 5
    _, held, first = find(time, fine_walk(60)[fix])
    assert held.sum() == 240
    assert np.array_equal(first[held], (fix * 1.0)[held])


def test_coarse_digits_at_rest_are_not_held():
    rng = np.random.default_rng(4)
    place = np.round(np.asarray([46.2, 6.1]) * 60 + rng.normal(0.0, 0.4e-3, (500, 2)), 3) / 60
    assert (np.diff(place, axis=0) == 0.0).all(axis=1).mean() > 0.1
    _, held, _ = find(np.arange(500.0), place)
    assert not held.any()


def test_a_ship_that_moors_after_a_voyage_is_not_held():
    rng = np.random.default_rng(4)
    along = np.concatenate((np.cumsum(np.full(300, 6.0)), np.full(600, 1800.0)))
    place = np.round(np.column_stack((along, 0.5 * along)) + rng.normal(0.0, 0.3, (900, 2)))
    _, held, _ = find(np.arange(900.0), place)
    assert (np.diff(place[300:], axis=0) == 0.0).all(axis=1).sum() > 50
    assert held.sum() <= 10  # until the changes at rest outweigh those under way


def test_a_static_log_with_noise_has_no_repeats():
    place = np.round(np.random.default_rng(5).normal(0.0, 1.0, (5000, 2)), 7)
    repeated, held, _ = find(np.arange(5000.0), place)
    assert not repeated.any()
    assert not held.any()


def test_rows_without_time_or_position_are_left_out():
    walk = np.repeat(fine_walk(20), 3, axis=0)
    time = np.arange(60.0)
    time[10], walk[13] = np.nan, np.nan
    repeated, held, first = find(time, walk)
    assert not repeated.any()
    assert not held[[10, 13]].any()
    assert held[14]
    assert first[14] == 12.0
    assert find([], np.empty((0, 2)))[0].size == 0


def test_a_sensor_that_is_not_in_the_head_is_never_held():
    state = start_repeats(fine_walk(5), np.zeros(5, dtype=np.int64), 2)
    out, _ = find_repeats(
        np.arange(10.0), np.repeat(fine_walk(5), 2, axis=0), np.ones(10, dtype=np.int64), state
    )
    assert not out.held.any()


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.integers(0, 5), min_size=1, max_size=60),
    st.lists(st.integers(0, 1), min_size=60, max_size=60),
    st.lists(st.integers(0, 60), max_size=5),
)
def test_the_result_does_not_depend_on_the_chunks(moves, sensor, cuts):
    time = np.cumsum(np.asarray(moves) % 3).astype(float)
    fields = np.cumsum(np.asarray(moves) // 2).astype(float)[:, None] * [[5.0, 7.0, 1.0]]
    sensor = np.asarray(sensor[: time.size])
    whole = find(time, fields, sensor)
    cut = find(time, fields, sensor, [min(at, time.size) for at in cuts])
    for one, two in zip(whole, cut, strict=True):
        assert np.array_equal(one, two, equal_nan=True)


def test_a_constant_axis_is_found():
    position = np.column_stack((fine_walk(12), np.zeros(12)))
    sensor = np.zeros(12, dtype=np.int64)
    assert constant_axes(position, sensor, 2).tolist() == [[False] * 2 + [True], [False] * 3]
    assert not constant_axes(position[:9], sensor[:9], 1).any()
    assert not constant_axes(np.ones((20, 3)), np.zeros(20, dtype=np.int64), 1).any()
    position[:, 2] = np.nan
    assert not constant_axes(position, sensor, 1).any()


@pytest.mark.parametrize(
    ("constant", "metric", "degrees"),
    [
        ({2: 0.0}, [2], [2]),
        ({2: -85.0}, [2], [2]),  # a height that is not measured
        ({0: 0.0}, [0], []),  # half a geographic position is no missing one
        ({0: 36.7}, [], []),  # along a meridian, a quay or the axis of a basin
        ({1: 36.7, 2: 0.0}, [2], [2]),
        ({0: 0.0, 1: 0.0}, [0, 1], [0, 1]),  # zeros in the place of nothing
        ({0: 36.7, 1: -122.1}, [], []),  # at rest
        ({0: 36.7, 1: 0.0}, [1], []),
    ],
    ids=str,
)
def test_an_idle_axis_is_one_that_nobody_measured(constant, metric, degrees):
    position = np.column_stack((fine_walk(12), fine_walk(12)[:, 0]))
    for axis, value in constant.items():
        position[:, axis] = value
    sensor = np.zeros(12, dtype=np.int64)
    for geographic, axes in ((False, metric), (True, degrees)):
        idle = idle_axes(position, sensor, 2, geographic=geographic)
        assert np.flatnonzero(idle[0]).tolist() == axes
        assert not idle[1].any()
    position[3, 0] = np.nan
    assert np.flatnonzero(idle_axes(position, sensor, 1, geographic=False)).tolist() == metric


def columns(path, *names):
    with path.open(newline="") as file:
        return np.asarray(
            [
                [float(row[name].replace("--.--", "nan")) for name in names]
                for row in csv.DictReader(file)
            ]
        )


def test_real_acoustic_log_polled_at_5_hz(data):
    path = data / "usbl_ugps_raw" / "2024-12-05_22-12-34_g2_acoustic.csv"
    table = columns(path, "timestamp", "x", "y", "z", "std")
    repeated, held, _ = find(table[:, 0], table[:, 1:], axes=3)
    assert not repeated.any()
    assert len(table) - held.sum() == 1724  # the first of them before there was any valid fix


def test_real_dive_log_is_polled_although_its_digits_are_coarse(data):
    """Positions kept as 32-bit floats, 0.4 m apart, which change by one step at a time.

    Each axis repeats by itself, but both together more often than independent axes would.
    """
    path = next((data / "usbl_ugps_dive").glob("*.csv"))
    place = columns(path, "gps.lat", "gps.lon")
    _, held, _ = find(np.arange(len(place)), place)
    assert len(place) - held.sum() == 1536


def test_real_survey_with_an_idle_altitude(data):
    path = data / "usbl_mbari" / "oi_survey_1648_USBL_WINFROG.csv"
    place = columns(path, "latitude", "longitude", "altitude")
    idle = idle_axes(place, np.zeros(len(place), dtype=np.int64), 1, geographic=True)
    assert idle.tolist() == [[False, False, True]]


def test_real_yachts_are_not_held_at_their_moorings(data):
    pattern = re.compile(r"\$..RMC,(\d+)[^,]*,A,(\d\d)([\d.]+),[NS],(\d{3})([\d.]+),[EW]")
    for path in sorted((data / "ship_yachts").glob("*.TXT")):
        found = np.asarray(pattern.findall(path.read_text(errors="replace")), dtype=float)
        found = found[np.diff(found[:, 0], prepend=np.nan) != 0.0]  # an epoch logged twice
        _, held, _ = find(np.arange(len(found)), found[:, 1::2] + found[:, 2::2] / 60.0)
        assert held.mean() < 0.01


def test_axes_that_repeat_together_betray_polling():
    """Coarse digits alone do not; handing out an old fix does, whatever the digits."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        fresh = np.rint(rng.normal(0.0, 0.8, (1500, 2)) + np.arange(1500)[:, None] * 0.1)
        _, held, _ = find(np.arange(len(fresh)), fresh)
        assert not held.any()
        polled = np.repeat(fresh, rng.integers(1, 3, len(fresh)), axis=0)
        _, held, _ = find(np.arange(len(polled)), polled)
        assert held.sum() >= len(polled) - len(fresh)
