import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surefix.geo.angle import circular_median, unwrap, wrap

TURN = 2.0 * np.pi
angles = st.floats(-1e4, 1e4)


@given(angles, st.sampled_from([360.0, TURN]))
def test_wrap_stays_within_half_a_turn_and_keeps_the_direction(angle, period):
    wrapped = float(wrap(angle, period))
    assert -period / 2 - 1e-9 <= wrapped <= period / 2
    turns = (angle - wrapped) / period
    assert turns == pytest.approx(round(turns), abs=1e-9)


@given(st.floats(-179.999, 179.999))
def test_wrap_leaves_wrapped_angles_alone(angle):
    assert float(wrap(angle)) == angle


def test_wrap_knows_no_wild_values():
    assert np.isnan(wrap([np.nan, np.inf, -np.inf])).all()


def test_unwrap_crosses_the_seam():
    assert unwrap([0.1, -179.9, np.nan], [359.9, 179.9, 0.0]) == pytest.approx(
        [360.1, 180.1, np.nan], nan_ok=True
    )


@given(angles, angles)
def test_unwrap_is_within_half_a_turn_of_its_reference(angle, reference):
    assert abs(float(unwrap(angle, reference)) - reference) <= 180.0 + 1e-9


@given(st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=20), st.floats(-500.0, 500.0))
def test_circular_median_is_the_median_wherever_the_seam_lies(values, turn):
    median = circular_median(np.asarray(values) + turn)
    assert float(wrap(median - np.median(values) - turn)) == pytest.approx(0.0, abs=1e-9)


def test_circular_median_resists_a_minority():
    rng = np.random.default_rng(3)
    good = 179.95 + rng.normal(0.0, 0.02, 60)
    wild = rng.uniform(-180.0, 180.0, 40)
    assert abs(float(wrap(circular_median(np.concatenate((good, wild))) - 179.95))) < 0.1


def test_circular_median_of_nothing_is_nan():
    assert np.isnan(circular_median([np.nan, np.inf]))
    assert np.isnan(circular_median([]))


def test_circular_median_of_one_value_is_that_value():
    assert circular_median([181.0]) == -179.0
