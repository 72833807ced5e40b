"""Properties of the multi-hypothesis filter: its state, its limits, its honesty, odd input."""

import numpy as np
import pytest

from filters.worlds import NEVER, PLAIN, epochs_of, motion_of, straight, world
from surefix.filters.hypotheses import Bank, Found, Prior, Trail, no_hypotheses
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.records import Epochs
from surefix.filters.track import filter_track, start

IMPOSSIBLE = 1e-40


def prior_of(motion, sigma=0.5, *, velocity=0.1, longest=40.0, **changes):
    return supposed(motion.axes, sigma, velocity, 10.0, longest)._replace(**changes)


def certain(motion):
    """A prior under which nothing is ever wrong."""
    no = IMPOSSIBLE
    return Prior(
        no, no, no, no, no, 1e9, no, no, no, np.ones(2 * motion.axes), NEVER.sigma_velocity
    )


def run(motion, prior, epochs, **how):
    return filter_hypotheses(motion, prior, epochs, no_hypotheses(motion), **how)


def rows(epochs, which):
    return Epochs(*(field[which] for field in epochs))


def spoilt(seed, made, share=0.15, size=(10.0, 130.0), *, velocity=0.0):
    """The epochs of a world with gross errors; which fixes are bad."""
    rng = np.random.default_rng(seed + 500)
    z, (n, m) = made.epochs.z.copy(), made.epochs.z.shape
    d = m // 2
    bad = rng.random(n) < share
    bad[:3] = False
    way = rng.normal(size=(n, d))
    way *= rng.uniform(*size, (n, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    z[bad, :d] += (way * np.sqrt(made.epochs.variance[:, :d]))[bad]
    slips = rng.random(n) < velocity
    z[slips, d:] += (way * np.sqrt(made.epochs.variance[:, d:]))[slips]
    sensor = np.zeros(n, np.int64)
    return made.epochs._replace(z=z, sensor=sensor), bad


def everything(seed, order=2, axes=2):
    """Aided, with gross errors, a run, missing components and three sensors."""
    made = world(seed, 150, order=order, axes=axes, velocity=0.1, missing=0.2, blocks=False)
    epochs, _ = spoilt(seed, made, velocity=0.1)
    epochs.z[60:80, :axes] += 30.0
    epochs.sensor[:] = np.random.default_rng(seed).integers(0, 3, 150)
    return made, epochs


@pytest.mark.parametrize(("order", "axes"), [(2, 2), (3, 1), (2, 3)])
def test_one_call_is_a_call_per_epoch(order, axes):
    """To the last bit, the state and the trail too; and the state given is not modified."""
    made, epochs = everything(1, order, axes)
    prior = prior_of(made.motion)
    before = [np.array(field) for field in epochs]
    whole, found, trail = run(made.motion, prior, epochs)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before, epochs, strict=True))
    bank, parts = no_hypotheses(made.motion), []
    for k in range(150):
        given = [field.copy() for field in bank]
        after, *rest = filter_hypotheses(made.motion, prior, rows(epochs, slice(k, k + 1)), bank)
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(given, bank, strict=True))
        parts.append(rest)
        bank = after
    one, steps = zip(*parts, strict=True)
    joined = Found(*(np.concatenate(fields) for fields in zip(*one, strict=True)))
    path = Trail(*(np.concatenate(fields) for fields in zip(*steps, strict=True)))
    counts = np.concatenate([np.diff(step.first) for step in steps])
    path = path._replace(first=np.append(0, np.cumsum(counts)))
    for a, b in zip((*found, *trail), (*joined, *path), strict=True):
        np.testing.assert_array_equal(a, b)
    used = whole.number[0]
    for name in Bank._fields:
        a, b = getattr(whole, name), getattr(bank, name)
        np.testing.assert_array_equal(a[:used], b[:used], err_msg=name)
    assert used > 1


