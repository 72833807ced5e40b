"""The median recursion: its twin, its promise, and what happens beyond it."""

import numpy as np
import pytest

from reference.median_recursion import recursion
from surefix.errors import OptionsError
from surefix.filters.median_recursion import filter_medians, median_recursion, start_medians
from surefix.types import Verdict

FORMS = ("printed", "repeated-median", "feedback")


def series(seed, n=400, speed=3.0, sigma=1.0):
    rng = np.random.default_rng(seed)
    return speed * np.arange(n) + sigma * rng.standard_normal(n)


def disturbed(seed):
    """A line with isolated errors, a burst, gaps and a jump that stays."""
    rng = np.random.default_rng([seed, 1])
    y = series(seed)
    y[rng.uniform(size=400) < 0.05] += 40.0
    y[120:135] -= 25.0
    y[rng.uniform(size=400) < 0.08] = np.nan
    y[:2] = np.nan
    y[280:] += 60.0
    return y


@pytest.mark.parametrize(
    ("form", "model"),
    [*((form, "cv") for form in FORMS), ("printed", "ca"), ("feedback", "ca")],
)
@pytest.mark.parametrize(("window", "longest"), [(39, 50), (12, 7), (15, 40)])
def test_kernel_is_its_twin(form, model, window, longest):
    options = median_recursion(form, model=model, window=window, longest_burst=longest)
    for seed in range(3):
        y = disturbed(seed)
        _, found = filter_medians(options, y)
        estimate, scale, used, restarts = recursion(
            y, form, options.order, window, options.lag, options.gain, options.gate,
            options.longest_burst,
        )  # fmt: skip
        np.testing.assert_allclose(found.estimate, estimate, atol=1e-9)
        np.testing.assert_allclose(found.scale, scale, atol=1e-9)
        assert np.flatnonzero(found.restart).tolist() == restarts
        assert (found.verdict == Verdict.MISSING).tolist() == [each is None for each in used]
        for k in np.flatnonzero(~found.restart):
            assert (found.verdict[k] == Verdict.REJECTED) == (used[k] is False)


@pytest.mark.parametrize("form", FORMS)
def test_one_call_a_sample_gives_the_same_bits(form):
    y = np.column_stack([disturbed(1), disturbed(2)])
    before = y.copy()
    options = median_recursion(form, window=15, longest_burst=20)
    _, whole = filter_medians(options, y)
    np.testing.assert_array_equal(y, before)
    states = start_medians(options, 2)
    parts = []
    for k in range(0, 400, 1):
        states, part = filter_medians(options, y[k : k + 1], states)
        parts.append(part)
    for name in whole._fields:
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name))


def test_a_state_can_be_used_twice():
    options = median_recursion()
    states, _ = filter_medians(options, series(1)[:100])
    one = filter_medians(options, series(1)[100:], states)[1]
    two = filter_medians(options, series(1)[100:], states)[1]
    np.testing.assert_array_equal(one.estimate, two.estimate)


def worst(options, seed, length, kind, after=78):
    """Largest error around one burst, in σ."""
    rng = np.random.default_rng([seed, 2])
    y = series(seed, 360)
    sign = rng.choice([-1.0, 1.0], length)
    size = rng.uniform(10.0, 30.0, length)
    y[200 : 200 + length] += size[0] * sign[0] if kind == "common" else size * sign
    off = filter_medians(options, y)[1].estimate - 3.0 * np.arange(360)
    return np.abs(off[200 : 200 + length + after]).max()


@pytest.mark.parametrize("kind", ["common", "own"])
def test_the_promise_a_window_of_39_survives_15_on_end(kind):
    for seed in range(40):
        assert worst(median_recursion(), seed, 15, kind) < 3.0


def test_the_printed_form_does_not_keep_it():
    lost = sum(worst(median_recursion("printed"), seed, 15, "common") > 3.0 for seed in range(40))
    assert 2 <= lost <= 25  # most bursts are survived, but not all


def test_repeated_medians_survive_15_but_not_25():
    options = median_recursion("repeated-median")
    assert sum(worst(options, seed, 15, "own") < 3.0 for seed in range(12)) >= 11
    assert all(worst(options, seed, 25, "common") > 5.0 for seed in range(6))


@pytest.mark.parametrize("longest", [15, 30, 50])
def test_bursts_up_to_the_promise_are_survived_and_longer_ones_are_believed(longest):
    options = median_recursion(longest_burst=longest)
    assert sum(worst(options, seed, longest, "common") < 4.0 for seed in range(20)) >= 19
    assert all(worst(options, seed, longest + 2, "common") > 9.0 for seed in range(20))


@pytest.mark.parametrize("jump", [8.0, 100.0, 1e6])
def test_a_true_jump_is_followed_after_the_promise(jump):
    for seed in range(5):
        y = series(seed)
        y[200:] += jump
        _, found = filter_medians(median_recursion(longest_burst=30), y)
        off = found.estimate - 3.0 * np.arange(400) - jump
        assert np.abs(off[200:229]).min() > 0.5 * jump
        assert np.abs(off[231:]).max() < 3.0
        assert np.flatnonzero(found.restart).tolist() == [230]
        assert found.rate[231:].mean() == pytest.approx(3.0, abs=0.05)


