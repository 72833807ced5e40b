"""Noise figures of positions that follow the stream, each sensor its own."""

import numpy as np
import pytest

from filters.worlds import world
from surefix.filters.hypotheses import MOST_SENSORS, no_hypotheses
from surefix.filters.learning import supposed
from surefix.filters.multi_hypothesis import filter_hypotheses
from surefix.filters.multi_hypothesis_modes import rows_of


def made(seed, n=2500, *, axes=2, velocity=None, share=0.1):
    drawn = world(seed, n, axes=axes, q=0.05, velocity=velocity, irregular=True, blocks=False)
    rng = np.random.default_rng(seed + 100)
    bad = rng.random(n) < share
    z = drawn.epochs.z.copy()
    z[bad, :axes] += rng.normal(0.0, 60.0, (bad.sum(), axes))
    return drawn, drawn.epochs._replace(z=z)


def prior_of(drawn, *sensors, memory=200.0):
    adapt = np.zeros(MOST_SENSORS)
    adapt[list(sensors)] = 1.0 / memory
    sigma = float(np.sqrt(drawn.epochs.variance[0, 0]))
    made = supposed(drawn.motion.axes, sigma, 0.1, 10.0, 39.5)
    return made._replace(adapt=adapt, isolated=0.1)


def run(drawn, epochs, prior):
    return filter_hypotheses(drawn.motion, prior, epochs, no_hypotheses(drawn.motion), traced=False)


def nees(drawn, found, late=1500):
    d = drawn.motion.axes
    error = (found.mean - drawn.truth)[late:, :d]
    return float(np.mean((error / found.sigma[late:, :d]) ** 2))


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("wrong", [0.25, 1.0, 4.0])
def test_the_noise_of_positions_is_found(axes, wrong):
    """Variances that were settled too small, right, and too large; a tenth are gross errors."""
    scales, sure = [], []
    for seed in range(4):
        drawn, epochs = made(seed, axes=axes)
        settled = epochs._replace(variance=wrong * epochs.variance)
        bank, found, _ = run(drawn, settled, prior_of(drawn, 0))
        scales.append(bank.scale[0] * wrong)
        sure.append(nees(drawn, found))
        np.testing.assert_array_equal(found.scale[0], 1.0)
    assert np.exp(np.mean(np.log(scales))) == pytest.approx(1.0, abs=0.15)
    assert np.mean(sure) == pytest.approx(1.0, abs=0.2)


def test_what_is_given_stays():
    drawn, epochs = made(3)
    settled = epochs._replace(variance=4.0 * epochs.variance)
    bank, found, _ = run(drawn, settled, prior_of(drawn))
    assert (bank.scale == 1.0).all()
    assert (found.scale == 1.0).all()


def test_each_sensor_has_its_own():
    drawn, epochs = made(5, 5000)
    sensor = np.arange(len(epochs.time)) % 2
    variance = epochs.variance * np.where(sensor == 1, 0.2, 1.0)[:, None]
    settled = epochs._replace(variance=variance, sensor=sensor)
    bank, _, _ = run(drawn, settled, prior_of(drawn, 0, 1))
    assert bank.scale[0] == pytest.approx(1.0, abs=0.4)
    assert bank.scale[1] == pytest.approx(5.0, rel=0.4)


def test_parts_give_the_same_as_the_whole():
    drawn, epochs = made(6, 400)
    prior = prior_of(drawn, 0)
    _, whole, _ = run(drawn, epochs, prior)
    bank, parts = no_hypotheses(drawn.motion), []
    for first in range(0, 400, 57):
        part = rows_of(epochs, first, min(first + 57, 400))
        bank, found, _ = filter_hypotheses(drawn.motion, prior, part, bank, traced=False)
        parts.append(found)
    for name in ("mean", "sigma", "scale"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name))
