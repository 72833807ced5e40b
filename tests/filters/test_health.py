"""The record of a sensor: it falls, rises, and says when its noise changes."""

import numpy as np
import pytest

from surefix.filters.health import CHANGED, SUSPECT, TRUSTED, Health, no_health, watch


def record(n, seed=0, sensors=2):
    rng = np.random.default_rng(seed)
    return rng.integers(0, sensors, n), np.zeros(n, np.bool_), rng.chisquare(2, n) / 2.0


@pytest.mark.parametrize("seed", range(5))
def test_a_good_sensor_is_not_spoken_of(seed):
    sensor, out, square = record(5000, seed)
    out[::5] = True  # a fifth is wrong
    _, what, figure = watch(no_health(2), sensor, out, square)
    assert not what.any()
    assert np.isnan(figure).all()


def test_a_sensor_falls_and_rises_by_itself():
    sensor, out, square = record(2000)
    bad = (sensor == 1) & (np.arange(2000) > 800) & (np.arange(2000) < 1000)
    out[bad] = True
    _, what, figure = watch(no_health(2), sensor, out, square)
    rows = np.flatnonzero(what)
    assert what[rows].tolist() == [SUSPECT, TRUSTED]
    assert (sensor[rows] == 1).all()
    assert 800 < rows[0] < 870
    assert 1000 < rows[1] < 1150
    assert figure[rows[0]] > 0.5
    assert figure[rows[1]] < 0.2


@pytest.mark.parametrize("factor", [3.0, 1.0 / 3.0])
def test_noise_that_changes_is_told_once(factor):
    sensor, out, square = record(6000)
    late = np.arange(6000) > 3000
    square = np.where(late & (sensor == 0), factor**2 * square, square)
    _, what, figure = watch(no_health(2), sensor, out, square)
    rows = np.flatnonzero(what)
    assert what[rows[0]] == CHANGED
    assert len(rows) == 1
    assert sensor[rows[0]] == 0
    assert rows[0] > 3000
    assert np.log(figure[rows[0]]) * np.log(factor) > 0.0


def test_what_is_not_known_is_left_aside():
    sensor, out, square = record(1000)
    square[:] = np.nan
    health, what, _ = watch(no_health(2), sensor, out, square)
    assert not what.any()
    assert health.used.sum() == 0


def test_parts_give_the_same_as_the_whole_and_nothing_is_modified():
    sensor, out, square = record(900, 3)
    out[300:420] = True
    square[600:] *= 9.0
    first = no_health(2)
    whole = watch(first, sensor, out, square)
    np.testing.assert_array_equal(first.seen, 0)
    health, what, figure = first, [], []
    for part in np.array_split(np.arange(900), 7):
        health, said, told = watch(health, sensor[part], out[part], square[part])
        what.append(said)
        figure.append(told)
    np.testing.assert_array_equal(np.concatenate(what), whole[1])
    np.testing.assert_array_equal(np.concatenate(figure), whole[2])
    assert isinstance(health, Health)
    for one, other in zip(health, whole[0], strict=True):
        np.testing.assert_array_equal(one, other)