def test_after_a_hard_turn_it_is_back_within_bounded_time():
    for seed in range(5):
        y = series(seed)
        y[200:] += 20.0 * np.arange(200)
        _, found = filter_medians(median_recursion(), y)
        truth = 3.0 * np.arange(400) + np.maximum(20.0 * (np.arange(400) - 200), 0.0)
        assert np.abs(found.estimate - truth)[260:].max() < 3.0


def test_noise_that_grows_tenfold_is_accepted_after_a_while():
    rng = np.random.default_rng(5)
    y = np.concatenate([rng.standard_normal(200), 10.0 * rng.standard_normal(400)])
    _, found = filter_medians(median_recursion(), y)
    assert found.scale[199] == pytest.approx(1.0, rel=0.5)
    assert found.scale[400:].mean() == pytest.approx(10.0, rel=0.2)


@pytest.mark.parametrize("speed", [0.0, -3.0, 500.0])
@pytest.mark.parametrize("sigma", [1e-3, 1.0, 1e3])
def test_noise_and_false_alarms_on_a_line(speed, sigma):
    rms, alarms = [], []
    for seed in range(6):
        y = series(seed, 1500, speed, sigma)
        _, found = filter_medians(median_recursion(), y)
        off = (found.estimate - speed * np.arange(1500))[100:] / sigma
        rms.append(np.sqrt(np.mean(off**2)))
        alarms.append(np.mean(found.verdict == Verdict.REJECTED))
    assert np.mean(rms) == pytest.approx(0.29, abs=0.03)
    assert np.mean(alarms) < 2e-3


def test_constant_acceleration_follows_a_parabola_without_lag():
    t = np.arange(600.0)
    truth = 0.05 * t**2
    off = {"cv": [], "ca": []}
    for seed in range(6):
        y = truth + np.random.default_rng(seed).standard_normal(600)
        for model, found in off.items():
            options = median_recursion(model=model, gain=0.3)
            found.append(filter_medians(options, y)[1].estimate[100:] - truth[100:])
    assert abs(np.mean(off["ca"])) < 0.1
    assert np.mean(off["cv"]) < -3.0
    assert np.sqrt(np.mean(np.square(off["ca"]))) < 0.75


def test_constant_acceleration_survives_15():
    t = np.arange(360.0)
    for seed in range(10):
        y = 0.05 * t**2 + np.random.default_rng(seed).standard_normal(360)
        y[200:215] += 25.0
        off = filter_medians(median_recursion(model="ca"), y)[1].estimate - 0.05 * t**2
        assert np.abs(off[200:300]).max() < 7.0


def test_missing_samples_are_bridged_and_do_not_count_as_a_run():
    y = series(3)
    y[200:240] = np.nan
    _, found = filter_medians(median_recursion(longest_burst=10), y)
    assert not found.restart.any()
    assert np.isnan(found.residual[200:240]).all()
    assert np.abs(found.estimate - 3.0 * np.arange(400))[50:].max() < 3.0


def test_nothing_seen_gives_nothing():
    _, found = filter_medians(median_recursion(), np.full(60, np.nan))
    assert np.isnan(found.estimate).all()
    assert (found.verdict == Verdict.MISSING).all()
    assert filter_medians(median_recursion(), np.empty(0))[1].estimate.shape == (0,)


def test_a_burst_while_it_begins():
    for seed in range(10):
        y = series(seed, 200)
        y[4:19] += 30.0
        off = filter_medians(median_recursion(), y)[1].estimate - 3.0 * np.arange(200)
        assert np.abs(off[38:]).max() < 10.0
        assert np.abs(off[120:]).max() < 2.5


def test_floor_keeps_samples_without_noise():
    y = np.repeat(np.arange(100.0), 3)
    _, found = filter_medians(median_recursion(floor=0.5), y)
    assert (found.verdict == Verdict.USED).all()
    assert found.scale.min() >= 0.5


@pytest.mark.parametrize(
    "wrong",
    [
        {"form": "newest"},
        {"model": "turn"},
        {"form": "repeated-median", "model": "ca"},
        {"window": 4},
        {"lag": 39},
        {"lag": 0},
        {"model": "ca", "lag": 20},
        {"gain": 0.0},
        {"gain": 1.5},
        {"gate": 0.0},
        {"floor": -1.0},
        {"floor": np.nan},
        {"longest_burst": 0},
    ],
)
def test_options_that_cannot_be_are_refused(wrong):
    with pytest.raises(OptionsError, match="expected"):
        median_recursion(**wrong)


def test_states_must_fit_the_axes():
    options = median_recursion()
    with pytest.raises(OptionsError, match="one state per axis"):
        filter_medians(options, np.zeros((5, 2)), start_medians(options, 3))
