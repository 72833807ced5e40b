"""From the trail to decisions, and the review of decisions by deleted residuals."""

import numpy as np
import pytest

from filters.worlds import PLAIN, world
from surefix.filters.hypotheses import (
    COMMIT,
    CONTINUE,
    DROP,
    OPEN,
    POOR,
    POOR_WEIGHT,
    RESTART,
    VELOCITY_OUT,
    VELOCITY_POOR,
    Trail,
)
from surefix.filters.hypothesis_review import deleted_residuals, review
from surefix.filters.hypothesis_trail import decide, follow, runs, undecided
from surefix.filters.learning import supposed
from surefix.filters.records import Recovery
from surefix.filters.rts import smooth
from surefix.filters.track import filter_track, start

KEEPS = Recovery(np.inf, 10.0, keeps_rate=True)
MOTION = world(0, 5, axes=2, blocks=False).motion


def trail_of(*codes):
    """Trail of one hypothesis in changing places."""
    n = len(codes)
    parent, code = np.zeros((n, 4), np.uint8), np.zeros((n, 4), np.uint16)
    best = (np.arange(n) % 3).astype(np.uint8)
    for k in range(n):
        parent[k, best[k]] = best[k - 1] if k else 0
        code[k, best[k]] = codes[k]
    return Trail(parent.ravel(), code.ravel(), 4 * np.arange(n + 1), best)


def every(codes):
    """Both axes observed each time."""
    return np.ones((len(codes), 2), np.bool_)


def decided(*codes, first=0):
    said = undecided(MOTION, len(codes))
    decide(MOTION, every(codes), trail_of(*codes), len(codes) - 1, first, said)
    return said


def test_every_word_has_its_weight():
    said = decided(0, 1, 3, POOR, VELOCITY_OUT, VELOCITY_POOR | 2, 0)
    few = POOR_WEIGHT
    expected = [
        [1, 1, 1, 1],
        [0, 1, 1, 1],
        [0, 0, 1, 1],
        [few, few, 1, 1],
        [1, 1, 0, 0],
        [1, 0, few, few],
        [1, 1, 1, 1],
    ]
    np.testing.assert_array_equal(said.fixed, expected)
    assert not said.jump.any()
    assert not said.run.any()


def test_a_run_that_ends_was_wrong():
    said = decided(0, OPEN, CONTINUE, 3, CONTINUE, DROP, 0)
    assert said.fixed[:, 0].tolist() == [1, 0, 0, 0, 0, 1, 1]
    assert said.run.tolist() == [0, 1, 1, 0, 1, 0, 0]
    assert not said.jump.any()


def test_a_run_that_is_confirmed_was_a_jump():
    """All of it belongs to the track but what was wrong by itself; it jumps at the first fix."""
    said = decided(0, OPEN, CONTINUE, 3, CONTINUE | COMMIT, 0)
    assert said.fixed[:, 0].tolist() == [1, 1, 1, 0, 1, 1]
    assert said.jump.tolist() == [0, 3, 0, 0, 0, 0]
    assert not said.run.any()
    assert (said.fixed[:, 2:] == 1.0).all()


def test_a_jump_after_a_run_that_was_wrong():
    said = decided(OPEN, DROP, OPEN, CONTINUE, OPEN, CONTINUE, CONTINUE | COMMIT, 0)
    assert said.jump.tolist() == [0, 0, 0, 0, 3, 0, 0, 0]
    assert said.run.tolist() == [1, 0, 1, 1, 0, 0, 0, 0]


def test_a_jump_beyond_the_window_is_put_at_its_edge_once():
    codes = (0, OPEN, CONTINUE, CONTINUE, CONTINUE | COMMIT, 0)
    said = undecided(MOTION, 6)
    decide(MOTION, every(codes), trail_of(*codes), 3, 0, said)
    assert said.run.tolist() == [0, 1, 1, 1, 0, 0]
    changed = decide(MOTION, every(codes), trail_of(*codes), 4, 3, said)
    assert changed == 3
    assert said.jump.tolist() == [0, 0, 0, 3, 0, 0]
    assert said.run.tolist() == [0, 1, 1, 0, 0, 0]
    assert decide(MOTION, every(codes), trail_of(*codes), 5, 3, said) == 5  # nothing new
    assert said.jump.tolist() == [0, 0, 0, 3, 0, 0]
    decide(MOTION, every(codes), trail_of(*codes), 5, 4, said)
    assert said.jump.tolist() == [0, 0, 0, 3, 0, 0]


def test_it_follows_until_the_past_is_seen_otherwise():
    codes = (0, 3, 0, OPEN, CONTINUE, CONTINUE | COMMIT, 0)
    trail = trail_of(*codes)
    said = undecided(MOTION, 7)
    assert follow(MOTION, trail, 0, 0, said) == 5
    assert said.fixed[:5, 0].tolist() == [1, 0, 1, 0, 0]
    assert said.run.tolist() == [0, 0, 0, 1, 1, 0, 0]
    trail.parent[trail.first[2] + trail.best[2]] = 3
    assert follow(MOTION, trail, 0, 0, said) == 2


