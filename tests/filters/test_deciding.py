"""Cleaners before the filter: what each rejects, keeps and promises."""

from itertools import pairwise

import numpy as np
import pytest

from surefix.filters.deciding import AHEAD, THRESHOLDS, Decider, decide, look_ahead
from surefix.filters.records import Epochs, Motion, Recovery
from surefix.filters.track import by_axis

METHODS = tuple(THRESHOLDS)
RECOVERY = Recovery(60.0, 1.0)


def motion(axes=1, period=0.0):
    return Motion(2, axes, np.full(axes, 0.01), by_axis(axes), 2 * axes, period)


def epochs(x, *, time=None, sensor=None, sigma=1.0):
    """Positions (n,) or (n, axes) without velocities, one a second unless told."""
    x = np.asarray(x, float)
    x = x[:, None] if x.ndim == 1 else x
    n, d = x.shape
    return Epochs(
        np.arange(float(n)) if time is None else np.asarray(time, float),
        np.hstack([x, np.full((n, d), np.nan)]),
        np.full((n, 2 * d), sigma**2),
        np.full((n, 2 * d), np.nan),
        np.zeros(n, np.int64),
        np.empty(0, np.int64) if sensor is None else np.asarray(sensor),
    )


def wild(method, given, *, k0=None, period=0.0):
    """Which positions are left out (n, axes)."""
    axes = given.z.shape[1] // 2
    decider = Decider(method, THRESHOLDS[method] if k0 is None else k0)
    _, after, far = decide(decider, motion(axes, period), RECOVERY, given, {})
    out = after.fixed[:, :axes] == 0.0
    assert (far[:, :axes][out] > decider.k0).all()
    np.testing.assert_array_equal(np.isnan(far), np.isnan(given.z))
    return out


def walk(seed, n=600, speed=0.8, sigma=1.0):
    """A vehicle that turns slowly, measured with white noise."""
    rng = np.random.default_rng(seed)
    k = np.arange(n)
    return speed * 80.0 * np.sin(k / 80.0) + sigma * rng.standard_normal(n)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(4))
def test_isolated_errors_go_and_good_fixes_stay(method, seed):
    x = walk(seed)
    rng = np.random.default_rng([seed, 1])
    bad = np.arange(12, 590, 17)
    x[bad] += rng.choice([-1.0, 1.0], len(bad)) * rng.uniform(12.0, 60.0, len(bad))
    out = wild(method, epochs(x))[:, 0]
    assert out[bad].all()
    assert np.delete(out, bad).mean() < 0.01


@pytest.mark.parametrize(
    ("method", "longest"), [("53h", 2), ("hampel", 3), ("median", 20)], ids=METHODS
)
def test_bursts_go_up_to_the_length_that_is_documented(method, longest):
    for seed in range(4):
        for length in (1, 2, longest):
            x = walk(seed, speed=0.1)
            x[300 : 300 + length] += 25.0
            assert wild(method, epochs(x))[300 : 300 + length].all(), length
        x = walk(seed, speed=0.1)
        x[300 : 300 + longest + 2] += 25.0
        assert not wild(method, epochs(x))[300 : 300 + longest + 2].all()


@pytest.mark.parametrize("method", METHODS)
def test_a_wild_beginning_or_end_is_found(method):
    x = walk(5)
    x[[3, -2]] += 40.0
    assert wild(method, epochs(x))[[3, -2], 0].all()


def test_the_recursion_follows_a_true_jump_after_twenty_fixes():
    x = walk(1)
    x[300:] += 40.0
    out = wild("median", epochs(x))[:, 0]
    assert out[300:320].all()
    assert not out[320:].any()


@pytest.mark.parametrize("method", METHODS)
def test_a_missing_fix_has_no_say(method):
    x = walk(2)
    x[100] += 40.0
    holes = np.insert(x, [50, 100, 101], np.nan)
    time = np.insert(np.arange(600.0), [50, 100, 101], [49.5, 99.5, 100.5])
    out = wild(method, epochs(x))[:, 0]
    np.testing.assert_array_equal(
        np.delete(wild(method, epochs(holes, time=time))[:, 0], [50, 101, 103]), out
    )
    assert not wild(method, epochs(np.full(5, np.nan))).any()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", range(6))
def test_short_series_are_no_error(method, n):
    assert wild(method, epochs(np.arange(float(n)))).sum() == 0


@pytest.mark.parametrize("method", METHODS)
def test_every_sensor_and_axis_is_judged_by_itself(method):
    rng = np.random.default_rng(3)
    x = np.column_stack([walk(3), walk(4)])
    x[rng.choice(600, 30, replace=False), rng.integers(0, 2, 30)] += 40.0
    sensor = rng.integers(0, 2, 600)
    x[sensor == 1] += 30.0  # which would be wild for the other
    together = wild(method, epochs(x, sensor=sensor))
    for number in (0, 1):
        mine = np.flatnonzero(sensor == number)
        for axis in (0, 1):
            alone = wild(method, epochs(x[mine, axis], time=mine))[:, 0]
            np.testing.assert_array_equal(together[mine, axis], alone)


