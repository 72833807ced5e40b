from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surefix.cleaning.clock import ClockState, repair

START = 1_700_000_000.0
HOUR, YEAR = 3600.0, 365.25 * 86400.0


@dataclass
class Whole:
    order: np.ndarray
    tau: np.ndarray
    time: np.ndarray
    late: np.ndarray
    events: list

    def kinds(self):
        return [event.kind for event in self.events]

    def by_row(self, name):
        column = np.empty(self.order.size)
        column[self.order] = getattr(self, name)
        return column


def run(time, place=None, cuts=(), window=10.0):
    """Repair a log cut into chunks; the way a caller keeps the held rows."""
    time = np.asarray(time, dtype=float)
    place = np.full((time.size, 2), np.nan) if place is None else np.asarray(place)
    row = np.arange(time.size)
    state, held, parts, events = ClockState(), row[:0], [], []
    edges = [0, *sorted(cuts), time.size]
    for begin, end in pairwise(edges):
        here = row[begin:end]
        out, state, new = repair(
            time[here],
            place[here],
            here,
            state,
            final=end == time.size and begin == edges[-2],
            window=window,
        )
        known = np.concatenate((held, here))
        parts.append((known[out.order], out.tau, out.time, out.late))
        held = known[out.held]
        events += new
    assert held.size == 0
    return Whole(*(np.concatenate(column) for column in zip(*parts, strict=True)), events)


def clean(count=300, step=1.0):
    return START + step * np.arange(count)


def moving(count, speed=1.0, step=1.0, noise=0.3):
    along = speed * step * np.arange(count)
    rng = np.random.default_rng(1)
    return np.column_stack((along, 0.2 * along)) + rng.normal(0.0, noise, (count, 2))


def test_a_clean_log_comes_out_as_it_went_in():
    out = run(clean())
    assert out.order.tolist() == list(range(300))
    assert (out.tau == clean()).all()
    assert (out.time == clean()).all()
    assert not out.late.any()
    assert out.events == []


@given(
    st.lists(st.floats(0.0, 9.9), min_size=2, max_size=120),
    st.floats(0.01, 3.0),
    st.lists(st.integers(0, 120), max_size=6),
)
def test_rows_out_of_order_within_the_window_equal_the_sorted_run(delays, step, cuts):
    true = START + step * np.arange(len(delays))
    arrival = np.argsort(true + np.asarray(delays), kind="stable")
    out = run(true[arrival], cuts=[min(cut, len(delays)) for cut in cuts])
    assert (out.tau == true).all()
    assert (arrival[out.order] == np.arange(len(delays))).all()
    assert not out.late.any()


def test_equal_times_keep_their_order():
    out = run(np.repeat(clean(100), 3))
    assert out.order.tolist() == list(range(300))
    assert (np.diff(out.tau)[::3] == 0.0).all()


def test_a_leap_second_gives_no_negative_step():
    time = clean()
    time[150:] -= 1.0
    out = run(time)
    assert (np.diff(out.tau) >= 0.0).all()
    assert out.events == []


def test_a_row_that_comes_too_late_is_flagged():
    time = np.insert(clean(), 200, START + 140.0)
    out = run(time)
    assert np.flatnonzero(out.by_row("late")).tolist() == [200]
    assert (out.tau[~out.late] == clean()).all()
    assert out.order.tolist() == list(range(301))


def test_a_late_row_of_a_slow_log_is_flagged():
    time = np.insert(clean(step=60.0), 200, START + 198 * 60.0)
    time[100:] += 7.0
    out = run(time)
    assert np.flatnonzero(out.by_row("late")).tolist() == [200]
    assert (np.diff(out.tau[~out.late]) > 0.0).all()


def test_a_late_batch_is_flagged_and_the_clock_goes_on():
    time = np.concatenate((clean(200), START + np.arange(100.0, 120.0), clean()[200:]))
    out = run(time)
    assert np.flatnonzero(out.by_row("late")).tolist() == list(range(200, 220))
    assert (out.tau[~out.late] == clean()).all()


