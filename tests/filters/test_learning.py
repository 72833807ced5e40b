"""Noise figures and priors that the multi-hypothesis filter learns, against what was put in."""

from dataclasses import replace

import numpy as np
import pytest

from surefix.filters import learning
from surefix.filters.learning import learn, likelihood, supposed
from surefix.filters.noise import NoiseFigures, Observations, estimate_noise
from surefix.simulate.contamination import alone, draw, draw_world

UNKNOWN = NoiseFigures(np.array([np.nan]), np.array([np.nan]), np.nan)
TINY = (1e-9, 1e-9)


def trial_of(name, kind, seed, *, axes=2, epochs=600):
    world = draw_world([13, seed], epochs=epochs, axes=axes)
    trial = draw(name, world, [13, seed])
    return alone(trial) if kind == "alone" else trial


def observed(trial):
    n, d = trial.fixes.shape
    z = np.hstack([trial.fixes, trial.velocities])
    return Observations(trial.time, z, np.zeros(n, np.int64), np.full((n, 2 * d), np.nan))


def learnt(trial, given=UNKNOWN, *, floor=TINY, first=None):
    seen, world = observed(trial), trial.world
    begin = estimate_noise(seen, given) if first is None else first
    speed = 20.0 * world.sigma_m / world.interval_s
    return learn(
        seen,
        given,
        begin,
        order=2,
        period=0.0,
        speed=speed,
        longest=39.5 * world.interval_s,
        floor=floor,
    )


def figures_of(trial, found):
    """Logarithms of position noise, process noise and, where there are any, velocity noise."""
    world = trial.world
    pairs = [(found.position[0], world.sigma_m), (found.process, world.process)]
    if trial.aided:
        pairs.append((found.velocity[0], world.sigma_mps))
    return [np.log(told / true) for told, true in pairs]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("clean", "alone"),
        ("isolated-20", "aided"),
        ("isolated-40", "alone"),
        ("isolated-40", "aided"),
    ],
)
def test_figures_are_found(name, kind):
    """However many fixes are wrong."""
    errors = []
    for seed in range(3):
        trial = trial_of(name, kind, seed)
        errors.append(figures_of(trial, learnt(trial).figures))
    assert (np.median(np.abs(errors), axis=0) < 0.1).all()
    assert np.max(np.abs(errors)) < 0.25
    assert np.abs(np.array(errors)[:, 0]).max() < 0.1


@pytest.mark.parametrize("name", ["dvl-faults", "one-axis", "burst-common", "jump"])
def test_faults_of_other_kinds_do_not_count_in_the_noise(name):
    trial = trial_of(name, "aided", 4)
    found = figures_of(trial, learnt(trial).figures)
    assert np.max(np.abs(found)) < 0.2
    assert abs(found[0]) < 0.1


def test_the_prior_is_what_the_log_shows():
    """Shares of the fixes that are wrong, and about how far."""
    for name, share in (("isolated-20", 0.2), ("isolated-40", 0.4), ("clean", 0.0)):
        trial = trial_of(name, "alone", 4)
        prior = learnt(trial).prior
        assert prior.isolated == pytest.approx(share, abs=0.02 + 0.1 * share)
        assert prior.partial < 0.03
        assert prior.poor < 0.05
        if share:
            size = np.median(np.abs(trial.fixes - trial.position)[trial.bad_fix])
            assert 0.7 * size < prior.spread[0] < 1.4 * size
            assert prior.spread[0] == prior.spread[1]
    prior = learnt(trial_of("one-axis", "alone", 4)).prior
    assert prior.partial == pytest.approx(0.2, abs=0.04)
    assert prior.isolated < 0.04


def test_how_many_errors_are_small_is_learnt():
    """None of less than 10 σ among many wrong fixes; where most are smaller nothing is denied."""
    for seed in range(3):
        none, some = (
            learnt(trial_of(name, "alone", seed, axes=1)).prior.small
            for name in ("isolated-40", "small")
        )
        assert none < 0.2
        assert some > 0.5
    assert learnt(trial_of("clean", "alone", 0)).prior.small == 1.0


def test_the_size_of_small_errors_is_learnt_at_any_noise():
    world = draw_world([13, 5], epochs=600, axes=2)
    sizes = []
    for sigma in (0.05, 5.0):
        trial = alone(draw("small", replace(world, sigma_m=sigma), [13, 5]))
        sizes.append(learnt(trial).prior.spread[0] / sigma)
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-3)
    assert 4.0 < sizes[0] < 8.0