@pytest.mark.parametrize("method", METHODS)
def test_weights_that_are_fixed_stay(method):
    x = walk(6)
    x[200] += 40.0
    given = epochs(x)
    given.fixed[200, 0] = 1.0
    _, after, _ = decide(Decider(method, 3.0), motion(), RECOVERY, given, {})
    assert after.fixed[200, 0] == 1.0
    assert np.isnan(given.fixed[:, 1]).all()
    assert np.isnan(np.delete(given.fixed[:, 0], 200)).all()  # the input is not modified


@pytest.mark.parametrize("method", METHODS)
def test_angles_go_on_across_north(method):
    rng = np.random.default_rng(7)
    heading = 330.0 + 0.3 * np.arange(400) + rng.standard_normal(400)
    heading[250] += 170.0
    heading[60:62] += 40.0
    out = wild(method, epochs(heading % 360.0), period=360.0)[:, 0]
    assert out[[60, 61, 250]].all()
    assert out.sum() <= 6
    if method == "median":
        heading[100:115] += 185.0  # more than half a turn
        out = wild(method, epochs(heading % 360.0), period=360.0)[:, 0]
        assert out[100:115].all()
        assert not out[115:240].any()


@pytest.mark.parametrize("method", METHODS)
def test_equal_values_are_no_scale(method):
    """A moored ship with coarse digits: the noise of the sensor is the least scale."""
    x = np.zeros(300)
    x[::7] = 1.0
    x[150] = 30.0
    out = wild(method, epochs(x, sigma=0.5))[:, 0]
    assert np.flatnonzero(out).tolist() == [150]


@pytest.mark.parametrize("method", METHODS)
def test_a_gap_costs_no_fix(method):
    """The vehicle sails on while there is none; 53H and the recursion must know."""
    rng = np.random.default_rng(8)
    time = np.concatenate([np.arange(100.0), np.arange(140.0, 300.0), np.arange(303.0, 400.0)])
    x = 2.0 * time + rng.standard_normal(len(time))
    given = epochs(x, time=time)
    _, after, _ = decide(
        Decider(method, THRESHOLDS[method]), motion(), Recovery(60.0, 2.0), given, {}
    )
    assert not (after.fixed[90:, 0] == 0.0).any()


@pytest.mark.parametrize("method", METHODS)
def test_moderately_irregular_steps(method):
    rng = np.random.default_rng(9)
    time = np.arange(600.0) + rng.uniform(-0.3, 0.3, 600)
    keep = rng.uniform(size=600) > 0.1
    x = 0.8 * 80.0 * np.sin(time / 80.0) + rng.standard_normal(600)
    bad = np.zeros(600, np.bool_)
    bad[10::23] = True
    x[bad] += 20.0
    out = wild(method, epochs(x[keep], time=time[keep]))[:, 0]
    assert out[bad[keep]].mean() > 0.95
    assert out[~bad[keep]].mean() < 0.02


@pytest.mark.parametrize("sizes", [[1] * 300, [7] * 42, [100, 1, 150]], ids=["1", "7", "100"])
def test_the_recursion_does_not_see_the_batches(sizes):
    rng = np.random.default_rng(10)
    x = np.column_stack([walk(10, 300), walk(11, 300)])
    x[rng.uniform(size=x.shape) < 0.08] += 30.0
    x[rng.uniform(size=x.shape) < 0.05] = np.nan
    x[150:, 0] += 50.0
    time = np.cumsum(rng.choice([1.0, 1.1, 2.0, 9.0], 300, p=[0.5, 0.4, 0.08, 0.02]))
    given = epochs(x, time=time, sensor=rng.integers(0, 3, 300))
    decider, series = Decider("median", 5.0), {}
    _, whole, far = decide(decider, motion(2), RECOVERY, given, {})
    fixed, distance = [], []
    for first, last in pairwise([*np.cumsum([0, *sizes]).clip(0, 300), 300]):
        before = {key: each.state.level.copy() for key, each in series.items()}
        part = Epochs(*(column[first:last] for column in given))
        kept, (series, after, away) = series, decide(decider, motion(2), RECOVERY, part, series)
        for key, level in before.items():
            np.testing.assert_array_equal(kept[key].state.level, level)  # not modified
        fixed.append(after.fixed)
        distance.append(away)
    np.testing.assert_array_equal(np.concatenate(fixed), whole.fixed)
    np.testing.assert_array_equal(np.concatenate(distance), far)


@pytest.mark.parametrize("method", METHODS)
def test_no_decision_needs_more_than_it_says(method):
    """What comes later than the samples a cleaner looks ahead changes nothing."""
    x = walk(12, 200)
    x[::19] += 30.0
    given = epochs(x)
    decider = Decider(method, THRESHOLDS[method])
    assert look_ahead(decider, motion(), given) == AHEAD[method]
    _, _, far = decide(decider, motion(), RECOVERY, given, {})
    other = x.copy()
    other[100 + AHEAD[method] + 1 :] = shuffled(other)[100 + AHEAD[method] + 1 :]
    _, _, changed = decide(decider, motion(), RECOVERY, epochs(other), {})
    far, changed = far[:101, 0], changed[:101, 0]
    ratio = (
        changed.max() / far.max() if method == "53h" else 1.0
    )  # its scale is of the whole series
    np.testing.assert_allclose(changed, ratio * far, rtol=1e-12)


def shuffled(x):
    return np.random.default_rng(13).permutation(x)
