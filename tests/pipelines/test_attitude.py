"""Lever arms on a vehicle that rolls and pitches."""

import numpy as np
import pytest

from pipelines.rolling import ARM, Rolling
from reference.lever import antenna, sigma
from surefix.api import clean
from surefix.pipelines.options import CleanOptions
from surefix.pipelines.turning import ANGLES, Turning, arms_at, reached, turned
from surefix.types import Channel, Verdict

HEADING, TILT = np.radians(1.0), np.radians(0.5)
RMS_TILT = np.radians(7.0)


def channels(time, angles, names=ANGLES):
    """Series of heading, roll and pitch, (3, n) rad."""
    return [
        Channel(f"{name}_deg", "mru", time, np.degrees(angle), 0.0)
        for name, angle in zip(ANGLES, angles, strict=True)
        if name in names
    ]


def known(time, angles, names=ANGLES):
    return turned(Turning(), channels(time, angles, names), 0.0)


def levers(turning, at, arm=ARM, heading=HEADING, tilt=TILT, beside=Turning()):  # noqa: B008
    return arms_at([turning, beside], at, np.tile(arm, (len(at), 1)), heading, tilt)


@pytest.mark.parametrize("seed", range(5))
def test_the_offset_and_its_uncertainty_are_those_of_the_twin(seed):
    rng = np.random.default_rng(seed)
    n = 40
    angles = np.array([rng.uniform(-np.pi, np.pi, n), *rng.uniform(-1.4, 1.4, (2, n))])
    arm = rng.normal(0.0, 20.0, 3)
    for k in range(n):  # each attitude lasts, so that nothing moves
        time = np.arange(0.0, 3.0, 0.1)
        still = np.tile(angles[:, [k]], (1, len(time)))
        lever = levers(known(time, still), np.array([1.5]), arm)[0]
        np.testing.assert_allclose(lever[:3], antenna(angles[:, k], arm), atol=1e-9)
        np.testing.assert_allclose(lever[3:6], 0.0, atol=1e-9)
        expected = sigma(angles[:, k], arm, (HEADING, TILT, TILT))
        np.testing.assert_allclose(lever[6:9], expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(("step", "off", "slow"), [(0.05, 0.01, 0.06), (1.0, 0.45, 0.8)])
def test_an_antenna_on_a_rolling_ship_swings(step, off, slow):
    ship = Rolling(100.0, 3)
    time = np.arange(0.0, 100.0, step)
    at = np.linspace(3.0, 90.0, 100)
    lever = levers(known(time, ship.attitude(time)), at, heading=1e-9, tilt=1e-9)
    wrong, rate = lever[:, :3] - ship.offset(at), lever[:, 3:6] - ship.swing(at)
    assert np.abs(wrong).max() < off
    assert np.abs(rate).max() < slow
    assert np.abs(ship.swing(at)).max() > 3.0
    # What happens unseen between two values is in the uncertainty, and is not much less
    z = np.hypot(wrong[:, 0], wrong[:, 1]) / np.hypot(lever[:, 6], lever[:, 7])
    assert np.sqrt(np.mean(z**2)) < 1.0
    if step == 1.0:
        spun = np.hypot(rate[:, 0], rate[:, 1]) / np.hypot(lever[:, 9], lever[:, 10])
        assert 0.2 < np.sqrt(np.mean(spun**2)) < 1.3


def test_what_is_carried_on_is_uncertain_and_then_lost():
    wrong, spread = [], []
    ahead = np.array([0.05, 0.3, 0.6, 1.0])
    for seed in range(30):
        ship = Rolling(60.0, seed)
        time = np.arange(0.0, 40.0, 0.1)
        lever = levers(known(time, ship.attitude(time)), 39.9 + ahead, heading=1e-9, tilt=1e-9)
        wrong.append(lever[:, 2] - ship.offset(39.9 + ahead)[:, 2])
        spread.append(lever[:, 8])
    z = np.sqrt(np.mean(np.square(wrong) / np.square(spread), axis=0))
    assert np.all(z[1:] < 1.0)
    assert np.all(z[1:] > 0.05)
    late = levers(known(time, ship.attitude(time)), np.array([39.9 + 1.3]))
    level = antenna([ship.heading(39.9), 0.0, 0.0], ARM)
    np.testing.assert_allclose(late[0, 2], level[2])
    np.testing.assert_allclose(late[0, 8], RMS_TILT * np.hypot(20.0, 3.0), rtol=0.01)
    # … until then, and where there is none at all, the vehicle is level, as it always was
    for turning in (
        known(time, ship.attitude(time), ("heading",)),
        turned(known(time, ship.attitude(time), ("heading",)), [], 0.0),
    ):
        lever = levers(turning, np.array([20.0]))
        np.testing.assert_allclose(lever[0, [2, 8]], [25.0, 0.0])


def test_before_the_first_roll_the_vehicle_is_level():
    ship = Rolling(60.0, 1)
    time = np.arange(0.0, 60.0, 0.1)
    turning = known(time, ship.attitude(time), ("heading",))
    some = known(time[300:], ship.attitude(time[300:]), ("roll", "pitch"))
    turning = turning._replace(roll=some.roll, pitch=some.pitch)
    lever = levers(turning, np.array([20.0, 40.0]))
    np.testing.assert_allclose(lever[0, [2, 5, 8]], [25.0, 0.0, 0.0])
    np.testing.assert_allclose(lever[1, :3], ship.offset([40.0])[0], atol=0.01)


@pytest.mark.parametrize("step", [0.1, 1.0])
def test_single_spikes_and_what_is_missing_do_little(step):
    ship = Rolling(60.0, 2)
    time = np.arange(0.0, 60.0, step)
    angles = ship.attitude(time)
    places = [len(time) // 3, len(time) // 2]
    angles[1, places[0]] += np.radians(40.0)
    angles[2, places[0]] = np.radians(91.0)  # none at all
    angles[1:, places[1]] = np.nan
    at = np.concatenate([time[places] + d for d in (-0.3, 0.0, 0.3)])
    lever = levers(known(time, angles), at)
    wrong = np.linalg.norm(lever[:, :3] - ship.offset(at), axis=1)
    assert wrong.max() < (0.3 if step < 1.0 else 4.0)  # untreated it would be 17 m
    assert np.all(np.isfinite(lever))


def test_without_a_heading_only_the_height_is_known():
    ship = Rolling(60.0, 2)
    time, at = np.arange(0.0, 60.0, 0.1), np.array([30.0, 31.3])
    lever = levers(known(time, ship.attitude(time), ("roll", "pitch")), at)
    np.testing.assert_array_equal(lever[:, [0, 1, 3, 4]], 0.0)
    right = ship.offset(at)
    np.testing.assert_allclose(lever[:, 2], right[:, 2], atol=0.01)
    np.testing.assert_allclose(lever[:, 6], np.hypot(right[:, 0], right[:, 1]), atol=0.01)
    np.testing.assert_allclose(lever[:, 9], lever[:, 10])


def test_what_an_input_does_not_tell_is_taken_from_beside_the_fixes():
    ship = Rolling(60.0, 2)
    time, at = np.arange(0.0, 60.0, 0.1), np.array([30.0])
    own = known(time, ship.attitude(time), ("roll", "pitch"))
    beside = known(time, ship.attitude(time) + np.array([[0.0], [1.0], [1.0]]))
    both = levers(own, at, beside=beside)
    np.testing.assert_array_equal(both, levers(known(time, ship.attitude(time)), at))


def test_angles_may_come_in_any_parts():
    ship = Rolling(400.0, 5)
    time = np.arange(0.0, 400.0, 0.1)
    angles = ship.attitude(time)
    whole, parts, at = known(time, angles), Turning(), np.linspace(380.0, 399.0, 50)
    for part in np.array_split(np.arange(len(time)), 57):
        parts = turned(parts, channels(time[part], angles[:, part]), 380.0)
    np.testing.assert_array_equal(levers(parts, at), levers(whole, at))
    assert len(parts.roll.time) < 2000
    some = known(time[:2000], angles[:, :2000])
    more = turned(some, channels(time[2000:], angles[:, 2000:] + 1.0), 0.0)
    at = np.arange(150.0, reached(some), 0.1)
    np.testing.assert_array_equal(levers(some, at), levers(more, at))


def sailed(seed, axes, *, rate=1.0, step=0.2, sigma_m=0.3, arm=ARM):
    """Fixes at the reference point, fixes of the antenna, what the instrument says, and the truth.

    The instrument is wrong by 0.1° each time.
    """
    rng = np.random.default_rng(seed)
    ship = Rolling(500.0, seed)
    time = np.arange(0.0, 500.0, 1.0 / rate)
    truth = ship.at(time)
    noise = rng.normal(0.0, sigma_m, (2, *truth.shape))
    fixes = [truth + noise[0], truth + ship.offset(time, arm) + noise[1]]
    told = np.arange(0.0, 500.0, step) + 0.013
    angles = np.degrees(ship.attitude(told)) + rng.normal(0.0, 0.1, (3, len(told)))
    tables = [{"time": time, **dict(zip("xyz", each.T[:axes], strict=False))} for each in fixes]
    columns = {"time": told, "heading": angles[0] % 360.0, "roll": angles[1], "pitch": angles[2]}
    return tables, columns, truth[:, :axes]


def figures(cleaned, truth):
    """RMSE, and NEES over its dimension."""
    axes = truth.shape[1]
    wrong = cleaned.track.position[30:, :axes] - truth[30:]
    nees = np.mean((wrong / cleaned.track.sigma_position[30:, :axes]) ** 2)
    return np.sqrt(np.mean(wrong**2)), nees


@pytest.mark.parametrize(("seed", "axes"), [(1, 2), (2, 3), (3, 3)])
def test_with_attitude_an_antenna_aloft_is_as_good_as_one_at_the_reference_point(seed, axes):
    (plain, aloft), told, truth = sailed(seed, axes)
    arms = CleanOptions(lever_arm={"fix": ARM.tolist()}, sigma_attitude_deg=0.1)
    best, nees = figures(clean(plain), truth)
    carried = clean(aloft, attitude=told, options=arms)
    off, honest = figures(carried, truth)
    assert off < 1.5 * best
    assert 0.25 < honest < 2.0 * max(nees, 1.0)
    assert np.mean(carried.verdicts.verdict == Verdict.REJECTED) < 0.01
    assert {each.name for each in carried.channels} == {"heading_deg", "roll_deg", "pitch_deg"}
    level = {name: told[name] for name in ("time", "heading")}
    rolled, _ = figures(clean(aloft, heading=level, options=arms), truth)
    assert rolled > 10.0 * best


def test_columns_beside_the_fixes_do_as_well_as_a_log_of_its_own():
    (_, aloft), told, truth = sailed(4, 2, rate=2.0)
    ship = Rolling(500.0, 4)
    angles = np.degrees(ship.attitude(aloft["time"]))
    beside = aloft | {"heading": angles[0], "roll": angles[1], "pitch": angles[2] % 360.0}
    arms = CleanOptions(lever_arm={"fix": ARM.tolist()})
    own, _ = figures(clean(aloft, attitude=told, options=arms), truth)
    column, _ = figures(clean(beside, options=arms), truth)
    assert column < 1.2 * own
    assert own < 0.2