def test_a_run_of_wrong_velocities_is_no_livelier_motion():
    """It passes for one where every velocity is judged by itself."""
    fooled = []
    for seed in (0, 1):
        trial = trial_of("dvl-faults", "aided", seed)
        seen, world = observed(trial), trial.world
        known = {"period": 0.0, "longest": 39.5 * world.interval_s}
        known["speed"] = 20.0 * world.sigma_m / world.interval_s
        fit = []
        for n in (2, 3):
            begun = estimate_noise(seen, UNKNOWN, order=n)
            found = learn(seen, UNKNOWN, begun, order=n, floor=TINY, **known).figures
            fit.append(
                [-begun.cost, *(likelihood(seen, f, order=n, **known) for f in (begun, found))]
            )
        steady, lively = fit
        assert steady[2] - lively[2] > 100.0
        fooled.append([lively[i] > steady[i] for i in (0, 1)])
    assert fooled == [[True, False], [False, False]]


def test_wrong_velocities_do_not_make_the_motion_calmer():
    """They are off alike, which tells nothing of how the vehicle moves."""
    errors = []
    for seed in range(4):
        trial = trial_of("dvl-faults", "aided", seed)
        errors.append(figures_of(trial, learnt(trial).figures)[1])
    assert abs(np.mean(errors)) < 0.06


def test_how_long_velocities_stay_wrong_and_alike_is_counted():
    """Runs of 5 … 40 with one error each, then the same velocities off anyhow, then none."""
    rng = np.random.default_rng(3)
    for seed in range(3):
        trial = trial_of("dvl-faults", "aided", seed)
        prior = learnt(trial).prior
        assert 0.93 < prior.again < 0.98
        assert prior.alike > 0.9
        wild = rng.uniform(20.0, 100.0, trial.velocities.shape) * rng.choice([-1.0, 1.0], 2)
        wild *= rng.choice([-1.0, 1.0], (len(wild), 1)) * trial.world.sigma_mps
        velocities = trial.velocity + np.where(trial.bad_velocity, wild, 0.0)
        noise = trial.world.sigma_mps * rng.standard_normal(wild.shape)
        scattered = learnt(replace(trial, velocities=velocities + noise)).prior
        assert scattered.again > 0.93
        assert scattered.alike < 0.5
        good = learnt(trial_of("clean", "aided", seed)).prior
        assert (good.again, good.alike) == pytest.approx((0.9, 0.7), abs=0.02)


def test_errors_of_one_axis_are_not_taken_for_errors_of_all():
    for seed in range(6):
        prior = learnt(trial_of("one-axis", "alone", seed, epochs=400)).prior
        assert prior.partial == pytest.approx(0.2, abs=0.05)
        assert prior.isolated < 0.03


def test_rows_of_wrong_fixes_are_counted():
    """After two that are wrong: nearly always in a burst, by chance elsewhere."""
    rows = {
        name: learnt(trial_of(name, "alone", 1)).prior.row
        for name in ("burst-independent", "burst-common", "isolated-40", "clean")
    }
    assert 0.75 < rows["burst-independent"] < 14 / 15
    assert rows["isolated-40"] == pytest.approx(0.4, abs=0.1)
    assert rows["burst-common"] < 0.5
    assert rows["clean"] == pytest.approx(0.3, abs=0.05)


def test_a_row_is_never_surer_to_go_on_than_a_run():
    trial = trial_of("clean", "alone", 2)
    rng = np.random.default_rng(5)
    for first in (100, 250, 400):
        wild = rng.uniform(20.0, 120.0, (36, 1)) * rng.choice([-1.0, 1.0], (36, 2))
        trial.fixes[first : first + 36] += trial.world.sigma_m * wild
    prior = learnt(trial).prior
    assert prior.row == pytest.approx(1.0 - prior.ending)
    assert prior.isolated == pytest.approx(108 / 600, abs=0.02)


@pytest.mark.parametrize("kind", ["aided", "alone"])
def test_fixes_of_a_run_do_not_count_as_wrong_by_themselves(kind):
    """30 of 600 fixes, as many more as err by themselves."""
    for seed in range(4):
        trial = trial_of("burst-common", kind, seed)
        prior = learnt(trial).prior
        alone_too = trial.bad_fix.any(axis=1).sum() - 30
        assert prior.isolated == pytest.approx(alone_too / 600, abs=0.01)
        assert prior.row < 0.5


def test_nothing_is_supposed_of_rows_where_learning_begins(monkeypatch):
    """After two wrong fixes the next is as likely wrong as any, whatever rows will be."""
    seen = observed(trial_of("burst-independent", "alone", 1))
    first, asked, evidence = estimate_noise(seen, UNKNOWN), [], learning._evidence
    monkeypatch.setattr(
        learning, "_evidence", lambda *given: asked.append(given[2]) or evidence(*given)
    )
    monkeypatch.setattr(learning, "_ROUNDS", 0)  # what it begins with
    settings = {"order": 2, "period": 0.0, "speed": 20.0, "longest": 40.0}
    likelihood(seen, first, **settings)
    assert len(asked) == 1
    begun = learn(seen, UNKNOWN, first, **settings, floor=TINY)
    assert len(asked) > 2
    assert all(prior.row == prior.isolated == 0.2 for prior in asked)
    assert begun.prior.row == 0.3


