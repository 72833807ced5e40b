"""What vouches for each other, judged together: velocities, and fixes amid wrong ones."""

import numpy as np
import pytest

from surefix.filters.hypothesis_disputes import settle_fixes, settle_velocities
from surefix.filters.hypothesis_trail import undecided
from surefix.filters.learning import supposed
from surefix.filters.records import Epochs, Motion, Recovery
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


AMID = slice(60, 90)  # of which all but two fixes are wild
PAIR = np.array([74, 75])


def amid(seed, axes, off, **supposes):
    """Fixes alone, of which the pair is ``off`` (two of σ) along one way; which are taken out."""
    rng = np.random.default_rng(seed)
    motion, prior, epochs = made(seed, axes)
    epochs.z[:, axes:] = np.nan
    ways = rng.standard_normal((N, axes))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    wild = flags(AMID)
    wild[PAIR] = False
    epochs.z[wild, :axes] += rng.uniform(30.0, 100.0, (wild.sum(), 1)) * ways[wild]
    epochs.z[PAIR, :axes] += np.array(off)[:, None] * ways[0]
    said = undecided(motion, N)
    said.fixed[wild, :axes] = 0.0
    prior = prior._replace(**{"row": 0.9, **supposes})
    out = settle_fixes(motion, prior, epochs, said, Recovery(np.inf, 20.0, keeps_rate=True))
    return np.flatnonzero(out).tolist()


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_fixes_that_agree_amid_wrong_ones_may_be_wrong_together(axes):
    """Each of them is where it should be if the other is."""
    for seed in range(4):
        assert amid(seed, axes, (11.0, 12.0)) == PAIR.tolist()


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_good_fixes_amid_wrong_ones_stay(axes):
    for seed in range(4):
        assert amid(seed, axes, (0.0, 0.0), isolated=0.3, row=0.5) == []


@pytest.mark.parametrize("axes", [2, 3])
def test_one_of_two_may_be_good(axes):
    for seed in range(4):
        often = {"isolated": 0.3, "row": 0.5}
        assert amid(seed, axes, (0.0, 14.0), **often) == [75]
        assert amid(seed, axes, (14.0, 0.0), **often) == [74]


def test_fixes_that_the_user_accepts_are_not_judged_together():
    motion, prior, epochs = made(0, 2)
    epochs.z[PAIR, :2] += 12.0
    epochs.fixed[PAIR] = 1.0
    said = undecided(motion, N)
    said.fixed[AMID, :2] = 0.0
    said.fixed[PAIR, :2] = 1.0
    recovery = Recovery(np.inf, 20.0, keeps_rate=True)
    assert not settle_fixes(motion, prior, epochs, said, recovery).any()
