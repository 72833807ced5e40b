"""53H against sorts, on-line against batch, and what its ends do."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference import ship_cleaning as twin
from surefix.cleaning.thresholds import rate_threshold
from surefix.cleaning.tukey53h import DELAY, State53H, push, tukey53h
from surefix.errors import OptionsError

ENDS = ("none", "reversal", "odd", "line")


def wild_series(seed, n=200, missing=0.0):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=n).cumsum()
    at = rng.random(n) < 0.08
    x[at] += rng.normal(0.0, 60.0, at.sum())
    x[rng.random(n) < missing] = np.nan
    return x


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("threshold", [0.0, 0.7, 5.0])
def test_inner_samples_are_those_of_the_textbook(seed, threshold):
    x = wild_series(seed)
    found = tukey53h(x, threshold, ends="none")
    estimate = twin.x3(x)
    np.testing.assert_allclose(found.estimate, estimate, atol=1e-12)
    wanted = twin.replaced(x, np.where(np.isnan(estimate), x, estimate), np.full(200, threshold))
    np.testing.assert_allclose(found.value, wanted, atol=1e-12)


@pytest.mark.parametrize("n", [20, 21, 37, 200])
def test_reversal_is_that_of_the_paper(n):
    x = wild_series(3, n)
    np.testing.assert_allclose(
        tukey53h(x, np.inf, ends="reversal").estimate, twin.improved_x3(x), atol=1e-12
    )


@pytest.mark.parametrize("seed", range(3))
def test_missing_samples_have_no_say_and_stay_missing(seed):
    x = wild_series(seed, missing=0.3)
    found = tukey53h(x, 1.0, ends="none")
    np.testing.assert_allclose(
        np.where(np.isnan(x), np.nan, found.estimate),
        np.where(np.isnan(x), np.nan, twin.x3(x)),
        atol=1e-12,
    )
    for ends in ENDS:
        np.testing.assert_array_equal(np.isnan(tukey53h(x, 1.0, ends=ends).value), np.isnan(x))
    assert np.isnan(tukey53h([np.inf, -np.inf, np.nan], 1.0).value).all()


@settings(max_examples=60, deadline=None)
@given(
    data=st.data(),
    ends=st.sampled_from(ENDS),
    period=st.sampled_from([0.0, 360.0]),
    n=st.integers(0, 60),
)
def test_parts_of_any_size_give_the_very_same_numbers(data, ends, period, n):
    x = 20.0 * wild_series(n, n, missing=0.1)
    threshold = np.linspace(0.5, 30.0, n)
    whole = tukey53h(x, threshold, ends=ends, period=period)
    cuts = sorted(data.draw(st.lists(st.integers(0, n), max_size=12)))
    state, parts = State53H(), []
    for part, limit in zip(np.split(x, cuts), np.split(threshold, cuts), strict=True):
        cleaned, state = push(part, limit, state, ends=ends, period=period)
        parts.append(cleaned)
    cleaned, state = push([], [], state, ends=ends, period=period, final=True)
    parts.append(cleaned)
    for batch, on_line in zip(whole, zip(*parts, strict=True), strict=True):
        np.testing.assert_array_equal(batch, np.concatenate(on_line))
    assert len(state.x) == 0


@pytest.mark.parametrize("ends", ENDS)
def test_a_sample_is_decided_four_samples_later(ends):
    state, given_out = State53H(), 0
    for k in range(40):
        cleaned, state = push([float(k)], 1.0, state, ends=ends)
        given_out += len(cleaned.value)
        waits = ends == "reversal" and k < 11
        assert given_out == (0 if waits else max(k + 1 - DELAY, 0))
        assert len(state.x) <= 12
    assert len(push([], 1.0, state, ends=ends, final=True)[0].value) == DELAY


def test_input_is_not_changed():
    x = wild_series(1)
    before = x.copy()
    tukey53h(x, 0.1, period=360.0)
    np.testing.assert_array_equal(x, before)


def test_bias_of_a_ramp_at_the_ends_is_that_of_the_closed_form():
    slope, ramp = 2.5, 2.5 * np.arange(40.0)
    bias = {e: (tukey53h(ramp, np.inf, ends=e).estimate - ramp) / slope for e in ENDS}
    np.testing.assert_allclose(bias["reversal"][:5], [3.5, 1.0, 0.25, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(bias["reversal"][-4:], [0.0, -0.25, -1.0, -3.5], atol=1e-12)
    for ends in ("odd", "line"):
        np.testing.assert_allclose(bias[ends], 0.0, atol=1e-12)
    assert np.isnan(bias["none"][[0, 3, -4, -1]]).all()


@pytest.mark.parametrize("at", [0, -1])
def test_a_wild_end_sample_is_found_but_by_odd_reflection(at):
    x = np.linspace(0.0, 3.0, 30)
    good = x.copy()
    x[at] = 500.0
    for ends in ("reversal", "line"):
        error = np.abs(tukey53h(x, 1.0, ends=ends).value - good)
        assert error.max() <= 1.0
    kept = tukey53h(x, 1.0, ends="odd").value
    assert kept[at] == 500.0
    beside = 1 if at == 0 else -2
    assert abs(kept[beside] - good[beside]) > 100.0  # it drags its good neighbour along


@pytest.mark.parametrize(("length", "gone"), [(1, True), (2, True), (3, False), (10, False)])
def test_bursts_up_to_two_are_replaced_and_longer_ones_kept(length, gone):
    x = np.zeros(60)
    x[30 : 30 + length] = 50.0
    cleaned = tukey53h(x, 1.0).value
    burst = cleaned[30 : 30 + length]
    if gone:
        assert np.abs(cleaned).max() <= 1.0
    else:
        assert burst.min() >= 0.75 * 50.0  # its edges are rounded, the burst stays


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi])
def test_heading_through_north(period):
    turn = period / 360.0
    true = np.mod(np.linspace(-20.0, 400.0, 300), 360.0)
    raw = true.copy()
    raw[[40, 150, 151]] = [200.0, 90.0, 95.0]
    found = tukey53h(turn * raw, 5.0 * turn, period=period)
    np.testing.assert_array_equal(np.flatnonzero(found.replaced), [40, 150, 151])
    off = (found.value / turn - true + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 3.0  # two samples of the turn
    assert ((found.value >= 0.0) & (found.value < period)).all()
    kept = ~found.replaced
    np.testing.assert_array_equal(found.value[kept], turn * raw[kept])


def test_a_wild_heading_does_not_turn_those_after_it():
    raw = np.full(30, 359.0)
    raw[::2] = 1.0
    raw[10] = 175.0
    found = tukey53h(raw, 10.0, period=360.0)
    np.testing.assert_array_equal(np.flatnonzero(found.replaced), [10])


def test_a_ship_at_full_speed_beside_a_gap_is_not_touched():
    time = np.concatenate([np.arange(20.0), np.arange(100.0, 120.0)])
    x = 9.0 * time
    assert not tukey53h(x, rate_threshold(time, 10.0)).replaced.any()
    assert tukey53h(x, 10.0).replaced.any()  # a threshold for the usual step is too tight there


def test_short_series_and_wrong_options():
    for n in range(12):
        for ends in ENDS:
            x = np.arange(float(n))
            np.testing.assert_array_equal(tukey53h(x, 5.0, ends=ends).value, x)
    for bad in ({"threshold": -1.0}, {"ends": "mirror"}, {"period": -1.0}, {"period": np.nan}):
        with pytest.raises(OptionsError):
            tukey53h([1.0, 2.0], **({"threshold": 1.0} | bad))


def test_unknown_threshold_keeps_the_sample():
    x = np.zeros(30)
    x[[10, 20]] = 9.0
    limit = np.ones(30)
    limit[10] = np.nan
    np.testing.assert_array_equal(np.flatnonzero(tukey53h(x, limit).replaced), [20])