def test_what_the_user_knows_stays():
    """Even where it is far off; the rest is learnt with it."""
    trial = trial_of("isolated-20", "aided", 0)
    world = trial.world
    true = [world.sigma_m, world.sigma_mps, world.process]
    for which, factor in ((0, 1.0), (1, 2.0), (2, 0.5), (0, 3.0)):
        told = [np.nan, np.nan, np.nan]
        told[which] = true[which] * factor
        given = NoiseFigures(np.array(told[:1]), np.array(told[1:2]), told[2])
        found = learnt(trial, given).figures
        values = [found.position[0], found.velocity[0], found.process]
        assert values[which] == told[which]
        if factor == 1.0:
            assert np.abs(np.log(np.array(values) / true)).max() < 0.2
    given = NoiseFigures(np.array(true[:1]), np.array(true[1:2]), true[2])
    found = learnt(trial, given, first=given).figures
    assert (found.position[0], found.velocity[0], found.process) == tuple(true)


@pytest.mark.parametrize("kind", ["aided", "alone"])
def test_no_figure_falls_below_the_resolution(kind):
    trial = trial_of("isolated-20", kind, 2)
    floor = (1.5 * trial.world.sigma_m, 2.5 * trial.world.sigma_mps)
    found = learnt(trial, floor=floor).figures
    assert found.position[0] >= floor[0]
    assert found.position[0] < 1.1 * floor[0]
    if kind == "aided":
        assert found.velocity[0] >= floor[1]


def test_every_sensor_has_figures_of_its_own():
    trial = trial_of("isolated-20", "alone", 4)
    n = len(trial.time)
    rng = np.random.default_rng(0)
    sensor = np.arange(n) % 2
    worse = 3.0 * trial.world.sigma_m
    fixes = trial.fixes.copy()
    fixes[sensor == 1] += rng.normal(size=(n, 2))[sensor == 1] * np.sqrt(8.0) * trial.world.sigma_m
    seen = observed(trial)
    seen = seen._replace(z=np.hstack([fixes, trial.velocities]), sensor=sensor)
    given = NoiseFigures(np.full(2, np.nan), np.full(2, np.nan), np.nan)
    begin = estimate_noise(seen, given)
    longest, speed = 39.5 * trial.world.interval_s, 20.0 * trial.world.sigma_m
    found = learn(
        seen, given, begin, order=2, period=0.0, speed=speed, longest=longest, floor=TINY
    ).figures
    assert found.position[0] == pytest.approx(trial.world.sigma_m, rel=0.1)
    assert found.position[1] == pytest.approx(worse, rel=0.1)


def test_an_angle():
    rng = np.random.default_rng(1)
    n = 600
    true = np.cumsum(rng.normal(size=n) * 0.3)
    z = np.stack([(true + rng.normal(size=n) * 2.0) % 360.0, np.full(n, np.nan)], axis=1)
    z[5::11, 0] = (z[5::11, 0] + 120.0) % 360.0
    seen = Observations(
        np.arange(n, dtype=float), z, np.zeros(n, np.int64), np.full((n, 2), np.nan)
    )
    begin = estimate_noise(seen, UNKNOWN, period=360.0)
    found = learn(seen, UNKNOWN, begin, order=2, period=360.0, speed=10.0, longest=39.5, floor=TINY)
    assert found.figures.position[0] == pytest.approx(2.0, rel=0.15)
    assert found.prior.isolated == pytest.approx(1 / 11, abs=0.03)


@pytest.mark.parametrize("n", [0, 1, 2])
def test_too_little_to_learn_from(n):
    """The figures begun with, and the usual prior."""
    trial = trial_of("clean", "alone", 0)
    whole = observed(trial)
    seen = Observations(*(field[:n] for field in whole))
    first = NoiseFigures(np.array([2.0]), np.array([np.nan]), 0.1)
    found = learn(seen, UNKNOWN, first, order=2, period=0.0, speed=3.0, longest=40.0, floor=TINY)
    assert found.figures == first
    usual = supposed(2, 2.0, 1.0, 3.0, 40.0)
    for a, b in zip(found.prior, usual, strict=True):
        np.testing.assert_array_equal(a, b)


def test_nothing_is_modified():
    trial = trial_of("isolated-20", "alone", 4)
    seen = observed(trial)
    before = [field.copy() for field in seen]
    one, other = learnt(trial), learnt(trial)
    assert one.figures.process == other.figures.process
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before, seen, strict=True))
