"""The trials that methods are compared on keep what their scenarios promise."""

import numpy as np
import pytest

from surefix.errors import OptionsError
from surefix.models.motion import noise_factor, transition
from surefix.simulate.contamination import SCENARIOS, World, alone, columns, draw, draw_world
from surefix.simulate.vehicles import drive

SEEDS = range(4)
NAMES = list(SCENARIOS)
VEHICLES = ("survey", "speedboat", "buoy")


def sizes(trial):
    """Length of the gross error of every fix, in σ."""
    return np.linalg.norm(trial.error, axis=1) / trial.world.sigma_m


@pytest.mark.parametrize("name", NAMES)
def test_a_seed_gives_the_same_bits_and_another_does_not(name):
    one, again, other = (draw(name, World(epochs=300), seed) for seed in ([1, 4], [1, 4], [1, 5]))
    np.testing.assert_array_equal(one.fixes, again.fixes)
    np.testing.assert_array_equal(one.velocities, again.velocities)
    assert not np.isin(one.velocities, other.velocities).any()


@pytest.mark.parametrize("name", NAMES)
def test_noise_and_rate_only_change_the_units(name):
    one = draw(name, World(epochs=300), 3)
    two = draw(name, World(epochs=300, sigma_m=4.5, interval_s=0.1), 3)
    length, speed = 4.5 / 0.3, 4.5 / 0.3 / 0.1
    np.testing.assert_allclose(two.time, 0.1 * one.time)
    np.testing.assert_allclose(two.fixes, length * one.fixes)
    np.testing.assert_allclose(two.velocities, speed * one.velocities)
    np.testing.assert_array_equal(two.bad_fix, one.bad_fix)
    assert two.world.process == pytest.approx(one.world.process * length / 0.1**1.5)


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_in_the_order_of_time_and_nothing_is_bad_at_the_beginning(name):
    trial = draw(name, World(epochs=400), 2)
    assert trial.time[0] == 0.0
    assert (np.diff(trial.time) > 0.0).all()
    early = trial.bad_fix[:5].any(axis=1)
    assert not early[1:].any()
    assert early[0] == (name == "first-bad")


@pytest.mark.parametrize("share", [5, 20, 40])
@pytest.mark.parametrize("seed", SEEDS)
def test_isolated_errors_are_as_many_and_as_long_as_promised(seed, share):
    trial = draw(f"isolated-{share}", World(epochs=1000), seed)
    long = sizes(trial)[trial.bad_fix.any(axis=1)]
    assert len(long) == 10 * share
    assert long.min() >= 10.0
    assert long.max() <= 130.0
    assert not trial.bad_velocity.any()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_burst_has_30_of_121_errors(seed):
    common, own = (draw(f"burst-{kind}", World(), seed) for kind in ("common", "independent"))
    for trial in (common, own):
        assert trial.bad_fix.any(axis=1).sum() == 121
    same = (np.diff(common.error, axis=0) == 0.0).all(axis=1) & common.bad_fix[1:].any(axis=1)
    rows = np.flatnonzero(same)
    assert len(rows) == 29
    assert np.ptp(rows) == 28
    stretch = slice(rows[0], rows[0] + 30)
    assert own.bad_fix[stretch].any(axis=1).all()
    assert len(np.unique(own.error[stretch], axis=0)) == 30
    np.testing.assert_array_equal(common.position, own.position)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_drag_goes_out_and_back_without_a_step(seed, axes):
    world = World(epochs=800, axes=axes, sigma_m=0.3)
    trial = draw("drag", world, seed)
    apart = np.flatnonzero(np.abs(sizes(trial) - 60.0) < 1e-9)  # isolated errors are other lengths
    (top,) = apart
    stretch = slice(top - 59, top + 60)
    np.testing.assert_allclose(sizes(trial)[stretch], [*range(1, 61), *range(59, 0, -1)])
    arrow = trial.error[stretch] / sizes(trial)[stretch, None]
    np.testing.assert_allclose(arrow, np.broadcast_to(arrow[0], arrow.shape), atol=1e-12)
    others = trial.bad_fix.any(axis=1)
    others[stretch] = False
    assert others.sum() == 40
    np.testing.assert_array_equal(trial.position, draw("clean", world, seed).position)
    assert not trial.bad_velocity.any()


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_jump_moves_truth_and_fixes_but_not_the_velocity(seed, axes):
    world = World(epochs=500, axes=axes)
    trial, calm = draw("jump", world, seed), draw("clean", world, seed)
    moved = (trial.position - calm.position) / world.sigma_m
    assert not moved[: trial.jump].any()
    assert np.linalg.norm(moved[trial.jump :], axis=1) == pytest.approx(67.0)
    assert not trial.bad_fix[trial.jump].any()
    np.testing.assert_array_equal(trial.velocities, calm.velocities)


