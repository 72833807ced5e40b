import base64
import json
from dataclasses import replace

import numpy as np
import pytest

from report.made import cleaned, judged, straight
from surefix.report.encode import dumps
from surefix.report.headline import headline
from surefix.report.marks import clock_of, drawn
from surefix.report.plan import swept
from surefix.report.tables import worst_table
from surefix.report.thin import breaks, extremes, outline, pieces, view
from surefix.types import Verdict


def test_extremes_keep_the_peaks_and_the_limit() -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal((10_000, 2))
    values[4321, 1] = 50.0
    values[17] = np.nan
    rows = extremes(values, 500)
    assert rows.size <= 500
    assert {0, 4321, 9_999} <= set(rows.tolist())
    assert (np.diff(rows) > 0).all()
    assert 17 not in rows


def test_all_rows_are_kept_while_they_are_few() -> None:
    assert extremes(np.full((7, 1), np.nan), 7).tolist() == list(range(7))


def test_lines_break_at_gaps_and_at_holes() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 90.0, 91.0])
    good = np.array([True, True, False, True, True, True, True])
    runs = pieces(np.arange(7), breaks(time), good)
    assert [run.tolist() for run in runs] == [[0, 1], [3, 4], [5, 6]]


def test_the_outline_closes_each_run() -> None:
    rows, values = outline(np.zeros(3), np.ones(3), [np.array([0, 1]), np.array([2])])
    assert rows.tolist() == [0, 1, 1, 0, -1, 2, 2, -1]
    np.testing.assert_array_equal(values, [0, 0, 1, 1, np.nan, 0, 1, np.nan])


def test_the_view_keeps_the_core_whatever_the_doubtful() -> None:
    shown = view(np.array([0.0, 10.0, np.nan]), np.array([1e7, -3.0]), least=1.0)
    assert shown.low < -3.0
    assert 10.0 < shown.high < 20.0
    assert view(np.zeros(0), np.zeros(0), least=1.0).high > 0.0


def test_the_swept_band_holds_both_ellipses_and_turns_one_way() -> None:
    centre = np.array([[0.0, 0.0], [10.0, 5.0], [4.0, 5.0]])
    radius = np.array([[1.0, 2.0], [2.0, 1.0], [0.5, 0.5]])
    points = swept(centre, radius).reshape(2, -1, 2)[:, :-1]
    for polygon, pair in zip(points, (slice(0, 2), slice(1, 3)), strict=True):
        x, y = polygon.T
        assert 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0.0
        np.testing.assert_allclose(polygon.max(axis=0), (centre + radius)[pair].max(axis=0))
        np.testing.assert_allclose(polygon.min(axis=0), (centre - radius)[pair].min(axis=0))


def test_one_ellipse_is_a_band_too() -> None:
    points = swept(np.array([[3.0, 4.0]]), np.array([[1.0, 2.0]]))
    np.testing.assert_allclose(np.nanmax(points, axis=0), [4.0, 6.0])


def test_arrays_are_stored_once_and_come_back() -> None:
    values = np.array([500_000.125, 500_001.5, np.nan])
    packed = json.loads(dumps([{"x": values, "y": values.copy(), "z": np.array(["a", "b", "a"])}]))
    assert packed["figures"] == [{"x": {"array": 0}, "y": {"array": 0}, "z": {"array": 1}}]
    first = packed["arrays"][0]
    back = np.frombuffer(base64.b64decode(first["number"]), "<f4") + first["offset"]
    np.testing.assert_allclose(back, values, atol=1e-4)


def test_times_are_milliseconds() -> None:
    time = clock_of(np.array([1.7e9])).values(np.array([1_700_000_000.1234, np.nan]))
    packed = json.loads(dumps(time))
    stored = np.frombuffer(base64.b64decode(packed["arrays"][0]["time"]), "<f8")
    np.testing.assert_array_equal(stored, [1_700_000_000_123.0, np.nan])


def test_nothing_in_the_json_means_anything_to_a_parser() -> None:
    text = dumps({"name": "</script><!--&\u2028", "value": float("nan")})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text)["figures"] == {"name": "</script><!--&\u2028", "value": None}


def test_rejected_rows_are_all_drawn_below_their_limit() -> None:
    size = np.full((19_000, 3), 9.0)
    groups = drawn(size, judged(size))
    rejected = next(g for g in groups if g.verdict == Verdict.REJECTED)
    assert rejected.rows.size == rejected.total == 19_000


def test_headline_figures_of_a_straight_track() -> None:
    time, raw, clean = straight(601)
    head = headline(cleaned(time, raw, clean))
    assert head.fixes == 601
    assert sum(head.counts.values()) == 601
    assert head.distance == pytest.approx(600 * np.hypot(0.5, 0.3))
    assert head.clean_speed == pytest.approx((np.hypot(0.5, 0.3),) * 2)
    assert head.raw_speed[1] > 15.0
    assert head.sigma_horizontal == pytest.approx(0.4)


def test_the_worst_fixes_have_the_depth_that_was_given() -> None:
    result = cleaned(*straight(200))
    clock = clock_of(result.track.time)
    result.raw_coordinates[:, 2] -= 85.0
    depth = worst_table(replace(result, has_depth=True), clock)
    height = worst_table(result, clock)
    assert "Depth, m" in depth
    assert "Height, m" in height
    assert ">-8" in height
    assert ">-8" not in depth
