"""Noise figures from the data against the noise that was put in."""

from itertools import product

import numpy as np
import pytest

from filters.worlds import world
from surefix.filters.noise import (
    NoiseFigures,
    Observations,
    difference_scale,
    estimate_noise,
    grain,
    speed_scale,
    variances,
)

UNKNOWN = NoiseFigures(np.array([np.nan]), np.array([np.nan]), np.nan)
SIGMAS = [0.05, 0.5, 5.0]
RATES = [0.2, 1.0, 20.0]


def observations(z, time, sensor=None):
    n = len(time)
    sensor = np.zeros(n, np.int64) if sensor is None else sensor
    return Observations(np.asarray(time, float), z, sensor, np.full(z.shape, np.nan))


def disturbed(rng, z, axes, sigma, gross):
    """A share of the positions is off by 8 to 150 standard deviations."""
    bad = rng.random(len(z)) < gross
    off = rng.choice([-1, 1], (bad.sum(), axes)) * rng.uniform(8, 150, (bad.sum(), axes))
    z[bad, :axes] += off * sigma
    return z


def drawn(seed, *, sigma, rate, gross=0.0, velocity=None, axes=2, n=600, process=0.05, order=2):
    """Truth from the motion model itself, with irregular steps."""
    made = world(
        seed,
        n,
        order=order,
        axes=axes,
        q=process**2,
        position=sigma,
        velocity=velocity,
        step=0.6 / rate,
    )
    rng = np.random.default_rng(seed + 77)
    return observations(disturbed(rng, made.epochs.z, axes, sigma, gross), made.epochs.time)


def surveyed(seed, *, sigma, rate, gross=0.0, velocity=None, n=600):
    """A vessel that turns smoothly to and fro, up to 1.3 m/s and 0.03 m/s²."""
    rng = np.random.default_rng(seed)
    t = (np.arange(n) + rng.uniform(-0.1, 0.1, n)) / rate
    w, begin = 2.0 * np.pi / 300.0 * np.array([1.0, 1.3]), rng.uniform(0.0, 6.0, 2)
    x = 60.0 * np.sin(w * t[:, None] + begin)
    z = np.full((n, 4), np.nan)
    z[:, :2] = x + sigma * rng.normal(size=(n, 2))
    if velocity is not None:
        v = 60.0 * w * np.cos(w * t[:, None] + begin)
        z[:, 2:] = v + velocity * rng.normal(size=(n, 2))
    return observations(disturbed(rng, z, 2, sigma, gross), t)


@pytest.mark.parametrize("velocity", [None, 0.05])
@pytest.mark.parametrize(
    ("sigma", "rate", "gross"),
    [
        case
        for case in product(SIGMAS, RATES, [0.0, 0.2])
        if case != (0.05, 0.2, 0.2)  # motion between two fixes is uncertain by six σ there
    ],
)
def test_position_and_velocity_noise(sigma, rate, gross, velocity):
    """The median of the seeds within 10 %, each within 15 %."""
    found = [
        estimate_noise(drawn(seed, sigma=sigma, rate=rate, gross=gross, velocity=velocity), UNKNOWN)
        for seed in range(3)
    ]
    ratio = np.array([figures.position[0] for figures in found]) / sigma
    assert abs(np.median(ratio) - 1.0) < 0.1
    assert np.abs(ratio - 1.0).max() < 0.15
    if velocity is None:
        assert np.isnan(found[0].velocity[0])
        return
    ratio = np.array([figures.velocity[0] for figures in found]) / velocity
    assert abs(np.median(ratio) - 1.0) < 0.1
    assert np.abs(ratio - 1.0).max() < 0.15


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize(("order", "process"), [(2, 0.02), (2, 0.5), (3, 0.02)])
def test_process_noise(axes, order, process):
    found = [
        estimate_noise(
            drawn(seed, sigma=0.5, rate=1.0, axes=axes, order=order, process=process, n=800),
            UNKNOWN,
            order=order,
        )
        for seed in range(5)
    ]
    ratio = np.array([figures.process for figures in found]) / process
    assert abs(np.median(ratio) - 1.0) < 0.15
    assert np.abs(ratio - 1.0).max() < 0.4
    ratio = np.array([figures.position[0] for figures in found]) / 0.5
    assert np.abs(ratio - 1.0).max() < 0.15


@pytest.mark.parametrize("velocity", [None, 0.05])
@pytest.mark.parametrize("gross", [0.0, 0.1])
@pytest.mark.parametrize(("sigma", "rate"), [(0.05, 1.0), (0.05, 5.0), (0.5, 0.2), (5.0, 1.0)])
def test_smooth_motion_is_not_taken_for_noise(sigma, rate, gross, velocity):
    """Motion that is no random walk, under the model that suits it."""
    found = [
        estimate_noise(
            surveyed(seed, sigma=sigma, rate=rate, gross=gross, velocity=velocity),
            UNKNOWN,
            order=3,
        )
        for seed in range(3)
    ]
    assert np.median([f.position[0] for f in found]) == pytest.approx(sigma, rel=0.1)
    if velocity is not None:
        assert np.median([f.velocity[0] for f in found]) == pytest.approx(velocity, rel=0.15)


@pytest.mark.xfail(reason="the search begins too far away and ends at a local optimum")
def test_a_fast_turning_vessel_with_sparse_fixes_and_many_gross_errors():
    """The likelihood is right, 1300 nats better at the truth; the search does not get there."""
    found = [
        estimate_noise(
            surveyed(seed, sigma=0.05, rate=0.2, gross=0.2, n=1000), UNKNOWN, order=3
        ).position[0]
        for seed in range(3)
    ]
    assert np.median(found) == pytest.approx(0.05, rel=0.2)