def test_runs_are_counted_and_numbered():
    used = np.array([1, 0, 0, 0, np.nan, 0, 1, 0, 0, 1, 1, 0], float)[:, None]
    run = np.array([0, 1, 1, 0, 0, 1, 0, 1, 1, 0, 0, 1])
    #                        isolated, missing
    length, number = runs(run, used)
    assert length.tolist() == [0, 3, 3, 0, 0, 3, 0, 2, 2, 0, 0, 1]
    assert number.tolist() == [-1, 0, 0, -1, -1, 0, -1, 1, 1, -1, -1, 2]
    assert len(runs(run[:0], used[:0])[0]) == 0


ANEW = 3 * RESTART


def test_a_track_that_began_anew_did_so_with_the_first_fix_left_out():
    """Where it is and how fast; in a window that begins later, at the fix itself."""
    codes = 0, 3, 0, 3, 1, 3, OPEN, 3, ANEW, 0
    said = decided(*codes)
    assert said.jump.tolist() == [0, 0, 0, 5, 0, 10, 0, 0, 0, 0]  # y is used once more
    said = decided(*codes, first=5)
    assert said.jump.tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 15, 0]


def test_what_is_not_observed_is_not_used_either():
    seen = np.ones((6, 2), np.bool_)
    seen[3] = False
    said = undecided(MOTION, 6)
    decide(MOTION, seen, trail_of(0, 3, 3, 0, 3, ANEW), 5, 0, said)
    assert said.jump.tolist() == [0, 15, 0, 0, 0, 0]


def fitted(made, fixed):
    told = made.epochs._replace(fixed=fixed)
    out = filter_track(made.motion, PLAIN, KEEPS, told, start(made.motion, KEEPS))[1]
    return smooth(made.motion, KEEPS, made.epochs.time, out)


@pytest.mark.parametrize("axes", [1, 2])
def test_deleted_residuals_are_those_without_the_observation(axes):
    """Each of some components left out in turn, used ones and others."""
    made = world(3, 40, axes=axes, velocity=0.3, missing=0.1, blocks=False, q=0.2)
    fixed = np.ones(made.epochs.z.shape)
    fixed[::7], fixed[3::7] = 0.0, POOR_WEIGHT
    whole = fitted(made, fixed)
    found = deleted_residuals(made.motion, made.epochs, fixed, whole)
    for k in range(5, 35, 3):
        for c in range(2 * axes):
            without = fixed.copy()
            without[k, c] = 0.0
            other = fitted(made, without)
            e = made.epochs.z[k, c] - other.mean[k, c]
            S = other.covariance[k, c, c] + made.epochs.variance[k, c]
            if np.isnan(e):
                assert np.isnan([figure[k, c] for figure in found]).all()
                continue
            np.testing.assert_allclose([figure[k, c] for figure in found], [e, S], rtol=1e-6)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_the_review_finds_what_is_wrong_and_what_is_not(axes):
    """From wrong decisions; what is locked or the user's stays."""
    made = world(4, 120, axes=axes, velocity=0.2, blocks=False, irregular=False)
    z, prior = made.epochs.z.copy(), supposed(axes, 0.5, 0.2, 10.0, 40.0)
    prior = prior._replace(partial=0.02)
    z[20, :axes] += 20.0
    z[40, 0] += 20.0
    z[60, axes:] += 10.0
    fixed = np.ones(z.shape)
    fixed[[20, 60]] = 0.0  # rightly
    fixed[40, 0] = 0.0
    fixed[[30, 50], :axes] = 0.0  # wrongly
    fixed[[70, 75], axes:] = 0.0
    user = np.full(z.shape, np.nan)
    user[80, 0], user[20, 0] = 0.0, np.nan
    epochs = made.epochs._replace(z=z, fixed=user)
    smoothed = fitted(made._replace(epochs=made.epochs._replace(z=z)), fixed)
    locked = np.zeros((120, 2), np.bool_)
    locked[50, 0], locked[75, 1] = True, True
    before = fixed.copy()
    out = review(made.motion, prior, epochs, fixed, smoothed, locked)
    np.testing.assert_array_equal(fixed, before)
    assert (out[20, :axes] == 0.0).all()
    assert (out[20, axes:] > 0.0).all()  # comes back
    assert out[40, 0] == 0.0
    assert (out[40, 1:] > 0.0).all()
    assert (out[60, axes:] == 0.0).all()
    assert (out[30, :axes] > 0.0).all()
    assert (out[50, :axes] == 0.0).all()
    assert (out[70, axes:] > 0.0).all()
    assert (out[75, axes:] == 0.0).all()
    assert out[80, 0] == 0.0
    assert (out == 1.0).mean() > 0.85
