"""Process noise that follows a stream: from rest to motion, and never without a reason."""

from itertools import pairwise

import numpy as np
import pytest

from filters.worlds import motion_of, times
from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.learning import supposed
from surefix.filters.liveliness import begin_lively, follow
from surefix.filters.multi_hypothesis_modes import realtime_hypotheses, rows_of
from surefix.filters.records import Epochs
from surefix.jit import compilations

REST = 200  # epochs at rest before a vehicle gets under way


def sailing(seed, *, axes=2, sigma=1.0, step=1.0, n=900, share=0.1, velocity=None):
    """A vehicle at rest that gets under way and turns; some fixes are wild. Truth, epochs, wild."""
    rng = np.random.default_rng(seed)
    time = times(rng, n, step=step)
    under = np.maximum(time - time[REST], 0.0) / step
    wave = np.stack([under / 15.0 + 2.0 * rng.random() for _ in range(axes)], axis=1)
    change = np.sin(wave) * np.minimum(under / 20.0, 1.0)[:, None] * sigma / step
    dt = np.diff(time, prepend=time[0])[:, None]
    before = np.vstack([change[:1], change[:-1]])
    truth = np.cumsum(0.5 * (change + before) * dt, axis=0)
    z = np.hstack([truth + rng.normal(0.0, sigma, truth.shape), np.full_like(truth, np.nan)])
    wild = rng.random(n) < share
    z[wild, :axes] += rng.normal(0.0, 40.0 * sigma, (wild.sum(), axes))
    variance = np.full_like(z, sigma**2)
    if velocity is not None:
        z[:, axes:] = change + rng.normal(0.0, velocity, truth.shape)
        variance[:, axes:] = velocity**2
    m = motion_of(axes=axes, q=(0.01 * sigma / step**1.5) ** 2, blocks=False)
    free = np.full((n, m.groups), np.nan)
    return truth, Epochs(time, z, variance, free, np.zeros(n, np.int64), np.zeros(n, np.int64)), m


def filtered(epochs, motion, cuts=(), blocks=None, *, follows=True, share=0.1):
    axes = motion.axes
    sigma = float(np.sqrt(epochs.variance[0, 0]))
    step = float(np.median(np.diff(epochs.time)))
    prior = supposed(axes, sigma, 0.1, 2.0 * sigma / step, 30.0 * step)._replace(
        isolated=max(share, 0.02)
    )

    def run(motion, part, bank):
        return realtime_hypotheses(motion, prior, part, bank)

    blocks = blocks or [range(axes)]
    bank = no_hypotheses(motion)
    if not follows:
        return run(motion, epochs, bank)[1], (), None
    lively, means, changes = begin_lively(motion, len(blocks)), [], []
    bounds = [0, *cuts, len(epochs.time)]
    for a, b in pairwise(bounds):
        part = rows_of(epochs, a, b)
        bank, lively, found, fresh = follow(run, motion, blocks, lively, part, bank, prior)
        means.append(found)
        changes += [each._replace(after=each.after + a) for each in fresh]
    found = type(found)._make(np.concatenate(each) for each in zip(*means, strict=True))
    return found, tuple(changes), lively


def rmse(found, truth, sigma, since=REST + 90):
    axes = truth.shape[1]
    return float(np.sqrt(np.mean((found.mean[since:, :axes] - truth[since:]) ** 2))) / sigma


def nees(found, truth, since=REST + 90):
    axes = truth.shape[1]
    error = (found.mean[since:, :axes] - truth[since:]) / found.sigma[since:, :axes]
    return float(np.mean(error**2))


@pytest.mark.parametrize(("axes", "sigma", "step"), [(1, 0.05, 0.1), (2, 1.0, 1.0), (3, 5.0, 4.0)])
def test_who_gets_under_way_is_followed(axes, sigma, step):
    follows, stays, sure = [], [], []
    for seed in range(6):
        truth, epochs, motion = sailing(seed, axes=axes, sigma=sigma, step=step)
        found, changes, _ = filtered(epochs, motion)
        assert changes
        assert all(each.process > 1.4 * each.before for each in changes)
        assert min(each.after for each in changes) >= REST
        follows.append(rmse(found, truth, sigma))
        sure.append(nees(found, truth))
        stays.append(rmse(filtered(epochs, motion, follows=False)[0], truth, sigma))
    assert np.median(follows) < 1.0  # better than the fixes themselves
    assert np.median(stays) > 2.0 * np.median(follows)
    assert 0.6 < np.median(sure) < 1.6


def test_beside_velocities_too():
    for seed in range(3):
        truth, epochs, motion = sailing(seed, velocity=0.05)
        found, _, _ = filtered(epochs, motion)
        assert rmse(found, truth, 1.0) < 0.6
        assert nees(found, truth) < 2.0


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_nothing_changes_without_a_reason(share):
    """At rest, with up to 40 % wild fixes and runs of thirty that are wrong together."""
    for seed in range(5):
        _, epochs, motion = sailing(seed, share=share, n=1500)
        rng = np.random.default_rng(seed)
        z = epochs.z.copy()
        z[:, :2] -= sailing(seed, share=share, n=1500)[0]
        for first in (400, 700, 1300):
            z[first : first + 30, :2] += rng.uniform(15.0, 60.0, 2)
        _, changes, lively = filtered(epochs._replace(z=z), motion, share=share)
        assert changes == ()
        np.testing.assert_array_equal(lively.density, motion.density)


def test_each_block_follows_by_itself():
    truth, epochs, motion = sailing(4, axes=3)
    z = epochs.z.copy()
    z[:, 2] -= truth[:, 2]  # the height rests
    _, changes, lively = filtered(epochs._replace(z=z), motion, blocks=[(0, 1), (2,)])
    assert {each.block for each in changes} == {0}
    assert lively.density[0] == lively.density[1] > 2.0 * motion.density[0]
    assert lively.density[2] == motion.density[2]


@pytest.mark.parametrize("seed", range(4))
def test_parts_give_the_same_as_the_whole(seed):
    _, epochs, motion = sailing(seed, n=600)
    whole, changes, lively = filtered(epochs, motion)
    assert changes
    rng = np.random.default_rng(seed)
    ends = [each.after + 1 for each in changes]
    for cuts in (
        range(1, 600),
        sorted(rng.choice(600, 9, replace=False)),
        ends,
        range(30, 600, 30),
    ):
        found, fresh, after = filtered(epochs, motion, cuts)
        assert fresh == changes
        for one, other in zip(found, whole, strict=True):
            np.testing.assert_array_equal(one, other)
        for one, other in zip(after, lively, strict=True):
            if isinstance(one, np.ndarray):
                np.testing.assert_array_equal(one, other)


def test_a_look_compiles_nothing_that_the_filter_did_not():
    """A live stream does not wait for the compiler, nor does one whose columns lie apart."""
    _, epochs, motion = sailing(1, axes=3)
    filtered(rows_of(epochs, 0, 10), motion)
    told = []
    with compilations(told.append):
        _, changes, _ = filtered(epochs, motion, blocks=[(0, 1), (2,)])
        filtered(rows_of(epochs, 0, 10)._replace(z=np.asfortranarray(epochs.z[:10])), motion)
    assert changes
    assert all(type(each.process) is float for each in changes)
    assert told == []
