import math
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surefix.errors import OptionsError
from surefix.geo.time import (
    DAY,
    GPS_ROLLOVER,
    day_number,
    nearest_day,
    parse_time,
    parse_times,
    second_of_day,
    unix_seconds,
    unix_unit,
    week_rollovers,
)

MIDNIGHT = datetime(2014, 8, 1, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    "text",
    [
        "2014-08-01T01:02:03.250Z",
        "2014-08-01T01:02:03,250",
        "2014-08-01 01:02:03.25",
        "2014-08-01 01:02:03.250000000 UTC",
        "2014-08-01T03:02:03.25+02:00",
        "2014-07-31T20:32:03.25-0430",
        "20140801T010203.250Z",
        "20140801 01:02:03.250",
        "2014/08/01 01:02:03.25",
        "01.08.2014 01:02:03.25",
        " 2014-08-01_01:02:03.25 ",
    ],
)
def test_calendar_texts_mean_the_same_instant(text: str) -> None:
    assert parse_time(text) == MIDNIGHT + 3723.25


@pytest.mark.parametrize("text", ["2014-08-01", "20140801", "2014-08-01 00:00", "2014/08/01"])
def test_what_is_left_out_is_nought(text: str) -> None:
    assert parse_time(text) == MIDNIGHT


@pytest.mark.parametrize(
    "text",
    ["", "now", "NaT", "2014-13-01", "2014-02-30T00:00:00", "2014-08-01 24:01:00", "1406851200",
     "2014-08/01", "12:00:00", "2014-08-01 12:60:00", "٢٠١٤-٠٨-٠١", "2014-08-01T00:00:61Z"],
)  # fmt: skip
def test_other_texts_are_missing(text: str) -> None:
    assert math.isnan(parse_time(text))


@given(st.text(max_size=40))
def test_no_text_raises(text: str) -> None:
    assert isinstance(parse_time(text), float)
    assert parse_times([text, "2014-08-01 00:00:00"])[1] == MIDNIGHT


@given(st.datetimes(datetime(1970, 1, 2), datetime(2200, 1, 1), timezones=st.just(UTC)))
def test_agrees_with_the_standard_library(stamp: datetime) -> None:
    assert parse_time(stamp.isoformat()) == pytest.approx(stamp.timestamp(), abs=1e-6)
    assert parse_time(f"{stamp:%Y%m%d %H:%M:%S.%f}") == pytest.approx(stamp.timestamp(), abs=1e-6)


def test_many_texts_as_one_by_one() -> None:
    texts = ["2014-08-01T00:00:00.124Z", "2014-08-01 00:00:01", "2014-08-01T00:00:02.5"]
    for more in ([], ["", "rubbish"], ["2016-12-31T23:59:60Z"], ["2014-02-30 00:00:00"]):
        one_by_one = [parse_time(text) for text in texts + more]
        np.testing.assert_allclose(parse_times(texts + more), one_by_one, rtol=0, atol=1e-6)
    assert parse_times([]).shape == (0,)
    assert np.isnan(parse_times(["2014-08-01 00:00:00\n2014-08-01 00:00:00"])).all()


def test_leap_second_never_runs_backwards() -> None:
    texts = ["23:59:59.0", "23:59:59.9", "23:59:60.0", "23:59:60.9"]
    times = parse_times([f"2016-12-31 {t}" for t in texts] + ["2017-01-01 00:00:00"])
    assert (np.diff(times) >= 0.0).all()
    assert second_of_day(23, 59, 60.5) == DAY
    assert math.isnan(second_of_day(12, 59, 60.0))
    assert math.isnan(second_of_day(24, 0, 0.0))


def test_day_number() -> None:
    assert day_number(1970, 1, 1) == 0
    assert day_number(2000, 2, 29) == 11016
    assert day_number(1900, 2, 29) is None
    assert day_number(0, 1, 1) is None


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_unit_is_told_by_size(unit: str) -> None:
    ticks = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    values = (np.array([MIDNIGHT, MIDNIGHT + 1.5, np.nan]) * ticks).tolist()
    assert unix_unit(values) == unit
    np.testing.assert_allclose(unix_seconds(values), [MIDNIGHT, MIDNIGHT + 1.5, np.nan], atol=1e-6)
    np.testing.assert_allclose(unix_seconds(values, unit), unix_seconds(values))


def test_small_and_missing_times_are_seconds() -> None:
    assert unix_unit([0.0, 1.0, 3600.0]) == "s"
    assert unix_unit([]) == "s"
    assert unix_unit([math.nan]) == "s"
    with pytest.raises(OptionsError, match="fortnight"):
        unix_seconds([1.0], "fortnight")


@given(st.floats(0.0, 86400.0), st.floats(-1e9, 4e9))
def test_nearest_day_is_within_twelve_hours(second: float, reference: float) -> None:
    time = nearest_day(second, reference)
    assert abs(time - reference) <= DAY / 2 + 1e-6
    assert (time - second) / DAY == pytest.approx(round((time - second) / DAY), abs=1e-9)


def test_nearest_day_of_arrays() -> None:
    seconds = np.array([86399.0, 1.0])
    times = nearest_day(seconds, np.array([MIDNIGHT + 1.0, MIDNIGHT - 1.0]))
    np.testing.assert_array_equal(times, [MIDNIGHT - 1.0, MIDNIGHT + 1.0])


@pytest.mark.parametrize("count", [-1, 0, 1, 2])
def test_week_rollovers(count: int) -> None:
    assert week_rollovers(MIDNIGHT - count * GPS_ROLLOVER + 3.0, MIDNIGHT) == count


def test_other_differences_are_no_rollover() -> None:
    assert week_rollovers(MIDNIGHT - GPS_ROLLOVER + 3 * DAY, MIDNIGHT) == 0
    assert week_rollovers(math.nan, MIDNIGHT) == 0
    assert week_rollovers(MIDNIGHT, math.inf) == 0