def test_sizes_and_axes_of_the_other_errors():
    small = sizes(draw("small", World(), 1))
    assert 3.3 <= small[small > 0.0].min() <= small.max() <= 10.0
    one = draw("one-axis", World(), 1)
    assert set(one.bad_fix.sum(axis=1)) == {0, 1}
    assert one.bad_fix.sum(axis=0) == pytest.approx([160] * 3, abs=40)


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_has_its_size_and_its_tails(seed):
    for name, heavy in (("clean", False), ("student-t3", True)):
        trial = draw(name, World(epochs=4000, sigma_m=2.0, interval_s=0.5), seed)
        noise = (trial.fixes - trial.position) / 2.0
        assert noise.std() == pytest.approx(1.0, abs=0.15 if heavy else 0.03)
        assert (np.abs(noise).max() > 7.0) == heavy
        slips = trial.velocities - trial.velocity
        assert slips.std() == pytest.approx(trial.world.sigma_mps, rel=0.03)


def test_wrong_velocities_come_in_runs():
    trial = draw("dvl-faults", World(), 5)
    bad = trial.bad_velocity.all(axis=1)
    runs = np.flatnonzero(np.diff(bad.astype(int), prepend=0) == 1)
    assert 8 <= len(runs) <= 12
    assert 60 <= bad.sum() <= 480
    off = np.linalg.norm(trial.velocities - trial.velocity, axis=1) / trial.world.sigma_mps
    assert off[bad].min() > 4.0
    assert off[~bad].max() < 6.0


def test_dropouts_take_fixes_and_sometimes_velocities():
    trial = draw("dropouts", World(), 1)
    lost = np.isnan(trial.fixes).any(axis=1)
    assert lost.sum() > 30
    assert np.isfinite(trial.velocities).all()
    assert np.diff(trial.time).max() > 9.0
    bare = alone(trial)
    assert np.isfinite(bare.fixes).all()
    assert len(bare.time) == (~lost).sum()
    assert not bare.aided


def test_irregular_steps_vary_about_the_interval():
    steps = np.diff(draw("irregular", World(interval_s=0.5), 1).time) / 0.5
    assert steps.mean() == pytest.approx(1.0, abs=0.05)
    assert steps.min() < 0.1
    assert steps.max() > 3.0


@pytest.mark.parametrize("name", ["clean", "irregular"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_model_vehicle_is_driven_by_white_acceleration(seed, name):
    world = draw_world([6, seed], epochs=1500)
    trial = draw(name, world, seed)
    whitened = []
    for k, dt in enumerate(np.diff(trial.time)):
        before = np.concatenate([trial.position[k], trial.velocity[k]])
        after = np.concatenate([trial.position[k + 1], trial.velocity[k + 1]])
        shove = after - transition("cv", 3, dt) @ before
        whitened.append(np.linalg.solve(noise_factor("cv", 3, dt, world.process**2), shove))
    assert np.var(whitened, axis=0) == pytest.approx([1.0] * 6, abs=0.15)
    assert np.corrcoef(np.transpose(whitened)) == pytest.approx(np.eye(6), abs=0.12)


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("axes", [1, 2, 3])
def test_velocity_is_the_derivative_of_the_position(vehicle, axes):
    time = np.arange(0.0, 100.0, 1.0 / 16.0)
    path = drive(vehicle, np.random.default_rng(4), time, axes, 0.2)
    mean = 0.5 * (path.velocity[1:] + path.velocity[:-1])
    assert path.position.shape == (len(time), axes)
    np.testing.assert_allclose(np.diff(path.position, axis=0) * 16.0, mean, atol=0.02)


def test_a_boat_is_fast_and_turns_hard_and_a_buoy_stays():
    time = np.arange(1000.0)
    boat = drive("speedboat", np.random.default_rng(1), time, 2, 0.2)
    pace = np.linalg.norm(boat.velocity, axis=1)
    assert pace.min() > 20.0
    assert np.linalg.norm(np.diff(boat.velocity, axis=0), axis=1).max() > 3.0
    buoy = drive("buoy", np.random.default_rng(1), time, 2, 0.2)
    assert np.linalg.norm(np.ptp(buoy.position, axis=0)) < 0.05 * pace.mean() * 1000.0


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_columns_are_those_of_a_log(axes):
    trial = draw("clean", World(epochs=200, axes=axes), 1)
    assert list(columns(trial)) == ["time", *"xyz"[:axes], *("vx", "vy", "vz")[:axes]]
    assert list(columns(alone(trial))) == ["time", *"xyz"[:axes]]


def test_worlds_are_drawn_from_wide_ranges():
    worlds = [draw_world([2, i]) for i in range(200)]
    for name, low, high in (
        ("sigma_m", 0.05, 5.0),
        ("interval_s", 0.05, 5.0),
        ("agility", 0.05, 0.3),
    ):
        values = np.array([getattr(world, name) for world in worlds])
        assert low <= values.min() < 1.2 * low
        assert high / 1.2 < values.max() <= high


@pytest.mark.parametrize(
    "wrong",
    [{"epochs": 199}, {"axes": 4}, {"sigma_m": 0.0}, {"interval_s": np.inf}, {"agility": np.nan}],
)
def test_a_world_that_cannot_be_is_refused(wrong):
    with pytest.raises(OptionsError):
        World(**wrong)


def test_an_unknown_scenario_names_the_known_ones():
    with pytest.raises(OptionsError, match=r"'rain'.*isolated-20, .*buoy"):
        draw("rain", World(), 1)
