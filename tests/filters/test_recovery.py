"""Bounded recovery: what lasts is followed, what is short is rejected, and nothing locks out."""

import numpy as np
import pytest

from filters.worlds import ROBUST, epochs_of, motion_of, straight
from surefix.filters.modes import realtime
from surefix.filters.records import Recovery
from surefix.filters.track import filter_track, start
from surefix.robust.loss import loss_named

AFTER = 30.0
RECOVERY = Recovery(AFTER, 5.0)
AT = 150
FEW = 6  # fixes that a restart may take to settle
REDESCENDING = sorted(set(ROBUST) - {"huber"})


def run(method, epochs, motion, recovery=RECOVERY):
    state = start(motion, recovery)
    return realtime(motion, loss_named(method), recovery, epochs, state)[1]


def shifted(seed, size, *, axes=2, velocity=None, until=None, n=300, step=1.0):
    """A straight run whose first axis is ``size`` metres aside from epoch AT to ``until``."""
    truth, epochs, motion = straight(seed, n, axes=axes, velocity=velocity, step=step)
    aside = np.zeros_like(truth)
    aside[AT:until, 0] = size
    epochs.z[:, :axes] += aside
    return truth, aside, epochs, motion


def errors(found, truth):
    return np.abs(found.mean[:, : truth.shape[1]] - truth).max(axis=1)


@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("size", [20.0, 500.0, 1e5])
@pytest.mark.parametrize("method", ROBUST)
def test_a_sustained_jump_is_followed_in_time(method, size, velocity):
    """Fault 23: within recovery.after and a few fixes, whatever the loss, size, axes and seed."""
    for seed, axes in enumerate((1, 2, 3, 2)):
        truth, aside, epochs, motion = shifted(seed, size, axes=axes, velocity=velocity)
        found = run(method, epochs, motion)
        error = errors(found, truth + aside)
        assert error[10:AT].max() < 3.0
        assert error[AT + int(AFTER) + FEW :].max() < 2.5
        assert (found.weight[AT + int(AFTER) + FEW :, 0] > 0.0).mean() > 0.95


@pytest.mark.parametrize("step", [0.1, 5.0])
@pytest.mark.parametrize("method", ROBUST)
def test_recovery_counts_seconds_and_three_fixes_at_least(method, step):
    truth, aside, epochs, motion = shifted(1, 800.0, velocity=0.1, step=step)
    recovery = Recovery(10.0, 5.0)
    found = run(method, epochs, motion, recovery)
    late = AT + max(int(10.0 / step), 2) + FEW
    assert errors(found, truth + aside)[late:].max() < 2.5
    if method != "huber":
        assert errors(found, truth)[AT : AT + min(int(10.0 / step), 2)].max() < 5.0


@pytest.mark.parametrize("method", REDESCENDING)
def test_a_jump_is_flagged_with_the_time_it_began(method):
    for seed in range(3):
        _, _, epochs, motion = shifted(seed, 500.0)
        found = run(method, epochs, motion)
        flagged = np.flatnonzero(found.jump)
        assert flagged.tolist() == [AT + int(AFTER)]
        assert found.since[flagged[0], 0] == epochs.time[AT]
        assert np.isnan(np.delete(found.since[:, 0], flagged)).all()


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("method", REDESCENDING)
def test_an_excursion_shorter_than_the_recovery_is_rejected(method, velocity, axes):
    """Fault 23, also through dead reckoning that has become uncertain."""
    for seed, long in enumerate((1, 2, 5, 12, 20, 29)):
        truth, _, epochs, motion = shifted(
            seed, 500.0, axes=axes, velocity=velocity, until=AT + long
        )
        found = run(method, epochs, motion)
        assert not found.jump[20:].any()  # a gate may begin anew after an unlucky start
        assert (found.weight[AT : AT + long, 0] < 0.1).all()
        error = errors(found, truth)
        drift = 1.5 + (0.4 * long if velocity is None else 0.03 * long)
        if method == "student-t":  # its weight is never nought
            drift *= 4.0
        assert error[10:].max() < 1.5 + drift
        assert error[AT + long + FEW :].max() < 2.5


@pytest.mark.parametrize("method", ROBUST)
def test_one_wild_fix_of_500_m_moves_nothing(method):
    for seed in range(5):
        truth, _, epochs, motion = shifted(seed, 500.0, until=AT + 1)
        error = errors(run(method, epochs, motion), truth)
        assert error[10:].max() < 2.5


@pytest.mark.parametrize("method", REDESCENDING)
def test_two_wild_fixes_a_minute_apart_are_not_yet_a_jump(method):
    """However short the recovery is beside the interval, three must agree."""
    truth, _, epochs, motion = shifted(0, 800.0, velocity=0.02, step=60.0, until=AT + 2)
    found = run(method, epochs, motion._replace(density=np.full(2, 1e-5)), Recovery(10.0, 5.0))
    assert not found.jump[20:].any()
    assert (found.weight[AT : AT + 2, 0] < 0.1).all()
    assert errors(found, truth)[20:].max() < 10.0