def test_the_trail_costs_nothing_but_itself():
    made, epochs = everything(2)
    _, one, trail = run(made.motion, prior_of(made.motion), epochs)
    _, other, none = run(made.motion, prior_of(made.motion), epochs, traced=False)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)
    assert len(none.best) == 0
    assert len(trail.best) == 150


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("velocity", [None, 0.2])
def test_without_errors_it_is_the_kalman_filter(order, axes, velocity):
    for seed in range(2):
        made = world(
            seed, 80, order=order, axes=axes, velocity=velocity, missing=0.2, q=0.3, blocks=False
        )
        epochs = made.epochs._replace(sensor=np.zeros(80, np.int64))
        bank, found, _ = run(made.motion, certain(made.motion), epochs)
        begin = start(made.motion, NEVER)
        out = filter_track(made.motion, PLAIN, NEVER, made.epochs, begin)[1]
        sigma = np.sqrt(np.einsum("kij,kij->ki", out.factor, out.factor))
        np.testing.assert_allclose(found.mean[40:], out.mean[40:], rtol=1e-9, atol=1e-8)
        np.testing.assert_allclose(found.sigma[40:], sigma[40:], rtol=1e-9)
        for field, other in ((found.standardised, out.standardised), (found.weight, out.weight)):
            known = np.isfinite(epochs.z[40:])
            np.testing.assert_allclose(field[40:][known], other[40:][known], atol=1e-7)
        assert bank.number[0] == 1


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("order", [2, 3])
def test_weights_are_probabilities_and_covariances_are_ones(order, axes):
    made, epochs = everything(3, order, axes)
    prior, bank = prior_of(made.motion), no_hypotheses(made.motion)
    for k in range(150):
        bank, found, _ = filter_hypotheses(
            made.motion, prior, rows(epochs, slice(k, k + 1)), bank, traced=False
        )
        used = bank.number[0]
        assert 1 <= used <= len(bank.weight)
        assert np.exp(bank.weight[:used]).sum() == pytest.approx(1.0)
        P = bank.covariance[:used]
        np.testing.assert_array_equal(P, P.swapaxes(-1, -2))
        spread = np.linalg.eigvalsh(P)
        assert (spread >= -1e-9 * np.abs(spread).max()).all()
        known = np.isfinite(epochs.z[k])
        np.testing.assert_array_equal(np.isfinite(found.weight[0]), known)
        assert (found.weight[0, known] >= 0.0).all()
        assert (found.weight[0, known] <= 1.0 + 1e-9).all()


NEES = [(axes, velocity, True) for axes in (1, 2, 3) for velocity in (None, 0.1)]
NEES += [(2, None, False), (3, 0.1, False)]


@pytest.mark.parametrize(("axes", "velocity", "irregular"), NEES)
def test_it_is_as_sure_as_it_may_be(axes, velocity, irregular):
    """NEES over seeds with 15 % gross errors, of all states and of the position."""
    whole, count, missed, lost = 0.0, 0, [], []
    for seed in range(40):
        made = world(
            seed, 250, axes=axes, q=0.02, velocity=velocity, irregular=irregular, blocks=False
        )
        epochs, bad = spoilt(seed, made)
        prior = prior_of(made.motion, isolated=0.15, row=0.15, partial=0.01)
        _, found, _ = run(made.motion, prior, epochs, traced=False)
        ratio = ((found.mean - made.truth) / found.sigma)[20:, :axes] ** 2
        whole, count = whole + ratio.sum(), count + ratio.size
        least = found.weight[20:, :axes].min(axis=1)
        missed.append((least[bad[20:]] > 0.5).mean())
        lost.append((found.weight[20:, :axes][~bad[20:]] < 0.1).mean())
    assert np.mean(missed) < 0.01
    assert np.mean(lost) < 0.003
    assert 0.9 < whole / count < 1.1


def test_gross_errors_do_not_move_it():
    """As good as if it had been told which fixes are wrong."""
    for velocity, limit in ((None, 1.06), (0.1, 1.02)):
        error = np.zeros(2)
        for seed in range(12):
            made = world(seed, 250, axes=2, q=0.02, velocity=velocity, blocks=False)
            epochs, bad = spoilt(seed, made)
            told = epochs.fixed.copy()
            told[bad, :2] = 0.0
            told[~bad, :2] = 1.0
            for i, each in enumerate((epochs, epochs._replace(fixed=told))):
                _, found, _ = run(made.motion, prior_of(made.motion, isolated=0.15), each)
                error[i] += ((found.mean - made.truth)[20:, :2] ** 2).sum()
        assert np.sqrt(error[0] / error[1]) < limit


def test_what_is_decided_beforehand_stays():
    made, epochs = everything(4)
    fixed = epochs.fixed.copy()
    fixed[60:80, :2] = 1.0
    fixed[100, :2] = 0.0
    fixed[101, 0] = 0.0
    fixed[110, 2:], fixed[111, 2:] = 0.0, 1.0
    _, found, _ = run(made.motion, prior_of(made.motion), epochs._replace(fixed=fixed))
    for k, c, expected in [
        (65, 0, 1.0),
        (100, 1, 0.0),
        (101, 0, 0.0),
        (110, 2, 0.0),
        (111, 3, 1.0),
    ]:
        for j in [c] if c < 2 else [2, 3]:
            w = found.weight[k, j]
            assert np.isnan(w) == np.isnan(epochs.z[k, j])
            if not np.isnan(w) and expected == 0.0:
                assert w == pytest.approx(0.0, abs=1e-12)
            elif not np.isnan(w):
                assert w > 0.2  # poor, at worst


