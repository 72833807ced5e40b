"""Rows of velocities that only one direction of the filter believes, judged together."""

import numpy as np
import pytest

from surefix.filters.hypothesis_disputes import settle_velocities
from surefix.filters.learning import supposed
from surefix.filters.records import Epochs, Motion
from surefix.filters.track import by_axis

N, SIGMA, NOISE, Q = 160, 1.0, 0.05, 0.06
ROWS = slice(70, 95)


def made(seed, axes, *, off=0.0, alike=True):
    """A track with fixes and velocities, of which those of ``ROWS`` are off by ``off`` σ."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 1.5, N))
    steps = np.diff(time, prepend=time[0])[:, None]
    velocity = 1.0 + np.cumsum(Q * np.sqrt(steps) * rng.standard_normal((N, axes)), axis=0)
    position = np.cumsum(steps * velocity, axis=0)
    z = np.hstack([position, velocity])
    z += np.repeat([SIGMA, NOISE], axes) * rng.standard_normal(z.shape)
    way = rng.standard_normal((1 if alike else 25, axes))
    z[ROWS, axes:] += off * NOISE * way / np.linalg.norm(way, axis=1, keepdims=True)
    variance = np.tile(np.repeat([SIGMA, NOISE], axes) ** 2, (N, 1))
    none = np.zeros(N, np.int64)
    epochs = Epochs(time, z, variance, np.full(z.shape, np.nan), none, none.copy())
    motion = Motion(2, axes, np.full(axes, Q**2), by_axis(axes), 2 * axes, 0.0)
    return motion, supposed(axes, SIGMA, NOISE, 20.0, 39.5), epochs


def flags(*rows):
    out = np.zeros(N, np.bool_)
    for each in rows:
        out[each] = True
    return out


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("ahead", [True, False])
def test_a_row_of_wrong_velocities_goes_whoever_believed_it(axes, ahead):
    """Though each of them is only 8 … 12 σ off, and agrees with the others of its row."""
    for seed, off in ((1, 8.0), (2, 10.0), (3, 12.0)):
        doubts = (flags(ROWS), flags()) if ahead else (flags(), flags(ROWS))
        out = settle_velocities(*made(seed, axes, off=off), *doubts)
        assert out[ROWS].all()
        assert out.sum() == 25


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_good_velocities_are_not_out_for_good(axes):
    for seed in range(3):
        out = settle_velocities(*made(seed, axes), flags(ROWS), flags())
        assert not out.any()


def test_what_both_say_and_what_is_single_is_left_alone():
    both, single = flags(slice(20, 30)), flags(120)
    out = settle_velocities(*made(0, 2), both | single, both)
    assert (out == both).all()


def test_each_sensor_has_rows_of_its_own():
    """Two velocity sensors in turns: the run of one is not broken by the other."""
    motion, prior, epochs = made(4, 2, off=12.0)
    sensor = np.arange(N) % 2
    epochs.z[:, 2:] = np.where((sensor == 1)[:, None], made(4, 2)[2].z[:, 2:], epochs.z[:, 2:])
    epochs = epochs._replace(sensor=sensor)
    mine = flags(ROWS) & (sensor == 0)
    out = settle_velocities(motion, prior, epochs, mine, flags())
    assert (out == mine).all()


def test_what_was_decided_beforehand_stays():
    motion, prior, epochs = made(1, 1, off=10.0)
    epochs.fixed[ROWS, 1] = 1.0  # the user accepts them: both accounts are the same
    out = settle_velocities(motion, prior, epochs, flags(ROWS), flags())
    assert not out.any()