@pytest.mark.parametrize("method", REDESCENDING)
def test_a_dozen_good_fixes_settle_a_track(method):
    truth, epochs, motion = straight(3, 100, velocity=0.1)
    epochs.z[14:34, :2] += 500.0
    found = run(method, epochs, motion)
    assert not found.jump.any()
    assert errors(found, truth)[10:].max() < 4.0


@pytest.mark.parametrize("method", REDESCENDING)
def test_excursions_again_and_again_do_not_add_up(method):
    """A good fix in between ends a run of rejections."""
    truth, epochs, motion = straight(0, 400, velocity=0.1)
    for begin in range(100, 350, 26):
        epochs.z[begin : begin + 25, :2] += 300.0
    found = run(method, epochs, motion)
    assert not found.jump.any()
    assert errors(found, truth)[10:].max() < 3.0


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("method", REDESCENDING)
def test_position_recovers_while_velocity_is_accepted_all_along(method, axes):
    """Fault 24."""
    truth, aside, epochs, motion = shifted(2, 5000.0, axes=axes, velocity=0.05)
    found = run(method, epochs, motion)
    velocity = motion.group[axes]
    assert (found.weight[AT:, velocity] > 0.1).mean() > 0.97
    assert (found.weight[AT : AT + int(AFTER), 0] < 0.1).all()
    assert errors(found, truth + aside)[AT + int(AFTER) + FEW :].max() < 2.0
    assert (np.flatnonzero(found.jump & 1) == AT + int(AFTER)).all()


@pytest.mark.parametrize("method", REDESCENDING)
def test_velocity_recovers_while_position_is_accepted(method):
    """A velocity sensor that changes its scale for good is believed in the end."""
    motion = motion_of(axes=1, q=1e-4)
    rng = np.random.default_rng(0)
    time = np.arange(300.0)
    z = np.column_stack([rng.normal(size=300) * 5.0, 0.02 * rng.normal(size=300)])
    z[AT:, 1] += 3.0
    found = run(method, epochs_of(time, z, [5.0, 0.02], motion), motion)
    assert np.isfinite(found.since[:, 1]).any()
    assert np.isfinite(found.mean).all()


@pytest.mark.parametrize("velocity", [None, 0.1])
@pytest.mark.parametrize("wrong", [1, 2])
@pytest.mark.parametrize("method", ROBUST)
def test_a_bad_beginning_is_left_behind_soon(method, wrong, velocity):
    """A track that is not settled yet recovers six times sooner."""
    for seed in range(4):
        truth, epochs, motion = straight(seed, 120, velocity=velocity)
        epochs.z[:wrong, :2] += 2000.0
        found = run(method, epochs, motion)
        assert errors(found, truth)[wrong + int(AFTER / 6.0) + FEW + 2 :].max() < 2.5


@pytest.mark.parametrize("method", REDESCENDING)
def test_after_a_long_gap_a_wild_fix_does_not_hold_the_track(method):
    truth, epochs, motion = straight(1, 200)
    time = epochs.time.copy()
    time[100:] += 3600.0
    moved = truth.copy()
    moved[100:] += 3600.0 * (truth[1] - truth[0])
    z = epochs.z.copy()
    z[100:, :2] += moved[100:] - truth[100:]
    z[100, :2] += 4e5
    found = run(method, epochs._replace(time=time, z=z), motion)
    assert errors(found, moved)[100 + int(AFTER / 6.0) + FEW + 2 :].max() < 2.5


@pytest.mark.parametrize("method", ROBUST)
def test_a_restart_has_an_honest_covariance(method):
    """Right after a recovery the error agrees with what is claimed."""
    squares = []
    for seed in range(40):
        truth, aside, epochs, motion = shifted(seed, 2000.0, velocity=0.1, n=190)
        found = run(method, epochs, motion)
        late = slice(AT + int(AFTER) + 1, AT + int(AFTER) + 4)
        error = found.mean[late, :2] - (truth + aside)[late]
        squares.append((error / found.sigma[late, :2]) ** 2)
    assert 0.3 < np.mean(squares) < 2.0


@pytest.mark.parametrize("method", REDESCENDING)
def test_without_recovery_a_jump_is_never_followed(method):
    """That it is the recovery which follows, and not the loss."""
    truth, _, epochs, motion = shifted(0, 5000.0, velocity=0.1)
    never = Recovery(np.inf, 5.0)
    found = filter_track(motion, loss_named(method), never, epochs, start(motion, never))[1]
    assert np.abs(found.mean[:, :2] - truth).max(axis=1)[10:].max() < 20.0


@pytest.mark.parametrize("method", REDESCENDING)
def test_a_heading_recovers_through_north(method):
    motion = motion_of(axes=1, q=1e-4, period=360.0)
    rng = np.random.default_rng(0)
    heading = np.where(np.arange(200) < 100, 350.0, 20.0) + 0.2 * rng.normal(size=200)
    z = np.column_stack([heading % 360.0, np.full(200, np.nan)])
    found = run(method, epochs_of(np.arange(200.0), z, [0.2, 1.0], motion), motion)
    after = (found.mean[140:, 0] - 20.0 + 180.0) % 360.0 - 180.0
    assert np.abs(after).max() < 1.0
    assert np.abs(np.diff(found.mean[10:, 0])).max() < 35.0
