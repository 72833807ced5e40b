"""Fixes that wander off slowly are caught beside velocities or another sensor, and only there."""

import numpy as np
import pytest

from surefix.comparison.oracle import oracle
from surefix.filters.hypotheses import no_hypotheses
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.multi_hypothesis_modes import (
    lagged_hypotheses,
    offline_hypotheses,
    realtime_hypotheses,
)
from surefix.filters.records import Epochs, Motion
from surefix.filters.track import by_axis
from surefix.simulate.contamination import World, alone, draw

MODES = ("offline", "lagged", "realtime")
WORLDS = {
    1: World(epochs=600, axes=1, interval_s=5.0, sigma_m=3.0, agility=0.1, velocity_noise=0.1),
    2: World(epochs=600, axes=2, interval_s=1.0, sigma_m=0.3, agility=0.2, velocity_noise=0.05),
    3: World(epochs=600, axes=3, interval_s=0.2, sigma_m=0.1, agility=0.1, velocity_noise=0.08),
}


def posed(trial):
    """Motion, prior and epochs of a trial, whose noise is known; the sensor beside has number 1."""
    world, d = trial.world, trial.world.axes
    z = np.hstack([trial.fixes, trial.velocities])
    other = np.hstack([trial.beside, np.full_like(trial.fixes, np.nan)])
    kept = np.isfinite(other).any()
    rows = np.stack([other, z] if kept else [z], axis=1).reshape(-1, 2 * d)
    each = 2 if kept else 1
    n = len(rows)
    variance = np.repeat([world.sigma_m**2, world.sigma_mps**2], d) * np.ones((n, 1))
    sensor = np.tile([1, 0] if kept else [0], n // each)
    epochs = Epochs(
        np.repeat(trial.time, each),
        rows,
        variance,
        np.full(rows.shape, np.nan),
        np.zeros(n, np.int64),
        sensor,
    )
    motion = Motion(2, d, np.full(d, world.process**2), by_axis(d), 2 * d, 0.0)
    speed = 20.0 * world.sigma_m / world.interval_s
    longest = 39.5 * world.interval_s
    made = supposed(d, world.sigma_m, world.sigma_mps, speed, longest, drags=True)
    return motion, made, epochs


def estimated(trial, mode):
    """Estimate of a trial at its fixes."""
    motion, prior, epochs = posed(trial)
    n = len(epochs.time)
    match mode:
        case "offline":
            found = offline_hypotheses(motion, prior, epochs)
        case "lagged":
            lag = 40.0 * trial.world.interval_s
            found = lagged_hypotheses(motion, prior, epochs, lag, np.ones(n, np.bool_))
        case "realtime":
            found = realtime_hypotheses(motion, prior, epochs, no_hypotheses(motion))[1]
    own = epochs.sensor == 0
    return type(found)(*(field[own] for field in found))


def ratio(trial, found, mode):
    """RMSE over that of the oracle, after the beginning."""
    d = trial.world.axes
    best = oracle(trial, mode)
    mine, least = found.mean[20:, :d] - trial.position[20:], (best.position - trial.position)[20:]
    return np.sqrt((mine**2).mean() / (least**2).mean())


def in_drag(trial, more=1.0):
    """Fixes of the drag that are more than so many σ off; isolated errors left out."""
    off = np.linalg.norm(trial.error, axis=1) / trial.world.sigma_m
    together = np.convolve(off > 0.0, np.ones(7), mode="same") >= 5
    return together & (off > more)


@pytest.mark.parametrize("name", ["drag", "drag-slow"])
@pytest.mark.parametrize("axes", WORLDS)
def test_a_drag_beside_velocities_is_caught(axes, name):
    """Offline as if it were known; with a lag where it shows on two axes; late in real time."""
    most = {"offline": 1.25, "lagged": 1.35 if axes > 1 else 4.5, "realtime": 5.0}
    for seed in range(3):
        trial = draw(name, WORLDS[axes], [seed, 41])
        far, inside = in_drag(trial, 10.0), in_drag(trial)
        for mode in MODES[: 3 if axes > 1 else 2]:
            found = estimated(trial, mode)
            assert ratio(trial, found, mode) < most[mode], (seed, mode)
            out = found.weight[far, :axes] < 0.5
            assert not far.any() or out.mean() > (0.85 if mode == "realtime" else 0.999), seed
            if mode == "offline":
                nees = ((found.mean[:, :axes] - trial.position) / found.sigma[:, :axes]) ** 2
                assert nees[inside].mean() < 7.0, seed
            if mode == "lagged" and far.any():
                assert found.drag[far].mean() > 0.95, seed
                off = trial.fixes[far] - trial.position[far] - found.offset[far]
                assert np.nanmedian(np.abs(off)) < 1.5 * trial.world.sigma_m, seed


def test_sigma_grows_as_the_track_is_dead_reckoned():
    trial = draw("drag", WORLDS[2], [1, 41])
    inside = np.flatnonzero(in_drag(trial))
    sigma = estimated(trial, "realtime").sigma[:, 0]
    assert sigma[inside[-5]] > 2.0 * sigma[inside[0] - 10]
    assert (np.diff(sigma[inside[15:-5]]) > 0.0).mean() > 0.9


@pytest.mark.parametrize("mode", MODES)
def test_a_depth_catches_what_is_dragged_along_its_axis(mode):
    """Without velocities; along the other axes fixes are used.

    Both have the same noise, so that which of them wanders off is not always seen at once.
    """
    ratios = []
    for seed in range(3):
        trial = alone(draw("drag-depth", WORLDS[3], [seed, 42]))
        found = estimated(trial, mode)
        ratios.append(ratio(trial, found, mode))
        far = in_drag(trial, 10.0)
        assert (found.weight[far, :2] > 0.5).mean() > 0.95, seed
    assert np.median(ratios) < 1.1
    assert max(ratios) < (1.1 if mode == "offline" else 10.0)


@pytest.mark.parametrize("mode", MODES)
def test_a_second_source_catches_a_drag_beside_velocities(mode):
    for seed in range(3):
        trial = draw("drag-source", WORLDS[2], [seed, 43])
        assert ratio(trial, estimated(trial, mode), mode) < 1.15, seed


def test_fixes_alone_follow_a_drag():
    """Nothing can tell it from the motion of the vehicle."""
    trial = alone(draw("drag", WORLDS[2], [1, 41]))
    found = estimated(trial, "offline")
    assert not found.drag.any()
    off = np.abs(found.mean[:, :2] - trial.position).max()
    assert off > 10.0 * trial.world.sigma_m


@pytest.mark.parametrize("name", ["dvl-faults", "jump", "burst-common", "isolated-40", "clean"])
def test_other_faults_are_no_drags(name):
    for axes, world in WORLDS.items():
        trial = draw(name, world, [axes, 44])
        for mode in MODES:
            found = estimated(trial, mode)
            assert found.drag.mean() < 0.002, (axes, mode)
            if name != "jump" or mode == "offline":
                assert ratio(trial, found, mode) < 1.1, (axes, mode)


def test_what_never_comes_back_is_followed_in_the_end():
    """Eight longest runs are the limit, or five minutes if these are more."""
    world = WORLDS[1]
    trial = draw("clean", world, 45)
    begin = 150
    off = world.sigma_m * np.clip(np.arange(600.0) - begin, 0.0, 60.0)
    trial.fixes[:, 0] += off
    motion, prior, epochs = posed(trial)
    prior = prior._replace(longest=20.0 * world.interval_s)
    _, found, _ = filter_hypotheses(motion, prior, epochs, no_hypotheses(motion))
    error = np.abs(found.mean[:, 0] - trial.position[:, 0]) / world.sigma_m
    assert error[begin : begin + 150].max() < 15.0
    assert found.drag[begin + 20 : begin + 150].all()
    last = np.flatnonzero(found.drag)[-1]
    assert begin + 150 < last < begin + 185
    assert error[last + 20 :].min() > 40.0


def test_a_drag_is_remembered_to_the_last_bit():
    trial = draw("drag", WORLDS[2], [1, 41])
    motion, prior, epochs = posed(trial)
    whole, found, _ = filter_hypotheses(motion, prior, epochs, no_hypotheses(motion))
    middle = np.flatnonzero(in_drag(trial))[40]
    bank, parts = no_hypotheses(motion), []
    for part in (slice(0, middle), slice(middle, None)):
        rows = Epochs(*(field[part] for field in epochs))
        bank, out, _ = filter_hypotheses(motion, prior, rows, bank)
        parts.append(out)
    assert parts[1].drag[0]
    for one, two, three in zip(found, *parts, strict=True):
        np.testing.assert_array_equal(one, np.concatenate([two, three]))
    used = whole.number[0]
    for name in ("mean", "drift", "walks", "opened", "length"):
        np.testing.assert_array_equal(getattr(whole, name)[:used], getattr(bank, name)[:used])
