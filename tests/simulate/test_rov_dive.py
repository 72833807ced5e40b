from dataclasses import fields

import numpy as np
import pytest

from surefix.simulate.faults import isolated
from surefix.simulate.rov_dive import (
    RovDive,
    columns,
    depth_columns,
    log,
    simulate,
    velocity_columns,
)

SEEDS = range(12)


@pytest.fixture(scope="module")
def dives() -> list[RovDive]:
    return [simulate(seed, minutes=20) for seed in SEEDS]


def _same(one: object, two: object) -> bool:
    if isinstance(one, tuple) and isinstance(two, tuple):
        return all(_same(a, b) for a, b in zip(one, two, strict=True))
    if isinstance(one, np.ndarray) and isinstance(two, np.ndarray):
        return one.tobytes() == two.tobytes()
    return repr(one) == repr(two)  # NaN equals NaN


def test_the_same_seed_gives_the_same_bits() -> None:
    one, two = simulate(7, minutes=5), simulate(7, minutes=5)
    assert all(_same(getattr(one, f.name), getattr(two, f.name)) for f in fields(one))
    assert not _same(one.fixes, simulate(8, minutes=5).fixes)


def test_an_option_of_one_sensor_leaves_the_others_alone() -> None:
    one, two = simulate(7, minutes=5), simulate(7, minutes=5, sigma_position_m=2.0)
    assert _same(one.position, two.position)
    assert _same(one.dvl, two.dvl)
    assert _same(one.fixes.time, two.fixes.time)


def test_velocity_is_the_derivative_of_position(dives: list[RovDive]) -> None:
    dive = dives[0]
    smooth = dive.position - np.outer(dive.time >= dive.jump_time, dive.jump_m)
    slope = (smooth[2:] - smooth[:-2]) / (dive.time[2:] - dive.time[:-2])[:, None]
    np.testing.assert_allclose(slope, dive.velocity[1:-1], atol=2e-4)


def test_the_motion_is_that_of_an_rov(dives: list[RovDive]) -> None:
    for dive in dives:
        speed = np.hypot(dive.velocity[:, 0], dive.velocity[:, 1])
        accelerations = np.diff(dive.velocity, axis=0) / np.diff(dive.time)[:, None]
        assert 0.40 < np.median(speed) < 0.60
        assert speed.max() < 0.8
        assert np.abs(accelerations).max() < 0.15
        assert np.ptp(dive.position[:, 2]) < 25.0
        assert ((dive.heading_deg >= 0.0) & (dive.heading_deg < 360.0)).all()


def test_good_fixes_have_the_stated_noise(dives: list[RovDive]) -> None:
    error = np.vstack([(d.fixes.position - d.fix_position)[~d.gross] for d in dives])
    sigma = error.std(axis=0)
    half = 3.3 / np.sqrt(2 * len(error))  # 99.9 % interval of a standard deviation
    np.testing.assert_allclose(sigma / [0.5, 0.5, 0.4], 1.0, atol=half)
    assert (np.abs(error.mean(axis=0)) < 3.3 * sigma / np.sqrt(len(error))).all()


def test_gross_errors_are_as_many_and_as_large_as_asked(dives: list[RovDive]) -> None:
    for dive in dives:
        single = dive.gross & ~dive.burst
        length = np.linalg.norm(dive.fixes.position - dive.fix_position, axis=1)
        assert single.sum() == round(0.08 * dive.gross.size)
        assert dive.burst.sum() == 12
        assert not (dive.burst & ~dive.gross).any()
        assert length[single].min() > 1.0
        assert length[single].max() < 43.0
        assert not dive.gross[:10].any()


def test_the_burst_is_consecutive_and_shares_one_offset(dives: list[RovDive]) -> None:
    for dive in dives:
        rows = np.flatnonzero(dive.burst)
        assert (np.diff(rows) == 1).all()
        error = (dive.fixes.position - dive.fix_position)[rows]
        assert 6.0 < np.linalg.norm(error.mean(axis=0)) < 28.0
        assert error.std(axis=0).max() < 1.2


