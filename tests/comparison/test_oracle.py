"""The oracle is the Kalman filter that knows everything, no more and no less."""

from dataclasses import replace

import numpy as np
import pytest

from reference import kalman, rts
from surefix.comparison.oracle import LAG_INTERVALS, oracle
from surefix.models.motion import noise_factor, transition
from surefix.simulate.contamination import SCENARIOS, World, alone, draw, draw_world

MODES = ("offline", "lagged", "realtime")


def nees(trial, found, first=20):
    return (((found.position - trial.position) / found.sigma)[first:] ** 2).mean()


def rmse(trial, found, first=20):
    return np.sqrt(((found.position - trial.position)[first:] ** 2).mean())


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["clean", "isolated-40", "one-axis", "jump", "irregular"])
def test_its_own_uncertainty_is_honest(name, mode):
    figures = []
    for seed in range(12):
        world = draw_world([31, seed], epochs=1500, axes=1 + seed % 3)
        trial = draw(name, world, [31, seed])
        figures.append([nees(each, oracle(each, mode)) for each in (trial, alone(trial))])
    aided, unaided = np.mean(figures, axis=0)
    assert aided == pytest.approx(1.0, abs=0.07)  # its errors are correlated over hundreds of rows
    assert unaided == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("name", ["isolated-20", "one-axis", "dvl-faults", "dropouts"])
@pytest.mark.parametrize("axes", [1, 3])
def test_it_is_the_textbook_filter_and_smoother_on_the_good_components(name, axes):
    world = World(epochs=300, axes=axes, sigma_m=1.7, interval_s=0.4)
    trial = draw(name, world, 8)
    z = np.hstack([trial.fixes, trial.velocities])
    z[np.hstack([trial.bad_fix, trial.bad_velocity])] = np.nan
    steps = np.diff(trial.time, prepend=trial.time[0])
    F = np.stack([transition("cv", axes, dt) for dt in steps])
    G = np.stack([noise_factor("cv", axes, dt, world.process**2) for dt in steps])
    Q, R = G @ G.transpose(0, 2, 1), np.repeat([world.sigma_m**2, world.sigma_mps**2], axes)
    vague = np.diag(np.repeat([1e4, 1e3], axes) ** 2)
    many = np.broadcast_to(np.diag(R), (len(z), 2 * axes, 2 * axes))
    filtered = kalman.run(np.zeros(2 * axes), vague, z, np.eye(2 * axes), many, F, Q)
    smoothed = rts.smooth(filtered[0], filtered[1], F, Q)
    for mode, (mean, covariance) in {"realtime": filtered[:2], "offline": smoothed}.items():
        found = oracle(trial, mode)
        np.testing.assert_allclose(found.position, mean[:, :axes], atol=1e-5)
        sigma = np.sqrt(np.einsum("kii->ki", covariance)[:, :axes])
        np.testing.assert_allclose(found.sigma, sigma, atol=1e-5)


@pytest.mark.parametrize("mode", MODES)
def test_it_does_not_look_at_what_is_bad(mode):
    trial = draw("isolated-20", World(epochs=300), 4)
    worse = replace(trial, fixes=np.where(trial.bad_fix, 1e6, trial.fixes))
    np.testing.assert_array_equal(oracle(trial, mode).position, oracle(worse, mode).position)


def test_each_mode_sees_as_much_of_the_future_as_it_may():
    trial = alone(draw("clean", World(epochs=300), 4))
    for mode, reach in (("realtime", 0), ("lagged", LAG_INTERVALS), ("offline", 299)):
        whole = oracle(trial, mode).position
        row = 100
        for end in (row + reach, row + reach + 1):
            if end >= len(trial.time):
                continue
            changed = trial.fixes.copy()
            changed[end] += 1.0
            seen = oracle(replace(trial, fixes=changed), mode).position[row] != whole[row]
            assert seen.all() == (end == row + reach)


@pytest.mark.parametrize("kind", ["aided", "alone"])
def test_a_jump_costs_it_next_to_nothing(kind):
    ratios = []
    for seed in range(8):
        world = World(epochs=800)
        both = [draw(name, world, seed) for name in ("jump", "isolated-5")]
        both = [alone(each) for each in both] if kind == "alone" else both
        ratios.append([rmse(each, oracle(each, "offline")) for each in both])
    jump, calm = np.mean(ratios, axis=0)
    assert jump / calm == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["clean", "speedboat", "buoy", "survey"])
def test_no_other_density_of_the_motion_does_better(name, mode):
    """For vehicles off the model the oracle has found the best; on it, the true one is the best."""
    told, other = [], []
    for seed in range(3):
        trial = alone(draw(name, World(epochs=400), seed))
        told.append(rmse(trial, oracle(trial, mode)))
        known = replace(trial, scenario=SCENARIOS["isolated-5"])
        for factor in (0.3, 3.0):
            world = replace(trial.world, agility=factor * trial.world.agility)
            other.append(rmse(trial, oracle(replace(known, world=world), mode)))
    assert np.mean(told) < min(np.mean(other[::2]), np.mean(other[1::2]))