@pytest.mark.parametrize("size", [-HOUR, -60.0, -6 * YEAR])
def test_a_lasting_step_back_leaves_dt_unaffected(size):
    time = clean()
    time[150:] += size
    out = run(time)
    assert out.tau == pytest.approx(clean(), abs=1e-6)
    assert out.time == pytest.approx(clean(), abs=1e-6)
    assert not out.late.any()
    assert out.kinds() == ["clock-step"]
    assert "back" in out.events[0].text
    assert "row 150" in out.events[0].text
    assert out.events[0].time == pytest.approx(START + 150.0)


def test_a_step_of_six_years_forward_follows_the_new_clock():
    time = clean()
    time[150:] += 6 * YEAR
    out = run(time)
    assert out.tau == pytest.approx(clean(), abs=1e-6)
    assert (out.time == time).all()
    assert out.kinds() == ["clock-step"]


def test_a_step_of_an_hour_forward_is_told_from_a_gap_by_the_motion():
    time = clean()
    time[150:] += HOUR
    out = run(time, moving(300))
    assert out.tau == pytest.approx(clean(), abs=1e-6)
    assert out.time == pytest.approx(clean(), abs=1e-6)
    assert out.kinds() == ["clock-step"]


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_gap_is_a_gap(speed):
    seconds = np.concatenate((np.arange(150.0), np.arange(150.0) + 150.0 + HOUR))
    rng = np.random.default_rng(2)
    place = np.column_stack((speed * seconds, 0.0 * seconds)) + rng.normal(0.0, 1.5, (300, 2))
    out = run(START + seconds, place)
    assert (out.tau == START + seconds).all()
    assert (out.time == START + seconds).all()
    assert out.kinds() == ["gap"]
    assert out.events[0].text == "no fix for 1.00 h"
    assert out.events[0].time == START + 149.0


def test_short_gaps_are_no_event_and_slow_logs_have_no_gaps():
    seconds = np.concatenate((np.arange(100.0), np.arange(125.0, 200.0)))
    assert run(START + seconds).events == []
    assert run(clean(200, step=60.0)).events[1:] == []
    assert (run(clean(200, step=60.0)).tau == clean(200, step=60.0)).all()


@pytest.mark.parametrize("size", [HOUR, 6 * YEAR, 90 * 86400.0])
def test_a_clock_that_steps_and_returns_ends_where_it_was(size):
    for sign in (-1.0, 1.0):
        time = clean(500)
        time[150:350] += sign * size
        out = run(time, moving(500))
        assert out.tau == pytest.approx(clean(500), abs=1e-6)
        assert (out.time[350:] == time[350:]).all()
        assert out.kinds() == ["clock-step", "clock-step"]


@pytest.mark.parametrize("size", [2 * HOUR, -2 * HOUR, 6 * YEAR, -6 * YEAR, 120.0])
@pytest.mark.parametrize("count", [1, 2])
def test_a_few_misdated_rows_are_interpolated(size, count):
    time = clean()
    time[150 : 150 + count] += size
    out = run(time)
    assert out.tau == pytest.approx(clean(), abs=1e-6)
    assert out.time == pytest.approx(clean(), abs=1e-6)
    assert out.kinds() == ["misdated"]
    assert not out.late.any()


@pytest.mark.parametrize("size", [2 * HOUR, -2 * HOUR, 6 * YEAR, -6 * YEAR])
def test_thirty_misdated_rows_are_interpolated(size):
    time = clean()
    time[150:180] += size
    out = run(time)
    assert out.tau == pytest.approx(clean(), abs=1e-6)
    assert out.kinds() == ["misdated"]


def test_a_row_that_overtakes_a_gap_is_not_misdated():
    seconds = np.asarray([*range(100), 8000.0, 105.0, *range(8001, 8100)], dtype=float)
    out = run(START + seconds)
    assert np.flatnonzero(out.by_row("late")).tolist() == []
    assert "gap" in out.kinds()
    assert (np.diff(out.tau) >= 0.0).all()
    assert out.tau[-1] == START + 8099.0


