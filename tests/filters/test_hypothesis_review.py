"""Every observation judged again by all others: what the fixes beside it say of one in doubt."""

import itertools

import numpy as np
import pytest

from surefix.filters.hypothesis_review import review
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis_modes import decide_offline
from surefix.filters.records import Epochs, Motion
from surefix.filters.rts import Smoothed
from surefix.filters.track import by_axis
from surefix.simulate.contamination import alone, draw, draw_world

N = 7
MOTION = Motion(2, 1, np.ones(1), by_axis(1), 2, 0.0)
PRIOR = supposed(1, 1.0, 1.0, 1.0, 40.0)


def judged(off, wrong, *, row, k, run=(), far=60.0, longest=40.0):
    """Weight of fix k, which is ``off``, if the fixes ``wrong`` are left out; noise is 1."""
    z = np.full((N, 2), np.nan)
    z[:, 0] = np.where(wrong, far, 0.0)
    z[k, 0] = off
    epochs = Epochs(
        np.arange(float(N)),
        z,
        np.ones((N, 2)),
        np.full((N, 2), np.nan),
        np.zeros(N, np.int64),
        np.zeros(N, np.int64),
    )
    fixed = np.ones((N, 2))
    fixed[wrong, 0] = 0.0
    fixed[k, 0] = 0.0  # then its residual is as it is
    locked = np.zeros((N, 2), np.bool_)
    locked[list(run), 0] = True
    sure = Smoothed(np.zeros((N, 2)), np.full((N, 2, 2), 1e-12))
    prior = PRIOR._replace(row=row, longest=longest)
    return review(MOTION, prior, epochs, fixed, sure, locked)[k, 0]


def chain(wrong, row):
    """Log-probability of a series of right and wrong fixes."""
    total = 0.0
    for k, each in enumerate(wrong):
        p = row if k > 1 and wrong[k - 1] and wrong[k - 2] else PRIOR.isolated
        total += np.log(p if each else 1.0 - p)
    return total


def test_a_fix_is_judged_with_its_neighbours():
    """As the probability of the whole series has it, for every series of the others."""
    seen = set()
    for k, row in itertools.product((0, 3, 6), (0.2, 0.85)):
        for others in itertools.product((False, True), repeat=N - 1):
            one, two = (np.array([*others[:k], each, *others[k:]]) for each in (True, False))
            spread = PRIOR.spread[0]
            for off in (0.0, 1.5, 3.0, 5.0):
                wide = spread**2 + 1.0
                wild = -np.log(np.pi) - 0.5 * np.log(wide) - np.log1p(off**2 / wide)
                poor = -0.5 * (off**2 / 4.0 + np.log(8.0 * np.pi)) + np.log(PRIOR.poor)
                usual = -0.5 * (off**2 + np.log(2.0 * np.pi))
                usual += np.log1p(-PRIOR.isolated - PRIOR.partial - PRIOR.poor)
                prior = chain(one, row) - chain(two, row)
                prior += np.log1p(-PRIOR.isolated)
                margin = max(usual, poor) - wild - prior
                if abs(margin) < 1e-3:
                    continue
                used = judged(off, two, row=row, k=k) > 0.0
                assert used == (margin > 0.0), (k, row, others, off)
                seen.add((off, used))
    assert {(1.5, True), (1.5, False), (3.0, True), (3.0, False)} <= seen


@pytest.mark.parametrize("run", [(), range(N)])
def test_a_run_is_no_row(run):
    """After a run with a common offset the next fix is as good as any."""
    wrong = np.array([True, True, True, False, True, True, True])
    assert (judged(1.5, wrong, row=0.85, k=3, run=[j for j in run if j != 3]) > 0.0) == bool(run)


def test_what_is_hardly_wrong_makes_no_row():
    """A sensor that wanders would confirm itself."""
    wrong = np.array([True, True, True, False, True, True, True])
    for far, used in ((5.0, True), (7.0, False)):
        assert (judged(1.5, wrong, row=0.85, k=3, far=far) > 0.0) == used


def test_what_lasts_as_long_as_the_longest_run_is_no_row():
    """Three before and three after, each of them over two intervals."""
    wrong = np.array([True, True, True, False, True, True, True])
    for longest, used in ((2.5, False), (2.0, True)):
        assert (judged(1.5, wrong, row=0.85, k=3, longest=longest) > 0.0) == used


def test_what_is_called_back_and_sent_away_again_stays_out():
    """A wrong fix amid a row of 30: without it nothing is far off its neighbours, with it they are.

    What is told is also what was used, whenever the reviews end.
    """
    for seed in (119, 120, 121):
        world = draw_world([seed, 0], epochs=1200)
        trial = alone(draw("burst-independent", world, [seed, 0]))
        n, d = trial.fixes.shape
        z = np.hstack([trial.fixes, trial.velocities])
        none = np.zeros(n, np.int64)
        variance = np.full((n, 2 * d), world.sigma_m**2)
        epochs = Epochs(trial.time, z, variance, np.full((n, 2 * d), np.nan), none, none.copy())
        density = np.full(d, world.process**2)
        motion = Motion(2, d, density, by_axis(d), 2 * d, 0.0)
        span = world.interval_s
        prior = supposed(d, world.sigma_m, 1.0, 20.0 * world.sigma_m / span, 39.5 * span)
        said, weight, _ = decide_offline(motion, prior._replace(row=0.88, small=0.74), epochs)
        assert np.array_equal(weight[:, :d], said.fixed[:, :d])
        used = (weight[:, :d] > 0.0).all(axis=1) & trial.bad_fix.any(axis=1)
        assert used.sum() <= (0 if seed == 119 else 1)