def test_the_likelihood_tells_the_models_apart():
    votes = []
    for seed in range(4):
        for order, process in ((2, 0.2), (3, 0.02)):
            log = drawn(seed, sigma=0.3, rate=1.0, order=order, process=process)
            costs = [estimate_noise(log, UNKNOWN, order=each).cost for each in (2, 3)]
            votes.append(2 + int(np.argmin(costs)) == order)
    assert np.mean(votes) >= 0.75


@pytest.mark.parametrize("gross", [0.0, 0.1])
def test_sensors_have_figures_of_their_own(gross):
    """Two position sensors in turn, and one that only knows velocities."""
    velocities = []
    for seed in range(3):
        made = world(seed, 1500, axes=2, q=0.01, position=1.0, velocity=1.0, irregular=False)
        rng = np.random.default_rng(seed)
        sensor = np.arange(1500) % 3
        z = made.truth + rng.normal(size=(1500, 4)) * np.array([0.3, 0.3, 0.1, 0.1])
        second = sensor == 1
        z[second] = made.truth[second] + rng.normal(size=(500, 4)) * 2.0
        z[sensor < 2, 2:] = np.nan
        z[sensor == 2, :2] = np.nan
        seen = sensor < 2
        bad = seen & (rng.random(1500) < gross)
        z[bad, :2] += rng.choice([-1, 1], (bad.sum(), 2)) * rng.uniform(20, 90, (bad.sum(), 2))
        unknown = NoiseFigures(np.full(3, np.nan), np.full(3, np.nan), np.nan)
        found = estimate_noise(observations(z, made.epochs.time, sensor), unknown)
        np.testing.assert_allclose(found.position[:2], [0.3, 2.0], rtol=0.15)
        assert np.isnan(found.position[2])
        assert np.isnan(found.velocity[:2]).all()
        velocities.append(found.velocity[2])
    assert np.median(velocities) == pytest.approx(0.1, rel=0.15)


def test_given_figures_win():
    log = drawn(0, sigma=0.5, rate=1.0, velocity=0.1)
    given = NoiseFigures(np.array([3.0]), np.array([np.nan]), np.nan)
    assert estimate_noise(log, given).position[0] == 3.0
    all_given = NoiseFigures(np.array([3.0]), np.array([0.7]), 0.25)
    found = estimate_noise(log, all_given)
    assert (found.position[0], found.velocity[0], found.process) == (3.0, 0.7, 0.25)


def test_declared_standard_deviations_go_before_figures():
    log = drawn(0, sigma=0.5, rate=1.0, velocity=0.1, n=10)
    declared = log.declared.copy()
    declared[3, 0] = 9.0
    figures = NoiseFigures(np.array([2.0]), np.array([0.5]), 1.0)
    found = variances(log._replace(declared=declared), figures)
    expected = np.tile([4.0, 4.0, 0.25, 0.25], (10, 1))
    expected[3, 0] = 81.0
    np.testing.assert_allclose(found, expected)


def test_coarse_digits_set_a_floor():
    """Positions of whole metres at rest: no figure may fall below a metre over root 12."""
    rng = np.random.default_rng(0)
    z = np.full((300, 4), np.nan)
    z[:, :2] = np.round(50.0 + 0.05 * rng.normal(size=(300, 2)))
    found = estimate_noise(observations(z, np.arange(300.0)), UNKNOWN, quantum=1.0)
    assert found.position[0] >= 1.0 / np.sqrt(12.0) - 1e-12


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_very_short_logs_have_finite_figures(n):
    z = np.full((n, 4), np.nan)
    z[:, :2] = np.arange(n)[:, None] * [1.0, 2.0]
    found = estimate_noise(observations(z, np.arange(float(n))), UNKNOWN)
    assert found.position[0] > 0.0
    assert np.isfinite(found.position[0])
    assert np.isfinite(found.process)


@pytest.mark.parametrize("sigma", [0.2, 2.0])
@pytest.mark.parametrize("turning", [0.0, 3.0])
def test_difference_scale(sigma, turning):
    """Unbiased on white noise, whatever the speed; a third of gross errors leaves its size."""
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.3, 2.0, 4000))
    y = 5.0 + turning * time + sigma * rng.normal(size=4000)
    assert difference_scale(time, y) == pytest.approx(sigma, rel=0.06)
    bad = rng.random(4000) < 0.15
    y[bad] += 200.0 * rng.normal(size=bad.sum())
    assert difference_scale(time, y) < 2.0 * sigma


def test_difference_scale_of_an_angle_and_of_too_little():
    rng = np.random.default_rng(0)
    time = np.arange(2000.0)
    heading = (3.0 * time + 0.5 * rng.normal(size=2000)) % 360.0
    assert difference_scale(time, heading, 360.0) == pytest.approx(0.5, rel=0.08)
    assert np.isnan(difference_scale(time[:2], heading[:2]))
    assert np.isnan(difference_scale(np.zeros(9), heading[:9]))


def test_grain_and_speed_scale():
    assert grain(np.array([0.25, 1.0, 0.5, np.nan, 2.0])) == 0.25
    assert grain(np.array([1.0, 1.0])) == 0.0
    time = np.arange(100.0)
    assert speed_scale(time, 3.0 * time) == pytest.approx(6.0)
    assert speed_scale(time[:1], time[:1]) == 1.0
    assert speed_scale(np.zeros(30), time[:30]) == 1.0