def test_rows_that_say_nothing_only_predict():
    _, epochs, motion = straight(0, 60, velocity=0.1)
    motion = motion_of(2, 2, 0.02, blocks=False)
    epochs = epochs._replace(sensor=np.zeros(60, np.int64), fixed=np.full((60, 4), np.nan))
    z = epochs.z.copy()
    z[30:40] = np.nan
    prior = prior_of(motion)
    _, found, _ = run(motion, prior, epochs._replace(z=z))
    steps = np.diff(found.mean[29:40], axis=0)
    np.testing.assert_allclose(steps[:, :2], found.mean[30:40, 2:], rtol=1e-3)  # some merge
    assert (np.diff(found.sigma[29:40], axis=0) > 0.0).all()
    assert np.isnan(found.weight[30:40]).all()
    assert (found.evidence[30:40] == 0.0).all()
    thin = np.r_[0:30, 40:60]
    _, other, _ = run(motion, prior, rows(epochs._replace(z=z), thin))
    np.testing.assert_allclose(other.mean, found.mean[thin], rtol=1e-5, atol=1e-4)


def single(z, *, sigma=0.5, q=0.02, period=0.0, time=None, sensor=None, order=2):
    """Epochs and motion of positions alone, (n, axes)."""
    z = np.asarray(z, float)
    n, d = z.shape
    motion = motion_of(order, d, q, blocks=False, period=period)
    time = np.arange(n, dtype=float) if time is None else time
    full = np.hstack([z, np.full((n, d), np.nan)])
    epochs = epochs_of(time, full, np.full(2 * d, sigma), motion)
    sensor = np.zeros(n, np.int64) if sensor is None else sensor
    return motion, epochs._replace(sensor=sensor)


def line(seed, n, d, *, sigma=0.5, speed=1.5):
    rng = np.random.default_rng(seed)
    truth = speed * np.arange(n)[:, None] * np.ones(d)
    return truth, truth + sigma * rng.normal(size=(n, d))


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("wrong", [1, 2, 6])
def test_a_bad_beginning(order, axes, wrong):
    """The first fix, or a run at the beginning with a common offset: later fixes outvote them."""
    for seed in range(4):
        truth, z = line(seed, 80, axes)
        z[:wrong] += 200.0
        motion, epochs = single(z, order=order, q=0.01)
        _, found, _ = run(motion, prior_of(motion), epochs)
        assert np.abs(found.mean[40:, :axes] - truth[40:]).max() < 4.0


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_wild_values_do_not_hurt(axes):
    for seed in range(4):
        truth, z = line(seed, 120, axes)
        bad = np.arange(10, 120, 7)
        z[bad] = 1e9 * np.random.default_rng(seed).choice([-1, 1], (len(bad), axes))
        motion, epochs = single(z)
        bank, found, _ = run(motion, prior_of(motion), epochs)
        assert np.abs(found.mean[20:, :axes] - truth[20:]).max() < 4.0
        assert (found.weight[bad, :axes] < 0.01).all()
        assert all(np.isfinite(field[: bank.number[0]]).all() for field in bank[2:4])


def test_equal_times():
    """Two fixes at one time are two observations of one place."""
    _, z = line(5, 60, 2)
    z = np.repeat(z, 2, axis=0)
    z[41] += 50.0
    motion, epochs = single(z, time=np.repeat(np.arange(60.0), 2))
    _, found, _ = run(motion, prior_of(motion), epochs)
    assert np.isfinite(found.mean).all()
    assert (found.weight[41, :2] < 0.01).all()
    assert (found.weight[[40, 42], :2] > 0.9).all()


def test_an_angle_goes_round():
    for seed in range(4):
        truth, z = line(seed, 300, 1, sigma=2.0, speed=7.0)
        z[50:300:9] += 90.0
        motion, epochs = single(z % 360.0, sigma=2.0, q=0.05, period=360.0)
        _, found, _ = run(motion, prior_of(motion, sigma=2.0), epochs)
        off = (found.mean[20:, 0] - truth[20:, 0] + 180.0) % 360.0 - 180.0
        assert np.abs(off).max() < 9.0
        assert (found.weight[50:300:9, 0] < 0.05).all()
        assert np.abs(found.standardised[60:, 0] * 2.0).max() < 190.0
        assert found.sigma[50:, 0].max() < 4.0