def test_the_jump_is_part_of_the_truth_but_not_of_the_velocity(dives: list[RovDive]) -> None:
    for dive in dives:
        step = np.diff(dive.position, axis=0)
        row = int(np.argmax(np.linalg.norm(step, axis=1)))
        assert dive.time[row] < dive.jump_time <= dive.time[row + 1]
        np.testing.assert_allclose(step[row], dive.jump_m, atol=0.1)
        assert 0.6 < (dive.jump_time - dive.time[0]) / np.ptp(dive.time) < 0.8
        assert not dive.gross[np.abs(dive.fixes.time - dive.jump_time) < 20.0].any()


def test_without_jump_errors_and_gaps_nothing_is_wrong() -> None:
    dive = simulate(
        3, minutes=5, jump_m=(0, 0, 0), gross_share=0, burst_fixes=0, dropouts=0, lost_share=0
    )
    assert np.isnan(dive.jump_time)
    assert not dive.gross.any()
    assert np.diff(dive.fixes.time).max() < 2.7


def test_steps_are_irregular_and_never_back(dives: list[RovDive]) -> None:
    for dive in dives:
        step = np.diff(dive.fixes.time)
        assert step.min() > 1.3
        assert np.std(step[step < 2.7]) > 0.1
        assert step.max() > 12.0


def test_the_dvl_has_its_own_clock_and_loses_the_bottom(dives: list[RovDive]) -> None:
    dvl = dives[0].dvl
    rate = np.diff(dvl.time) / np.diff(dvl.true_time)
    np.testing.assert_allclose(rate, 1.0 + 60e-6, atol=2e-6)
    lost = np.isnan(dvl.velocity[:, 0])
    assert 0.005 < lost.mean() < 0.15
    truth = np.column_stack(
        [np.interp(dvl.true_time, dives[0].time, axis) for axis in dives[0].velocity.T]
    )
    np.testing.assert_allclose(np.nanstd(dvl.velocity - truth, axis=0), 0.01, rtol=0.1)


def test_pressure_is_five_hertz_with_marked_spikes(dives: list[RovDive]) -> None:
    dive = dives[0]
    error = dive.depth.value + np.interp(dive.depth.time, dive.time, dive.position[:, 2])
    np.testing.assert_allclose(np.diff(dive.depth.time), 0.2, atol=1e-3)
    assert np.abs(error[dive.depth_gross]).min() > 0.9
    assert np.std(error[~dive.depth_gross]) == pytest.approx(0.02, rel=0.1)
    assert (dive.depth.name, dive.heading.period) == ("depth_m", 360.0)


def test_geographic_fixes_are_the_metric_ones() -> None:
    metric, geographic = simulate(5, minutes=4), simulate(5, minutes=4, geographic=True)
    position = geographic.fixes.position
    x, y, _ = geographic.frame.to_local(position[:, 0], position[:, 1])
    np.testing.assert_allclose(np.column_stack((x, y)), metric.fixes.position[:, :2], atol=1e-6)
    assert geographic.fixes.geographic


def test_columns_hold_one_row_a_fix() -> None:
    dive = simulate(5, minutes=4, geographic=True)
    table = columns(dive)
    assert list(table) == ["time", "lat", "lon", "depth", "heading"]
    assert {column.shape for column in table.values()} == {dive.fixes.time.shape}
    assert list(columns(simulate(5, minutes=4))) == ["time", "x", "y", "z", "heading"]
    assert set(depth_columns(dive)) == {"time", "depth"}
    assert set(velocity_columns(dive)) == {"time", "ve", "vn", "vu"}


def test_the_log_holds_fixes_and_channels() -> None:
    given = log(simulate(5, minutes=4))
    assert given.fixes is not None
    assert given.sensors == ("USBL",)
    assert [channel.name for channel in given.channels] == ["depth_m", "heading_deg"]


def test_isolated_rows_are_no_neighbours_while_there_is_room() -> None:
    rng = np.random.default_rng(1)
    assert (np.diff(isolated(rng, np.arange(100), 20)) > 1).all()
    assert isolated(rng, np.arange(10), 9).size == 9