def test_rows_without_time_keep_their_place():
    time = clean()
    time[[0, 1, 150, 151, 299]] = np.nan, np.inf, np.nan, np.nan, np.nan
    out = run(time)
    assert out.order.tolist() == list(range(300))
    assert np.flatnonzero(np.isnan(out.tau)).tolist() == [0, 1, 150, 151, 299]
    assert np.isnan(out.time[[0, 1, 150, 151, 299]]).all()


def test_a_log_without_any_time_is_let_through_at_once():
    out, _, _ = repair(
        np.full(50, np.nan), np.zeros((50, 2)), np.arange(50), ClockState(), final=False
    )
    assert out.order.tolist() == list(range(50))


def test_an_empty_log_gives_nothing():
    out = run([])
    assert out.order.size == 0


def test_a_wrong_date_at_the_start_does_not_shift_the_log():
    for count, size in ((1, 13 * YEAR), (5, -40 * YEAR), (3, HOUR)):
        time = clean()
        time[:count] += size
        out = run(time)
        assert (out.time[count:] == time[count:]).all()
        assert np.diff(out.tau[1:]) == pytest.approx(1.0, abs=1e-6)


def test_two_sensors_with_different_delays_are_interleaved():
    one, two = clean(), clean() + 0.3
    arrival = np.concatenate((one, two + 8.5)).argsort(kind="stable")
    time = np.concatenate((one, two))[arrival]
    out = run(time)
    assert (out.tau == np.sort(time)).all()
    assert out.events == []


def test_little_is_held_back():
    out, _, _ = repair(clean(), moving(300), np.arange(300), ClockState(), final=False)
    assert out.held.tolist() == list(range(290, 300))


FAULTS = st.tuples(
    st.integers(0, 399),
    st.sampled_from(["step", "stray", "late", "gap", "nan", "repeat", "swap"]),
    st.sampled_from([-6 * YEAR, -HOUR, -700.0, -30.0, 12.0, 300.0, 700.0, HOUR, 5 * HOUR, YEAR]),
    st.integers(1, 90),
)


def spoil(time, fault):
    at, kind, size, count = fault
    time = time.copy()
    match kind:
        case "step":
            time[at:] += size
        case "stray" | "late":
            time[at : at + count] += size if kind == "stray" else -abs(size)
        case "gap":
            time[at:] += abs(size)
        case "nan":
            time[at : at + count] = np.nan
        case "repeat":
            time[at : at + count] = time[at]
        case "swap":
            time[at : at + count] = time[at : at + count][::-1]
    return time


@settings(max_examples=150, deadline=None)
@given(
    st.lists(FAULTS, max_size=5),
    st.lists(st.integers(0, 400), max_size=12),
    st.sampled_from([0.05, 1.0, 20.0]),
)
def test_the_result_does_not_depend_on_the_chunks(faults, cuts, step):
    time = clean(400, step)
    for fault in faults:
        time = spoil(time, fault)
    place = moving(400, step=step)
    whole, cut = run(time, place), run(time, place, cuts)
    assert whole.order.tolist() == cut.order.tolist()
    assert np.array_equal(whole.tau, cut.tau, equal_nan=True)
    assert np.array_equal(whole.time, cut.time, equal_nan=True)
    assert (whole.late == cut.late).all()
    assert whole.events == cut.events
    assert sorted(whole.order.tolist()) == list(range(400))
    assert (np.isnan(whole.tau) == np.isnan(whole.time)).all()
    assert (np.diff(whole.tau[~whole.late & ~np.isnan(whole.tau)]) >= 0.0).all()


def test_row_by_row_equals_the_whole():
    time = clean()
    time[100:] -= HOUR
    time[200] += 3 * HOUR
    whole, single = run(time, moving(300)), run(time, moving(300), cuts=range(1, 300))
    assert (whole.tau == single.tau).all()
    assert whole.events == single.events