def test_an_axis_that_is_wrong_does_not_cost_the_others():
    for seed in range(4):
        truth, z = line(seed, 200, 3)
        bad = np.arange(30, 200, 6)
        axis = np.random.default_rng(seed).integers(0, 3, len(bad))
        z[bad, axis] += 30.0
        motion, epochs = single(z)
        _, found, _ = run(motion, prior_of(motion, partial=0.1), epochs)
        weight = found.weight[bad, :3]
        assert (weight[np.arange(len(bad)), axis] < 0.02).all()
        weight[np.arange(len(bad)), axis] = 1.0
        assert np.median(weight) > 0.9
        assert np.abs(found.mean[20:, :3] - truth[20:]).max() < 2.5


def test_a_run_of_one_sensor_leaves_the_other():
    """Fixes of the second sensor support the track; the offset of the first is found."""
    for seed in range(4):
        truth, z = line(seed, 200, 2)
        sensor = np.arange(200) % 2
        run_of = (sensor == 1) & (np.arange(200) >= 80) & (np.arange(200) < 130)
        z[run_of] += [25.0, -40.0]
        motion, epochs = single(z, sensor=sensor)
        _, found, _ = run(motion, prior_of(motion, longest=100.0), epochs)
        assert np.abs(found.mean[20:, :2] - truth[20:]).max() < 2.5
        assert (found.weight[run_of, :2] < 0.02).all()
        assert (found.weight[~run_of, :2] > 0.2).mean() > 0.98
        assert found.run[run_of][3:].min() > 0
        assert found.run[127] == 24


@pytest.mark.parametrize("depth", [False, True])
def test_a_sensor_that_is_off_for_good(depth):
    """As long as another one denies it the track does not follow; a depth alone has no say."""
    for seed in range(3):
        truth, z = line(seed, 300, 3)
        sensor = np.arange(300) % 2
        z[(sensor == 1) & (np.arange(300) >= 80)] += [25.0, -40.0, 0.0]
        z[200:][sensor[200:] == 0] = np.nan
        if depth:
            z[sensor == 0, :2] = np.nan
        motion, epochs = single(z, sensor=sensor)
        _, found, _ = run(motion, prior_of(motion), epochs)
        jumps = found.since[np.isfinite(found.since)]
        error = np.abs(found.mean[:, :3] - truth)
        assert len(jumps) == 1
        last = 80 if depth else 198
        assert last <= jumps[0] <= last + 2
        assert error[20:last].max() < 2.5
        truth += np.array([25.0, -40.0, 0.0])
        assert np.abs(found.mean[last + 50 :, :3] - truth[last + 50 :]).max() < 3.0


def test_a_run_lasts_and_is_a_jump():
    """Told once, when it has lasted too long, and dated to its first fix."""
    for seed in range(4):
        truth, z = line(seed, 200, 2)
        z[100:], truth[100:] = z[100:] + 30.0, truth[100:] + 30.0
        motion, epochs = single(z)
        _, found, _ = run(motion, prior_of(motion, longest=40.0), epochs)
        told = np.flatnonzero(np.isfinite(found.since))
        assert found.since[told].tolist() == [100.0]
        assert told[0] <= 140
        assert np.abs(found.mean[140:, :2] - truth[140:]).max() < 2.5
        assert np.abs(found.mean[20:99, :2] - truth[20:99]).max() < 2.5


def test_velocities_alone():
    """Rates are known, the position is not, and that is said."""
    _, epochs, _ = straight(0, 40, velocity=0.1)
    motion = motion_of(2, 2, 0.02, blocks=False)
    z = epochs.z.copy()
    z[:25, :2] = np.nan
    epochs = epochs._replace(z=z, sensor=np.zeros(40, np.int64), fixed=np.full((40, 4), np.nan))
    _, found, _ = run(motion, prior_of(motion), epochs)
    assert np.isnan(found.mean[:25, :2]).all()
    assert np.isfinite(found.mean[:25, 2:]).all()
    assert found.sigma[24, 2:].max() < 0.1
    assert np.isfinite(found.mean[25:]).all()
    assert found.sigma[39, :2].max() < 0.3


@pytest.mark.parametrize("n", [0, 1, 2])
def test_next_to_nothing(n):
    motion, epochs = single(np.full((n, 2), 5.0))
    bank, found, trail = run(motion, prior_of(motion), epochs)
    assert found.mean.shape == (n, 4)
    assert len(trail.best) == n
    np.testing.assert_allclose(found.mean[:, :2], np.full((n, 2), 5.0), atol=1e-9)
    assert np.isnan(bank.time[0]) == (n == 0)
