"""The delay of positions against velocities, and how honest its standard error is."""

import numpy as np
import pytest

from surefix.filters.latency import UNKNOWN, latency
from surefix.simulate.contamination import World, draw, draw_world
from surefix.simulate.rov_dive import simulate

STILL = {"minutes": 20.0, "dvl_clock_ppm": 0.0}


def errors(estimates):
    """Errors over their standard errors; a log that cannot tell counts as none."""
    found = [(each.delay - delay) / each.sigma for each, delay in estimates if each is not UNKNOWN]
    return np.array(found)


def dive(seed, delay, **given):
    simulated = simulate(seed, **{**STILL, **given})
    fixes, dvl = simulated.fixes, simulated.dvl
    return latency(fixes.time + delay, fixes.position, dvl.time, dvl.velocity)


def trial(scenario, seed, axes):
    """A drawn world: noise, rate and agility of any size; up to three intervals late or early."""
    world = draw_world(seed, epochs=800, axes=axes)
    drawn = draw(scenario, world, seed)
    delay = np.random.default_rng(seed).uniform(-3.0, 3.0) * world.interval_s
    return latency(drawn.time + delay, drawn.fixes, drawn.time, drawn.velocities), delay


def test_standard_error_is_honest_on_dives():
    """20 % gross errors, a burst, a jump, dropouts of both sensors; four delays, two noises."""
    delays = (0.0, 1.3, 6.0, -2.0)  # the errors are those of the seed, whatever the delay
    found = [
        (dive(seed, delays[seed % 4], gross_share=0.2, sigma_dvl_mps=noise), delays[seed % 4])
        for noise in (0.01, 0.03)
        for seed in range(24)
    ]
    z = errors(found)
    assert len(z) >= 47
    assert 0.6 < np.mean(z**2) < 1.7
    assert np.mean(np.abs(z) < 2.0) > 0.88
    assert abs(np.mean(z)) < 0.5
    assert np.median([each.sigma for each, _ in found]) < 0.2


@pytest.mark.parametrize(
    ("scenario", "axes"),
    [
        ("isolated-20", 1),
        ("isolated-20", 2),
        ("burst-independent", 3),
        ("irregular", 3),
        ("dropouts", 2),
    ],
)
def test_standard_error_is_honest_in_any_world(scenario, axes):
    z = errors([trial(scenario, seed, axes) for seed in range(16)])
    assert len(z) >= 14
    assert 0.3 < np.mean(z**2) < 1.9
    assert np.abs(z).max() < 4.0


def test_runs_of_wrong_velocities_do_not_pass_for_a_delay():
    """A quarter of the velocities are wrong, in runs."""
    found = [trial("dvl-faults", seed, 3) for seed in range(16)]
    z = errors(found)
    assert len(z) >= 14
    assert np.mean(z**2) < 2.5
    assert np.abs(z).max() < 5.0


@pytest.mark.parametrize("noise", [0.01, 0.1, 0.5])
def test_even_motion_tells_no_delay(noise):
    """The noise of the velocity is no change of velocity."""
    sure = 0
    time, often = np.arange(0.0, 1200.0, 2.0), np.arange(0.0, 1200.0, 0.5)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        way = np.array([1.0, 0.5, 0.0])
        position = time[:, None] * way + rng.normal(0.0, 0.5, (len(time), 3))
        velocity = way + rng.normal(0.0, noise, (len(often), 3))
        found = latency(time + 1.0, position, often, velocity)
        sure += abs(found.delay) > 3.0 * found.sigma
        assert not found.sigma < 0.3
    assert sure == 0


def weaving(rng, *, arm=(0.0, 0.0), turn_deg=0.0, scale=1.0, delay=0.0, changing=True):
    """Fixes every 2 s and velocities at 5 Hz of a vehicle that turns, and may change its speed."""
    often = np.arange(0.0, 1500.0, 0.2)
    course = 1.5 * np.sin(often / 40.0) + 0.5 * np.sin(often / 9.0)
    speed = 1.5 + (0.9 * np.sin(often / 23.0) if changing else 0.0)
    velocity = np.column_stack([speed * np.sin(course), speed * np.cos(course)])
    path = np.cumsum(velocity, axis=0) * 0.2
    ahead = np.column_stack([np.sin(course), np.cos(course)])
    aside = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    place = path + arm[0] * ahead + arm[1] * aside
    time = np.arange(10.0, 1480.0, 2.0)
    fixes = np.column_stack([np.interp(time, often, axis) for axis in place.T])
    fixes += rng.normal(0.0, 0.3, fixes.shape)
    angle = np.radians(turn_deg)
    turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    measured = scale * velocity @ turned + rng.normal(0.0, 0.02, velocity.shape)
    return latency(time + delay, fixes, often, measured)


@pytest.mark.parametrize(
    "wrong",
    [
        {"turn_deg": 5.0},
        {"scale": 1.03},
        {"arm": (0.0, 3.0)},
        {"arm": (3.0, -1.0), "turn_deg": 3.0},
    ],
)
def test_arms_and_headings_are_no_delay(wrong):
    z = errors(
        [
            (weaving(np.random.default_rng(seed), delay=delay, **wrong), delay)
            for seed in range(6)
            for delay in (0.0, 0.8)
        ]
    )
    assert len(z) == 12
    assert np.mean(z**2) < 2.2
    assert np.abs(z).max() < 3.5


@pytest.mark.parametrize("changing", [False, True])
def test_where_an_arm_may_pass_for_a_delay_its_error_says_so(changing):
    """At one speed they are the same; a small one is not told apart in little noise either."""
    for seed in range(4):
        found = weaving(np.random.default_rng(seed), arm=(-1.2, 0.0), changing=changing)
        told_apart = 3.0 * found.arm_sigma < abs(found.delay) * found.speed
        assert not told_apart or abs(found.delay) < 3.0 * found.sigma


def test_long_logs_are_thinned_to_where_the_velocity_changes():
    """One turn in a straight line of 10,000 fixes is found."""
    rng = np.random.default_rng(2)
    time = np.arange(10_000.0)
    course = np.where((time > 6000.0) & (time < 6200.0), (time - 6000.0) / 60.0, 0.0)
    velocity = np.column_stack([np.sin(course), np.cos(course)])
    path = np.cumsum(velocity, axis=0)
    found = latency(time + 2.5 + 0.5, path + rng.normal(0.0, 0.2, path.shape), time, velocity)
    assert found.fixes <= 4000
    assert found.delay == pytest.approx(2.5, abs=3.5 * found.sigma)
    assert found.sigma < 0.2


def test_the_same_times_moved_give_the_same_delay():
    world = World(epochs=600)
    drawn = draw("isolated-20", world, 4)
    here = latency(drawn.time + 0.7, drawn.fixes, drawn.time, drawn.velocities)
    far = latency(
        drawn.time + 0.7 + 4096.0, drawn.fixes + 1e4, drawn.time + 4096.0, drawn.velocities
    )
    assert far.delay == pytest.approx(here.delay, abs=0.05 * here.sigma)


@pytest.mark.parametrize("count", [0, 1, 5, 29])
def test_few_fixes_tell_nothing(count):
    time = np.arange(float(count))
    assert latency(time, np.zeros((count, 2)), time, np.zeros((count, 2))) is UNKNOWN


def test_missing_axes_and_constant_series_tell_nothing():
    time = np.arange(200.0)
    still, none = np.zeros((200, 3)), np.full((200, 3), np.nan)
    assert latency(time, none, time, still) is UNKNOWN
    assert latency(time, still, time, none) is UNKNOWN
    assert latency(time, still, time, still) is UNKNOWN
